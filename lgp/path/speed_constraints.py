"""Speed limits of joints in a path with given durations: those that are near their limit become rows.

A row says how far a joint moves from one point of a slice to the next, times the number of points: not farther than its
limit allows in the time of the slice. Points are those that the interpolation gives, as for collisions.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from lgp.kinematics.human_speeds import speed_limit
from lgp.kinematics.interpolation import AROUND, interpolate, interpolation_weights
from lgp.kinematics.world import World
from lgp.path.mode_constraints import Blocks, ConstraintInfo
from lgp.path.phases import Phases
from reba.arrays import Array, Indices

SAMPLES: Final = 10
"""Points of each slice between which speeds are measured."""
NEAR: Final = 0.05
"""Where a limit is broken, joints within this share of theirs become active too."""
BROKEN: Final = 1e-4
"""Share of a limit above it that counts as broken."""


def speed_limits(world: World) -> Array:
    """Return the speed limit of each joint [rad/s, m/s], (nq,); inf where a URDF gives none."""
    limits = world.speed_limit.copy()
    if world.scene.human is not None:
        for column in world.columns("human"):
            limits[column] = speed_limit(world.joints[column].partition(".")[2])
    return np.asarray(limits, dtype=np.float64)


def moves_per_slice(start: Array, path: Array) -> Array:
    """Return how far (T, SAMPLES, nq) [rad, m] joints would move in a slice with the speed they have at each point."""
    knots = np.concatenate([start[None], path])
    dense = interpolate(knots, *_at(np.arange(len(path) * SAMPLES)))
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


class SpeedConstraints:
    """The active speed limits of one sequence, whose phases last as long as `phases` says.

    Args:
        initial_configuration: (nq,) [rad, m].

    Attributes:
        points, joints: (m,) point, `SAMPLES` to a slice, and column of q of each row; new ones come last.
        senses: (m,) 1.0 or -1.0, the sense in which the joint moves.
    """

    def __init__(self, world: World, phases: Phases, initial_configuration: Array) -> None:
        self.world, self.phases, self.initial_configuration = world, phases, initial_configuration
        self.limits = speed_limits(world) * phases.steps[:, None]
        self.points, self.joints, self.senses = np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0)

    def __len__(self) -> int:
        return len(self.points)

    def add_violated(self, q: Array) -> int:
        """Add the limits that a path (T, nq) breaks, and those it is near; return how many are broken.

        Of the points of a slice and a joint only the fastest becomes active.
        """
        moves = moves_per_slice(self.initial_configuration, q)
        fastest = np.abs(moves).argmax(axis=1)
        most = np.take_along_axis(moves, fastest[:, None], axis=1)[:, 0]
        slices, joints = np.nonzero(np.abs(most) > (1.0 - NEAR) * self.limits)
        points = slices * SAMPLES + fastest[slices, joints]
        known = set(zip(self.points.tolist(), self.joints.tolist(), strict=True))
        new = np.array([pair not in known for pair in zip(points.tolist(), joints.tolist(), strict=True)], dtype=bool)
        slices, joints, points = slices[new], joints[new], points[new]
        broken = np.abs(most[slices, joints]) > (1.0 + BROKEN) * self.limits[slices, joints]
        if not broken.any():
            return 0
        self.points, self.joints = np.concatenate([self.points, points]), np.concatenate([self.joints, joints])
        self.senses = np.concatenate([self.senses, np.sign(most[slices, joints])])
        return int(np.count_nonzero(broken))

    def blocks(self) -> Blocks:
        """Return the unknowns of each row: the joint in the slices around."""
        return [
            (1, np.array(self._slices(point)) * self.world.nq + joint)
            for point, joint in zip(self.points.tolist(), self.joints.tolist(), strict=True)
        ]

    def names(self) -> list[ConstraintInfo]:
        """Return kind, unit, slice and joint of each row."""
        return [
            ConstraintInfo("speed", self.world.units[self.world.joints[joint]].si, point // SAMPLES,
                           self.world.joints[joint])
            for point, joint in zip(self.points.tolist(), self.joints.tolist(), strict=True)
        ]  # fmt: skip

    def evaluate(self, q: Array) -> tuple[Array, list[Array]]:
        """Return the rows (m,) [rad, m] at a path (T, nq), and the entries of their gradients."""
        if not len(self):
            return np.zeros(0), []
        moves = moves_per_slice(self.initial_configuration, q).reshape(-1, self.world.nq)[self.points, self.joints]
        used, places = np.unique(self.points, return_inverse=True)
        knots = np.concatenate([self.initial_configuration[None], q])
        before, share = _at(used)
        weights = interpolation_weights(knots, before, share + 1.0 / SAMPLES)
        weights -= interpolation_weights(knots, before, share)
        by_knot = SAMPLES * self.senses[:, None] * weights[places, :, self.joints]
        blocks = []
        for row, point in enumerate(self.points.tolist()):
            slices = self._slices(point)
            first = AROUND.index(slices[0] + 1 - point // SAMPLES)
            blocks.append(by_knot[row, first : first + len(slices)])
        return self.senses * moves - self.limits[self.points // SAMPLES, self.joints], blocks

    def _slices(self, point: int) -> list[int]:
        """Return the slices that a point depends on; the initial configuration is no unknown."""
        at = point // SAMPLES
        return [at - 1 + offset for offset in AROUND if 0 <= at - 1 + offset < self.phases.total]


def _at(points: Indices) -> tuple[Indices, Array]:
    """Return the knot before each point (the start is knot 0), and its share of the way to the next knot."""
    return points // SAMPLES, points % SAMPLES / SAMPLES
