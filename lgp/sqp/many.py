"""Many small dense problems of one structure, solved at once: sequential quadratic programming on stacked arrays.

Every iteration linearises all problems that are still open, solves their QPs by a primal-dual active-set method
(Hintermueller, Ito & Kunisch 2002) with one batched factorisation a round, and backtracks on the l1 merit function.
There is no elastic mode and no second-order correction: problems that these need end with `converged` false. Meant for
many starts of one problem, the best of which `lgp.sqp.solver` solves to the last digit.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array, Flags

ROUNDS = 5
"""Working sets solved in an iteration at most; the next iteration goes on from the last."""
SHIFT = 1e-9
"""Regularisation of the rows, so that dependent ones do not make a system singular."""
SINGULAR_SHIFT = 1e-6
"""Regularisation of the rows where a system is singular all the same."""
ARMIJO = 1e-4
"""Share of the predicted decrease that a step must achieve (NW eq. 3.4)."""
RHO = 0.1
"""rho of NW eq. 18.36."""
TRIALS = 3
"""Step lengths tried, each a quarter of the last."""
SHORTER = 0.25
FIRST_DAMPING = 1e-2
"""Damping after a step of which no length is accepted, relative to the largest diagonal entry of the Hessian; ten times
as much after each further one."""
NEAR = 1e-2
"""Violation below which a cost is near that of the feasible point."""
LARGEST_NUMBER = 1e15
"""Steps and multipliers from which on a system was singular but for rounding."""
LARGEST_DAMPING = 1e3
"""Damping at which a problem is given up."""


@dataclass(frozen=True)
class ManyModels:
    """Convex models of B problems: Hessian (B, n, n), gradient (B, n); rows and Jacobians (B, m) and (B, m, n)."""

    hessian: Array
    gradient: Array
    eq: Array
    eq_jac: Array
    ineq: Array
    in_jac: Array


class ManyProblem(Protocol):
    """B problems that differ in start and bounds only; costs in cost units, see `lgp.sqp.problem.Problem`.

    An unknown with equal bounds is a parameter of its problem.
    """

    @property
    def lower(self) -> Array:
        """(n,) or (B, n) lower bounds."""

    @property
    def upper(self) -> Array:
        """(n,) or (B, n) upper bounds."""

    def evaluate(self, x: Array) -> tuple[Array, Array, Array]:
        """Return costs (B,), equalities (B, m_e) and inequalities (B, m_i) at x (B, n)."""

    def linearise(self, x: Array, y_eq: Array, y_in: Array) -> ManyModels:
        """Return the models at x (B, n); multipliers y_eq (B, m_e) and y_in (B, m_i) weight the curvature of rows."""


@dataclass(frozen=True)
class ManyResults:
    """Outcome of B solves: points (B, n), costs (B,), violations (B,), iterations (B,) and whether each converged."""

    x: Array
    cost: Array
    violation: Array
    iterations: Array
    converged: Flags


@dataclass
class _Step:
    """Steps (B, n) with multipliers, working sets and p'Hp."""

    step: Array
    y_eq: Array
    y_in: Array
    side: NDArray[np.int8]
    active: Flags
    settled: Flags
    """(B,) whether the working set is that of the solution."""


