"""A warm-started active-set method: whole blocks of rows and bounds are exchanged, at the end one at a time.

Each round solves the equality-constrained QP of the current active set on the fixed-pattern `KKT`, then adds every
violated row and bound and drops every one whose multiplier has the wrong sign (the primal-dual active set of
Hintermueller, Ito & Kunisch 2002). That ends in a few rounds where the set is nearly known, and may cycle otherwise.
Where it no longer reduces the number of errors, `DualActiveSet` goes on from the best set so far; where that takes long
the QP goes to an interior point back end, whose answer is polished on its active set so that the next QP starts warm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lgp.sqp.backends import Piqp
from lgp.sqp.dual_active_set import DualActiveSet
from lgp.sqp.kkt import KKT
from lgp.sqp.qp import QP, QPBackend, QPResult, QPStatus, cost_scale
from reba.arrays import Array, Flags

PRIMAL_TOLERANCE = 1e-9
DUAL_TOLERANCE = 1e-9
WALKS = 2
"""Walks from working set to working set; the second mends what rounding left of the first."""
MANY = 200
"""Errors of a first active set beyond which an interior point method is as fast as exchanging them."""
PATIENCE = 1
"""Block exchanges in a row that may be without progress."""
SHED = 5
"""Multipliers of the wrong sign up to which a walk lets go of them one by one, without another factorisation."""
KEPT = 1e-7
"""Share of the largest multiplier below which a row of a foreign solution counts as inactive."""


@dataclass(frozen=True)
class WorkingSet:
    """A working set: inequality rows (m_i,) and side of each unknown (n,): -1 at its lower bound, +1 upper, 0 free."""

    rows: Flags
    side: NDArray[np.int8]


@dataclass(frozen=True)
class _Point:
    """Solution of one working set, and which rows and sides contradict it."""

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
    """Warm-started QPs of one pattern; the fastest back end where consecutive QPs share most of their active set.

    Args:
        fallback: takes over QPs whose active set is far off, and infeasible or unbounded ones; PIQP by default.
        rounds: block exchanges at most.
        limit: single exchanges at most.
    """

    name = "active_set"

    def __init__(self, fallback: QPBackend | None = None, rounds: int = 24, limit: int = 40) -> None:
        self.fallback = Piqp() if fallback is None else fallback
        self.rounds, self.limit = rounds, limit
        self._kkt: KKT | None = None
        self._factorised: WorkingSet | None = None

    def solve(self, qp: QP, warm: QPResult | None = None) -> QPResult:
        """Solve; `warm` gives the first active set by its nonzero multipliers."""
        if self._kkt is None or not self._kkt.fits(qp):
            self._kkt = KKT(qp)
        scale = cost_scale(qp)
        self._kkt.load(qp, scale)
        self._factorised = None
        active, guess = _start(qp, warm, scale)
        best, least, patience = (active, guess), np.inf, PATIENCE
        for count in range(1, self.rounds + 1):
            point = self._try(qp, scale, active, guess)
            if point is None or (count == 1 and point.errors > MANY):
                break
            if point.errors == 0:
                return _result(point, scale, count, self.name)
            guess = np.concatenate([point.x, point.y, point.z])
            if point.errors < least:
                best, least, patience = (active, guess), point.errors, PATIENCE
            elif patience == 0:
                break
            else:
                patience -= 1
            active = _exchange(active, point)
        if least < np.inf:
            point, more = self._walk(qp, scale, *best)
            count += more
            if point is not None:
                return _result(point, scale, count, self.name)
        return self._fall_back(qp, scale, count)

    def _walk(self, qp: QP, scale: float, active: WorkingSet, guess: Array) -> tuple[_Point | None, int]:
        """Exchange one row or bound at a time; return the solution, if it was found, and the effort in rounds."""
        count = 0
        for _ in range(WALKS):
            active, point, more = self._lighten(qp, scale, active, guess)
            count += more
            if point is None or self._kkt is None:
                break
            if point.errors == 0:
                return point, count
            walk = DualActiveSet(
                self._kkt, qp, scale, active.rows, active.side, (point.x, point.y, point.z, point.z_box)
            )
            self._factorised = None
            try:
                arrived = walk.run(self.limit)
            except (RuntimeError, np.linalg.LinAlgError):
                break
            count += walk.exchanged
            if not arrived:
                break
            active, guess = WorkingSet(walk.rows, walk.side), walk.point
            point = self._try(qp, scale, active, guess)
            count += 1
            if point is not None and point.errors == 0:
                return point, count
        return None, count

    def _lighten(self, qp: QP, scale: float, active: WorkingSet, guess: Array) -> tuple[WorkingSet, _Point | None, int]:
        """Drop rows and bounds until few multipliers have the wrong sign; return also the factorisations."""
        for count in range(1, self.rounds + 1):
            point = self._try(qp, scale, active, guess)
            if point is None:
                break
            rows, sides = point.rows_wrong & active.rows, point.side_wrong & (active.side != 0)
            if np.count_nonzero(rows) + np.count_nonzero(sides) <= SHED:
                return active, point, count
            active = WorkingSet(active.rows & ~rows, np.where(sides, 0, active.side).astype(np.int8))
        return active, None, count

    def _try(self, qp: QP, scale: float, active: WorkingSet, guess: Array) -> _Point | None:
        """Solve one working set; None where its system is singular or its rows contradict each other."""
        kkt = self._kkt
        if kkt is None:
            return None
        n, m_e, _ = kkt.sizes
        free = active.side == 0
        held = np.where(active.side < 0, qp.lb, qp.ub)
        held[free] = 0.0
        right = np.concatenate([-scale * (qp.q + qp.hessian_dot(held)), qp.b - qp.A @ held, qp.h - qp.G @ held])
        right[:n][~free] = held[~free]
        right[n + m_e :][~active.rows] = 0.0
        guess = guess.copy()
        guess[:n][~free] = held[~free]
        guess[n + m_e :][~active.rows] = 0.0
        tolerance = 1e-11 * (1.0 + float(np.abs(right).max(initial=0.0)))
        if active is not self._factorised:
            self._factorised = None
            try:
                kkt.refactor(free, active.rows)
            except RuntimeError:
                return None
            self._factorised = active
        found, error = kkt.solve(right, guess, tolerance)
        if not error <= 1e4 * tolerance:
            return None
        return _judge(qp, scale, active, found, error)

    def _fall_back(self, qp: QP, scale: float, count: int) -> QPResult:
        """Solve by the fallback, then on the active set of its answer."""
        found = self.fallback.solve(qp)
        found = replace(found, iterations=found.iterations + count, solver=f"{self.name}+{found.solver}")
        if found.status is not QPStatus.SOLVED:
            return found
        side = np.zeros(qp.q.size, dtype=np.int8)
        side[-found.z_box * scale > found.x - qp.lb] = -1
        side[found.z_box * scale > qp.ub - found.x] = 1
        rows = found.z * scale > qp.h - qp.G @ found.x
        guess = np.concatenate([found.x, scale * found.y, scale * found.z])
        point = self._try(qp, scale, WorkingSet(rows, side), guess)
        if point is not None and point.errors == 0:
            return _result(point, scale, found.iterations, found.solver)
        return replace(found, z=np.where(rows, found.z, 0.0), z_box=np.where(side != 0, found.z_box, 0.0))


def _start(qp: QP, warm: QPResult | None, scale: float) -> tuple[WorkingSet, Array]:
    """Return the first working set and the first guess of unknowns and multipliers (n + m_e + m_i,)."""
    side = np.zeros(qp.q.size, dtype=np.int8)
    rows = np.zeros(qp.h.size, dtype=bool)
    guess = np.zeros(qp.q.size + qp.b.size + qp.h.size)
    if warm is not None:
        size = np.abs(warm.z_box).max(initial=0.0)
        side[(warm.z_box < -KEPT * size) & np.isfinite(qp.lb)] = -1
        side[(warm.z_box > KEPT * size) & np.isfinite(qp.ub)] = 1
        rows |= warm.z > KEPT * warm.z.max(initial=0.0)
        guess = np.concatenate([warm.x, scale * warm.y, scale * warm.z])
    side[qp.lb == qp.ub] = -1
    return WorkingSet(rows, side), guess


def _judge(qp: QP, scale: float, active: WorkingSet, found: Array, error: float) -> _Point:
    """Find the rows and bounds that contradict the solution of a working set."""
    n, m_e = qp.q.size, qp.b.size
    x, y, z = found[:n], found[n : n + m_e], found[n + m_e :]
    slope = scale * (qp.hessian_dot(x) + qp.q) + qp.pull(y, z)
    # A sign within the error of the linear system says nothing; trusting it would exchange rows for ever.
    wrong_sign = max(DUAL_TOLERANCE * scale * max(1.0, float(np.abs(qp.q).max(initial=0.0))), 10.0 * error)
    below = (active.side == 0) & (x < qp.lb - PRIMAL_TOLERANCE * (1.0 + np.abs(x)))
    above = (active.side == 0) & (x > qp.ub + PRIMAL_TOLERANCE * (1.0 + np.abs(x)))
    z_box = np.where(active.side == 0, 0.0, -slope)
    released = (z_box * active.side < -wrong_sign) & (qp.lb < qp.ub)
    side_next = np.where(released, 0, active.side).astype(np.int8)
    side_next[below], side_next[above] = -1, 1
    violated = qp.G @ x > qp.h + PRIMAL_TOLERANCE * (1.0 + np.abs(qp.h))
    rows_wrong = np.where(active.rows, z < -wrong_sign, violated)
    return _Point(x, y, z, z_box, rows_wrong, side_next, side_next != active.side, error)


def _exchange(active: WorkingSet, point: _Point) -> WorkingSet:
    """Correct every contradicting row and bound."""
    return WorkingSet(active.rows ^ point.rows_wrong, point.side_next)


def _result(point: _Point, scale: float, iterations: int, solver: str) -> QPResult:
    return QPResult(
        status=QPStatus.SOLVED,
        x=point.x,
        y=point.y / scale,
        z=np.maximum(point.z, 0.0) / scale,
        z_box=point.z_box / scale,
        iterations=iterations,
        solver=solver,
    )
