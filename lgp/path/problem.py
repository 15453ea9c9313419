"""The path problem of a sequence (k-order motion optimisation, Toussaint 2015), on all slices or some, for `lgp.sqp`.

Unknowns: configurations at the knots, knot after knot, then the variables of grasps and placements.
Cost: squared accelerations (a constant quadratic, minimised over all other slices), the ergonomic score integrated
over time (the least possible score in all other slices) and cost terms of one's own (0 in all other slices). Dropping
slices and switches only removes constraints and lowers the cost, so a smaller problem bounds a larger one from below,
on the same scale.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lgp.kinematics.cost_terms import CostTerms
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import World
from lgp.path.active_constraints import ActiveConstraints
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
from lgp.search.time_limit import stop_if_time_is_up
from lgp.sqp.problem import Model
from reba.arrays import Array, Indices

VARIABLE_CURVATURE = 1e-6
"""Curvature of the model in the variables of grasps and placements, which no cost acts on, in cost units."""


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
        active: constraints of a path on all slices that became active; they must not change afterwards.

    Attributes:
        cost_unit: the least cost of a joint that moves by 1 rad in one phase, from rest to rest. In multiples of it
            the same motion costs the same in any unit of cost and time, so that its optimum does not depend on them.
        rates: cost of a score point in the slice of each knot, in cost units, (P,).
        terms: cost terms of one's own, with `term_rates` (P,).
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
        active: ActiveConstraints | None = None,
    ) -> None:
        self.world, self.phases = world, phases
        self.modes = ModeSequence(world, phases.switches)
        self.weights = Weights() if weights is None else weights
        self.knots = np.arange(phases.total) if knots is None else np.asarray(knots, dtype=np.intp)
        self.initial_configuration = (
            world.initial_configuration if initial_configuration is None else initial_configuration
        )
        self.ergonomics = ergonomics if self.weights.ergonomics > 0.0 else None
        self.cost_unit = 12.0 * self.weights.acceleration / phases.seconds**3 or 1.0
        # Rounding, so that the same program in other units is the same to the last digit.
        self.rate = float(f"{self.weights.ergonomics * phases.tau / self.cost_unit:.12g}")
        self.stage = stage
        self.terms = CostTerms(world)
        switches = tuple(range(len(phases.switches))) if enforced is None else tuple(enforced)
        self.constraints = Constraints(world, phases, self.modes, self.knots, switches, active)
        self.n = self.constraints.size
        self.lower = np.concatenate([np.tile(world.lower, len(self.knots)), self.modes.lower])
        self.upper = np.concatenate([np.tile(world.upper, len(self.knots)), self.modes.upper])
        self.loads = phases.loads()[self.knots]
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
        path = np.empty((len(self.groups[0][1].expand), self.world.nq))
        for columns, condensed in self.groups:
            path[:, columns] = condensed.expand @ away[:, columns]
        return path + self.initial_configuration

    def costs(self, x: Array) -> Costs:
        """Return the terms of the cost at x."""
        acceleration, ergonomics, terms = (self.cost_unit * term for term in self._terms(x))
        return Costs(acceleration, ergonomics, self._time, terms, self.phases.action_cost)

    def evaluate(self, x: Array) -> tuple[float, Array, Array]:
        """Return the cost of the motion in cost units, equalities and inequalities at x."""
        values = self._values(x)
        return sum(self._terms(x)), values.equality, values.inequality

    def _terms(self, x: Array) -> tuple[float, float, float]:
        """Return the costs of acceleration, ergonomics and one's own terms at x, in cost units."""
        q, _ = self.split(x)
        away = q - self.initial_configuration
        acceleration = 0.5 * float(np.vdot(away, self._acceleration_gradient(away)))
        ergonomics = self.score_elsewhere
        if self.ergonomics is not None:
            ergonomics += float(self.ergonomics.value(q, self.loads, self.stage) @ self.rates)
        return acceleration, ergonomics, float(self.terms.value(q) @ self.term_rates) if self.terms else 0.0

    def ergonomics_by_phase(self, x: Array) -> Array:
        """Return the ergonomic cost of each phase at x, (K,)."""
        if self.ergonomics is None:
            return np.zeros(self.phases.count)
        scores = np.full(len(self._all_shares), self.ergonomics.lower_bound)
        scores[self.knots] = self.ergonomics.value(self.split(x)[0], self.loads, self.stage)
        scores += self.ergonomics.payload(self.phases.loads()[: len(scores)])
        by_phase = (scores * self._all_shares).reshape(-1, self.phases.slices).sum(axis=1)
        return np.asarray(self.cost_unit * self.rate * by_phase)

    def running_by_phase(self, x: Array) -> Array:
        """Return what each phase costs at x beside accelerations and time, (K,)."""
        own = np.zeros(len(self._all_shares))
        if self.terms:
            own[self.knots] = self.cost_unit * self.term_rates * self.terms.value(self.split(x)[0])
        return self.ergonomics_by_phase(x) + own.reshape(-1, self.phases.slices).sum(axis=1)

    def slope_by_durations(self, x: Array) -> Array:
        """Return the derivative of the total cost by the logarithm of each duration at x, (K,).

        Of the path with its own durations this is all: no constraint depends on time.
        """
        steps = self.phases.steps[: len(self._all_shares)]
        away = (self.path(x) - self.initial_configuration) * np.sqrt(self.world.acceleration_weights)
        accelerations = slope_by_steps(away, steps, self._stop)
        by_phase = accelerations.reshape(-1, self.phases.slices).sum(axis=1)
        time = self.weights.time * self.phases.phase_durations
        return np.asarray(self.weights.acceleration * by_phase + self.running_by_phase(x) + time)

    def linearise(self, x: Array, y_eq: Array, y_in: Array) -> Model:
        """Return the convex model at x, in cost units: Gauss-Newton cost, convexified curvature of the switches."""
        stop_if_time_is_up()
        q, z = self.split(x)
        values = self._values(x)
        eq_jac, in_jac = self.constraints.jacobians(values, q, z)
        gradient = np.concatenate(
            [self._acceleration_gradient(q - self.initial_configuration).ravel(), np.zeros(len(z))]
        )
        hessians = self.constraints.equality_hessians(values, q, z, y_eq)
        violation = float(np.abs(values.equality).max(initial=0.0))
        blocks = self._convexity.convexify(hessians, values.eq_blocks, violation)
        blocks += self.constraints.inequality_hessians(q, z, y_in)
        blocks += self.constraints.action_hessians(q, z, y_eq, y_in)
        if self.ergonomics is not None:
            _, score_gradient, score_hessians = self.ergonomics.quadratic_model(q, self.loads, self.stage)
            gradient[self._postures.ravel()] += (self.rates[:, None] * score_gradient).ravel()
            blocks += [self.rates[:, None, None] * hessian for hessian in score_hessians]
        if self.terms:
            _, slope, curvature = self.terms.quadratic_model(q)
            gradient[self._term_columns.ravel()] += (self.term_rates[:, None] * slope).ravel()
            blocks.append(self.term_rates[:, None, None] * curvature)
        return Model(self._hessian.fill(blocks), gradient, eq_jac, values.equality, in_jac, values.inequality)

    def _values(self, x: Array) -> Values:
        """Return all constraints at x; the last ones are stored, as each accepted point is evaluated twice."""
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = x.copy(), self.constraints.evaluate(*self.split(x))
        return self._last[1]

    def _acceleration_gradient(self, away: Array) -> Array:
        """Return the gradient (P, nq) of the acceleration cost at a path counted from the start."""
        gradient = np.empty_like(away)
        for columns, condensed in self.groups:
            gradient[:, columns] = 2.0 * condensed.cost @ away[:, columns]
        return gradient

    def _eliminate(self, stop: bool) -> None:
        """Group the joints by the switches at which they rest, and eliminate the slices between knots."""
        self._stop = stop
        horizon = int(self.knots[-1]) + 1
        steps = self.phases.steps[:horizon]
        # In cost units a phase of `Phases.seconds` lasts 1, and to move by 1 in it costs 1.
        if self.phases.durations:
            matrix = acceleration_quadratic_of(steps / self.phases.seconds, stop) / 12.0
        else:
            matrix = acceleration_quadratic(horizon, 1.0 / self.phases.slices, stop) / 12.0
        matrix *= self.weights.acceleration > 0.0
        groups: dict[tuple[float, tuple[tuple[int, int], ...]], list[int]] = {}
        weights = self.world.acceleration_weights
        for joint in range(self.world.nq):
            own = tuple(pair for pair, joints in self.constraints.equal_eliminated.items() if joint in joints)
            groups.setdefault((float(weights[joint]), own), []).append(joint)
        self.groups: list[tuple[Indices, CondensedQuadratic]] = [
            (np.array(joints, dtype=np.intp), eliminate_slices(weight * matrix, self.knots, pairs))
            for (weight, pairs), joints in groups.items()
        ]
        self._all_shares = steps / self.phases.tau
        self.rates = self.rate * self._all_shares[self.knots]
        self.term_rates = steps[self.knots] / self.cost_unit
        self._time = self.weights.time * float(steps.sum())
        self.score_elsewhere = 0.0
        if self.ergonomics is not None:
            # Loads are known in every slice, postures at knots only.
            carried = float(self.ergonomics.payload(self.phases.loads()[:horizon]) @ self._all_shares)
            elsewhere = self.rate * float(self._all_shares.sum()) - float(self.rates.sum())
            self.score_elsewhere = self.rate * carried + self.ergonomics.lower_bound * elsewhere

    def _set_patterns(self) -> None:
        """Set the sparsity pattern of the Hessian from the acceleration cost and the blocks of its curvature."""
        nq = self.world.nq
        rows, columns, values = [], [], []
        for joints, condensed in self.groups:
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
            self.groups, of_switches, self.constraints.curved_equalities(), (nq, self.modes.size)
        )
        if self.ergonomics is not None:
            self._postures = np.arange(len(self.knots))[:, None] * nq + self.ergonomics.columns
            blocks += [self._postures[:, part] for part in self.ergonomics.parts]
        if self.terms:
            self._term_columns = np.arange(len(self.knots))[:, None] * nq + self.terms.columns
            blocks.append(self._term_columns)
        constant = np.concatenate(rows), np.concatenate(columns), np.concatenate(values)
        self._hessian = UpperBlocks(constant, blocks, self.n)
