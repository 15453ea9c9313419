"""The KKT system of a QP of fixed sparsity pattern, factorised for any working set of rows and bounds.

    [ P + e   A'   G' ] [x]   [-q]
    [   A    -e       ] [y] = [ b]
    [   G         -e  ] [z]   [ h]

Fixed variables and inactive rows stay in the pattern: their off-diagonal entries are multiplied by zero and their
diagonal becomes one. One symbolic analysis (QDLDL, Stellato et al. 2020) then serves every working set, and a fixed
variable equals its bound exactly, unlike with a penalty on the diagonal. The small regularisation e makes the matrix
quasi-definite even with linearly dependent rows; iterative refinement removes its effect.
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
"""e of the rows: with a smaller one, rounding exceeds the curvature where a row is eliminated before its unknowns."""
REFINEMENTS = 12
"""Steps of iterative refinement at most; most solves end earlier, by their tolerance."""


class KKT:
    """Factorised KKT system of one QP pattern; `refactor` sets values and working set."""

    def __init__(self, qp: QP) -> None:
        self._hessian, self._equality, self._inequality = qp.P.copy(), qp.A.copy(), qp.G.copy()
        self.sizes = (qp.q.size, qp.b.size, qp.h.size)
        n, m_e, m_i = self.sizes
        p_nnz, a_nnz = qp.P.nnz, qp.A.nnz
        # Columns of the upper triangle: those of P, then the rows of A and G, each with its diagonal entry last.
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
        self._lower = self._matrix.T  # shares its values
        self._shifted = self._matrix.copy()
        self._shifted_lower = self._shifted.T
        self._values = np.zeros(indptr[-1])
        self._solver: Any = None
        self.shift = DUAL_SHIFTS[0]

    def fits(self, qp: QP) -> bool:
        """Whether a QP has the sparsity pattern of this system."""
        pairs = ((qp.P, self._hessian), (qp.A, self._equality), (qp.G, self._inequality))
        return all(same_pattern(one, other) for one, other in pairs)

    def load(self, qp: QP, scale: float) -> None:
        """Set the values of a QP, its cost times `scale`."""
        self._values[self._p] = scale * qp.P.data
        self._values[self._a], self._values[self._g] = qp.A.data, qp.G.data

    def refactor(self, free: Flags, rows: Flags) -> None:
        """Factorise for the `free` unknowns (n,) and the active inequality `rows` (m_i,).

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
            self._factorise(DUAL_SHIFTS[0])
        except RuntimeError:
            self._factorise(DUAL_SHIFTS[1])

    def _factorise(self, shift: float) -> None:
        """Factorise with regularisation `shift` of the rows."""
        self.shift = shift
        rows = self._diagonal[self.sizes[0] :]
        self._shifted.data[rows] = self._matrix.data[rows] - shift
        if self._solver is None:
            import qdldl

            self._solver = qdldl.Solver(self._shifted, upper=True)
        else:
            self._solver.update(self._shifted, upper=True)

    def solve(self, right: Array, guess: Array, tolerance: float) -> tuple[Array, float]:
        """Return the solution without regularisation and its largest residual, by iterative refinement from a guess.

        Refinement ends at `tolerance`, when the residual stops falling, or after `REFINEMENTS` steps.
        """
        best, best_error, point = guess, np.inf, guess
        for _ in range(REFINEMENTS + 1):
            error = right - self._times(self._matrix, self._lower, point)
            size = float(np.abs(error).max(initial=0.0))
            if not size < best_error:
                break
            stalled = size > 0.5 * best_error
            best, best_error = point, size
            if size <= tolerance or stalled:
                break
            point = point + self._solver.solve(error)
        return best, best_error

    def solve_shifted(self, right: Array) -> Array:
        """Return the solution with regularisation: linearly dependent rows have equal multipliers."""
        point = self._solver.solve(right)
        return np.asarray(point + self._solver.solve(right - self._times(self._shifted, self._shifted_lower, point)))

    def _times(self, upper: sp.csc_matrix, lower: sp.csr_matrix, point: Array) -> Array:
        """Return a symmetric matrix, given by its two triangles, times a vector."""
        return np.asarray(upper @ point + lower @ point - upper.data[self._diagonal] * point)
