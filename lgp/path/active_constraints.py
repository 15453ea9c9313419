"""The constraints of a path that become rows as it comes near them: limits of joints, and distances of bodies."""

from __future__ import annotations

from typing import Protocol, TypeVar

import numpy as np

from lgp.path.collision_constraints import CollisionConstraints
from lgp.path.joint_constraints import JointConstraints
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
    """Limits of joints and, where they are asked for, distances of bodies, in the order in which they become active.

    Args:
        collisions: None where bodies may be in each other.
    """

    def __init__(self, joints: JointConstraints, collisions: CollisionConstraints | None) -> None:
        self.joints, self.collisions = joints, collisions
        self._of_joint = np.zeros(0, dtype=bool)

    def __len__(self) -> int:
        return len(self._of_joint)

    def add_violated(self, q: Array, z: Array) -> int:
        """Add what a path (T, nq) with variables (nz,) violates; return how many rows that are."""
        violated = 0
        for of_joint in (True, False):
            before = self._count(of_joint)
            if of_joint:
                violated += self.joints.add_violated(q)
            elif self.collisions is not None:
                violated += self.collisions.add_violated(q, z)
            self._of_joint = np.append(self._of_joint, np.full(self._count(of_joint) - before, of_joint))
        return violated

    def _count(self, of_joint: bool) -> int:
        return len((self.joints if of_joint else self.collisions) or ())

    def blocks(self, tail: int) -> Blocks:
        """Return the unknowns of each row; variables begin at `tail`."""
        return self._in_order(
            self.joints.blocks(),
            [] if self.collisions is None else self.collisions.blocks(tail),
        )

    def names(self) -> list[ConstraintInfo]:
        """Return what each row is about."""
        return self._in_order(
            self.joints.names(),
            [] if self.collisions is None else self.collisions.names(),
        )

    def evaluate(self, q: Array, z: Array) -> Array:
        """Return the rows (m,) [rad, m] at a path (T, nq) and variables (nz,)."""
        value = np.zeros(len(self))
        value[self._of_joint] = self.joints.evaluate(q)[0]
        if self.collisions is not None:
            value[~self._of_joint] = self.collisions.evaluate(q, z)
        return value

    def gradients(self, q: Array, z: Array) -> list[Array]:
        """Return the entries of the gradients of all rows in their order.

        Those of distances alone come as one array, row after row.
        """
        joints = self.joints.evaluate(q)[1]
        collisions = [] if self.collisions is None else self.collisions.gradients(q, z)
        if not joints or not collisions or self.collisions is None:
            return joints or collisions
        sizes = [len(columns) for _, columns in self.collisions.blocks(0)]
        return self._in_order(joints, np.split(collisions[0], np.cumsum(sizes)[:-1]))

    def hessian_columns(self) -> list[Indices]:
        """Return the unknowns of each block of `hessian`."""
        return [] if self.collisions is None else self.collisions.hessian_columns()

    def hessian(self, q: Array, z: Array, y: Array) -> list[Array]:
        """Return the convex curvature of the distances, for multipliers y (m,); limits of joints are linear."""
        return [] if self.collisions is None else self.collisions.hessian(q, z, y[~self._of_joint])

    def _in_order(self, joints: list[T], collisions: list[T]) -> list[T]:
        ordered = {True: iter(joints), False: iter(collisions)}
        return [next(ordered[of_joint]) for of_joint in self._of_joint.tolist()]
