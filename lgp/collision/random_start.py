"""Random postures to start from: inside the joint limits, feet on the ground, touching nothing."""

from __future__ import annotations

import numpy as np

from lgp.collision.distances import Collisions
from lgp.errors import WorldError
from lgp.kinematics.leg_ik import STRAIGHTEST, solve_legs
from lgp.kinematics.posture import PELVIS
from lgp.kinematics.world import World
from reba.arrays import Array

TRIES = 2000
"""Postures drawn before a scene counts as leaving no room for any."""


def random_start(world: World, rng: np.random.Generator, clearance: float = 0.01) -> Array:
    """Return a configuration (nq,) with a random human: joints uniform in their limits, robots as they start.

    Drawn anew until the legs reach the ground inside their limits and no body of the human is nearer than `clearance`
    [m] to another one, to a table or a robot.

    Raises:
        WorldError: there is no human, or no posture was found.

    Example:
        >>> q = random_start(world, np.random.default_rng(1))            # doctest: +SKIP
    """
    person = world.scene.human
    if person is None:
        raise WorldError("the scene has no human whose posture could be drawn; add a [human] table")
    columns = world.columns("human")
    collisions = Collisions(world)
    q = world.initial_configuration.copy()
    for _ in range(TRIES):
        q[columns] = rng.uniform(world.lower[columns], world.upper[columns])
        pelvis = np.array([[_value(world, q, name) for name in PELVIS]])
        angles, beyond = solve_legs(pelvis, person.stature, person.sex)
        straight = min(float(angle[0]) for name, angle in angles.items() if name.endswith("knee_Z"))
        if person.legs != "locked" and (beyond.max() > 0.0 or straight < STRAIGHTEST):
            continue
        if _set(world, q, angles) and _clear(collisions, q, clearance):
            return q
    raise WorldError(f"no posture without contact in {TRIES} draws; move the tables away from the human")


def _value(world: World, q: Array, name: str) -> float:
    full = f"human.{name}"
    return float(q[world.column[full]]) if full in world.column else world.initial_values[full]


def _set(world: World, q: Array, angles: dict[str, Array]) -> bool:
    """Write the legs into a configuration that has them; return whether they keep their limits."""
    for name, angle in angles.items():
        column = world.column.get(f"human.{name}")
        if column is not None:
            q[column] = angle[0]
            if not world.lower[column] <= q[column] <= world.upper[column]:
                return False
    return True


def _clear(collisions: Collisions, q: Array, clearance: float) -> bool:
    kinematics = collisions.world.at(q[None], collisions.frames)
    nothing = np.zeros(0)
    slices, pairs = collisions.near_pairs(kinematics, [0], nothing, clearance)
    humans = np.array(["human." in collisions.name(int(pair)) for pair in pairs], dtype=bool)
    return bool(np.all(collisions.values(kinematics, [0], nothing, slices[humans], pairs[humans]) > clearance))
