"""Hands that hold a part stand still, in moved motions and in new plans; arms without a part move as planned or not."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import lgp
from lgp.collision.contacts import Clock, declared_contacts, required_distances
from lgp.collision.distances import Collisions
from lgp.execution.fixed_path import holding_hands
from lgp.execution.retarget import ActionMotion, Planner
from lgp.execution.tracking import Observation, TrackedPose, TrackedWorld
from lgp.kinematics.modes import ModeSequence
from lgp.scene.model import Scene
from tests.support.execution_plans import small_plan
from tests.support.lgp_worlds import needs_robots

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
    return toolbox().scene(number, view_before(number))


def view_before(number: int, handle_off: float = 0.0) -> TrackedWorld:
    """Return the tracked world as it is planned before an action, the handle that far off along x [m]."""
    planner = toolbox()
    row = number * planner.motion.phases.slices
    poses = {name: planner.motion.object_poses(name) for name in planner.plan.scene.objects}
    view = TrackedWorld(planner.motion.world)
    for time in np.arange(0.0, 0.4, 0.05):
        objects = {name: TrackedPose(at.rotation[row], at.position[row], time) for name, at in poses.items()}
        moved = objects[HANDLE].position + np.array([handle_off, 0.0, 0.0])
        objects[HANDLE] = TrackedPose(objects[HANDLE].rotation, moved, time)
        view.add(Observation(time, planner.motion.path[row], objects, frozenset({"baxter.left", "baxter.right"})))
    return view


@pytest.mark.slow
def test_a_part_is_placed_beside_its_counterpart_wherever_that_stands() -> None:
    planner, places = toolbox(), GIVES + 1
    assert planner.deviations(places, view_before(places)) == []
    deviation, *others = planner.deviations(places, view_before(places, handle_off=0.05))
    assert not others
    assert deviation.startswith(f"{HANDLE} is 0.050 m")
    # Before it is placed, where the counterpart stands is no matter.
    assert planner.deviations(GIVES, view_before(GIVES, handle_off=0.05)) == []


def test_a_hand_that_holds_stands_still_in_a_moved_motion_wherever_it_holds() -> None:
    planner = toolbox()
    world, row = planner.motion.world, GIVES * planner.motion.phases.slices
    assert holding_hands(planner.motion.modes, GIVES) == ("baxter.right",)
    start = planner.motion.path[row].copy()
    arm = np.flatnonzero(world.support("baxter.right"))
    # It holds a little elsewhere than planned: one joint is far from the plan, the others are near it.
    start[arm] += np.where(np.arange(len(arm)) == 3, 0.2, 0.015)
    phase = planner.retarget(GIVES, scene_before(GIVES), start)
    assert isinstance(phase, ActionMotion)
    at = world.at(phase.trajectory.knots, ["baxter.right"]).position[:, 0]
    np.testing.assert_allclose(at, np.broadcast_to(at[0], at.shape), atol=1e-4)
    np.testing.assert_allclose(phase.trajectory.knots[0], start)


def test_a_new_plan_begins_with_the_hold_that_goes_on() -> None:
    planner, scene = toolbox(), scene_before(GIVES)
    assert f"holding(baxter.right, {HANDLE})" in [text.replace(",", ", ").replace("  ", " ") for text in scene.initial]
    found = planner.replan(GIVES, scene, planner.motion.path[GIVES * planner.motion.phases.slices], 5.0)
    assert found.feasible
    assert [action.partition("(")[0] for action in found.actions] == ["handover", "place", "screw"]
    arm = np.flatnonzero(planner.motion.world.support("baxter.right"))
    np.testing.assert_allclose(
        found.path[:, arm], np.broadcast_to(found.start[arm], (len(found.path), len(arm))), atol=1e-4
    )
    # The hand may touch what it holds in every phase.
    world = planner.motion.world.with_scene(scene)
    switches = planner.motion.phases.switches[GIVES:]
    assert ModeSequence(world, switches).held_at_first == (("baxter.right", HANDLE, 2),)
    bodies = Collisions(world, ModeSequence(world, switches))
    pair = {"baxter.right_gripper_base_link", HANDLE}
    touching = [at for at in range(len(bodies.pairs)) if set(bodies.name(at).split(" and ")) == pair]
    assert touching
    contacts = declared_contacts(bodies.modes, Clock.of(np.full(len(bodies.modes.switches), 2.0), 2.0, 10))
    times = np.arange(0.0, 6.0, 0.05)
    assert np.isneginf(required_distances(bodies.shapes, bodies.pairs, contacts, times, 0.01)[:, touching]).all()


def test_who_acts_by_a_plan_keeps_it_when_there_is_a_new_one() -> None:
    planner = Planner(small_plan())
    kept = planner.snapshot()
    scene = lgp.load_scene("screwdriver").with_heights({"left": 0.9, "center": 1.0, "right": 1.2})
    planner.follow(lgp.plan(scene, None, sequence=small_plan().actions[:3], slices=3, collisions=False))
    assert planner.motion.phases.slices == 3
    assert kept.motion.phases.slices == 4
