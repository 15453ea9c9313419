"""The tracked world as a scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lgp.execution.predicates import free, grasped
from lgp.execution.tracked_scene import atoms_now, carrier, levelled, scene_now
from lgp.execution.tracking import TrackedPose
from lgp.kinematics.attachments import UPRIGHT
from lgp.kinematics.features import exponential
from lgp.kinematics.world import World
from lgp.logic.task import parse_atom
from lgp.planner import task_of
from lgp.scene.scene_file import read_scene
from tests.support.tracked_box import HAND, box_world, tracked_box


@pytest.fixture(scope="module")
def world() -> World:
    return box_world()


def test_an_object_in_the_hand_is_grasped_and_the_scene_has_it_there(world: World) -> None:
    at = world.at(world.initial_configuration[None], [HAND]).position[0, 0]
    view = tracked_box(world, [at] * 8)
    assert grasped(view, HAND, "box").holds
    assert free(view, HAND).holds is False
    task = task_of(world.scene)
    assert carrier(view, "box", set()) == HAND
    atoms = atoms_now(view, task, {parse_atom("on_table(box)")})
    assert parse_atom(f"grasped({HAND}, box)") in atoms
    assert parse_atom("on_table(box)") not in atoms
    scene = scene_now(world.scene, view, set(), atoms)
    held = World(scene)
    from lgp.kinematics.modes import ModeSequence

    modes = ModeSequence(held, ())
    pose = modes.pose("box", 0, held.at(held.initial_configuration[None], modes.frames), np.zeros(0))
    np.testing.assert_allclose(pose.position[0], at, atol=1e-9)
    np.testing.assert_allclose(pose.rotation[0], np.eye(3), atol=1e-9)


def test_an_object_that_was_taken_is_placed_nowhere_even_while_it_stands_there(world: World) -> None:
    at = world.at(world.initial_configuration[None], [HAND]).position[0, 0]
    table = {"position": at[:2].tolist(), "size": [0.4, 0.4], "height": float(at[2]) - 0.1}
    there = World(
        read_scene(dict(world.scene.values) | {"tables": {"near": table}, "goal": ["placed(box, table.near)"]})
    )
    view, task = tracked_box(there, [at] * 8), task_of(there.scene)
    taken, placed = parse_atom(f"grasped({HAND}, box)"), parse_atom("placed(box, table.near)")
    assert placed in atoms_now(view, task, {parse_atom("on_table(box)")})
    assert taken in atoms_now(view, task, {taken})
    assert placed not in atoms_now(view, task, {taken})


def test_the_scene_that_is_seen_is_the_scene_that_was(world: World) -> None:
    box = replace(world.scene.objects["box"], at=(0.05, -0.04, 33.0))
    scene = read_scene(
        world.scene.values, "box", {"objects.box": {**world.scene.values["objects"]["box"], "at": [0.05, -0.04, 33.0]}}
    )
    assert scene.objects["box"] == box
    from lgp.execution.simulation import SimulatedRobots, SimulatedWorld

    there = world.with_scene(scene)
    simulation = SimulatedWorld(there, SimulatedRobots(there, there.initial_configuration), there.initial_configuration)
    for number in range(1, 9):
        simulation.step(0.05 * number)
    task = task_of(scene)
    again = scene_now(scene, simulation.view, set(), task.holding(task.initial))
    np.testing.assert_allclose(again.objects["box"].at, box.at, atol=1e-9)


@pytest.mark.parametrize("stands", [*UPRIGHT.values(), np.diag([1.0, -1.0, -1.0])])
def test_an_object_is_level_within_the_noise_of_the_tracker(stands: np.ndarray) -> None:
    yaw, noise = exponential(np.array([0.0, 0.0, 0.8])), exponential(np.array([0.006, -0.008, 0.0]))
    seen = TrackedPose(noise @ yaw @ stands, np.array([1.0, 2.0, 3.0]), 4.0)
    level = levelled(seen, 0.0101)
    np.testing.assert_allclose(level.rotation, yaw @ stands, atol=1e-4)
    assert np.isclose(np.abs(level.rotation[2]).max(), 1.0, atol=1e-12)
    assert levelled(seen, 0.0099) is seen
    np.testing.assert_allclose(levelled(level, 0.01).rotation, level.rotation, atol=1e-9)
