"""A warm-started primal-dual active-set method (Hintermueller, Ito & Kunisch 2002) with a dual active-set fallback.

Each round solves the equality-constrained QP of the working set on the fixed-pattern `KKT`, then adds every violated
row and bound and drops every one whose multiplier has the wrong sign. That ends in a few rounds from a warm start close
to the active set, and may cycle otherwise. Where it no longer reduces the number of errors, `DualActiveSet` continues
from the best working set; where that takes long, an interior point back end solves the QP, and its solution is polished
on its active set so that the next QP starts warm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lgp.sqp.backends import Piqp
from lgp.sqp.dual_active_set import DualActiveSet
from lgp.sqp.kkt import KKT
from lgp.sqp.qp import QP, QPResult, QPStatus, cost_scale
from reba.arrays import Array, Flags

PRIMAL_TOLERANCE = 1e-9
DUAL_TOLERANCE = 1e-9
ROUNDS = 24
"""Working sets solved by block exchanges at most; from a warm start few are needed."""
DUAL_RUNS = 2
"""Runs of the dual method; the second corrects the rounding errors of the first."""
MAX_EXCHANGES = 40
"""Single exchanges of the dual method at most; beyond, the interior point method is faster."""
MAX_FIRST_ERRORS = 200
"""Errors of the first working set beyond which an interior point method is as fast."""
MAX_COLD_ERRORS = 20
"""The same without a warm start, whose first working set is a mere guess."""
MAX_STALLED_ROUNDS = 1
"""Consecutive block exchanges without fewer errors before they count as cycling."""
MAX_WRONG_SIGNS = 5
"""Multipliers of the wrong sign up to which the dual method drops them one by one, without a factorisation."""
ACTIVE_MULTIPLIER = 1e-7
"""Share of the largest multiplier below which a row of a warm start counts as inactive."""


@dataclass(frozen=True)
class WorkingSet:
    """Active inequality rows (m_i,) and the side of each unknown (n,): -1 at its lower bound, +1 upper, 0 free."""

    rows: Flags
    side: NDArray[np.int8]


@dataclass(frozen=True)
class _Candidate:
    """Solution of one working set, and its rows and sides with a violated row or a multiplier of the wrong sign."""

    x: Array
    y: Array
    z: Array
    z_box: Array
    rows_wrong: Flags
    side_next: NDArray[np.int8]
    side_wrong: Flags
    error: float

    @property
    def errors(self) -> int:
        return int(np.count_nonzero(self.rows_wrong)) + int(np.count_nonzero(self.side_wrong))


class ActiveSet:
    """Warm-started QPs of one pattern: the fastest back end where consecutive QPs share most of their active set.

    PIQP solves QPs whose active set is far from the warm start, and infeasible or unbounded ones.
    """

    name = "active_set"

    def __init__(self) -> None:
        self.fallback = Piqp()
        self._kkt: KKT | None = None
        self._factorised: WorkingSet | None = None

    def solve(self, qp: QP, warm: QPResult | None = None) -> QPResult:
        """Solve one QP; the nonzero multipliers of `warm` are the first working set."""
        if self._kkt is None or not self._kkt.fits(qp):
            self._kkt = KKT(qp)
        scale = cost_scale(qp)
        self._kkt.load(qp, scale)
        self._factorised = None
        active, guess = _initial_working_set(qp, warm, scale)
        best, least, stalled = (active, guess), np.inf, 0
        for count in range(1, ROUNDS + 1):
            point = self._solve_working_set(qp, scale, active, guess)
            if point is None or (count == 1 and point.errors > (MAX_COLD_ERRORS if warm is None else MAX_FIRST_ERRORS)):
                break
            if point.errors == 0:
                return _result(point, scale, count, self.name)
            guess = np.concatenate([point.x, point.y, point.z])
            if point.errors < least:
                best, least, stalled = (active, guess), point.errors, 0
            elif stalled == MAX_STALLED_ROUNDS:
                break
            else:
                stalled += 1
            active = _exchanged(active, point)
        if least < np.inf:
            point, more = self._run_dual(qp, scale, *best)
            count += more
            if point is not None:
                return _result(point, scale, count, self.name)
        return self._interior_point(qp, scale, count)

    def _run_dual(self, qp: QP, scale: float, active: WorkingSet, guess: Array) -> tuple[_Candidate | None, int]:
        """Return the solution by the dual active-set method, None where it fails, and the number of rounds."""
        count = 0
        for _ in range(DUAL_RUNS):
            active, point, more = self._drop_wrong_signs(qp, scale, active, guess)
            count += more
            if point is None or self._kkt is None:
                break
            if point.errors == 0:
                return point, count
            method = DualActiveSet(
                self._kkt, qp, scale, active.rows, active.side, (point.x, point.y, point.z, point.z_box)
            )
            self._factorised = None
            try:
                solved = method.run(MAX_EXCHANGES)
            except (RuntimeError, np.linalg.LinAlgError):
                break
            count += method.exchanged
            if not solved:
                break
            active, guess = WorkingSet(method.rows, method.side), method.point
            point = self._solve_working_set(qp, scale, active, guess)
            count += 1
            if point is not None and point.errors == 0:
                return point, count
        return None, count

    def _drop_wrong_signs(
        self, qp: QP, scale: float, active: WorkingSet, guess: Array
    ) -> tuple[WorkingSet, _Candidate | None, int]:
        """Return a working set with few multipliers of the wrong sign, its solution and the factorisations it took."""
        for count in range(1, ROUNDS + 1):
            point = self._solve_working_set(qp, scale, active, guess)
            if point is None:
                break
            rows, sides = point.rows_wrong & active.rows, point.side_wrong & (active.side != 0)
            if np.count_nonzero(rows) + np.count_nonzero(sides) <= MAX_WRONG_SIGNS:
                return active, point, count
            active = WorkingSet(active.rows & ~rows, np.where(sides, 0, active.side).astype(np.int8))
        return active, None, count

    def _solve_working_set(self, qp: QP, scale: float, active: WorkingSet, guess: Array) -> _Candidate | None:
        """Return the solution of a working set, None where its system is singular or its rows are inconsistent."""
        kkt = self._kkt
        if kkt is None:
            return None
        n, m_e, _ = kkt.sizes
        free = active.side == 0
        fixed = np.where(active.side < 0, qp.lb, qp.ub)
        fixed[free] = 0.0
        right = np.concatenate([-scale * (qp.q + qp.hessian_dot(fixed)), qp.b - qp.A @ fixed, qp.h - qp.G @ fixed])
        right[:n][~free] = fixed[~free]
        right[n + m_e :][~active.rows] = 0.0
        guess = guess.copy()
        guess[:n][~free] = fixed[~free]
        guess[n + m_e :][~active.rows] = 0.0
        tolerance = 1e-11 * (1.0 + float(np.abs(right).max(initial=0.0)))
        if active is not self._factorised:
            self._factorised = None
            try:
                kkt.refactor(free, active.rows)
            except RuntimeError:
                return None
            self._factorised = active
        solution, error = kkt.solve(right, guess, tolerance)
        if not error <= 1e4 * tolerance:
            return None
        return _check_optimality(qp, scale, active, solution, error)

    def _interior_point(self, qp: QP, scale: float, count: int) -> QPResult:
        """Return the solution by PIQP, polished on its active set."""
        result = self.fallback.solve(qp)
        result = replace(result, iterations=result.iterations + count, solver=f"{self.name}+{result.solver}")
        if result.status is not QPStatus.SOLVED:
            return result
        side = np.zeros(qp.q.size, dtype=np.int8)
        side[-result.z_box * scale > result.x - qp.lb] = -1
        side[result.z_box * scale > qp.ub - result.x] = 1
        rows = result.z * scale > qp.h - qp.G @ result.x
        guess = np.concatenate([result.x, scale * result.y, scale * result.z])
        point = self._solve_working_set(qp, scale, WorkingSet(rows, side), guess)
        if point is not None and point.errors == 0:
            return _result(point, scale, result.iterations, result.solver)
        return replace(result, z=np.where(rows, result.z, 0.0), z_box=np.where(side != 0, result.z_box, 0.0))


def _initial_working_set(qp: QP, warm: QPResult | None, scale: float) -> tuple[WorkingSet, Array]:
    """Return the first working set and the initial guess of unknowns and multipliers (n + m_e + m_i,)."""
    side = np.zeros(qp.q.size, dtype=np.int8)
    rows = np.zeros(qp.h.size, dtype=bool)
    guess = np.zeros(qp.q.size + qp.b.size + qp.h.size)
    if warm is not None:
        size = np.abs(warm.z_box).max(initial=0.0)
        side[(warm.z_box < -ACTIVE_MULTIPLIER * size) & np.isfinite(qp.lb)] = -1
        side[(warm.z_box > ACTIVE_MULTIPLIER * size) & np.isfinite(qp.ub)] = 1
        rows |= warm.z > ACTIVE_MULTIPLIER * warm.z.max(initial=0.0)
        guess = np.concatenate([warm.x, scale * warm.y, scale * warm.z])
    side[qp.lb == qp.ub] = -1
    return WorkingSet(rows, side), guess


def _check_optimality(qp: QP, scale: float, active: WorkingSet, solution: Array, error: float) -> _Candidate:
    """Return a solution (n + m_e + m_i,) with its violated rows and its multipliers of the wrong sign."""
    n, m_e = qp.q.size, qp.b.size
    x, y, z = solution[:n], solution[n : n + m_e], solution[n + m_e :]
    gradient = scale * (qp.hessian_dot(x) + qp.q) + qp.transpose_product(y, z)
    # A sign within the error of the linear system is rounding: exchanging by it would cycle.
    wrong_sign = max(DUAL_TOLERANCE * scale * max(1.0, float(np.abs(qp.q).max(initial=0.0))), 10.0 * error)
    below = (active.side == 0) & (x < qp.lb - PRIMAL_TOLERANCE * (1.0 + np.abs(x)))
    above = (active.side == 0) & (x > qp.ub + PRIMAL_TOLERANCE * (1.0 + np.abs(x)))
    z_box = np.where(active.side == 0, 0.0, -gradient)
    released = (z_box * active.side < -wrong_sign) & (qp.lb < qp.ub)
    side_next = np.where(released, 0, active.side).astype(np.int8)
    side_next[below], side_next[above] = -1, 1
    violated = qp.G @ x > qp.h + PRIMAL_TOLERANCE * (1.0 + np.abs(qp.h))
    rows_wrong = np.where(active.rows, z < -wrong_sign, violated)
    return _Candidate(x, y, z, z_box, rows_wrong, side_next, side_next != active.side, error)


def _exchanged(active: WorkingSet, point: _Candidate) -> WorkingSet:
    """Return the working set with every wrong row and bound exchanged."""
    return WorkingSet(active.rows ^ point.rows_wrong, point.side_next)


def _result(point: _Candidate, scale: float, iterations: int, solver: str) -> QPResult:
    return QPResult(
        status=QPStatus.SOLVED,
        x=point.x,
        y=point.y / scale,
        z=np.maximum(point.z, 0.0) / scale,
        z_box=point.z_box / scale,
        iterations=iterations,
        solver=solver,
    )
