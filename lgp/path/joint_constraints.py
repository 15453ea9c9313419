"""Limits of joints between slices, of speeds and of values: those that a path breaks become rows.

Durations are given. A row of a speed says how far a joint moves from one point of a slice to the next, times the number
of points: not farther than its limit allows in the time of the slice. Points are those that the interpolation gives, as
for collisions; it is linear, so these rows are as well.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from lgp.kinematics.interpolation import AROUND, interpolate, interpolation_weights
from lgp.kinematics.world import World
from lgp.path.joint_speeds import BROKEN, SAMPLES, moves_per_slice, place_of, speed_limits
from lgp.path.mode_constraints import Blocks, ConstraintInfo
from lgp.path.phases import Phases
from reba.arrays import Array, Flags, Indices

NEAR: Final = 0.05
"""Where a limit of speed is broken, joints within this share of theirs become active too."""
BEYOND: Final = 5e-5
"""[rad, m] By which a joint may pass its limit between slices: half of what counts as rounding of a plan."""


class _Rows(NamedTuple):
    """Points (m,) of a path, joints (m,) there, senses (m,) in which these are limited, and whether as speeds (m,)."""

    points: Indices
    joints: Indices
    senses: Array
    speeds: Flags


def _beyond(world: World, start: Array, path: Array) -> tuple[Array, Array]:
    """Return how far (T, SAMPLES, nq) [rad, m] joints pass their limits between slices, and in which sense."""
    dense = interpolate(np.concatenate([start[None], path]), *place_of(np.arange(len(path) * SAMPLES)))
    above, below = dense - world.upper, world.lower - dense
    shape = (len(path), SAMPLES, -1)
    return np.maximum(above, below).reshape(shape), np.where(above > below, 1.0, -1.0).reshape(shape)


class JointConstraints:
    """The active limits of joints of one sequence, whose phases last as long as `phases` says.

    Args:
        initial_configuration: (nq,) [rad, m].
        limits_speeds: whether speeds are limited; values always are.

    Attributes:
        rows: new ones come last. Points are `SAMPLES` to a slice.
    """

    def __init__(
        self, world: World, phases: Phases, initial_configuration: Array, *, limits_speeds: bool = True
    ) -> None:
        self.world, self.phases, self.initial_configuration = world, phases, initial_configuration
        self.limits_speeds = limits_speeds
        self.limits = speed_limits(world) * phases.steps[:, None]
        none = np.zeros(0, np.intp)
        self.rows = _Rows(none, none, np.zeros(0), np.zeros(0, dtype=bool))

    def __len__(self) -> int:
        return len(self.rows.points)

    def add_violated(self, q: Array, z: Array) -> int:
        """Add the limits that a path (T, nq) breaks, and speeds that are near theirs; return how many are broken.

        Of the points of a slice and a joint only the worst becomes active.
        """
        return self._add_speeds(q) + self._add_values(q)

    def _add_speeds(self, q: Array) -> int:
        if not self.limits_speeds:
            return 0
        moves = moves_per_slice(self.initial_configuration, q)
        fastest = np.abs(moves).argmax(axis=1)
        most = np.take_along_axis(moves, fastest[:, None], axis=1)[:, 0]
        slices, joints = np.nonzero(np.abs(most) > (1.0 - NEAR) * self.limits)
        rows = self._new(slices * SAMPLES + fastest[slices, joints], joints, np.sign(most[slices, joints]), speed=True)
        at = rows.points // SAMPLES
        broken = np.abs(most[at, rows.joints]) > (1.0 + BROKEN) * self.limits[at, rows.joints]
        return self._add(rows, broken)

    def _add_values(self, q: Array) -> int:
        over, senses = _beyond(self.world, self.initial_configuration, q)
        farthest = over.argmax(axis=1)
        slices, joints = np.nonzero(over.max(axis=1) > BEYOND)
        at = farthest[slices, joints]
        rows = self._new(slices * SAMPLES + at, joints, senses[slices, at, joints], speed=False)
        return self._add(rows, np.ones(len(rows.points), dtype=bool))

    def _new(self, points: Indices, joints: Indices, senses: Array, *, speed: bool) -> _Rows:
        """Return the rows that are not active yet."""
        given = _Rows(points, joints, senses, np.full(len(points), speed))
        known = set(zip(*(part.tolist() for part in self.rows), strict=True))
        new = np.array([row not in known for row in zip(*(part.tolist() for part in given), strict=True)], dtype=bool)
        return _Rows(*(part[new] for part in given))

    def _add(self, rows: _Rows, broken: Flags) -> int:
        """Add rows where one of them is broken (m,); return how many are."""
        if broken.any():
            self.rows = _Rows(*(np.concatenate(pair) for pair in zip(self.rows, rows, strict=True)))
        return int(np.count_nonzero(broken))

    def blocks(self, tail: int) -> Blocks:
        """Return the unknowns of each row: the joint in the slices around."""
        return [
            (1, np.array(self._slices(point)) * self.world.nq + joint)
            for point, joint in zip(self.rows.points.tolist(), self.rows.joints.tolist(), strict=True)
        ]

    def names(self) -> list[ConstraintInfo]:
        """Return kind, unit, slice and joint of each row."""
        return [
            ConstraintInfo("speed" if speed else "limit", self.world.units[self.world.joints[joint]].si,
                           point // SAMPLES, self.world.joints[joint])
            for point, joint, _, speed in zip(*(part.tolist() for part in self.rows), strict=True)
        ]  # fmt: skip

    def evaluate(self, q: Array, z: Array) -> Array:
        """Return the rows (m,) [rad, m] at a path (T, nq)."""
        if not len(self):
            return np.zeros(0)
        points, joints, senses, speeds = self.rows
        knots, before, share = self._places(q)
        here, further = interpolate(knots, before, share), interpolate(knots, before, share + 1.0 / SAMPLES)
        rows = np.arange(len(points))
        moves = senses * SAMPLES * (further - here)[rows, joints] - self.limits[points // SAMPLES, joints]
        bounds = np.where(senses > 0.0, self.world.upper[joints], self.world.lower[joints])
        return np.where(speeds, moves, senses * (here[rows, joints] - bounds))

    def gradients(self, q: Array, z: Array) -> list[Array]:
        """Return the entries of the gradient of each row."""
        if not len(self):
            return []
        points, joints, senses, speeds = self.rows
        knots, before, share = self._places(q)
        rows = np.arange(len(points))
        by_knot = interpolation_weights(knots, before, share)[rows, :, joints]
        further = interpolation_weights(knots, before, share + 1.0 / SAMPLES)[rows, :, joints]
        weights = senses[:, None] * np.where(speeds[:, None], SAMPLES * (further - by_knot), by_knot)
        blocks = []
        for row, point in enumerate(points.tolist()):
            slices = self._slices(point)
            first = AROUND.index(slices[0] + 1 - point // SAMPLES)
            blocks.append(weights[row, first : first + len(slices)])
        return blocks

    def hessian_columns(self) -> list[Indices]:
        """Return no blocks: the rows are linear."""
        return []

    def hessian(self, q: Array, z: Array, y: Array) -> list[Array]:
        """Return no curvature."""
        return []

    def _places(self, q: Array) -> tuple[Array, Indices, Array]:
        """Return the knots of a path (T, nq), and the knot before each row and the share of the way to the next."""
        return np.concatenate([self.initial_configuration[None], q]), *place_of(self.rows.points)

    def _slices(self, point: int) -> list[int]:
        """Return the slices that a point depends on; the initial configuration is no unknown."""
        at = point // SAMPLES
        return [at - 1 + offset for offset in AROUND if 0 <= at - 1 + offset < self.phases.total]
