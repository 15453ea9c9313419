"""The path problem of a sequence (k-order motion optimisation, Toussaint 2015), on all slices or some, for `lgp.sqp`.

Unknowns: configurations at the knots, knot after knot, then the variables of grasps and placements.
Cost: squared accelerations (a constant quadratic, minimised over all other slices) and the ergonomic score integrated
over time (the least possible score in all other slices). Dropping slices and switches only removes constraints and
lowers the cost, so a smaller problem bounds a larger one from below, on the same scale.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import World
from lgp.path.collision_constraints import CollisionConstraints
from lgp.path.constraints import Constraints, Values
from lgp.path.costs import (
    CondensedQuadratic,
    Costs,
    Weights,
    acceleration_quadratic,
    acceleration_quadratic_of,
    eliminate_slices,
    slope_by_steps,
)
from lgp.path.ergonomics import Ergonomics
from lgp.path.hessian import Convexity, UpperBlocks
from lgp.path.phases import Phases
from lgp.sqp.problem import Model
from reba.arrays import Array, Indices

VARIABLE_CURVATURE = 1e-6
"""Curvature of the model in the variables of grasps and placements, which no cost acts on."""


class PathProblem:
    """A path problem or one of its relaxations.

    Args:
        phases: the sequence; only its first `knots[-1] + 1` slices exist for the cost.
        knots: (P,) slices whose configurations are unknowns, rising; None for all.
        enforced: numbers of the switches whose constraints are enforced; None for all.
        stop: whether all agents stop at the end (a complete sequence) or may go on (a prefix).
        ergonomics: the ergonomic cost, None to leave it out.
        initial_configuration: (nq,) [rad, m], of the world by default.
        stage: continuation stage of the ergonomic cost, see `Ergonomics.stages`.
        collision_constraints: where all slices are knots; they must not change afterwards.
    """

    def __init__(
        self,
        world: World,
        phases: Phases,
        *,
        knots: Indices | None = None,
        enforced: Sequence[int] | None = None,
        stop: bool = True,
        ergonomics: Ergonomics | None = None,
        weights: Weights | None = None,
        initial_configuration: Array | None = None,
        stage: int = -1,
        collision_constraints: CollisionConstraints | None = None,
    ) -> None:
        self.world, self.phases = world, phases
        self.modes = ModeSequence(world, phases.switches)
        self.weights = Weights() if weights is None else weights
        self.knots = np.arange(phases.total) if knots is None else np.asarray(knots, dtype=np.intp)
        self.initial_configuration = (
            world.initial_configuration if initial_configuration is None else initial_configuration
        )
        self.ergonomics = ergonomics if self.weights.ergonomics > 0.0 else None
        self.stage = stage
        switches = tuple(range(phases.count)) if enforced is None else tuple(enforced)
        self.constraints = Constraints(world, phases, self.modes, self.knots, switches, collision_constraints)
        self.n = self.constraints.size
        self.lower = np.concatenate([np.tile(world.lower, len(self.knots)), self.modes.lower])
        self.upper = np.concatenate([np.tile(world.upper, len(self.knots)), self.modes.upper])
        self._loads = phases.loads()[self.knots]
        self._eliminate(stop)
        self._set_patterns()
        self._last: tuple[Array, Values] | None = None

    def split(self, x: Array) -> tuple[Array, Array]:
        """Return the configurations (P, nq) and the variables (nz,) in x (n,)."""
        tail = len(self.knots) * self.world.nq
        return x[:tail].reshape(len(self.knots), self.world.nq), x[tail:]

    def join(self, q: Array, z: Array) -> Array:
        """Return x (n,) of configurations (P, nq) and variables (nz,), moved inside the bounds."""
        return np.clip(np.concatenate([q.ravel(), z]), self.lower, self.upper)

    def path(self, x: Array) -> Array:
        """Return all slices (T, nq) of x; those between knots have the least acceleration."""
        away = self.split(x)[0] - self.initial_configuration
        path = np.empty((len(self._groups[0][1].expand), self.world.nq))
        for columns, condensed in self._groups:
            path[:, columns] = condensed.expand @ away[:, columns]
        return path + self.initial_configuration

    def costs(self, x: Array) -> Costs:
        """Return the terms of the cost at x."""
        q, _ = self.split(x)
        away = q - self.initial_configuration
        acceleration = 0.5 * float(np.vdot(away, self._acceleration_gradient(away)))
        ergonomics = self._score_elsewhere
        if self.ergonomics is not None:
            ergonomics += self._rate * float(
                self.ergonomics.value(q, self._loads, self.stage) @ self._share[self.knots]
            )
        return Costs(acceleration, ergonomics, self._time)

    def ergonomics_by_phase(self, x: Array) -> Array:
        """Return the ergonomic cost of each phase at x, (K,)."""
        if self.ergonomics is None:
            return np.zeros(self.phases.count)
        horizon = len(self._share)
        scores = np.full(horizon, self.ergonomics.lower_bound)
        scores[self.knots] = self.ergonomics.value(self.split(x)[0], self._loads, self.stage)
        scores += self.ergonomics.payload(self.phases.loads()[:horizon])
        return self._rate * (scores * self._share).reshape(-1, self.phases.slices).sum(axis=1)

    def slope_by_durations(self, x: Array) -> Array:
        """Return the derivative of the total cost by the logarithm of each duration at x, (K,).

        Of the path with its own durations this is all: no constraint depends on time.
        """
        steps = self.phases.steps[: len(self._share)]
        accelerations = slope_by_steps(self.path(x) - self.initial_configuration, steps, self._stop)
        by_phase = accelerations.reshape(-1, self.phases.slices).sum(axis=1)
        time = self.weights.time * self.phases.phase_durations
        return np.asarray(self.weights.acceleration * by_phase + self.ergonomics_by_phase(x) + time)

    def evaluate(self, x: Array) -> tuple[float, Array, Array]:
        """Return the cost of the motion, equalities and inequalities at x."""
        values = self._values(x)
        return self.costs(x).motion, values.equality, values.inequality

    def linearise(self, x: Array, y_eq: Array, y_in: Array) -> Model:
        """Return the convex model at x: Gauss-Newton cost, convexified curvature of the switches."""
        q, z = self.split(x)
        values = self._values(x)
        eq_jac, in_jac = self.constraints.jacobians(values)
        gradient = np.concatenate(
            [self._acceleration_gradient(q - self.initial_configuration).ravel(), np.zeros(len(z))]
        )
        hessians = self.constraints.equality_hessians(values, z, y_eq)
        violation = float(np.abs(values.equality).max(initial=0.0))
        blocks = self._convexity.convexify(hessians, values.eq_blocks, violation) + self.constraints.leg_hessian(
            q, y_in
        )
        if self.ergonomics is not None:
            _, score_gradient, score_hessians = self.ergonomics.quadratic_model(q, self._loads, self.stage)
            rates = self._rate * self._share[self.knots]
            gradient[self._postures.ravel()] += (rates[:, None] * score_gradient).ravel()
            blocks += [rates[:, None, None] * hessian for hessian in score_hessians]
        return Model(self._hessian.fill(blocks), gradient, eq_jac, values.equality, in_jac, values.inequality)

    def _values(self, x: Array) -> Values:
        """Return all constraints at x; the last ones are stored, as each accepted point is evaluated twice."""
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = x.copy(), self.constraints.evaluate(*self.split(x))
        return self._last[1]

    def _acceleration_gradient(self, away: Array) -> Array:
        """Return the gradient (P, nq) of the acceleration cost at a path counted from the start."""
        gradient = np.empty_like(away)
        for columns, condensed in self._groups:
            gradient[:, columns] = 2.0 * condensed.cost @ away[:, columns]
        return gradient

    def _eliminate(self, stop: bool) -> None:
        """Group the joints by the switches at which they rest, and eliminate the slices between knots."""
        self._stop = stop
        horizon = int(self.knots[-1]) + 1
        steps = self.phases.steps[:horizon]
        plain = (
            acceleration_quadratic_of(steps, stop)
            if self.phases.durations
            else acceleration_quadratic(horizon, self.phases.tau, stop)
        )
        matrix = self.weights.acceleration * plain
        groups: dict[tuple[tuple[int, int], ...], list[int]] = {}
        for joint in range(self.world.nq):
            own = tuple(pair for pair, joints in self.constraints.equal_eliminated.items() if joint in joints)
            groups.setdefault(own, []).append(joint)
        self._groups: list[tuple[Indices, CondensedQuadratic]] = [
            (np.array(joints, dtype=np.intp), eliminate_slices(matrix, self.knots, pairs))
            for pairs, joints in groups.items()
        ]
        self._rate = self.weights.ergonomics * self.phases.tau
        # Slices of phases with durations of their own last longer or shorter than others.
        self._share = steps / self.phases.tau
        self._time = self.weights.time * float(steps.sum())
        self._score_elsewhere = 0.0
        if self.ergonomics is not None:
            # Loads are known in every slice, postures at knots only.
            carried = float(self.ergonomics.payload(self.phases.loads()[:horizon]) @ self._share)
            elsewhere = float(self._share.sum() - self._share[self.knots].sum())
            self._score_elsewhere = self._rate * (carried + self.ergonomics.lower_bound * elsewhere)

    def _set_patterns(self) -> None:
        """Set the sparsity pattern of the Hessian from the acceleration cost and the blocks of its curvature."""
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
        values.append(np.full(len(tail), VARIABLE_CURVATURE))
        blocks = self.constraints.hessian_columns()
        of_switches = [block for block in blocks if block.ndim == 1]
        self._convexity = Convexity(
            self._groups, of_switches, self.constraints.curved_equalities(), (nq, self.modes.size)
        )
        if self.ergonomics is not None:
            self._postures = np.arange(len(self.knots))[:, None] * nq + self.ergonomics.columns
            blocks += [self._postures[:, part] for part in self.ergonomics.parts]
        constant = np.concatenate(rows), np.concatenate(columns), np.concatenate(values)
        self._hessian = UpperBlocks(constant, blocks, self.n)
