"""Elastic mode: a QP whose rows contradict each other, with slacks at a price (Gill, Murray & Saunders 2005).

    minimise  x'Px/2 + q'x + price * (sum s+ + sum s- + sum t)
    subject to  Ax - s+ + s- = b,  Gx - t <= h,  lb <= x <= ub,  s+, s-, t >= 0

Bounds stay hard. The slacks are the smallest violation that the linearised rows admit once the price is above the
multipliers.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from lgp.sqp.backend_piqp import Piqp
from lgp.sqp.qp import QP, QPBackend, QPResult, cost_scale, same_pattern


class Elastic:
    """Builds and solves elastic QPs of one pattern.

    Args:
        backend: solves the widened QP; the slacks have no curvature, which suits interior point methods.
    """

    def __init__(self, backend: QPBackend | None = None) -> None:
        self.backend = Piqp() if backend is None else backend
        self._of: QP | None = None
        self._wide: QP | None = None

    def solve(self, qp: QP, price: float) -> QPResult:
        """Return the elastic solution, cut to the unknowns of `qp`; its rows may be violated."""
        wide = self._widen(qp)
        n, slacks = qp.q.size, 2 * qp.b.size + qp.h.size
        wide.P.data[: qp.P.nnz] = qp.P.data
        # The unchanging -1 and +1 close each row, so the values of a row keep their places.
        wide.A.data[self._a] = qp.A.data
        wide.G.data[self._g] = qp.G.data
        price = max(price, 1e-8 / cost_scale(qp))
        filled = replace(
            wide,
            q=np.concatenate([qp.q, np.full(slacks, price)]),
            b=qp.b,
            h=qp.h,
            lb=np.concatenate([qp.lb, np.zeros(slacks)]),
            ub=np.concatenate([qp.ub, np.full(slacks, np.inf)]),
        )
        found = self.backend.solve(filled)
        return replace(found, x=found.x[:n], z_box=found.z_box[:n], solver=f"elastic {found.solver}")

    def _widen(self, qp: QP) -> QP:
        """Return the widened QP, its pattern made on first use."""
        if self._wide is not None and self._of is not None:
            old = self._of
            if all(same_pattern(*pair) for pair in ((old.P, qp.P), (old.A, qp.A), (old.G, qp.G))):
                return self._wide
        m_e, m_i = qp.b.size, qp.h.size
        self._of = replace(qp, P=qp.P.copy(), A=qp.A.copy(), G=qp.G.copy())
        n, slacks = qp.q.size, 2 * m_e + m_i
        diagonal = sp.csc_matrix((np.zeros(slacks), (np.arange(slacks), np.arange(slacks))), shape=(slacks, slacks))
        hessian = sp.block_diag([qp.P, diagonal], format="csc")
        eye, none = sp.eye_array(m_e, format="csr"), sp.csr_matrix((m_e, m_i))
        equality = sp.csr_matrix(sp.hstack([_labels(qp.A), -eye, eye, none], format="csr"))
        limit = sp.csr_matrix(
            sp.hstack([_labels(qp.G), sp.csr_matrix((m_i, 2 * m_e)), -sp.eye_array(m_i, format="csr")], format="csr")
        )
        self._a, self._g = np.flatnonzero(equality.data > 1.5), np.flatnonzero(limit.data > 1.5)
        self._wide = QP(
            P=sp.csc_matrix(hessian),
            q=np.zeros(n + slacks),
            A=equality,
            b=qp.b,
            G=limit,
            h=qp.h,
            lb=np.zeros(n + slacks),
            ub=np.zeros(n + slacks),
        )
        return self._wide


def _labels(matrix: sp.csr_matrix) -> sp.csr_matrix:
    """Return the pattern filled with twos, told apart from the -1 and +1 of the slacks."""
    return sp.csr_matrix((np.full(matrix.nnz, 2.0), matrix.indices, matrix.indptr), shape=matrix.shape)
