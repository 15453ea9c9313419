"""Bodies that are in each other at the start of a plan: named before anything is planned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lgp.collision.contacts import Clock, declared_contacts, required_distances
from lgp.collision.distances import Collisions
from lgp.errors import WorldError
from lgp.kinematics.world import World
from reba.arrays import Array

TOUCH = 1e-3
"""[m] Bodies that are less deep in each other count as touching."""


@dataclass(frozen=True)
class StartPenetration:
    """Two bodies that are in each other at the start, by `depth` [m]."""

    first: str
    second: str
    depth: float

    def __str__(self) -> str:
        return f"{self.first} is {1000 * self.depth:.0f} mm inside {self.second}"


def start_penetrations(world: World, configuration: Array) -> tuple[StartPenetration, ...]:
    """Return the bodies that are in each other at a configuration (nq,), the deepest first, each pair once.

    Objects may touch what they rest on and the hand that has them.

    Example:
        >>> from lgp.scene.scene_file import load_scene
        >>> world = World(load_scene("screwdriver"))
        >>> start_penetrations(world, world.initial_configuration)
        ()
    """
    collisions = Collisions(world)
    contacts = declared_contacts(collisions.modes, Clock.of(np.zeros(0), 1.0, 1))
    required = required_distances(collisions.shapes, collisions.pairs, contacts, np.zeros(1), 0.0)
    kinematics, z = world.at(configuration[None], collisions.frames), np.zeros(0)
    slices, pairs = collisions.near_pairs(kinematics, [0], z, 0.0, required)
    depths = -collisions.values(kinematics, [0], z, slices, pairs)
    touching: dict[frozenset[str], StartPenetration] = {}
    for pair, depth in zip(pairs.tolist(), depths.tolist(), strict=True):
        first, second = (collisions.shapes[side].name for side in collisions.pairs[pair])
        known = touching.get(frozenset((first, second)))
        deeper = depth > (TOUCH if known is None else known.depth)
        if deeper and not collisions.is_grip(collisions.pairs[pair]):
            touching[frozenset((first, second))] = StartPenetration(first, second, depth)
    return tuple(sorted(touching.values(), key=lambda one: -one.depth))


def check_start(world: World, configuration: Array) -> None:
    """Refuse a start (nq,) in which bodies are in each other.

    Raises:
        WorldError: names the deepest pairs.
    """
    touching = start_penetrations(world, configuration)
    if touching:
        most = 3
        more = f" and {len(touching) - most} more" if len(touching) > most else ""
        raise WorldError(
            f"{world.scene.name}: at the start {', '.join(map(str, touching[:most]))}{more}; "
            "move them apart in the scene, or accept the start"
        )
