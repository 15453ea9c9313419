"""Declared contacts: what may touch when, and how far everything else is apart."""

from __future__ import annotations

import math

import numpy as np
import pytest

from lgp.collision.contacts import (
    DRAW_BACK_SECONDS,
    GRIP_MARGIN,
    WINDOW,
    Clock,
    Contact,
    declared_contacts,
    required_distances,
)
from lgp.collision.distances import Collisions
from lgp.collision.withdrawals import (
    DRAWN_BACK,
    NOT_YET,
    declared_withdrawals,
    require_withdrawals,
)
from lgp.kinematics.modes import KinematicSwitch, ModeSequence
from lgp.kinematics.world import World
from lgp.scene.scene_file import load_scene
from tests.support.lgp_worlds import needs_robots, screwdriver_world

RIGHT = "human.right_hand"
HANDED_OVER = [
    KinematicSwitch("grasp", "baxter.right", "screwdriver"),
    KinematicSwitch("place", "baxter.right", "screwdriver", "table.left"),
    KinematicSwitch("grasp", RIGHT, "screwdriver"),
]
SECONDS, TAU, MARGIN = 2.0, 0.2, 0.01


def required(world: World, switches: list[KinematicSwitch], first: str, second: str, times: list[float]) -> list[float]:
    """Return the distance that two bodies keep at some times."""
    modes = ModeSequence(world, switches)
    clock = Clock.of(np.full(len(switches), SECONDS), SECONDS, round(SECONDS / TAU))
    collisions = Collisions(world, modes)
    at = np.array(times)
    limits = required_distances(collisions.shapes, collisions.pairs, declared_contacts(modes, clock), at, MARGIN)
    require_withdrawals(limits, collisions.shapes, collisions.pairs, tuple(declared_withdrawals(modes, clock)), at)
    names = [{collisions.shapes[side].name for side in pair} for pair in collisions.pairs]
    return limits[:, names.index({first, second})].tolist()


@pytest.mark.parametrize("free", [False, True])
def test_a_margin_fades_before_and_after_a_contact(free: bool) -> None:
    contact = Contact("a", "b", 1.0, 2.0, free=free)
    away = np.array([0.0, WINDOW / 2.0, WINDOW, 2.0 * WINDOW])
    faded = [-math.inf, -math.inf, MARGIN, MARGIN] if free else [-math.inf, MARGIN / 2.0, MARGIN, MARGIN]
    for times in (1.0 - away, 2.0 + away):
        assert contact.required(times, MARGIN) == pytest.approx(faded)
    assert contact.required(np.array([1.5]), MARGIN) == [-math.inf]
    assert Contact("a", "b", 1.0, 2.0, touches=False).required(np.array([1.5, 9.0]), MARGIN).tolist() == [0.0, MARGIN]


@needs_robots
def test_an_object_touches_its_support_while_it_rests_and_no_other() -> None:
    world = screwdriver_world()
    times = [0.1, 1.9, 2.2, 2.35, 2.5, 3.0, 3.85, 4.0, 5.9]
    start = required(world, HANDED_OVER, "table.start", "screwdriver", times)
    assert start == pytest.approx([-math.inf] * 3 + [MARGIN / 2.0] + [MARGIN] * 5)
    left = required(world, HANDED_OVER, "table.left", "screwdriver", times)
    assert left == pytest.approx([MARGIN] * 6 + [MARGIN / 2.0] + [-math.inf] * 2)
    assert set(required(world, HANDED_OVER, "table.right", "screwdriver", times)) == {MARGIN}


@needs_robots
def test_the_hand_may_touch_what_it_takes_and_the_arm_may_not() -> None:
    world = screwdriver_world()
    times = [1.5, 1.75, 3.0, 4.45, 4.5]
    palm = "baxter.right_gripper_base_link"
    assert required(world, HANDED_OVER, palm, "screwdriver", times) == [MARGIN, *[-math.inf] * 3, MARGIN]
    forearm = "baxter.right_lower_forearm"
    assert set(required(world, HANDED_OVER, forearm, "screwdriver", times)) == {MARGIN}
    human = required(world, HANDED_OVER, "human.right_palm", "screwdriver", [5.0, 5.75, 6.0])
    assert human == [MARGIN, -math.inf, -math.inf]