def solve_many(
    problem: ManyProblem,
    x0: Array,
    *,
    violation: float = 1e-4,
    decrease: float = 1e-4,
    iterations: int = 18,
    longest_step: float = 1.0,
    cost_ratio: float = 1.15,
) -> ManyResults:
    """Return the local minima from starts x0 (B, n).

    Args:
        violation: largest violation of a row of a converged problem.
        decrease: predicted decrease, relative to max(1, cost), at which a problem has converged.
        longest_step: largest change of an unknown in one iteration.
        cost_ratio: cost expected after the next step, relative to the best minimum so far, at which one is given up.
    """
    low, high = (np.broadcast_to(end, x0.shape) for end in (problem.lower, problem.upper))
    x = np.clip(x0, low, high)
    cost, eq, ineq = problem.evaluate(x)
    count, n = x.shape
    y_eq, y_in = np.zeros_like(eq), np.zeros_like(ineq)
    side, active = np.zeros((count, n), np.int8), np.zeros(ineq.shape, bool)
    penalty, taken = np.ones(count), np.zeros(count, int)
    converged, damping = np.zeros(count, bool), np.zeros(count)
    open_ = np.flatnonzero(np.isfinite(cost))
    for _ in range(iterations):
        if not len(open_):
            break
        model = problem.linearise(x[open_], y_eq[open_], y_in[open_])
        diagonal = np.einsum("bii->bi", model.hessian)
        diagonal += (damping[open_] * diagonal.max(axis=1, initial=0.0))[:, None]
        solved = _solve_qps(model, low[open_] - x[open_], high[open_] - x[open_], side[open_], active[open_])
        _drop_unusable(solved)
        y_eq[open_], y_in[open_] = solved.y_eq, solved.y_in
        side[open_], active[open_] = solved.side, solved.active
        step, slope, curvature = solved.step, *_slopes(model, solved.step)
        before = violation_sums(model.eq, model.ineq)
        after = violation_sums(
            model.eq + (model.eq_jac @ step[..., None])[..., 0], model.ineq + (model.in_jac @ step[..., None])[..., 0]
        )
        gain = before - after
        needed = (slope + 0.5 * curvature) / np.maximum((1.0 - RHO) * gain, 1e-10)
        raised = (gain > 1e-10) & (needed > penalty[open_])
        penalty[open_] = np.where(raised, 1.5 * needed, penalty[open_])
        mu = penalty[open_]
        predicted = -slope - 0.5 * curvature + mu * gain
        met = _largest(eq[open_], ineq[open_]) <= violation
        done = met & solved.settled & (predicted <= decrease * np.maximum(1.0, np.abs(cost[open_])))
        converged[open_[done]] = True
        left = np.flatnonzero(~done & (slope - mu * gain < 0.0))
        size = np.abs(step[left]).max(axis=1, initial=0.0)
        length = np.minimum(1.0, longest_step / np.maximum(size, 1e-300))
        merit, descent = cost[open_] + mu * before, slope - mu * gain
        moved, length_of = np.zeros(len(open_), bool), np.zeros(len(open_))
        for _ in range(TRIALS):
            if not len(left):
                break
            at = open_[left]
            point = np.clip(x[at] + length[:, None] * step[left], low[at], high[at])
            values = problem.evaluate(point)
            reached = values[0] + mu[left] * violation_sums(values[1], values[2])
            good = reached <= merit[left] + ARMIJO * length * descent[left] + 1e-12 * np.abs(merit[left])
            at = open_[left[good]]
            x[at], cost[at], eq[at], ineq[at] = point[good], *(value[good] for value in values)
            moved[left[good]], length_of[left[good]] = True, length[good]
            left, length = left[~good], length[~good] * SHORTER
        taken[open_] += 1
        full = moved & (length_of >= 1.0)
        damping[open_] = np.where(
            moved,
            np.where(full, 0.1, 1.0) * damping[open_] * (damping[open_] > 1e-4),
            np.maximum(10.0 * damping[open_], FIRST_DAMPING),
        )
        side[open_[~moved]], active[open_[~moved]] = 0, False
        best = np.min(cost[converged], initial=np.inf)
        far = (cost[open_] - np.maximum(predicted, 0.0) > cost_ratio * best) & (_largest(eq[open_], ineq[open_]) < NEAR)
        open_ = open_[~done & ~far & (damping[open_] <= LARGEST_DAMPING)]
    return ManyResults(x, cost, _largest(eq, ineq), taken, converged)


def _drop_unusable(solved: _Step) -> None:
    """Replace steps of nearly singular systems by none, so that they are damped: their numbers overflow."""
    parts = (solved.step, solved.y_eq, solved.y_in)
    usable = np.all([(np.abs(part) < LARGEST_NUMBER).all(axis=1) for part in parts], axis=0)
    for part in parts:
        part[~usable] = 0.0
    solved.settled[~usable] = False


def violation_sums(eq: Array, ineq: Array) -> Array:
    """Return the l1 violations (B,)."""
    return np.asarray(np.abs(eq).sum(axis=1) + np.maximum(ineq, 0.0).sum(axis=1))


def _largest(eq: Array, ineq: Array) -> Array:
    return np.maximum(np.abs(eq).max(axis=1, initial=0.0), ineq.max(axis=1, initial=0.0))


