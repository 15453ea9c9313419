"""Inequalities that keep bodies apart: chosen where bodies are near each other, kept while a path is solved.

Few of the pairs of bodies ever come near, so a path starts without rows and gets those it needs, see
`lgp.path.collision_path`. A row says margin - distance <= 0 in one slice or between two, on the joints that move its
two bodies and the variables of how an object among them is held.
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
"""[m] Distance that is kept at the slices, so that little is left to touch between them."""
AHEAD = 0.02
"""[m] Where a row is missing, all pairs nearer than the margin and this get one in their slices."""
TOLERATED = 1e-3
"""[m] A margin that is missed by less where there is no row calls for none."""
FINER = 4
"""Points looked at per slice, joints moving evenly between slices: an arm moves 10 cm or more from one to the next."""


class _Near(NamedTuple):
    """Pairs of bodies near each other: in which slices or points (m,), which pairs (m,), their distances (m,) [m]."""

    slices: Indices
    pairs: Indices
    value: Array


class CollisionRows:
    """The rows chosen so far for the slices of one sequence.

    Args:
        world: the kinematics.
        phases: the sequence.
        start: (nq,) first configuration; what is nearer there than the margin need not part within the first phase.
        margin: [m].

    Attributes:
        points: (m,) where each row is, counted in steps of 1 / FINER slices; new rows come last.
        pairs: (m,) which pair of bodies it keeps apart.

    Example:
        >>> rows = CollisionRows(world, phases, world.initial_configuration)              # doctest: +SKIP
        >>> rows.extend(path, variables)                                  # doctest: +SKIP
        12
    """

    def __init__(self, world: World, phases: Phases, start: Array, margin: float = MARGIN) -> None:
        self.world, self.phases, self.start, self.margin = world, phases, start, margin
        self.collisions = Collisions(world, ModeSequence(world, phases.switches))
        self.points, self.pairs = np.zeros(0, np.intp), np.zeros(0, np.intp)
        self._columns: list[tuple[Indices, Indices]] = []
        self._places: tuple[Indices, Indices, Array] | None = None
        self._phase = np.repeat(np.arange(phases.count), phases.slices * FINER)
        self._limits = margin - self.collisions.allowed_penetration(self._phase)
        near = self._near(start[None], np.zeros(1, np.intp), np.zeros(self.collisions.modes.size), margin)
        first = self._limits[: phases.slices * FINER]
        first[:, near.pairs] = np.minimum(first[:, near.pairs], near.value)

    def extend(self, q: Array, z: Array) -> int:
        """Add rows if bodies of a path (T, nq) are too near where there are none; return in how many places."""
        near = self._near(self._between(q, np.arange(len(self._phase))), self._phase, z, self.margin + AHEAD)
        count = len(self.collisions.pairs)
        over = near.value - self._limits[near.slices, near.pairs]
        new = ~np.isin(near.slices * count + near.pairs, self.points * count + self.pairs)
        violated = int(np.count_nonzero(new & (over < -TOLERATED)))
        if not violated:
            return 0
        new &= (over < 0.0) | ((over < AHEAD) & (near.slices % FINER == FINER - 1))
        self.points = np.concatenate([self.points, near.slices[new]])
        self.pairs = np.concatenate([self.pairs, near.pairs[new]])
        self._places = None
        self._columns += [
            self.collisions.dependencies(int(pair), int(self._phase[at]))
            for at, pair in zip(near.slices[new], near.pairs[new], strict=True)
        ]
        return violated

    def blocks(self, tail: int) -> Blocks:
        """Return the unknowns of each row: configurations (T, nq) first, then from `tail` on the variables."""
        nq = self.world.nq
        found: Blocks = []
        for point, (joints, variables) in zip(self.points.tolist(), self._columns, strict=True):
            parts = [at * nq + joints for at, _ in _shares(point)]
            found.append((1, np.concatenate([*parts, tail + variables])))
        return found

    def names(self) -> list[ConstraintInfo]:
        """Return what each row is about."""
        return [
            ConstraintInfo("collision", "m", point // FINER, self.collisions.name(pair))
            for point, pair in zip(self.points.tolist(), self.pairs.tolist(), strict=True)
        ]

    def evaluate(self, q: Array, z: Array) -> tuple[Array, list[Array]]:
        """Return the rows (m,) at a path (T, nq) and variables (nz,), and the values of their blocks one by one."""
        if not len(self.points):
            return np.zeros(0), []
        used, places = np.unique(self.points, return_inverse=True)
        kinematics = self.world.at(self._between(q, used), self.collisions.frames)
        found = self.collisions.distances(kinematics, self._phase[used], z, places, self.pairs)
        slopes = np.concatenate([found.by_q, found.by_variables], axis=1)
        row, column, share = self._entries()
        return self._limits[self.points, self.pairs] - found.value, [-share * slopes[row, column]]

    def _entries(self) -> tuple[Indices, Indices, Array]:
        """Return row, column among joints and variables, and share of each entry of the blocks, in their order."""
        if self._places is None:
            nq = self.world.nq
            rows, columns, shares = [], [], []
            for row, (point, (joints, variables)) in enumerate(zip(self.points.tolist(), self._columns, strict=True)):
                own = [part for _, part in _shares(point)]
                columns += [*[joints] * len(own), nq + variables]
                shares += [np.repeat([*own, 1.0], [*[len(joints)] * len(own), len(variables)])]
                rows.append(np.full(len(shares[-1]), row))
            self._places = np.concatenate(rows), np.concatenate(columns), np.concatenate(shares)
        return self._places

    def worst(self, q: Array, z: Array) -> tuple[float, str]:
        """Return the deepest penetration [m] of any pair along a path (T, nq), between slices too, and what it is.

        0 and "" where nothing touches more than it may.
        """
        near, depth = self._depths(q, z)
        if not len(depth) or depth.max() <= 0.0:
            return 0.0, ""
        deepest = int(depth.argmax())
        first, second = (self.collisions.shapes[side].name for side in self.collisions.pairs[near.pairs[deepest]])
        phase = int(self._phase[near.slices[deepest]]) + 1
        return float(depth[deepest]), f"phase {phase}: {first} goes {depth[deepest]:.3f} m into {second}"

    def overlap(self, q: Array, z: Array) -> float:
        """Return how deep [m] bodies are in each other beyond what they may, summed over pairs and points of a path."""
        return float(np.maximum(self._depths(q, z)[1], 0.0).sum())

    def _depths(self, q: Array, z: Array) -> tuple[_Near, Array]:
        """Return the distances of all pairs that may touch along a path (T, nq), and how deep [m] each goes (m,)."""
        near = self._near(self._between(q, np.arange(len(self._phase))), self._phase, z, 0.0)
        return near, self._limits[near.slices, near.pairs] - self.margin - near.value

    def _between(self, q: Array, points: Indices) -> Array:
        """Return the configurations (m, nq) at given points of a path (T, nq)."""
        last = points // FINER
        share = ((points % FINER + 1) / FINER)[:, None]
        before = np.concatenate([self.start[None], q])[last]
        return np.asarray((1.0 - share) * before + share * q[last])

    def _near(self, q: Array, phases: Indices, z: Array, within: float) -> _Near:
        """Return the distances of all pairs that may be nearer than `within` [m] beyond their slack."""
        kinematics = self.world.at(q, self.collisions.frames)
        slices, pairs = self.collisions.near_pairs(kinematics, phases, z, within)
        return _Near(slices, pairs, self.collisions.values(kinematics, phases, z, slices, pairs))


def _shares(point: int) -> list[tuple[int, float]]:
    """Return the slices that a point lies between, and the share of each; the start before the first is no unknown."""
    at, share = point // FINER, (point % FINER + 1) / FINER
    return [(at, share)] if share == 1.0 or at == 0 else [(at - 1, 1.0 - share), (at, share)]
