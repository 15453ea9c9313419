"""Hands that hold a part stand still, in moved motions and in new plans; arms without a part move as planned or not."""

from __future__ import annotations

from functools import cache

import numpy as np

import lgp
from lgp.collision.distances import Collisions
from lgp.execution.fixed_path import SLACK, FixedPathBounds, holding_hands, planned_course
from lgp.execution.replan import again, shortened
from lgp.execution.retarget import Phase, Planner
from lgp.execution.tracking import Observation, TrackedPose, TrackedWorld
from lgp.kinematics.modes import ModeSequence
from lgp.planner import task_of
from lgp.scene.model import Scene
from tests.support.execution_plans import small_plan
from tests.support.lgp_worlds import needs_robots, screwdriver_world

pytestmark = needs_robots
HANDLE, SIDE, HAND = "toolbox/handle", "toolbox/side.left", "human.right_hand"
GIVES = 5
"""The action after the right arm began to hold."""


@cache
def toolbox() -> Planner:
    sequence = (
        f"grasp(baxter.left, {HANDLE})",
        f"handover(baxter.left, {HANDLE}, {HAND})",
        f"grasp(baxter.left, {SIDE})",
        f"place({HAND}, {HANDLE}, table.center)",
        f"hold(baxter.right, {HANDLE})",
        f"handover(baxter.left, {SIDE}, {HAND})",
        f"place({HAND}, {SIDE}, table.center)",
        f"screw({HAND}, {HANDLE}, {SIDE})",
    )
    return Planner(lgp.plan("toolbox", None, sequence=sequence, slices=3, collisions=False))


def scene_before(number: int) -> Scene:
    """Return the world as it is planned before an action."""
    planner = toolbox()
    row = number * planner.motion.phases.slices
    poses = {name: planner.motion.thing(name) for name in planner.plan.scene.things}
    view = TrackedWorld(planner.motion.world)
    for time in np.arange(0.0, 0.4, 0.05):
        things = {name: TrackedPose(at.rotation[row], at.position[row], time) for name, at in poses.items()}
        view.add(Observation(time, planner.motion.path[row], things, frozenset({"baxter.left", "baxter.right"})))
    return planner.scene(number, view)


def test_a_hand_that_holds_stands_still_in_a_moved_motion_wherever_it_holds() -> None:
    planner = toolbox()
    world, row = planner.motion.world, GIVES * planner.motion.phases.slices
    assert holding_hands(planner.motion.modes, GIVES) == ("baxter.right",)
    start = planner.motion.path[row].copy()
    arm = np.flatnonzero(world.support("baxter.right"))
    # It holds a little elsewhere than planned: one joint is far from the plan, the others are near it.
    start[arm] += np.where(np.arange(len(arm)) == 3, 0.2, 0.015)
    phase = planner.retarget(GIVES, scene_before(GIVES), start)
    assert isinstance(phase, Phase)
    at = world.at(phase.segment.knots, ["baxter.right"]).position[:, 0]
    np.testing.assert_allclose(at, np.broadcast_to(at[0], at.shape), atol=1e-4)
    np.testing.assert_allclose(phase.segment.knots[0], start)


def test_a_new_plan_begins_with_the_hold_that_goes_on() -> None:
    planner, scene = toolbox(), scene_before(GIVES)
    assert f"holding(baxter.right, {HANDLE})" in [text.replace(",", ", ").replace("  ", " ") for text in scene.initial]
    found = planner.anew(GIVES, scene, planner.motion.path[GIVES * planner.motion.phases.slices], 5.0)
    assert found.feasible
    assert [action.partition("(")[0] for action in found.actions] == ["handover", "place", "screw"]
    arm = np.flatnonzero(planner.motion.world.support("baxter.right"))
    np.testing.assert_allclose(
        found.path[:, arm], np.broadcast_to(found.start[arm], (len(found.path), len(arm))), atol=1e-4
    )
    # The arm may touch what it holds in every phase.
    world = planner.motion.world.with_scene(scene)
    switches = planner.motion.phases.switches[GIVES:]
    assert ModeSequence(world, switches).held_at_first == (("baxter.right", HANDLE, 2),)
    bodies = Collisions(world, ModeSequence(world, switches))
    pair = {"baxter.right_w2", HANDLE}
    touching = [at for at in range(len(bodies.pairs)) if set(bodies.name(at).split(" and ")) == pair]
    assert touching
    assert np.isinf(bodies.slack(range(3))[:, touching]).all()


def test_a_hand_that_holds_is_free_after_its_next_action() -> None:
    world = screwdriver_world()
    task = task_of(world.scene)
    names = ("grasp(human.right_hand, screwdriver)", "place(human.right_hand, screwdriver, table.center)",
             "grasp(baxter.right, screwdriver)", "place(baxter.right, screwdriver, table.left)")  # fmt: skip
    bounds = FixedPathBounds(world, slices=2, holding=["baxter.right"])
    problem = bounds.problem("path", bounds.phases(tuple(map(task.action, names))))
    arm = np.flatnonzero(world.support("baxter.right"))
    room = (problem.upper - problem.lower)[: 8 * world.nq].reshape(8, -1)[:, arm].max(axis=1)
    np.testing.assert_allclose(room[:6], 2 * SLACK)
    assert (room[6:] > 0.1).all()


def test_an_arm_without_a_part_moves_as_planned_as_a_whole_or_not_at_all() -> None:
    world = screwdriver_world()
    planned = world.start + np.linspace(0.0, 0.1, 4)[:, None]
    left, right = (set(np.flatnonzero(world.support(f"baxter.{side}"))) for side in ("left", "right"))
    assert left | right <= set(planned_course(world, planned[0], planned, []).columns)
    off = planned[0].copy()
    off[min(right)] += 0.1
    course = planned_course(world, off, planned, [])
    assert left <= set(course.columns)
    assert not right & set(course.columns)
    np.testing.assert_array_equal(course.values, planned[1:, course.columns])
    assert not left & set(planned_course(world, off, planned, ["baxter.left"]).columns)
    assert not set(world.columns("human")) & set(course.columns)


def test_what_is_left_is_tried_first_with_what_must_be_done_again() -> None:
    planner = Planner(small_plan())
    world = planner.motion.world
    bounds = FixedPathBounds(world, slices=planner.motion.phases.slices)
    task = task_of(world.scene)
    # The screwdriver lies where it was at first: it was dropped on the way.
    assert again(planner.motion, task, 1, bounds) == planner.actions
    path, variables = bounds.planned_motions[planner.actions]
    np.testing.assert_array_equal(path, planner.motion.path)
    np.testing.assert_array_equal(variables, planner.motion.variables)


def test_who_acts_by_a_plan_keeps_it_when_there_is_a_new_one() -> None:
    planner = Planner(small_plan())
    kept = planner.as_it_is()
    scene = lgp.load_scene("screwdriver").with_heights({"left": 0.9, "center": 1.0, "right": 1.2})
    planner.follow(lgp.plan(scene, None, sequence=small_plan().actions[:3], slices=3))
    assert planner.motion.phases.slices == 3
    assert kept.motion.phases.slices == 4


def test_reasons_are_told_once_and_the_first_of_them_only() -> None:
    reason = "; ".join(f"phase {n}, grasp({n}, baxter.left, box): baxter.left is {n // 2} m away" for n in range(2, 12))
    assert shortened(reason) == "baxter.left is 1 m away; baxter.left is 2 m away; baxter.left is 3 m away; and 2 more"
