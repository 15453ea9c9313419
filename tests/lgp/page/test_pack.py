"""The packed motion is that of the plan."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.motion import Motion
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


def data_of(page: Path) -> dict[str, Any]:
    text = (page / "assets" / "plan.js").read_text(encoding="utf-8")
    found: dict[str, Any] = json.loads(text.removeprefix("window.PLAN = ").removesuffix(";\n"))
    return found


@needs_page
def test_packed_motion_is_that_of_the_plan(plan: lgp.Plan, page: Path) -> None:
    view = data_of(page)["view"]
    count = len(view["frames"])
    raw = np.frombuffer(base64.b64decode(view["position"]["data"]), "<i2").reshape(-1, count, 3)
    position = raw * view["position"]["scale"] + view["position"]["middle"]
    time = np.array(view["time"])
    motion = Motion(plan)
    at = [int(np.abs(time - moment).argmin()) for moment in motion.time]
    np.testing.assert_allclose(time[at], motion.time, atol=1e-6)
    np.testing.assert_allclose(
        position[at, view["frames"].index("box")], motion.object_poses("box").position, atol=2e-4
    )
    wrist = motion.frames(["human.right_wrist_X"])["human.right_wrist_X"].position
    np.testing.assert_allclose(position[at, view["frames"].index("human.right_wrist_X")], wrist, atol=2e-4)
    turns = np.frombuffer(base64.b64decode(view["rotation"]), "<i2").reshape(-1, count, 4) / 32767
    np.testing.assert_allclose(np.linalg.norm(turns, axis=2), 1.0, atol=1e-3)
    assert ((turns[1:] * turns[:-1]).sum(axis=2) > 0).all()
