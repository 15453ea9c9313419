"""A plan that simulated studies follow."""

from __future__ import annotations

import pytest

import lgp
from lgp.scene.scene_file import read_scene
from tests.support.lgp_worlds import HUMAN_ONLY


@pytest.fixture(scope="session")
def planned() -> lgp.Plan:
    """A human alone who takes a box of 2 kg."""
    scene = {**HUMAN_ONLY, "initial": ["on_table(box)", "free(human.right_hand)", "free(human.left_hand)"]}
    return lgp.plan(read_scene(scene), slices=5)
