"""Worlds, random configurations and finite differences for the tests of `lgp`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib import metadata

import numpy as np
import pytest
from numpy.typing import NDArray

from lgp.kinematics.world import World
from lgp.scene.scene_file import load_scene, read_scene

Array = NDArray[np.float64]


def _has_robots() -> bool:
    try:
        metadata.distribution("example-robot-data")
    except metadata.PackageNotFoundError:
        return False
    return True


HAS_ROBOTS = _has_robots()
needs_robots = pytest.mark.skipif(not HAS_ROBOTS, reason="example-robot-data is not installed: no Baxter")

HUMAN_ONLY = {
    "domain": "screwdriver",
    "initial": ["on_table(box)", "free(human.right_hand)"],
    "goal": ["grasped(human.right_hand, box)"],
    "human": {"hands": ["left_hand", "right_hand"], "position": [0.1, -0.3], "yaw": 40},
    "tables": {"near": {"position": [0.5, 0.1], "yaw": 20, "size": [0.6, 0.4], "height": 0.8}},
    "objects": {"box": {"size": [0.3, 0.1, 0.2], "mass": 2.0, "on": "table.near", "slide": 0.1}},
}


@cache
def human_world(legs: str = "solved") -> World:
    """Return a world with a human alone, away from the origin and rotated."""
    scene = read_scene(HUMAN_ONLY)
    assert scene.human is not None
    return World(replace(scene, humans={"human": replace(scene.human, legs=legs)}))


@cache
def screwdriver_world() -> World:
    return World(load_scene("screwdriver"))


def anywhere(world: World, n: int, seed: int = 0) -> Array:
    """Return (n, nq) random configurations inside the limits, legs bent enough for every position of the pelvis."""
    q = np.random.default_rng(seed).uniform(world.lower, world.upper, (n, world.nq))
    if "human.pelvis_z" in world.column:
        at = world.column["human.pelvis_z"]
        q[:, at] = np.minimum(q[:, at], -0.09)
    return q


def differences(function: Callable[[Array], Array], x: Array, step: float = 1e-6) -> Array:
    """Return the Jacobian (n, m, k) of a function (n, k) -> (n, m) by central differences."""
    columns = []
    for at in range(x.shape[1]):
        change = np.zeros(x.shape[1])
        change[at] = step
        columns.append((function(x + change) - function(x - change)) / (2.0 * step))
    return np.stack(columns, axis=2)
