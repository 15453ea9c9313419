"""The constraints of a path that become rows as it comes near them: speed limits, and distances of bodies."""

from __future__ import annotations

from typing import Protocol, TypeVar

import numpy as np

from lgp.path.collision_constraints import CollisionConstraints
from lgp.path.mode_constraints import Blocks, ConstraintInfo
from lgp.path.speed_constraints import SpeedConstraints
from reba.arrays import Array, Indices

T = TypeVar("T")


class ActiveConstraints(Protocol):
    """Rows that a path problem gets while it is solved; new ones come last, so that multipliers keep their places."""

    def __len__(self) -> int: ...

    def add_violated(self, q: Array, z: Array) -> int:
        """Add what a path (T, nq) with variables (nz,) violates; return how many rows that are."""

    def blocks(self, tail: int) -> Blocks:
        """Return the unknowns of each row; variables begin at `tail`."""

    def names(self) -> list[ConstraintInfo]:
        """Return what each row is about."""

    def evaluate(self, q: Array, z: Array) -> Array:
        """Return the rows (m,)."""

    def gradients(self, q: Array, z: Array) -> list[Array]:
        """Return the entries of the gradients of all rows."""

    def hessian_columns(self) -> list[Indices]:
        """Return the unknowns of each block of `hessian`."""

    def hessian(self, q: Array, z: Array, y: Array) -> list[Array]:
        """Return the convex curvature of all rows, for multipliers y (m,)."""


class MotionConstraints:
    """Speed limits and, where they are asked for, distances of bodies, in the order in which they become active.

    Args:
        speeds: None where durations follow from the speeds.
        collisions: None where bodies may be in each other.
    """

    def __init__(self, speeds: SpeedConstraints | None, collisions: CollisionConstraints | None) -> None:
        self.speeds, self.collisions = speeds, collisions
        self._is_speed = np.zeros(0, dtype=bool)

    def __len__(self) -> int:
        return len(self._is_speed)

    def add_violated(self, q: Array, z: Array) -> int:
        """Add what a path (T, nq) with variables (nz,) violates; return how many rows that are."""
        violated = 0
        for is_speed in (True, False):
            before = self._count(is_speed)
            if is_speed and self.speeds is not None:
                violated += self.speeds.add_violated(q)
            elif not is_speed and self.collisions is not None:
                violated += self.collisions.add_violated(q, z)
            self._is_speed = np.append(self._is_speed, np.full(self._count(is_speed) - before, is_speed))
        return violated

    def _count(self, is_speed: bool) -> int:
        return len((self.speeds if is_speed else self.collisions) or ())

    def blocks(self, tail: int) -> Blocks:
        """Return the unknowns of each row; variables begin at `tail`."""
        return self._in_order(
            [] if self.speeds is None else self.speeds.blocks(),
            [] if self.collisions is None else self.collisions.blocks(tail),
        )

    def names(self) -> list[ConstraintInfo]:
        """Return what each row is about."""
        return self._in_order(
            [] if self.speeds is None else self.speeds.names(),
            [] if self.collisions is None else self.collisions.names(),
        )

    def evaluate(self, q: Array, z: Array) -> Array:
        """Return the rows (m,) [rad, m] at a path (T, nq) and variables (nz,)."""
        value = np.zeros(len(self))
        if self.speeds is not None:
            value[self._is_speed] = self.speeds.evaluate(q)[0]
        if self.collisions is not None:
            value[~self._is_speed] = self.collisions.evaluate(q, z)
        return value

    def gradients(self, q: Array, z: Array) -> list[Array]:
        """Return the entries of the gradients of all rows in their order.

        Those of distances alone come as one array, row after row.
        """
        speeds = [] if self.speeds is None else self.speeds.evaluate(q)[1]
        collisions = [] if self.collisions is None else self.collisions.gradients(q, z)
        if not speeds or not collisions or self.collisions is None:
            return speeds or collisions
        sizes = [len(columns) for _, columns in self.collisions.blocks(0)]
        return self._in_order(speeds, np.split(collisions[0], np.cumsum(sizes)[:-1]))

    def hessian_columns(self) -> list[Indices]:
        """Return the unknowns of each block of `hessian`."""
        return [] if self.collisions is None else self.collisions.hessian_columns()

    def hessian(self, q: Array, z: Array, y: Array) -> list[Array]:
        """Return the convex curvature of the distances, for multipliers y (m,); speeds are as good as linear."""
        return [] if self.collisions is None else self.collisions.hessian(q, z, y[~self._is_speed])

    def _in_order(self, speeds: list[T], collisions: list[T]) -> list[T]:
        ordered = {True: iter(speeds), False: iter(collisions)}
        return [next(ordered[is_speed]) for is_speed in self._is_speed.tolist()]
