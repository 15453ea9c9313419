"""Speed limits of joints: how fast a path is between its slices, and how long its phases would have to be."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from lgp.kinematics.human_speeds import speed_limit
from lgp.kinematics.interpolation import interpolate
from lgp.kinematics.world import World
from lgp.path.phases import Phases
from reba.arrays import Array, Indices

SAMPLES: Final = 10
"""Points of each slice between which speeds are measured."""
BROKEN: Final = 1e-4
"""Share of a limit above it that counts as broken."""


def speed_limits(world: World) -> Array:
    """Return the speed limit of each joint [rad/s, m/s], (nq,); inf where a URDF gives none."""
    limits = world.speed_limit.copy()
    for name, person in world.scene.humans.items():
        for column in world.columns(name):
            limits[column] = speed_limit(world.joints[column].partition(".")[2], person)
    return np.asarray(limits, dtype=np.float64)


def moves_per_slice(start: Array, path: Array) -> Array:
    """Return how far (T, SAMPLES, nq) [rad, m] joints would move in a slice with the speed they have at each point."""
    knots = np.concatenate([start[None], path])
    dense = interpolate(knots, *place_of(np.arange(len(path) * SAMPLES)))
    return np.diff(dense, axis=0, append=knots[-1:]).reshape(len(path), SAMPLES, -1) * SAMPLES


def needed_durations(limits: Array, start: Array, path: Array, slices: int) -> Array:
    """Return how long each phase takes at the speed limits [s], (K,), on a path (T, nq) from (nq,)."""
    seconds = (np.abs(moves_per_slice(start, path)) / limits).max(axis=(1, 2), initial=0.0)
    return np.asarray(seconds.reshape(-1, slices).max(axis=1) * slices)


def too_fast(world: World, phases: Phases, start: Array, path: Array) -> str:
    """Return which joint of a path (T, nq) is too fast and what to do, "" where all keep their limits."""
    limits = speed_limits(world)
    needed = needed_durations(limits, start, path, phases.slices)
    if (needed <= phases.phase_durations * (1.0 + BROKEN)).all():
        return ""
    number = int((needed / phases.phase_durations).argmax())
    first = number * phases.slices
    moves = np.abs(moves_per_slice(start, path)[first : first + phases.slices]).max(axis=(0, 1))
    column = int((moves / limits).argmax())
    name, unit = world.joints[column], world.units[world.joints[column]]
    speed, limit = unit.from_si(moves[column] / phases.steps[first]), unit.from_si(limits[column])
    return (
        f"{phases.title(number)}: {name} moves at {speed:.3g} of {limit:.3g} {unit.written}/s; "
        f"give phase_seconds = {math.ceil(10.0 * needed.max() + 1e-6) / 10.0:g} or more, or "
        'durations = "stretched" or "free"'
    )


def place_of(points: Indices) -> tuple[Indices, Array]:
    """Return the knot before each point (the start is knot 0), and its share of the way to the next knot."""
    return points // SAMPLES, points % SAMPLES / SAMPLES
