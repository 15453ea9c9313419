"""Signed distances: against closed forms, with derivatives, and only between what may not touch."""

from __future__ import annotations

import numpy as np
import pytest

from lgp.collision.distances import Collisions
from lgp.kinematics.modes import KinematicSwitch, ModeSequence
from tests.support.lgp_worlds import anywhere, human_world, needs_robots, screwdriver_world

RIGHT = "human.right_hand"
HANDED_OVER = [
    KinematicSwitch("grasp", "baxter.right", "screwdriver"),
    KinematicSwitch("place", "baxter.right", "screwdriver", "table.left"),
    KinematicSwitch("grasp", RIGHT, "screwdriver"),
]
"""The robot puts the screwdriver on a table, the human takes it."""


def _pair(collisions: Collisions, first: str, second: str) -> int:
    names = [{collisions.shapes[side].name for side in pair} for pair in collisions.pairs]
    return names.index({first, second})


def test_distances_are_what_a_ruler_says() -> None:
    world = human_world()
    world = world.with_scene(world.scene.with_heights({"near": 0.3}))
    collisions = Collisions(world)
    pair = _pair(collisions, "human.head", "box")
    kinematics = world.at(world.initial_configuration[None], collisions.frames)
    found = collisions.distances(kinematics, [0], np.zeros(0), np.array([0]), np.array([pair]))
    # The box lies below the head: nearest is the lower end of the head's capsule, radius 0.1 m at 1.75 m stature.
    end = kinematics.placement("human.middle_cervical_Y").position[0]
    box = ModeSequence(world, ()).pose("box", 0, kinematics, np.zeros(0))
    local = box.rotation[0].T @ (end - box.position[0])
    gap = np.linalg.norm(np.maximum(np.abs(local) - np.array([0.15, 0.05, 0.1]), 0.0)) - 0.1
    assert found.value[0] == pytest.approx(gap, abs=1e-6)


def test_distance_goes_below_zero_by_the_depth() -> None:
    world = human_world()
    pair = _pair(Collisions(world), "human.right_palm", "table.near")
    q = world.initial_configuration.copy()
    depths = []
    for height in (0.6, 0.61, 0.62):
        lifted = world.with_scene(world.scene.with_heights({"near": height}))
        found = Collisions(lifted)
        kinematics = lifted.at(q[None], found.frames)
        depths.append(found.distances(kinematics, [0], np.zeros(0), np.array([0]), np.array([pair])).value[0])
    assert depths[0] > 0
    assert np.diff(depths).max() < 0


@needs_robots
def test_derivatives_by_differences_objects_and_variables_included() -> None:
    world = screwdriver_world()
    modes = ModeSequence(world, HANDED_OVER)
    collisions = Collisions(world, modes)
    rng = np.random.default_rng(0)
    q = np.clip(world.initial_configuration + 0.25 * rng.standard_normal((8, world.nq)), world.lower, world.upper)
    phases, z = np.repeat(np.arange(4), 2), 0.6 * rng.uniform(modes.lower, modes.upper)
    kinematics = world.at(q, collisions.frames)
    rows = collisions.near_pairs(kinematics, phases, z, within=0.3)
    found = collisions.distances(kinematics, phases, z, *rows)
    assert len(found.value) > 50
    assert (found.value < 0).any()
    for at in range(world.nq + modes.size):
        step_q, step_z = np.zeros(world.nq), np.zeros(modes.size)
        (step_q if at < world.nq else step_z)[at if at < world.nq else at - world.nq] = 1e-6
        ahead, behind = (
            collisions.distances(
                world.at(q + sense * step_q, collisions.frames), phases, z + sense * step_z, *rows
            ).value
            for sense in (1.0, -1.0)
        )
        slope = found.by_q[:, at] if at < world.nq else found.by_variables[:, at - world.nq]
        # A few rows may lie on an edge of a box, where the nearest point jumps.
        assert np.quantile(np.abs((ahead - behind) / 2e-6 - slope), 0.97) < 1e-6


@needs_robots
def test_the_filter_keeps_every_row_that_is_near() -> None:
    world = screwdriver_world()
    collisions = Collisions(world)
    q = anywhere(world, 6)
    kinematics = world.at(q, collisions.frames)
    phases = np.zeros(6, dtype=int)
    everything = collisions.near_pairs(kinematics, phases, np.zeros(0), within=np.inf)
    all_rows = collisions.distances(kinematics, phases, np.zeros(0), *everything)
    kept = set(
        zip(
            *(part.tolist() for part in collisions.near_pairs(kinematics, phases, np.zeros(0), within=0.1)), strict=True
        )
    )
    near = all_rows.value < 0.1
    assert near.any()
    assert set(zip(all_rows.slices[near].tolist(), all_rows.pairs[near].tolist(), strict=True)) <= kept
    assert len(kept) < len(all_rows.value)


@needs_robots
def test_the_resting_postures_are_clear_of_tables_of_any_height() -> None:
    world = screwdriver_world()
    for height in np.linspace(0.6, 1.6, 6):
        heights = dict.fromkeys(("left", "center", "right"), float(height))
        lifted = world.with_scene(world.scene.with_heights(heights))
        collisions = Collisions(lifted)
        kinematics = lifted.at(lifted.initial_configuration[None], collisions.frames)
        rows = collisions.near_pairs(kinematics, [0], np.zeros(0), within=0.3)
        assert collisions.distances(kinematics, [0], np.zeros(0), *rows).value.min() > 0.03


@needs_robots
def test_an_object_may_touch_what_holds_it_around_a_switch() -> None:
    world = screwdriver_world()
    modes = ModeSequence(world, HANDED_OVER)
    collisions = Collisions(world, modes)
    kinematics = world.at(np.tile(world.initial_configuration, (4, 1)), collisions.frames)
    z = modes.guess(np.tile(world.initial_configuration, (3, 1)))
    slices, pairs = collisions.near_pairs(kinematics, np.arange(4), z, within=np.inf)
    met = {(int(at), collisions.name(int(pair))) for at, pair in zip(slices, pairs, strict=True)}
    assert (0, "table.start and screwdriver") not in met
    assert (0, "table.right and screwdriver") in met
    assert (1, "table.left and screwdriver") not in met
    assert (1, "human.right_palm and screwdriver") in met
    assert (2, "human.right_palm and screwdriver") not in met
    assert not any("baxter" in name and "screwdriver" in name for at, name in met if at == 1)


def test_neighbours_of_one_body_are_no_pairs() -> None:
    collisions = Collisions(human_world())
    names = {collisions.name(pair) for pair in range(len(collisions.pairs))}
    assert "human.trunk and human.right_forearm" in names
    assert "human.left_palm and human.right_palm" in names
    assert not names & {
        "human.trunk and human.right_upper_arm",
        "human.trunk and human.abdomen",
        "human.right_upper_arm and human.right_forearm",
    }
    assert len(Collisions(human_world("planted")).shapes) == len(collisions.shapes) + 4


@pytest.mark.parametrize("legs", ["planted", "solved"])
def test_no_near_rows_give_empty_arrays(legs: str) -> None:
    world = human_world(legs)
    collisions = Collisions(world)
    kinematics = world.at(world.initial_configuration[None], collisions.frames)
    none = np.zeros(0, dtype=np.intp)
    found = collisions.distances(kinematics, [0], np.zeros(0), none, none)
    assert found.by_q.shape == (0, world.nq)
