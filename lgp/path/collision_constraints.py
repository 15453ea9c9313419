"""Collision constraints of a path: pairs of bodies that are near each other become active, others cost no rows.

Few of the pairs ever come near, so a path starts without constraints and `lgp.path.collision_path` adds the violated
ones. Each says margin - distance <= 0 at one point of time, in a slice or between two, by the joints that move its two
bodies and the variables of how an object among them is attached.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lgp.collision.contacts import (
    Clock,
    declared_contacts,
    required_distances,
)
from lgp.collision.distances import Collisions, NearestPoints, sum_by
from lgp.collision.withdrawals import declared_withdrawals, require_withdrawals
from lgp.kinematics.interpolation import AROUND, interpolate, interpolation_weights
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import Kinematics, World
from lgp.path.mode_constraints import Blocks, ConstraintInfo
from lgp.path.phases import Phases
from reba.arrays import Array, Flags, Indices

MARGIN = 0.01
"""[m] Distance between bodies at the constrained points, so that little penetration is left between them."""
EARLY_MARGIN = 0.005
"""[m] Where a constraint is violated, pairs within the margin and this become active too."""
MARGIN_TOLERANCE = 1e-3
"""[m] A pair below the margin by less does not become active."""
POINTS_PER_SLICE = 4
"""Points checked per slice, joints interpolated: the hand of an arm moves 10 cm or more from slice to slice."""
BETWEEN = 4
"""Parts that the time between two points is divided into when a path is solved: an edge may pass between the points."""
EXTRA = 2e-3
"""[m] Around what bodies miss between two points, they keep so much more than that at these: a choice."""


class _Near(NamedTuple):
    """Pairs of bodies near each other: slices or points (m,), pairs (m,), distances (m,) [m]."""

    slices: Indices
    pairs: Indices
    value: Array


class _Evaluation(NamedTuple):
    """The nearest points of all constraints at a path (T, nq) and variables (nz,), in the points (u,) they are at."""

    q: Array
    z: Array
    points: Indices
    kinematics: Kinematics
    nearest: NearestPoints


class CollisionConstraints:
    """The active collision constraints of one sequence.

    Args:
        initial_configuration: (nq,) [rad, m]; pairs nearer than the margin there may stay so within the first phase.
        margin: [m].

    Attributes:
        points: (m,) time of each constraint in steps of 1 / POINTS_PER_SLICE slices; new ones come last.
        pairs: (m,) its pair of bodies.
        contacts_alone: whether only pairs become active for which actions declare contact or a distance.
        stride: constraints become active in every so manieth slice of a phase alone, the last one among them.
    """

    def __init__(self, world: World, phases: Phases, initial_configuration: Array, margin: float = MARGIN) -> None:
        self.world, self.phases, self.margin = world, phases, margin
        self.initial_configuration = initial_configuration
        self.collisions = Collisions(world, ModeSequence(world, phases.switches))
        self.points, self.pairs = np.zeros(0, np.intp), np.zeros(0, np.intp)
        self._columns: list[tuple[Indices, Indices]] = []
        self._gradient_entries: tuple[Indices, Indices, Indices] | None = None
        self._last: _Evaluation | None = None
        self._phase = np.repeat(phases.switched, phases.slices * POINTS_PER_SLICE)
        clock = Clock.of(phases.phase_durations, phases.seconds, phases.slices, phases.phase_of)
        contacts = declared_contacts(self.collisions.modes, clock)
        times = np.cumsum(np.repeat(phases.steps, POINTS_PER_SLICE) / POINTS_PER_SLICE)
        shapes, pairs = self.collisions.shapes, self.collisions.pairs
        self._limits = required_distances(shapes, pairs, contacts, times, margin, self.collisions.close)
        require_withdrawals(
            self._limits, shapes, pairs, tuple(declared_withdrawals(self.collisions.modes, clock)), times
        )
        self._contacts = (self._limits != margin).any(axis=0)
        self._grips = np.array([self.collisions.is_grip(pair) for pair in pairs], dtype=bool)
        self.contacts_alone, self.stride = False, 1
        at_first = required_distances(shapes, pairs, contacts, np.zeros(1), margin, self.collisions.close)
        near = self._near(
            initial_configuration[None], np.zeros(1, np.intp), np.zeros(self.collisions.modes.size), 0.0, at_first
        )
        first = self._limits[: phases.slices * POINTS_PER_SLICE]
        first[:, near.pairs] = np.minimum(first[:, near.pairs], near.value)

    def __len__(self) -> int:
        return len(self.points)

    def add_violated(self, q: Array, z: Array) -> int:
        """Add the constraints that a path (T, nq) violates, and near pairs with them; return how many are violated.

        Of the points of a slice and a pair only the nearest becomes active: the next ones say nearly the same.
        """
        points = np.arange(len(self._phase))
        near = self._near(self._between(q, points), self._phase, z, EARLY_MARGIN, self._limits)
        count = len(self.collisions.pairs)
        clearance = near.value - self._limits[near.slices, near.pairs]
        new = self._nearest_of_slice(near, clearance) & (clearance < EARLY_MARGIN)
        if self.contacts_alone:
            new &= self._contacts[near.pairs]
        before_end = self.phases.slices - 1 - near.slices // POINTS_PER_SLICE % self.phases.slices
        new &= before_end % self.stride == 0
        new &= ~np.isin(near.slices * count + near.pairs, self.points * count + self.pairs)
        violated = int(np.count_nonzero(new & (clearance < -MARGIN_TOLERANCE)))
        if not violated:
            return 0
        self.points = np.concatenate([self.points, near.slices[new]])
        self.pairs = np.concatenate([self.pairs, near.pairs[new]])
        self._gradient_entries = self._last = None
        self._columns += [
            self.collisions.dependencies(int(pair), int(self._phase[at]))
            for at, pair in zip(near.slices[new], near.pairs[new], strict=True)
        ]
        return violated

    def keep_more_around(self, q: Array, z: Array) -> int:
        """Let pairs keep more at the points around which they are in each other, or grip points too near, on a path
        (T, nq); return how many points and pairs these are.

        The whole margin between all points would make every path dearer for the few that need it. Points near a
        contact, where less than the margin is kept, stay as they are: there the actions decide.
        """
        fine = np.arange(len(self._phase) * BETWEEN)
        fine = fine[(fine + 1) % BETWEEN != 0]
        after = fine // BETWEEN
        before = np.maximum(after - 1, 0)
        required = np.minimum(self._limits[before], self._limits[after])
        required[:, ~self._grips] = np.minimum(required[:, ~self._grips], 0.0)
        near = self._near(self._between(q, fine, BETWEEN), self._phase[after], z, 0.0, required)
        missed = required[near.slices, near.pairs] - near.value
        some = np.flatnonzero(missed > 0.5 * MARGIN_TOLERANCE)
        pairs, more = np.tile(near.pairs[some], 2), np.tile(missed[some] + EXTRA, 2)
        points = np.concatenate([before[near.slices[some]], after[near.slices[some]]])
        whole = self._limits[points, pairs] >= np.where(self._grips[pairs], 0.0, self.margin)
        where = points[whole], pairs[whole]
        np.maximum.at(self._limits, where, self._distances(q, z, *where) + more[whole])
        return int(np.count_nonzero(whole))

    def _distances(self, q: Array, z: Array, points: Indices, pairs: Indices) -> Array:
        """Return the distances (m,) [m] of pairs at points of a path (T, nq)."""
        used, places = np.unique(points, return_inverse=True)
        kinematics = self.world.at(self._between(q, used), self.collisions.frames)
        return self.collisions.values(kinematics, self._phase[used], z, places, pairs)

    def _nearest_of_slice(self, near: _Near, clearance: Array) -> Flags:
        """Return (m,) whether no other point of the same slice and pair has less clearance."""
        of = near.slices // POINTS_PER_SLICE * len(self.collisions.pairs) + near.pairs
        order = np.lexsort((clearance, of))
        nearest = np.zeros(len(of), dtype=bool)
        nearest[order[np.unique(of[order], return_index=True)[1]]] = True
        return nearest

    def blocks(self, tail: int) -> Blocks:
        """Return the unknowns of each constraint: configurations (T, nq) first, variables from `tail` on."""
        nq = self.world.nq
        blocks: Blocks = []
        for point, (joints, variables) in zip(self.points.tolist(), self._columns, strict=True):
            parts = [at * nq + joints for at in self._slices(point)]
            blocks.append((1, np.concatenate([*parts, tail + variables])))
        return blocks

    def names(self) -> list[ConstraintInfo]:
        """Return kind, unit, slice and pair of each constraint."""
        return [
            ConstraintInfo("collision", "m", point // POINTS_PER_SLICE, self.collisions.name(pair))
            for point, pair in zip(self.points.tolist(), self.pairs.tolist(), strict=True)
        ]

    def evaluate(self, q: Array, z: Array) -> Array:
        """Return the constraints (m,) [m] at a path (T, nq) and variables (nz,)."""
        if not len(self.points):
            return np.zeros(0)
        return np.asarray(self._limits[self.points, self.pairs] - self._evaluation(q, z).nearest.value)

    def gradients(self, q: Array, z: Array) -> list[Array]:
        """Return the entries of the gradients of all constraints, in the order of `blocks`."""
        if not len(self.points):
            return []
        known = self._evaluation(q, z)
        places = known.nearest.slices
        phases = self._phase[known.points]
        gradients = np.concatenate(self.collisions.gradients(known.kinematics, phases, z, known.nearest), axis=1)
        row, column, around = self._entries()
        weights = interpolation_weights(self._knots(q), *_share(known.points))
        weight = np.where(around < 0, 1.0, weights[places[row], around, np.minimum(column, self.world.nq - 1)])
        return [-weight * gradients[row, column]]

    def _evaluation(self, q: Array, z: Array) -> _Evaluation:
        """Return the nearest points of all constraints; the last ones are stored, for gradients and curvature."""
        if self._last is None or not (np.array_equal(self._last.q, q) and np.array_equal(self._last.z, z)):
            used, places = np.unique(self.points, return_inverse=True)
            kinematics = self.world.at(self._between(q, used), self.collisions.frames_of(self.pairs))
            nearest = self.collisions.nearest(kinematics, self._phase[used], z, places, self.pairs)
            self._last = _Evaluation(q.copy(), z.copy(), used, kinematics, nearest)
        return self._last

    def hessian_columns(self) -> list[Indices]:
        """Return the unknowns of each block of `hessian`: those of one agent in the slices nearest to constraints."""
        at = np.unique(self._nearest_slices())[:, None] * self.world.nq
        return [at + columns for columns in self._agents()] if len(at) else []

    def hessian(self, q: Array, z: Array, y: Array) -> list[Array]:
        """Return the convex part of sum_i y_i d2 row_i (n, p, p) of each agent, for multipliers y (m,).

        Each constraint counts for the slice nearest to it.
        """
        if not len(self.points):
            return []
        slices, places = np.unique(self._nearest_slices(), return_inverse=True)
        total = np.zeros((len(slices), self.world.nq, self.world.nq))
        rows = np.flatnonzero(y > 0.0)
        if len(rows):
            known = self._evaluation(q, z)
            own = known.nearest.rows(rows)
            by_point = self.collisions.curvature(known.kinematics, self._phase[known.points], own, -y[rows])
            first = np.zeros(len(known.points), np.intp)
            first[own.slices] = places[rows]
            total = sum_by(by_point, first, len(slices))
        return [_convex_part(total[:, columns[:, None], columns]) for columns in self._agents()]

    def _agents(self) -> list[Indices]:
        return [np.array(self.world.columns(agent.name), np.intp) for agent in self.world.scene.agents]

    def _nearest_slices(self) -> Indices:
        """Return the slice (m,) nearest to each constraint; the start is none."""
        return np.maximum((self.points + POINTS_PER_SLICE // 2 + 1) // POINTS_PER_SLICE - 1, 0)

    def _entries(self) -> tuple[Indices, Indices, Indices]:
        """Return row, column among joints and variables, and place among the knots around of each gradient entry.

        The place is -1 for a variable.
        """
        if self._gradient_entries is None:
            nq = self.world.nq
            rows, columns, places = [], [], []
            for row, (point, (joints, variables)) in enumerate(zip(self.points.tolist(), self._columns, strict=True)):
                slices = self._slices(point)
                columns += [*[joints] * len(slices), nq + variables]
                first = AROUND.index(slices[0] + 1 - point // POINTS_PER_SLICE)
                around = [np.full(len(joints), first + number) for number in range(len(slices))]
                places += [*around, np.full(len(variables), -1)]
                rows.append(np.full(len(slices) * len(joints) + len(variables), row))
            self._gradient_entries = np.concatenate(rows), np.concatenate(columns), np.concatenate(places)
        return self._gradient_entries

    def _slices(self, point: int) -> list[int]:
        """Return the slices that a point depends on; the initial configuration is no unknown."""
        at = point // POINTS_PER_SLICE
        if (point + 1) % POINTS_PER_SLICE == 0:
            return [at]
        return [at - 1 + offset for offset in AROUND if 0 <= at - 1 + offset < self.phases.total]

    def limits_of_phase(self, phase: int) -> Array:
        """Return the distances (points, pairs) [m] that pairs keep at the points of a phase, -inf where contact is
        free."""
        points = self.phases.slices * POINTS_PER_SLICE
        return self._limits[phase * points : (phase + 1) * points]

    def distances_at(self, q: Array, phase: int, z: Array) -> tuple[Indices, Array]:
        """Return the pairs (m,) that are in each other at a configuration (nq,) within a phase, with distances [m]."""
        none = np.zeros((1, len(self.collisions.pairs)))
        near = self._near(q[None], self.phases.switched[phase : phase + 1], z, 0.0, none)
        return near.pairs, near.value

    def keeps(self, q: Array, phase: int, z: Array, required: Array) -> Flags:
        """Return whether configurations (n, nq) within a phase keep distances (n, pairs) [m]."""
        near = self._near(q, np.full(len(q), self.phases.switched[phase]), z, 0.0, required)
        kept = np.ones(len(q), dtype=bool)
        kept[near.slices[near.value < required[near.slices, near.pairs] - MARGIN_TOLERANCE]] = False
        return kept

    def deepest_penetration(self, q: Array, z: Array) -> tuple[float, str]:
        """Return the deepest penetration [m] along a path (T, nq), between slices too, with its phase and pair.

        0 and "" where no pair penetrates more than allowed.
        """
        near, depth = self._depths(q, z)
        if not len(depth) or depth.max() <= 0.0:
            return 0.0, ""
        deepest = int(depth.argmax())
        first, second = (self.collisions.shapes[side].name for side in self.collisions.pairs[near.pairs[deepest]])
        phase = int(near.slices[deepest]) // (self.phases.slices * POINTS_PER_SLICE) + 1
        return float(depth[deepest]), f"phase {phase}: {first} penetrates {second} by {depth[deepest]:.3f} m"

    def total_penetration(self, q: Array, z: Array) -> float:
        """Return the penetration [m] beyond what is allowed, summed over pairs and points of a path (T, nq)."""
        return float(np.maximum(self._depths(q, z)[1], 0.0).sum())

    def _depths(self, q: Array, z: Array) -> tuple[_Near, Array]:
        """Return the near pairs along a path (T, nq), and the penetration [m] of each beyond what is allowed (m,)."""
        touching = np.where(np.isneginf(self._limits), -np.inf, 0.0)
        touching[:, self._grips] = -np.inf  # no bodies
        near = self._near(self._between(q, np.arange(len(self._phase))), self._phase, z, 0.0, touching)
        return near, -near.value

    def _between(self, q: Array, points: Indices, parts: int = 1) -> Array:
        """Return the interpolated configurations (m, nq) at some points of a path (T, nq), or parts of points."""
        return interpolate(self._knots(q), *_share(points, parts))

    def _knots(self, q: Array) -> Array:
        return np.concatenate([self.initial_configuration[None], q])

    def _near(self, q: Array, phases: Indices, z: Array, within: float, required: Array) -> _Near:
        """Return the distances of all pairs nearer than `within` [m] beyond the distance they must keep."""
        kinematics = self.world.at(q, self.collisions.frames)
        slices, pairs = self.collisions.near_pairs(kinematics, phases, z, within, required)
        return _Near(slices, pairs, self.collisions.values(kinematics, phases, z, slices, pairs))


def _convex_part(matrices: Array) -> Array:
    """Return symmetric matrices (n, p, p) without their negative eigenvalues."""
    convex = np.zeros_like(matrices)
    curved = np.flatnonzero(matrices.any(axis=(1, 2)))
    values, vectors = np.linalg.eigh(matrices[curved])
    convex[curved] = (vectors * np.maximum(values, 0.0)[:, None]) @ np.swapaxes(vectors, 1, 2)
    return convex


def _share(points: Indices, parts: int = 1) -> tuple[Indices, Array]:
    """Return the knot before each point (the start is knot 0), and its share of the way to the next knot."""
    count = POINTS_PER_SLICE * parts
    return points // count, (points % count + 1) / count
