"""Stills and films for browsers without WebGL."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lgp
from lgp.page.page import write_page
from lgp.scene.scene_file import read_scene
from tests.support.lgp_worlds import HUMAN_ONLY
from tests.support.page_packages import needs_page

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def plan() -> lgp.Plan:
    return lgp.plan(read_scene(HUMAN_ONLY, "box"), cost=None, slices=4, collisions=False)


@pytest.fixture(scope="module")
def page(plan: lgp.Plan, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_page(plan, tmp_path_factory.mktemp("page")).parent


@needs_page
def test_films_move_and_stills_show_something(page: Path) -> None:
    from PIL import Image

    film = Image.open(page / "pictures" / "action-1-film.webp")
    frames = []
    for number in range(film.n_frames):
        film.seek(number)
        frames.append(np.asarray(film.convert("RGB"), dtype=int))
    assert len(frames) >= 5
    assert np.abs(frames[0] - frames[-1]).max() > 60
    still = np.asarray(Image.open(page / "pictures" / "action-1.webp").convert("RGB"), dtype=int)
    assert still.std() > 15
