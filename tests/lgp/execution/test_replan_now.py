"""`lgp.replan`: what remains of a plan, from where everything is now."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.errors import LgpError
from lgp.execution.retarget import Planner
from lgp.execution.tracking import Observation, TrackedPose, TrackedWorld
from lgp.scene.scene_file import read_scene
from tests.support.gantry import HEIGHT, SECONDS, scene_values
from tests.support.lgp_worlds import HUMAN_ONLY
from tests.support.says import says

GRASP, PLACE = "grasp(1, gantry.hand, box)", "place({}, gantry.hand, box, table.b)"


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> lgp.Plan:
    values = scene_values(tmp_path_factory.mktemp("replan"), goal=["placed(box, table.b)"])
    values["robots"]["gantry"]["joints"] = {"z": 1.3}  # above the tables, not below them
    scene = read_scene(values)
    found = lgp.plan(scene, cost=None, depth=2)
    assert found.actions == (GRASP, PLACE.format(2))
    return found


def at(x: float, y: float, z: float = HEIGHT + 0.04, yaw: float = 0.0) -> np.ndarray:
    """Return a pose of the box, upright."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]]
    matrix[:3, 3] = x, y, z
    return matrix


def test_at_the_start_nothing_changes(plan: lgp.Plan) -> None:
    again = lgp.replan(plan)
    assert again.actions == plan.actions
    np.testing.assert_array_equal(again.start, plan.start)
    assert again.feasible


def test_actions_that_have_ended_are_done(plan: lgp.Plan) -> None:
    later = lgp.replan(plan, SECONDS + 0.5)
    assert later.actions == (PLACE.format(1),)
    assert later.time[0] < 0.5, "it starts anew, at time 0"
    moved = plan.trajectory("gantry", step=0.5)
    np.testing.assert_allclose(later.start, moved.position[np.flatnonzero(moved.time == SECONDS + 0.5)[0]], atol=1e-9)
    assert later.audit["faults"] == lgp.audit_plan(later).summary()["faults"]


def test_an_object_that_was_moved_is_taken_where_it_is(plan: lgp.Plan) -> None:
    moved = lgp.replan(plan, 1.0, {"box": at(0.12, -0.1, yaw=0.4)})
    # It may be put down on the way, which costs less here: phases are of one length.
    assert (moved.actions[0], moved.actions[-1]) == (GRASP, PLACE.format(len(moved.actions)))
    motion = lgp.Motion(moved).object_poses("box")
    np.testing.assert_allclose(motion.position[0], [0.12, -0.1, HEIGHT + 0.04], atol=1e-9)
    np.testing.assert_allclose(motion.rotation[0, :2, 0], [np.cos(0.4), np.sin(0.4)], atol=1e-9)


def test_what_was_dropped_is_taken_again(plan: lgp.Plan) -> None:
    dropped = lgp.replan(plan, 1.5 * SECONDS, {"box": at(0.1, 0.0)})
    assert dropped.actions == plan.actions


def test_what_a_person_has_in_the_hand_stays_there() -> None:
    values = HUMAN_ONLY | {"goal": ["placed(box, table.far)", "not placed(box, table.near)"]}
    values["tables"] = HUMAN_ONLY["tables"] | {"far": {"position": [0.3, -0.7], "size": [0.4, 0.4], "height": 0.9}}
    values["initial"] = [*HUMAN_ONLY["initial"], "placed(box, table.near)"]
    scene = read_scene(values)
    person = lgp.plan(scene, cost=None, depth=2, collisions=False)
    assert person.actions == ("grasp(1, human.right_hand, box)", "place(2, human.right_hand, box, table.far)")
    for share in (1.0, 1.2, 1.5):
        later = lgp.replan(person, share * scene.phase_seconds)
        assert later.actions == ("place(1, human.right_hand, box, table.far)",), later.reason


def test_a_gripper_that_holds_something_still_does_so(tmp_path: Path) -> None:
    values = scene_values(tmp_path, goal=["holding(gantry.hand, box)"])
    values["domain"] = "toolbox"
    values["robots"]["gantry"]["joints"] = {"z": 1.3}
    values["robots"]["gantry"]["hands"]["hand"]["kind"] = "parallel_gripper"
    held = lgp.plan(read_scene(values), cost=None, sequence=["hold(gantry.hand, box)"])
    assert held.feasible, held.reason
    assert lgp.replan(held, SECONDS).actions == ()
    assert lgp.replan(held, SECONDS, {"box": at(0.1, 0.1)}).actions == held.actions


def test_joints_are_where_they_are_measured(plan: lgp.Plan) -> None:
    off = lgp.replan(plan, 0.0, joints={"gantry.x": 0.3, "gantry.tilt": 0.1})
    assert (off.start[0], off.start[3]) == (0.3, 0.1)
    np.testing.assert_array_equal(off.start[1:3], plan.start[1:3])


def test_a_slide_that_is_off_is_said_in_metres(plan: lgp.Plan) -> None:
    planner = Planner(plan, None)
    view = TrackedWorld(planner.motion.world)
    box = planner.motion.object_poses("box")
    objects = {"box": TrackedPose(box.rotation[0], box.position[0], 0.0)}
    view.add(Observation(0.0, plan.start + np.array([0.25, 0.0, 0.0, 0.1]), objects))
    assert planner.deviations(0, view) == ["gantry.x is 0.25 m off"]


def test_nothing_remains_where_the_goal_holds(plan: lgp.Plan) -> None:
    assert lgp.replan(plan, 2 * SECONDS).actions == ()
    assert lgp.replan(plan, 100.0).actions == ()
    back = lgp.replan(plan, 2 * SECONDS, {"box": at(0.0, 0.0)})
    assert back.feasible


@pytest.mark.parametrize(
    ("given", "facts"),
    [
        ({"poses": {"bxo": at(0, 0)}}, ("no object 'bxo'", "known are box")),
        ({"poses": {"box": [0, 0, 0]}}, ("pose of box", "(4, 4) matrix")),
        ({"poses": {"box": 2.0 * np.eye(4)}}, ("pose of box", "no rotation")),
        ({"poses": {"box": at(0, 0, 3.0)}}, ("box is neither in a hand nor on a table",)),
        ({"poses": 3}, ("poses", "a mapping")),
        ({"joints": {"gantry.w": 1.0}}, ("no joint 'gantry.w'",)),
        ({"joints": {"gantry.x": "far"}}, ("gantry.x", "finite number")),
        ({"joints": {"gantry.x": 30.0}}, ("gantry.x starts at 30 m", "expected -3 to 3 m")),
        ({"now": -1.0}, ("now", "0 or more")),
    ],
)
def test_wrong_arguments_are_refused(plan: lgp.Plan, given: dict[str, Any], facts: tuple[str, ...]) -> None:
    with pytest.raises(LgpError) as error:
        lgp.replan(plan, **given)
    says(error, *facts)


def test_a_plan_without_motion_is_refused(tmp_path: Path) -> None:
    scene = read_scene(scene_values(tmp_path, goal=["placed(box, table.b)"]))
    none = lgp.plan(scene, cost=None, depth=1)
    with pytest.raises(LgpError) as error:
        lgp.replan(none, 1.0)
    says(error, "infeasible")
