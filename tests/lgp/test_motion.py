"""A plan's motion: objects ride along without a jump, legs are complete, a saved plan moves as the one it was."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lgp
from lgp.motion import Motion
from lgp.scene.model import GRIP_DEPTH
from lgp.scene.scene_file import read_scene
from tests.support.lgp_worlds import HUMAN_ONLY
from tests.support.says import says

BOX = HUMAN_ONLY | {"initial": ["on_table(box)", "free(human.right_hand)", "free(human.left_hand)"]}


@pytest.fixture(scope="module")
def plan() -> lgp.Plan:
    return lgp.plan(read_scene(BOX, "box"), cost=None, slices=8, collisions=False)


def test_objects_lie_still_and_are_met_by_the_hand(plan: lgp.Plan) -> None:
    motion = Motion(plan)
    assert len(motion.time) == len(plan.time) + 1 == len(motion.path)
    box = motion.object_poses("box").position
    half, top = plan.scene.objects["box"].size[2] / 2, plan.scene.tables["table.near"].height
    # It may be taken up and put down on the way, by no more than the tolerance of a path.
    np.testing.assert_allclose(box[[0, 1, -1], 2], top + half, atol=1e-5)
    hand = motion.frames(["human.right_hand"])["human.right_hand"].position
    assert np.linalg.norm(hand[0] - box[0]) > 0.2
    # The hand grasps below the top, and may do so off the middle, along the longest side.
    farthest = np.hypot(plan.scene.objects["box"].slide, half - GRIP_DEPTH)
    assert np.linalg.norm(hand[-1] - box[-1]) <= farthest + 1e-5


def test_a_saved_plan_moves_the_same(plan: lgp.Plan, tmp_path: Path) -> None:
    plan.save(tmp_path)
    again = lgp.Plan.load(tmp_path)
    assert again.scene == plan.scene
    for name in plan.scene.objects:
        np.testing.assert_allclose(
            Motion(again).object_poses(name).position, Motion(plan).object_poses(name).position, atol=1e-12
        )


def test_all_joints_of_the_human_are_there(plan: lgp.Plan) -> None:
    joints = Motion(plan).human
    assert len(joints) == 41
    assert all(len(values) == len(plan.time) + 1 and np.isfinite(values).all() for values in joints.values())


def test_heights_given_to_a_scene_are_saved_with_it() -> None:
    scene = lgp.load_scene("screwdriver").with_heights({"left": 1.3})
    assert read_scene(scene.values, scene.name).tables["table.left"].height == 1.3


def test_a_plan_that_failed_has_no_motion() -> None:
    failed = lgp.Plan(read_scene(BOX, "box"), False, "infeasible", "too far", (), np.zeros(0), {})
    with pytest.raises(lgp.LgpError) as error:
        Motion(failed)
    says(error, "too far")
