"""The optimality system of a QP on a fixed pattern, for any set of active rows and bounds.

    [ P + e   A'   G' ] [x]   [-q]
    [   A    -e       ] [y] = [ b]
    [   G         -e  ] [z]   [ h]

A variable held at a bound and a row that is not active stay in the pattern: their couplings are multiplied by zero
and their diagonal becomes one. One symbolic analysis (QDLDL, Stellato et al. 2020) then serves every active set, and a
held variable sits on its bound exactly, which a penalty on the diagonal does not achieve. The small e makes the matrix
quasi-definite even where rows depend on each other; iterative refinement removes its effect.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp

from lgp.sqp.qp import QP, same_pattern
from reba.arrays import Array, Flags

PRIMAL_SHIFT = 1e-12
"""e of the unknowns: below the smallest curvature of smooth paths, about (pi / slices)^4 of the largest."""
DUAL_SHIFTS = (1e-7, 1e-5)
"""e of the rows: where a row is eliminated before its unknowns, a smaller one drowns their curvature in rounding."""


class KKT:
    """Factorised optimality system of one QP pattern; `refactor` changes values and active set."""

    def __init__(self, qp: QP) -> None:
        self._hessian, self._equality, self._limit = qp.P.copy(), qp.A.copy(), qp.G.copy()
        self.sizes = (qp.q.size, qp.b.size, qp.h.size)
        n, m_e, m_i = self.sizes
        p_nnz, a_nnz = qp.P.nnz, qp.A.nnz
        # A row of A is a column of its transpose: the columns of the upper triangle are P's, then rows of A and G,
        # each closed by its diagonal entry.
        counts = np.concatenate([np.diff(qp.P.indptr), np.diff(qp.A.indptr) + 1, np.diff(qp.G.indptr) + 1])
        indptr = np.concatenate([[0], np.cumsum(counts)])
        self._diagonal = indptr[1:] - 1
        entries = np.setdiff1d(np.arange(indptr[-1]), self._diagonal[n:], assume_unique=True)
        self._p, self._a, self._g = entries[:p_nnz], entries[p_nnz : p_nnz + a_nnz], entries[p_nnz + a_nnz :]
        indices = np.empty(indptr[-1], dtype=np.int32)
        indices[self._p], indices[self._a], indices[self._g] = qp.P.indices, qp.A.indices, qp.G.indices
        indices[self._diagonal[n:]] = n + np.arange(m_e + m_i)
        self._columns = np.repeat(np.arange(n + m_e + m_i), counts)
        size = n + m_e + m_i
        self._matrix = sp.csc_matrix((np.zeros(indptr[-1]), indices, indptr.astype(np.int32)), shape=(size, size))
        self._mirror = self._matrix.T  # of the same values
        self._shifted = self._matrix.copy()
        self._shifted_mirror = self._shifted.T
        self._values = np.zeros(indptr[-1])
        self._solver: Any = None
        self.shift = DUAL_SHIFTS[0]

    def fits(self, qp: QP) -> bool:
        """Whether a QP has the pattern of this system."""
        pairs = ((qp.P, self._hessian), (qp.A, self._equality), (qp.G, self._limit))
        return all(same_pattern(one, other) for one, other in pairs)

    def load(self, qp: QP, scale: float) -> None:
        """Take over the values of a QP, its cost times `scale`."""
        self._values[self._p] = scale * qp.P.data
        self._values[self._a], self._values[self._g] = qp.A.data, qp.G.data

    def refactor(self, free: Flags, rows: Flags) -> None:
        """Factorise for the unknowns that are `free` (n,) and the inequality `rows` (m_i,) that are active.

        Raises:
            RuntimeError: the matrix cannot be factorised, e.g. a Hessian with a negative eigenvalue.
        """
        n, m_e, _ = self.sizes
        on = np.concatenate([free, np.ones(m_e, dtype=bool), rows]).astype(float)
        data = self._matrix.data
        np.multiply(self._values, on[self._matrix.indices], out=data)
        data *= on[self._columns]
        data[self._diagonal[:n]] += 1.0 - on[:n]
        data[self._diagonal[n:]] = on[n:] - 1.0
        self._shifted.data[:] = data
        self._shifted.data[self._diagonal[:n]] += PRIMAL_SHIFT
        try:
            self._factor(DUAL_SHIFTS[0])
        except RuntimeError:
            self._factor(DUAL_SHIFTS[1])

    def _factor(self, shift: float) -> None:
        """Factorise with a shift of the rows."""
        self.shift = shift
        rows = self._diagonal[self.sizes[0] :]
        self._shifted.data[rows] = self._matrix.data[rows] - shift
        if self._solver is None:
            import qdldl

            self._solver = qdldl.Solver(self._shifted, upper=True)
        else:
            self._solver.update(self._shifted, upper=True)

    def solve(self, right: Array, guess: Array, tolerance: float, rounds: int = 12) -> tuple[Array, float]:
        """Solve the system without the shift by iterative refinement from a guess (size,).

        Returns the solution and its largest residual; refinement ends at `tolerance`, when it stops helping, or after
        `rounds`.
        """
        best, best_error, point = guess, np.inf, guess
        for _ in range(rounds + 1):
            error = right - self._times(self._matrix, self._mirror, point)
            size = float(np.abs(error).max(initial=0.0))
            if not size < best_error:
                break
            stalled = size > 0.5 * best_error
            best, best_error = point, size
            if size <= tolerance or stalled:
                break
            point = point + self._solver.solve(error)
        return best, best_error

    def respond(self, right: Array) -> Array:
        """Solve the system with the shift, as factorised: rows that depend on each other share their load evenly."""
        point = self._solver.solve(right)
        return np.asarray(point + self._solver.solve(right - self._times(self._shifted, self._shifted_mirror, point)))

    def _times(self, upper: sp.csc_matrix, mirror: sp.csr_matrix, point: Array) -> Array:
        """Return a symmetric matrix, given by its upper triangle and the mirror of that, times a vector."""
        return np.asarray(upper @ point + mirror @ point - upper.data[self._diagonal] * point)
