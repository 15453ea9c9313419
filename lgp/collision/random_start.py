"""Random collision-free initial postures by rejection sampling: inside joint limits, soles on the floor."""

from __future__ import annotations

import numpy as np

from lgp.collision.distances import Collisions
from lgp.errors import WorldError
from lgp.kinematics.leg_ik import STRAIGHTEST, solve_legs
from lgp.kinematics.posture import PELVIS
from lgp.kinematics.world import World
from lgp.scene.model import Human
from reba.arrays import Array

MAX_DRAWS = 2000
"""Rejected draws after which a scene counts as too narrow for any posture."""
CLEARANCE = 0.01
"""[m] Least distance of a person from tables, robots, other persons and itself."""


def random_start(world: World, rng: np.random.Generator, draws: int = MAX_DRAWS) -> Array:
    """Return a configuration (nq,) [rad, m] with random persons: joints uniform in their limits, robots as initially.

    Persons are drawn one after the other. A draw is rejected if the legs do not reach the floor inside their limits, or
    if a collision shape of the person is nearer than `CLEARANCE` to another one. WorldError where all draws are
    rejected or there is no human.
    """
    if not world.scene.humans:
        raise WorldError("the scene has no human, so no posture can be drawn; add a [human] table")
    collisions = Collisions(world)
    q = world.initial_configuration.copy()
    for person in world.scene.humans.values():
        q = _drawn(world, collisions, q, person, rng, draws)
    return q


def _drawn(
    world: World, collisions: Collisions, start: Array, person: Human, rng: np.random.Generator, draws: int
) -> Array:
    """Return a configuration (nq,) with another posture of a person."""
    q, columns = start.copy(), world.columns(person.name)
    for _ in range(draws):
        q[columns] = rng.uniform(world.lower[columns], world.upper[columns])
        pelvis = np.array([[_value(world, q, f"{person.name}.{name}") for name in PELVIS]])
        angles, beyond = solve_legs(pelvis, person.stature, person.sex)
        straight = min(float(angle[0]) for name, angle in angles.items() if name.endswith("knee_Z"))
        if person.legs != "locked" and (beyond.max() > 0.0 or straight < STRAIGHTEST):
            continue
        if _set(world, q, angles, person.name) and _clear(collisions, q, person.name):
            return q
    raise WorldError(
        f"{draws} random postures collide, expected one that does not; move the tables away from {person.name}"
    )


def _value(world: World, q: Array, full: str) -> float:
    return float(q[world.column[full]]) if full in world.column else world.initial_values[full]


def _set(world: World, q: Array, angles: dict[str, Array], person: str) -> bool:
    """Write the leg joints that a configuration has into it; return whether they are inside their limits."""
    for name, angle in angles.items():
        column = world.column.get(f"{person}.{name}")
        if column is not None:
            q[column] = angle[0]
            if not world.lower[column] <= q[column] <= world.upper[column]:
                return False
    return True


def _clear(collisions: Collisions, q: Array, person: str) -> bool:
    kinematics = collisions.world.at(q[None], collisions.frames)
    no_variables = np.zeros(0)
    slices, pairs = collisions.near_pairs(kinematics, [0], no_variables, CLEARANCE)
    owners = [{collisions.shapes[side].owner for side in collisions.pairs[pair]} for pair in pairs]
    own = np.array([person in pair for pair in owners], dtype=bool)
    return bool(np.all(collisions.values(kinematics, [0], no_variables, slices[own], pairs[own]) > CLEARANCE))
