"""QPs without what does not matter in them: inequality rows far from their limit, and zeros of the Hessian.

Leaving rows out relaxes a QP, so a solution of the rest that satisfies them is the solution of the whole, with
multipliers 0; where it violates some, these are added and the QP is solved again from there. Of the distances of a path
one in ten is active, and only these have curvature; a factorisation of the rest would take three times as long.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from lgp.sqp.qp import QP, QPResult, QPStatus
from reba.arrays import Array, Flags, Indices

FEW = 100
"""Rows up to which a QP is solved as it is."""
NEAR = 1e-3
"""[m, rad] Rows nearer to their limit than this are taken before they are violated."""
VIOLATED = 1e-9
"""Violation of a row that is left out, relative to its limit."""
ROUNDS = 12
"""Times rows are added before the whole QP is solved."""

Solve = Callable[[QP, QPResult | None], QPResult]
"""QP and a warm start -> solution, as a `lgp.sqp.qp.QPBackend` has it."""


class ReducedQP:
    """What mattered in QPs of one pattern so far.

    Example:
        >>> from lgp.sqp.active_set import ActiveSet
        >>> rows, free = sp.csr_matrix(np.vstack([np.eye(3)] * 50)), np.full(3, np.inf)
        >>> cost, limits, none = sp.csc_matrix(np.eye(3)), np.linspace(0.5, 1.0, 150), sp.csr_matrix((0, 3))
        >>> qp = QP(cost, -np.ones(3), none, np.zeros(0), rows, limits, -free, free)
        >>> ReducedQP().solve(qp, None, ActiveSet().solve).x.round(3).tolist()
        [0.5, 0.503, 0.507]
    """

    def __init__(self) -> None:
        self._source: tuple[int, ...] = ()
        self._rows: Flags = np.zeros(0, bool)
        self._nonzero: Flags = np.zeros(0, bool)
        self._hessian: tuple[Indices, Array, Array] = (np.zeros(0, np.intp), np.zeros(0), np.zeros(0))
        self._limits = self._hessian

    def solve(self, qp: QP, warm: QPResult | None, solve: Solve, *, whole: bool = True) -> QPResult:
        """Return the solution of a QP; the `whole` is solved where a part has none, but for inconsistent rows."""
        if qp.h.size <= FEW:
            return solve(qp, warm)
        self._start(qp, warm)
        iterations = 0
        for _ in range(ROUNDS):
            kept = np.flatnonzero(self._rows)
            result = solve(self._part(qp, kept), None if warm is None else replace(warm, z=warm.z[kept]))
            iterations += result.iterations
            if result.status is QPStatus.INFEASIBLE or (result.status is QPStatus.FAILED and not whole):
                return QPResult.unsolved(qp, result.status, iterations, result.solver)
            if result.status is not QPStatus.SOLVED:
                break
            z = np.zeros(qp.h.size)
            z[kept] = result.z
            warm = replace(result, z=z, iterations=iterations)
            excess = qp.G @ result.x - qp.h
            if not (~self._rows & (excess > VIOLATED * (1.0 + np.abs(qp.h)))).any():
                return warm
            self._keep_rows(qp, self._rows | (excess > -NEAR))
        return solve(qp, warm)

    def _start(self, qp: QP, warm: QPResult | None) -> None:
        """Keep what mattered in the last QP, and what does by now."""
        rows, nonzero = qp.h < NEAR, qp.P.data != 0.0
        nonzero[qp.P.indptr[1:] - 1] = True  # the diagonal is stored
        if warm is not None:
            rows |= warm.z > 0.0
        source = (*qp.G.shape, qp.G.nnz, qp.P.nnz)
        if source == self._source:
            rows |= self._rows
            nonzero |= self._nonzero
        if source != self._source or (rows != self._rows).any():
            self._keep_rows(qp, rows)
        if source != self._source or (nonzero != self._nonzero).any():
            self._nonzero = nonzero
            entries = np.flatnonzero(nonzero)
            ends = np.concatenate([[0], np.cumsum(nonzero)])[qp.P.indptr]
            self._hessian = entries, qp.P.indices[entries], ends.astype(qp.P.indptr.dtype)
        self._source = source

    def _keep_rows(self, qp: QP, rows: Flags) -> None:
        self._rows = rows
        counts = np.diff(qp.G.indptr)
        entries = np.flatnonzero(np.repeat(rows, counts))
        ends = np.concatenate([[0], np.cumsum(counts[rows])])
        self._limits = entries, qp.G.indices[entries], ends.astype(qp.G.indptr.dtype)

    def _part(self, qp: QP, kept: Indices) -> QP:
        """Return the QP without other rows and zeros."""
        (of_hessian, *hessian), (of_rows, *rows) = self._hessian, self._limits
        return replace(
            qp,
            P=sp.csc_matrix((qp.P.data[of_hessian], *hessian), shape=qp.P.shape),
            G=sp.csr_matrix((qp.G.data[of_rows], *rows), shape=(len(kept), qp.G.shape[1])),
            h=qp.h[kept],
        )
