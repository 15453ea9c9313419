"""Leg reach of people whose legs follow from the pelvis: in every knot, and between slices where a path breaks it."""

from __future__ import annotations

from typing import Final

import numpy as np

from lgp.kinematics.interpolation import AROUND, interpolate, interpolation_weights
from lgp.kinematics.posture import PELVIS, PostureMap
from lgp.kinematics.world import World
from lgp.path.joint_speeds import SAMPLES, place_of
from lgp.path.mode_constraints import Blocks, ConstraintInfo
from lgp.path.phases import Phases
from lgp.scene.model import Human
from reba.arrays import Array, Indices

BLEND = 1e-4
"""[m] Width of the smooth maximum over both legs: each counts where they differ by less; costs 0.07 mm of reach."""
SHORT: Final = 5e-4
"""[m] By which a leg may be too short between slices before this becomes a row: half of what an audit allows."""


class LegReachConstraint:
    """Leg reach of a person whose legs follow from the pelvis: a smooth maximum (log-sum-exp) over both legs.

    Attributes:
        person: name of the person.
        columns: (p,) of q: those of the pelvis that move.
    """

    def __init__(self, world: World, person: Human) -> None:
        self.person, self.posture = person.name, PostureMap(world, person)
        pelvis = (world.column.get(f"{person.name}.{name}") for name in PELVIS)
        self.columns = np.array(sorted(column for column in pelvis if column is not None), dtype=np.intp)
        self._own = np.searchsorted(self.posture.columns, self.columns)

    def evaluate(self, q: Array) -> tuple[Array, Array]:
        """Return by how much [m] the legs are too short (n,), not above 0 where both reach, and its gradient (n, p)."""
        excess, gradients, shares = self._sides(q)
        longer = excess.max(axis=1)
        value = longer + BLEND * np.log(np.exp((excess - longer[:, None]) / BLEND).sum(axis=1))
        return value, np.einsum("ns,nsp->np", shares, gradients)

    def curvature(self, q: Array) -> Array:
        """Return the convex part of the second derivative (n, p, p)."""
        _, gradients, shares = self._sides(q)
        difference = gradients[:, 0] - gradients[:, 1]
        scale = (shares.prod(axis=1) / BLEND)[:, None, None]
        return np.asarray(scale * difference[:, :, None] * difference[:, None, :])

    def _sides(self, q: Array) -> tuple[Array, Array, Array]:
        """Return by how much [m] each leg is too short (n, 2), its gradient (n, 2, p), its share in the maximum."""
        excess, by_person = self.posture.leg_shortfall(q)
        weights = np.exp((excess - excess.max(axis=1, keepdims=True)) / BLEND)
        return excess, by_person[:, :, self._own], weights / weights.sum(axis=1, keepdims=True)


class LegConstraints:
    """The leg reach of one person between slices: where a path of one sequence breaks it, it becomes a row.

    Args:
        initial_configuration: (nq,) [rad, m].

    Attributes:
        points: (m,) of each row, `SAMPLES` to a slice; new ones come last.
    """

    def __init__(self, world: World, phases: Phases, initial_configuration: Array, person: Human) -> None:
        self.world, self.phases, self.initial_configuration = world, phases, initial_configuration
        self.reach = LegReachConstraint(world, person)
        self.points = np.zeros(0, np.intp)
        self._at_start = max(float(self.reach.evaluate(initial_configuration[None])[0][0]), 0.0)

    def __len__(self) -> int:
        return len(self.points)

    def add_violated(self, q: Array, z: Array) -> int:
        """Add the points of a path (T, nq) where a leg is too short, the worst of each slice; return how many."""
        short = self._short(q, np.arange(self.phases.total * SAMPLES))
        by_slice = short.reshape(-1, SAMPLES)
        slices = np.flatnonzero(by_slice.max(axis=1) > SHORT)
        new = np.setdiff1d(slices * SAMPLES + by_slice[slices].argmax(axis=1), self.points)
        self.points = np.concatenate([self.points, new])
        return len(new)

    def blocks(self, tail: int) -> Blocks:
        """Return the unknowns of each row: the pelvis in the slices around."""
        columns = self.reach.columns
        return [
            (1, np.concatenate([at * self.world.nq + columns for at in self._slices(point)]))
            for point in self.points.tolist()
        ]

    def names(self) -> list[ConstraintInfo]:
        """Return kind, unit, slice and person of each row."""
        return [ConstraintInfo("leg", "m", point // SAMPLES, self.reach.person) for point in self.points.tolist()]

    def evaluate(self, q: Array, z: Array) -> Array:
        """Return the rows (m,) [m] at a path (T, nq)."""
        return self._short(q, self.points) if len(self) else np.zeros(0)

    def gradients(self, q: Array, z: Array) -> list[Array]:
        """Return the entries of the gradient of each row."""
        if not len(self):
            return []
        slope = self.reach.evaluate(self._between(q, self.points))[1]
        weights = interpolation_weights(self._knots(q), *place_of(self.points))[:, :, self.reach.columns]
        blocks = []
        for row, point in enumerate(self.points.tolist()):
            slices = self._slices(point)
            first = AROUND.index(slices[0] + 1 - point // SAMPLES)
            blocks.append((weights[row, first : first + len(slices)] * slope[row]).ravel())
        return blocks

    def hessian_columns(self) -> list[Indices]:
        """Return no blocks: rows in the knots around have this curvature."""
        return []

    def hessian(self, q: Array, z: Array, y: Array) -> list[Array]:
        """Return no curvature."""
        return []

    def _short(self, q: Array, points: Indices) -> Array:
        """Return by how much legs are too short at some points, before the first slice beyond that of the start."""
        short = self.reach.evaluate(self._between(q, points))[0]
        return np.asarray(short - np.where(points < SAMPLES, self._at_start, 0.0))

    def _between(self, q: Array, points: Indices) -> Array:
        return interpolate(self._knots(q), *place_of(points))

    def _knots(self, q: Array) -> Array:
        return np.concatenate([self.initial_configuration[None], q])

    def _slices(self, point: int) -> list[int]:
        """Return the slices that a point depends on; the initial configuration is no unknown."""
        at = point // SAMPLES
        return [at - 1 + offset for offset in AROUND if 0 <= at - 1 + offset < self.phases.total]
