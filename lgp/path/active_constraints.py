"""The constraints of a path that become rows as it comes near them: limits of joints, leg reach, distances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar

import numpy as np

from lgp.path.collision_constraints import CollisionConstraints
from lgp.path.joint_constraints import JointConstraints
from lgp.path.leg_reach import LegConstraints
from lgp.path.mode_constraints import Blocks, ConstraintInfo
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
    """Limits of joints, leg reach between slices and, where they are asked for, distances of bodies, in the order in
    which they become active.

    Args:
        collisions: None where bodies may be in each other.
    """

    def __init__(
        self, joints: JointConstraints, legs: Sequence[LegConstraints], collisions: CollisionConstraints | None
    ) -> None:
        self.collisions = collisions
        self.parts: tuple[ActiveConstraints, ...] = (joints, *legs, *([] if collisions is None else [collisions]))
        self._of = np.zeros(0, np.intp)

    def __len__(self) -> int:
        return len(self._of)

    def add_violated(self, q: Array, z: Array) -> int:
        """Add what a path (T, nq) with variables (nz,) violates; return how many rows that are."""
        violated = 0
        for number, part in enumerate(self.parts):
            before = len(part)
            violated += part.add_violated(q, z)
            self._of = np.append(self._of, np.full(len(part) - before, number))
        return violated

    def keep_more_around(self, q: Array, z: Array) -> int:
        """Let bodies keep more where a path (T, nq) has them in each other between two constrained points; return at
        how many points."""
        return 0 if self.collisions is None else self.collisions.keep_more_around(q, z)

    def blocks(self, tail: int) -> Blocks:
        """Return the unknowns of each row; variables begin at `tail`."""
        return self._in_order([part.blocks(tail) for part in self.parts])

    def names(self) -> list[ConstraintInfo]:
        """Return what each row is about."""
        return self._in_order([part.names() for part in self.parts])

    def evaluate(self, q: Array, z: Array) -> Array:
        """Return the rows (m,) [rad, m] at a path (T, nq) and variables (nz,)."""
        value = np.zeros(len(self))
        for number, part in enumerate(self.parts):
            value[self._of == number] = part.evaluate(q, z)
        return value

    def gradients(self, q: Array, z: Array) -> list[Array]:
        """Return the entries of the gradients of all rows in their order.

        Those of distances alone come as one array, row after row.
        """
        gradients = [part.gradients(q, z) for part in self.parts]
        if self.collisions is None or not len(self.collisions) or not any(gradients[:-1]):
            return [entry for own in gradients for entry in own]
        sizes = [len(columns) for _, columns in self.collisions.blocks(0)]
        return self._in_order([*gradients[:-1], np.split(gradients[-1][0], np.cumsum(sizes)[:-1])])

    def hessian_columns(self) -> list[Indices]:
        """Return the unknowns of each block of `hessian`."""
        return [block for part in self.parts for block in part.hessian_columns()]

    def hessian(self, q: Array, z: Array, y: Array) -> list[Array]:
        """Return the convex curvature of all rows, for multipliers y (m,)."""
        return [block for number, part in enumerate(self.parts) for block in part.hessian(q, z, y[self._of == number])]

    def _in_order(self, parts: Sequence[Sequence[T]]) -> list[T]:
        rows = [iter(part) for part in parts]
        return [next(rows[number]) for number in self._of.tolist()]
