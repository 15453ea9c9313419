"""Collision constraints of a path: pairs of bodies that are near each other become active, others cost no rows.

Few of the pairs ever come near, so a path starts without constraints and `lgp.path.collision_path` adds the violated
ones. Each says margin - distance <= 0 at one point of time, in a slice or between two, by the joints that move its two
bodies and the variables of how an object among them is attached.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lgp.collision.distances import Collisions
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import World
from lgp.path.mode_constraints import Blocks, ConstraintInfo
from lgp.path.phases import Phases
from reba.arrays import Array, Indices

MARGIN = 0.01
"""[m] Distance between bodies at the constrained points, so that little penetration is left between them."""
EARLY_MARGIN = 0.02
"""[m] Where a constraint is violated, pairs within the margin and this become active in the slices too."""
MARGIN_TOLERANCE = 1e-3
"""[m] A pair below the margin by less does not become active."""
POINTS_PER_SLICE = 4
"""Points checked per slice, joints interpolated: the hand of an arm moves 10 cm or more from slice to slice."""


class _Near(NamedTuple):
    """Pairs of bodies near each other: slices or points (m,), pairs (m,), distances (m,) [m]."""

    slices: Indices
    pairs: Indices
    value: Array


class CollisionConstraints:
    """The active collision constraints of one sequence.

    Args:
        initial_configuration: (nq,) [rad, m]; pairs nearer than the margin there may stay so within the first phase.
        margin: [m].

    Attributes:
        points: (m,) time of each constraint in steps of 1 / POINTS_PER_SLICE slices; new ones come last.
        pairs: (m,) its pair of bodies.
    """

    def __init__(self, world: World, phases: Phases, initial_configuration: Array, margin: float = MARGIN) -> None:
        self.world, self.phases, self.margin = world, phases, margin
        self.initial_configuration = initial_configuration
        self.collisions = Collisions(world, ModeSequence(world, phases.switches))
        self.points, self.pairs = np.zeros(0, np.intp), np.zeros(0, np.intp)
        self._columns: list[tuple[Indices, Indices]] = []
        self._gradient_entries: tuple[Indices, Indices, Array] | None = None
        self._phase = np.repeat(np.arange(phases.count), phases.slices * POINTS_PER_SLICE)
        self._limits = margin - self.collisions.allowed_penetration(self._phase)
        near = self._near(
            initial_configuration[None], np.zeros(1, np.intp), np.zeros(self.collisions.modes.size), margin
        )
        first = self._limits[: phases.slices * POINTS_PER_SLICE]
        first[:, near.pairs] = np.minimum(first[:, near.pairs], near.value)

    def add_violated(self, q: Array, z: Array) -> int:
        """Add the constraints that a path (T, nq) violates, and near pairs with them; return how many are violated."""
        near = self._near(self._between(q, np.arange(len(self._phase))), self._phase, z, self.margin + EARLY_MARGIN)
        count = len(self.collisions.pairs)
        clearance = near.value - self._limits[near.slices, near.pairs]
        new = ~np.isin(near.slices * count + near.pairs, self.points * count + self.pairs)
        violated = int(np.count_nonzero(new & (clearance < -MARGIN_TOLERANCE)))
        if not violated:
            return 0
        new &= (clearance < 0.0) | (
            (clearance < EARLY_MARGIN) & (near.slices % POINTS_PER_SLICE == POINTS_PER_SLICE - 1)
        )
        self.points = np.concatenate([self.points, near.slices[new]])
        self.pairs = np.concatenate([self.pairs, near.pairs[new]])
        self._gradient_entries = None
        self._columns += [
            self.collisions.dependencies(int(pair), int(self._phase[at]))
            for at, pair in zip(near.slices[new], near.pairs[new], strict=True)
        ]
        return violated

    def blocks(self, tail: int) -> Blocks:
        """Return the unknowns of each constraint: configurations (T, nq) first, variables from `tail` on."""
        nq = self.world.nq
        blocks: Blocks = []
        for point, (joints, variables) in zip(self.points.tolist(), self._columns, strict=True):
            parts = [at * nq + joints for at, _ in _interpolation(point)]
            blocks.append((1, np.concatenate([*parts, tail + variables])))
        return blocks

    def names(self) -> list[ConstraintInfo]:
        """Return kind, unit, slice and pair of each constraint."""
        return [
            ConstraintInfo("collision", "m", point // POINTS_PER_SLICE, self.collisions.name(pair))
            for point, pair in zip(self.points.tolist(), self.pairs.tolist(), strict=True)
        ]

    def evaluate(self, q: Array, z: Array) -> tuple[Array, list[Array]]:
        """Return the constraints (m,) [m] at a path (T, nq) and variables (nz,), and the entries of their gradients."""
        if not len(self.points):
            return np.zeros(0), []
        used, places = np.unique(self.points, return_inverse=True)
        kinematics = self.world.at(self._between(q, used), self.collisions.frames)
        distances = self.collisions.distances(kinematics, self._phase[used], z, places, self.pairs)
        gradients = np.concatenate([distances.by_q, distances.by_variables], axis=1)
        row, column, weight = self._entries()
        return self._limits[self.points, self.pairs] - distances.value, [-weight * gradients[row, column]]

    def _entries(self) -> tuple[Indices, Indices, Array]:
        """Return row, column among joints and variables, and interpolation weight of each entry of the gradients."""
        if self._gradient_entries is None:
            nq = self.world.nq
            rows, columns, weights = [], [], []
            for row, (point, (joints, variables)) in enumerate(zip(self.points.tolist(), self._columns, strict=True)):
                own = [weight for _, weight in _interpolation(point)]
                columns += [*[joints] * len(own), nq + variables]
                weights += [np.repeat([*own, 1.0], [*[len(joints)] * len(own), len(variables)])]
                rows.append(np.full(len(weights[-1]), row))
            self._gradient_entries = np.concatenate(rows), np.concatenate(columns), np.concatenate(weights)
        return self._gradient_entries

    def deepest_penetration(self, q: Array, z: Array) -> tuple[float, str]:
        """Return the deepest penetration [m] along a path (T, nq), between slices too, with its phase and pair.

        0 and "" where no pair penetrates more than allowed.
        """
        near, depth = self._depths(q, z)
        if not len(depth) or depth.max() <= 0.0:
            return 0.0, ""
        deepest = int(depth.argmax())
        first, second = (self.collisions.shapes[side].name for side in self.collisions.pairs[near.pairs[deepest]])
        phase = int(self._phase[near.slices[deepest]]) + 1
        return float(depth[deepest]), f"phase {phase}: {first} penetrates {second} by {depth[deepest]:.3f} m"

    def total_penetration(self, q: Array, z: Array) -> float:
        """Return the penetration [m] beyond what is allowed, summed over pairs and points of a path (T, nq)."""
        return float(np.maximum(self._depths(q, z)[1], 0.0).sum())

    def _depths(self, q: Array, z: Array) -> tuple[_Near, Array]:
        """Return the near pairs along a path (T, nq), and the penetration [m] of each beyond what is allowed (m,)."""
        near = self._near(self._between(q, np.arange(len(self._phase))), self._phase, z, 0.0)
        return near, self._limits[near.slices, near.pairs] - self.margin - near.value

    def _between(self, q: Array, points: Indices) -> Array:
        """Return the interpolated configurations (m, nq) at some points of a path (T, nq)."""
        last = points // POINTS_PER_SLICE
        weight = ((points % POINTS_PER_SLICE + 1) / POINTS_PER_SLICE)[:, None]
        before = np.concatenate([self.initial_configuration[None], q])[last]
        return np.asarray((1.0 - weight) * before + weight * q[last])

    def _near(self, q: Array, phases: Indices, z: Array, within: float) -> _Near:
        """Return the distances of all pairs nearer than `within` [m] beyond their allowed penetration."""
        kinematics = self.world.at(q, self.collisions.frames)
        slices, pairs = self.collisions.near_pairs(kinematics, phases, z, within)
        return _Near(slices, pairs, self.collisions.values(kinematics, phases, z, slices, pairs))


def _interpolation(point: int) -> list[tuple[int, float]]:
    """Return the slices around a point and their weights; the initial configuration is no unknown."""
    at, weight = point // POINTS_PER_SLICE, (point % POINTS_PER_SLICE + 1) / POINTS_PER_SLICE
    return [(at, weight)] if weight == 1.0 or at == 0 else [(at - 1, 1.0 - weight), (at, weight)]
