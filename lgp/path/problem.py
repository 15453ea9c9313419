"""The path problem of a sequence, on all slices or some of them, in the form `lgp.sqp` solves.

Unknowns: configurations of the kept slices, slice after slice, then the variables of grasps and placements.
Cost: squared accelerations (a constant quadratic; slices that are not kept are at their best) and the ergonomic score
integrated over time (the least possible score stands in for slices that are not kept). Dropping slices and switches
only removes constraints and lowers the cost, so a smaller problem bounds a larger one from below, on the same scale.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import World
from lgp.path.collision_constraints import CollisionRows
from lgp.path.constraints import Constraints, Values
from lgp.path.costs import CondensedQuadratic, Costs, Weights, eliminate_slices, quadratic
from lgp.path.ergonomics import Ergonomics
from lgp.path.hessian import Convexity, UpperBlocks
from lgp.path.phases import Phases
from lgp.sqp.problem import Model
from reba.arrays import Array, Indices

HOLD = 1e-6
"""Curvature of the model in the variables of grasps and placements, which no cost acts on."""


class PathProblem:
    """A path problem or one of its relaxations.

    Args:
        world: the kinematics.
        phases: the sequence; only its first `kept[-1] + 1` slices exist for the cost.
        kept: (P,) slices whose configurations are unknowns, rising; None for all.
        enforced: numbers of the switches whose constraints are kept; None for all.
        stop: whether everybody stops at the end (a whole sequence) or may go on (a prefix).
        ergonomics: the ergonomic cost, None to leave it out.
        weights: of the terms.
        start: (nq,) first configuration, of the world by default.
        stage: of the ergonomic cost, see `Ergonomics.stages`.
        apart: rows that keep bodies apart, where all slices are kept; they must not change afterwards.

    Example:
        >>> problem = PathProblem(world, phases)            # doctest: +SKIP
        >>> lgp.sqp.solve(problem, problem.guess())         # doctest: +SKIP
    """

    def __init__(
        self,
        world: World,
        phases: Phases,
        *,
        kept: Indices | None = None,
        enforced: Sequence[int] | None = None,
        stop: bool = True,
        ergonomics: Ergonomics | None = None,
        weights: Weights | None = None,
        start: Array | None = None,
        stage: int = -1,
        apart: CollisionRows | None = None,
    ) -> None:
        self.world, self.phases = world, phases
        self.modes = ModeSequence(world, phases.switches)
        self.weights = Weights() if weights is None else weights
        self.kept = np.arange(phases.total) if kept is None else np.asarray(kept, dtype=np.intp)
        self.start = world.initial_configuration if start is None else start
        self.ergonomics = ergonomics if self.weights.ergonomics > 0.0 else None
        self.stage = stage
        switches = tuple(range(phases.count)) if enforced is None else tuple(enforced)
        self.rows = Constraints(world, phases, self.modes, self.kept, switches, apart)
        self.n = self.rows.size
        self.lower = np.concatenate([np.tile(world.lower, len(self.kept)), self.modes.lower])
        self.upper = np.concatenate([np.tile(world.upper, len(self.kept)), self.modes.upper])
        self._loads = phases.loads()[self.kept]
        self._condense(stop)
        self._patterns()
        self._last: tuple[Array, Values] | None = None

    def split(self, x: Array) -> tuple[Array, Array]:
        """Return the configurations (P, nq) and the variables (nz,) in x (n,)."""
        tail = len(self.kept) * self.world.nq
        return x[:tail].reshape(len(self.kept), self.world.nq), x[tail:]

    def join(self, q: Array, z: Array) -> Array:
        """Return x (n,) of configurations (P, nq) and variables (nz,), moved inside the bounds."""
        return np.clip(np.concatenate([q.ravel(), z]), self.lower, self.upper)

    def path(self, x: Array) -> Array:
        """Return all slices (T, nq) of x; slices that are not kept are those of least acceleration."""
        away = self.split(x)[0] - self.start
        whole = np.empty((len(self._groups[0][1].expand), self.world.nq))
        for columns, condensed in self._groups:
            whole[:, columns] = condensed.expand @ away[:, columns]
        return whole + self.start

    def costs(self, x: Array) -> Costs:
        """Return the terms of the cost at x."""
        q, _ = self.split(x)
        away = q - self.start
        acceleration = 0.5 * float(np.vdot(away, self._pull(away)))
        ergonomics = self._floor
        if self.ergonomics is not None:
            ergonomics += self._rate * float(self.ergonomics.value(q, self._loads, self.stage).sum())
        return Costs(acceleration, ergonomics)

    def evaluate(self, x: Array) -> tuple[float, Array, Array]:
        """Return cost, equalities and inequalities at x."""
        values = self._rows(x)
        return self.costs(x).total, values.equality, values.inequality

    def linearise(self, x: Array, y_eq: Array, y_in: Array) -> Model:
        """Return the convex model at x: Gauss-Newton cost, convex part of the curvature of the switches."""
        q, z = self.split(x)
        values = self._rows(x)
        eq_jac, in_jac = self.rows.jacobians(values)
        gradient = np.concatenate([self._pull(q - self.start).ravel(), np.zeros(len(z))])
        bends = self.rows.bends(values, z, y_eq)
        violation = float(np.abs(values.equality).max(initial=0.0))
        blocks = self._convexity.convexify(bends, values.eq_blocks, violation) + self.rows.press(q, y_in)
        if self.ergonomics is not None:
            _, slope, bent = self.ergonomics.model_at(q, self._loads, self.stage)
            gradient[self._postures.ravel()] += self._rate * slope.ravel()
            blocks += [self._rate * bend for bend in bent]
        return Model(self._hessian.fill(blocks), gradient, eq_jac, values.equality, in_jac, values.inequality)

    def _rows(self, x: Array) -> Values:
        """Return all rows at x; those of the last point are kept, as each accepted point is asked for twice."""
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = x.copy(), self.rows.evaluate(*self.split(x))
        return self._last[1]

    def _pull(self, away: Array) -> Array:
        """Return the gradient (P, nq) of the acceleration cost at a path counted from the start."""
        pull = np.empty_like(away)
        for columns, condensed in self._groups:
            pull[:, columns] = 2.0 * condensed.cost @ away[:, columns]
        return pull

    def _condense(self, stop: bool) -> None:
        """Group the joints by the switches at which they rest, and eliminate the slices that are not kept."""
        horizon = int(self.kept[-1]) + 1
        matrix = self.weights.acceleration * quadratic(horizon, self.phases.tau, stop)
        groups: dict[tuple[tuple[int, int], ...], list[int]] = {}
        for joint in range(self.world.nq):
            own = tuple(pair for pair, joints in self.rows.tied.items() if joint in joints)
            groups.setdefault(own, []).append(joint)
        self._groups: list[tuple[Indices, CondensedQuadratic]] = [
            (np.array(joints, dtype=np.intp), eliminate_slices(matrix, self.kept, pairs))
            for pairs, joints in groups.items()
        ]
        self._rate = self.weights.ergonomics * self.phases.tau
        self._floor = 0.0
        if self.ergonomics is not None:
            # Loads are known in every slice, postures in those that are kept.
            carried = float(self.ergonomics.payload(self.phases.loads()[:horizon]).sum())
            self._floor = self._rate * (carried + self.ergonomics.floor * (horizon - len(self.kept)))

    def _patterns(self) -> None:
        nq = self.world.nq
        rows, columns, values = [], [], []
        for joints, condensed in self._groups:
            i, j = np.nonzero(np.triu(condensed.cost))
            rows.append((i[:, None] * nq + joints).ravel())
            columns.append((j[:, None] * nq + joints).ravel())
            values.append(np.repeat(2.0 * condensed.cost[i, j], len(joints)))
        tail = np.arange(self.n - self.modes.size, self.n)
        rows.append(tail)
        columns.append(tail)
        values.append(np.full(len(tail), HOLD))
        blocks = self.rows.curved()
        bent = [block for block in blocks if block.ndim == 1]
        self._convexity = Convexity(self._groups, bent, self.rows.bending(), (nq, self.modes.size))
        if self.ergonomics is not None:
            self._postures = np.arange(len(self.kept))[:, None] * nq + self.ergonomics.columns
            blocks += [self._postures[:, part] for part in self.ergonomics.parts]
        constant = np.concatenate(rows), np.concatenate(columns), np.concatenate(values)
        self._hessian = UpperBlocks(constant, blocks, self.n)