@needs_robots
def test_an_acting_hand_comes_near_to_its_table_and_does_not_touch_it() -> None:
    world = screwdriver_world()
    palm = "baxter.right_gripper_base_link"
    near = required(world, HANDED_OVER, palm, "table.start", [1.0, 1.85, 2.0, 2.2, 3.0])
    assert near == pytest.approx([MARGIN, MARGIN / 2.0, 0.0, 0.0, MARGIN])
    assert set(required(world, HANDED_OVER, palm, "table.left", [1.0, 1.85, 2.0, 2.2])) == {MARGIN}


@needs_robots
def test_grip_points_keep_their_clearance_and_a_hand_draws_back_before_another_comes() -> None:
    world = screwdriver_world()
    robot, person = "grip point of baxter.right", f"grip point of {RIGHT}"
    half = world.scene.hand_clearance / 2.0
    # At one object the grips say their distance; elsewhere they keep a margin, as they come nearer between the points.
    assert set(required(world, HANDED_OVER, robot, person, [0.1, 4.0, 6.0])) == {GRIP_MARGIN}
    given = [HANDED_OVER[0], KinematicSwitch("handover", RIGHT, "screwdriver", giver="baxter.right")]
    assert required(world, given, robot, person, [3.0, 4.0 - TAU, 4.0, 4.0]) == pytest.approx(
        [GRIP_MARGIN, GRIP_MARGIN, 0.0, 0.0]
    )
    soon, later = 4.0 + DRAW_BACK_SECONDS / 2.0, 4.0 + 2.0 * DRAW_BACK_SECONDS
    assert required(world, HANDED_OVER, person, "screwdriver", [3.9, soon, later]) == pytest.approx(
        [-math.inf, NOT_YET - half, -math.inf]
    )
    assert required(world, HANDED_OVER, robot, "screwdriver", [3.9, soon, later]) == pytest.approx(
        [-math.inf, -math.inf, DRAWN_BACK - half]
    )


def test_other_hands_stay_away_from_what_the_last_action_puts_down() -> None:
    world = screwdriver_world()
    half = world.scene.hand_clearance / 2.0
    person = required(world, HANDED_OVER[:2], f"grip point of {RIGHT}", "screwdriver", [3.99, 4.0])
    assert person == pytest.approx([-math.inf, NOT_YET - half])
    robot = required(world, HANDED_OVER[:2], "grip point of baxter.right", "screwdriver", [4.0])
    assert robot == [-math.inf]


@needs_robots
def test_parts_touch_only_while_they_stand_for_a_screw() -> None:
    world = World(load_scene("toolbox"))
    handle, side, table = "toolbox/handle", "toolbox/side.left", "table.center"
    brought = [
        KinematicSwitch("grasp", "baxter.left", handle),
        KinematicSwitch("handover", RIGHT, handle, giver="baxter.left"),
        KinematicSwitch("place", RIGHT, handle, table),
        KinematicSwitch("grasp", "baxter.left", side),
        KinematicSwitch("handover", RIGHT, side, giver="baxter.left"),
        KinematicSwitch("place", RIGHT, side, table),
    ]
    screwed = [
        *brought,
        KinematicSwitch("hold", "baxter.right", handle),
        KinematicSwitch("screw", RIGHT, handle, other=side),
    ]
    times = [0.1, 9.0, 12.0, 14.0]
    assert set(required(world, brought, handle, side, times)) == {MARGIN}
    assert required(world, screwed, handle, side, times) == [MARGIN, MARGIN, -math.inf, -math.inf]
    # The hand that put the handle down acts beside it next: it need not stay away, and no other hand comes near then.
    grip, other = f"grip point of {RIGHT}", "grip point of baxter.right"
    away = DRAWN_BACK - world.scene.hand_clearance / 2.0
    assert required(world, screwed, grip, handle, [7.0, 9.0, 11.9, 13.0]) == [away, -math.inf, -math.inf, away]
    far = NOT_YET - world.scene.hand_clearance / 2.0
    assert required(world, screwed, other, handle, [7.0, 9.0, 11.9, 13.0]) == [-math.inf, far, far, -math.inf]
    holding = "baxter.right_gripper_base_link"
    assert required(world, screwed, holding, handle, [13.0, 14.0, 16.0]) == [MARGIN, -math.inf, -math.inf]
