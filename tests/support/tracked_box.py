"""A box that a tracker sees, in a scene with one human: input of predicates and scenes."""

from __future__ import annotations

import numpy as np

from lgp.execution.tracking import Observation, TrackedPose, TrackedWorld
from lgp.kinematics.world import World
from lgp.scene.scene_file import read_scene
from tests.support.lgp_worlds import HUMAN_ONLY

HAND = "human.right_hand"


def box_world() -> World:
    """Return a human with empty hands beside a table with a box."""
    return World(
        read_scene(HUMAN_ONLY | {"initial": ["on_table(box)", f"free({HAND})", "free(human.left_hand)"]}, "box")
    )


def tracked_box(world: World, positions: list[np.ndarray], age: float = 0.0) -> TrackedWorld:
    """Return the tracked world with the box at (3,) positions [m], one every 0.05 s; its poses are `age` old [s]."""
    view = TrackedWorld(world)
    for number, position in enumerate(positions):
        time = 0.05 * number
        objects = {"box": TrackedPose(np.eye(3), np.asarray(position, dtype=float), time - age)}
        view.add(Observation(time, world.initial_configuration, objects))
    return view


def table_top(world: World) -> np.ndarray:
    """Return the position (3,) of the box in the middle of the near table [m]."""
    table = world.scene.tables["table.near"]
    return np.array([*table.position, table.height + world.scene.objects["box"].size[2] / 2])
