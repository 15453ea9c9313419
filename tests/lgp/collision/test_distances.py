"""Signed distances: against closed forms, with derivatives, and only between what may not touch."""

from __future__ import annotations

import numpy as np
import pytest

from lgp.collision.distances import Collisions
from lgp.kinematics.leg_ik import solve_legs
from lgp.kinematics.modes import KinematicSwitch, ModeSequence, jaw_opening
from lgp.kinematics.posture import PELVIS
from lgp.kinematics.world import World
from lgp.scene.scene_file import load_scene, shipped_scenes
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


@pytest.mark.slow
@needs_robots
def test_derivatives_by_differences_objects_and_variables_included() -> None:
    world = screwdriver_world()
    modes = ModeSequence(world, HANDED_OVER)
    collisions = Collisions(world, modes)
    rng = np.random.default_rng(0)
    q = np.clip(world.initial_configuration + 0.25 * rng.standard_normal((8, world.nq)), world.lower, world.upper)
    q[:, [world.column[f"human.{name}"] for name in ("pelvis_x", "pelvis_y", "pelvis_yaw")]] *= 0.1
    q[:, world.column["human.pelvis_z"]] = rng.uniform(-0.4, -0.1, 8)  # the legs are long enough
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
        slices, pairs = collisions.near_pairs(kinematics, [0], np.zeros(0), within=0.3)
        moving = np.array(["screwdriver" not in collisions.name(pair) for pair in pairs.tolist()])
        sides = [[collisions.shapes[side].owner for side in collisions.pairs[pair]] for pair in pairs.tolist()]
        moving &= [one != other for one, other in sides]  # links of one robot are closer to each other
        values = collisions.values(kinematics, [0], np.zeros(0), slices[moving], pairs[moving])
        assert values.min() > 0.03


def test_neighbours_of_one_body_are_no_pairs() -> None:
    collisions = Collisions(human_world())
    names = {collisions.name(pair) for pair in range(len(collisions.pairs))}
    assert "human.trunk and human.right_forearm" in names
    assert "human.trunk and human.right_upper_arm" in names
    assert "human.left_palm and human.right_palm" in names
    assert not names & {
        "human.trunk and human.abdomen",
        "human.right_upper_arm and human.right_forearm",
    }
    for legs in ("planted", "locked"):
        assert [shape.name for shape in Collisions(human_world(legs)).shapes] == [
            shape.name for shape in collisions.shapes
        ]


@needs_robots
@pytest.mark.parametrize("name", shipped_scenes())
def test_no_pair_is_of_bodies_that_nothing_moves_against_each_other(name: str) -> None:
    collisions = Collisions(World(load_scene(name)))
    for one, other in collisions.pairs:
        first, second = collisions.shapes[one], collisions.shapes[other]
        assert (first.owner, first.frame) != (second.owner, second.frame), (first.name, second.name)


@pytest.mark.parametrize("name", ["left_thigh", "right_shank"])
def test_solved_legs_stand_where_the_joints_of_planted_ones_do(name: str) -> None:
    solved, planted = human_world("solved"), human_world("planted")
    rng = np.random.default_rng(3)
    q = np.tile(solved.initial_configuration, (5, 1))
    for joint, low, high in (("pelvis_x", -0.1, 0.1), ("pelvis_z", -0.4, -0.1), ("pelvis_yaw", -0.3, 0.3)):
        q[:, solved.column[f"human.{joint}"]] = rng.uniform(low, high, 5)
    full = np.tile(planted.initial_configuration, (5, 1))
    for joint, column in solved.column.items():
        full[:, planted.column[joint]] = q[:, column]
    person = solved.scene.human
    assert person is not None
    pelvis = np.stack([q[:, solved.column[f"human.{joint}"]] for joint in PELVIS], axis=1)
    for joint, angles in solve_legs(pelvis, person.stature, person.sex)[0].items():
        full[:, planted.column[f"human.{joint}"]] = angles
    found = []
    for world, configurations in ((solved, q), (planted, full)):
        collisions = Collisions(world)
        pair = _pair(collisions, f"human.{name}", "table.near")
        kinematics = world.at(configurations, collisions.frames)
        slices = np.arange(5)
        found.append(collisions.values(kinematics, slices * 0, np.zeros(0), slices, np.full(5, pair)))
    assert found[0] == pytest.approx(found[1], abs=1e-9)


@needs_robots
def test_jaws_are_open_until_they_hold_something() -> None:
    world = screwdriver_world()
    modes = ModeSequence(world, HANDED_OVER)
    fingers = [shape for shape in Collisions(world, modes).shapes if shape.jaw is not None]
    assert {shape.jaw.hand for shape in fingers if shape.jaw} == {"baxter.left", "baxter.right"}
    assert all(shape.jaw.width > 0.03 for shape in fingers if shape.jaw)
    openings = [jaw_opening(modes, "baxter.right", phase, 0.08) for phase in range(4)]
    assert openings == [1.0, pytest.approx(min(world.scene.objects["screwdriver"].size) / 0.08), 1.0, 1.0]


@pytest.mark.parametrize("legs", ["planted", "solved"])
def test_no_near_rows_give_empty_arrays(legs: str) -> None:
    world = human_world(legs)
    collisions = Collisions(world)
    kinematics = world.at(world.initial_configuration[None], collisions.frames)
    none = np.zeros(0, dtype=np.intp)
    found = collisions.distances(kinematics, [0], np.zeros(0), none, none)
    assert found.by_q.shape == (0, world.nq)