def _slopes(model: ManyModels, step: Array) -> tuple[Array, Array]:
    """Return g'p and p'Hp (B,)."""
    slope = np.einsum("bi,bi->b", model.gradient, step)
    return slope, np.einsum("bi,bi->b", step, (model.hessian @ step[..., None])[..., 0])


def _solve_qps(model: ManyModels, low: Array, high: Array, side: NDArray[np.int8], active: Flags) -> _Step:
    """Return the steps within low and high (B, n), from the working sets of the last iteration.

    Where the sets do not settle, the last step is moved inside its bounds.
    """
    count, n = model.gradient.shape
    m_e, m_i = model.eq.shape[1], model.ineq.shape[1]
    size = n + m_e + m_i
    result = _Step(
        np.zeros((count, n)),
        np.zeros((count, m_e)),
        np.zeros((count, m_i)),
        side.copy(),
        active.copy(),
        np.zeros(count, bool),
    )
    rows = np.concatenate([model.eq_jac, model.in_jac], axis=1)
    right_rows = -np.concatenate([model.eq, model.ineq], axis=1)
    scale = np.maximum(np.einsum("bii->bi", model.hessian).max(axis=1), 1e-12)
    tolerance = 1e-9 * np.maximum(scale, np.abs(model.gradient).max(axis=1, initial=0.0))[:, None]
    left = np.arange(count)
    for _ in range(ROUNDS):
        own, on = result.side[left], np.ones((len(left), size), bool)
        on[:, :n] = own == 0
        on[:, n + m_e :] = result.active[left]
        fixed = np.where(own < 0, low[left], np.where(own > 0, high[left], 0.0))
        hessian, jacobian = model.hessian[left], rows[left]
        matrix = np.zeros((len(left), size, size))
        matrix[:, :n, :n] = hessian
        matrix[:, n:, :n] = jacobian
        matrix[:, :n, n:] = np.swapaxes(jacobian, 1, 2)
        matrix *= on[:, :, None]
        matrix *= on[:, None, :]
        diagonal = np.einsum("bii->bi", matrix)
        diagonal += np.where(on, 0.0, 1.0)
        diagonal[:, :n] += np.where(on[:, :n], SHIFT * scale[left, None], 0.0)
        diagonal[:, n:] -= np.where(on[:, n:], SHIFT / scale[left, None], 0.0)
        moved = (hessian @ fixed[..., None])[..., 0]
        right = np.concatenate(
            [-model.gradient[left] - moved, right_rows[left] - (jacobian @ fixed[..., None])[..., 0]], axis=1
        )
        right = np.where(on, right, 0.0)
        right[:, :n] += fixed
        try:
            solution = np.linalg.solve(matrix, right[..., None])[..., 0]
        except np.linalg.LinAlgError:
            # One of them is singular to the last digit, e.g. rows without a free unknown.
            diagonal[:, n:] -= np.where(on[:, n:], SINGULAR_SHIFT / scale[left, None], 0.0)
            solution = np.linalg.solve(matrix, right[..., None])[..., 0]
        step, y, z = solution[:, :n], solution[:, n : n + m_e], solution[:, n + m_e :]
        gradient = model.gradient[left] + (hessian @ step[..., None])[..., 0]
        gradient += (np.swapaxes(jacobian, 1, 2) @ solution[:, n:, None])[..., 0]
        below = (own == 0) & (step < low[left] - 1e-9)
        above = (own == 0) & (step > high[left] + 1e-9)
        released = (-gradient * own < -tolerance[left]) & (low[left] < high[left])
        following = np.where(below, -1, np.where(above, 1, np.where(released, 0, own))).astype(np.int8)
        violated = (jacobian[:, m_e:] @ step[..., None])[..., 0] > right_rows[left, m_e:] + 1e-9
        kept = np.where(result.active[left], z >= -tolerance[left], violated)
        result.step[left] = np.clip(step, low[left], high[left])
        result.y_eq[left], result.y_in[left] = y, np.maximum(np.where(result.active[left], z, 0.0), 0.0)
        changed = (following != own).any(axis=1) | (kept != result.active[left]).any(axis=1)
        result.side[left], result.active[left], result.settled[left] = following, kept, ~changed
        left = left[changed]
        if not len(left):
            break
    return result
