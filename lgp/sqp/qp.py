"""The one seam to quadratic programs: the record of a QP, of its solution, and the protocol of a back end."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from lgp.sqp.problem import Vector


class QPStatus(Enum):
    """How a QP ended."""

    SOLVED = "solved"
    INFEASIBLE = "no point meets the linearised constraints"
    UNBOUNDED = "the quadratic model falls without end"
    FAILED = "the back end gave up before its tolerance"


@dataclass(frozen=True)
class QP:
    """Minimise x'Px/2 + q'x with Ax = b, Gx <= h, lb <= x <= ub.

    P (n, n) holds the **upper triangle only**, with sorted indices and every diagonal entry stored, so the diagonal is
    the last entry of each column. A (m_e, n) and G (m_i, n) are in rows. Bounds may be infinite.
    """

    P: sp.csc_matrix
    q: Vector
    A: sp.csr_matrix
    b: Vector
    G: sp.csr_matrix
    h: Vector
    lb: Vector
    ub: Vector

    def hessian_dot(self, x: Vector) -> Vector:
        """Return P x (n,) with both triangles."""
        return self.P @ x + self._lower @ x - self.P.data[self.P.indptr[1:] - 1] * x

    def pull(self, y: Vector, z: Vector) -> Vector:
        """Return A'y + G'z (n,)."""
        pull = self._equality_columns @ y
        return pull + self._limit_columns @ z if z.size else pull

    @cached_property
    def _lower(self) -> sp.csr_matrix:
        return self.P.T

    @cached_property
    def _equality_columns(self) -> sp.csc_matrix:
        return self.A.T

    @cached_property
    def _limit_columns(self) -> sp.csc_matrix:
        return self.G.T

    def objective(self, x: Vector) -> float:
        """Return x'Px/2 + q'x."""
        return float(0.5 * x @ self.hessian_dot(x) + self.q @ x)


@dataclass(frozen=True)
class QPResult:
    """Solution of a QP; multipliers follow Px + q + A'y + G'z + z_box = 0 with z >= 0, z_box > 0 at upper bounds."""

    status: QPStatus
    x: Vector
    y: Vector
    z: Vector
    z_box: Vector
    iterations: int
    solver: str

    @staticmethod
    def nothing(qp: QP, status: QPStatus, iterations: int, solver: str) -> QPResult:
        """Return a result without a solution: zeros."""
        n, m_e, m_i = qp.q.size, qp.b.size, qp.h.size
        return QPResult(status, np.zeros(n), np.zeros(m_e), np.zeros(m_i), np.zeros(n), iterations, solver)


@dataclass(frozen=True)
class QPResiduals:
    """Errors of a claimed solution, from the data of the QP alone."""

    primal: float
    """Largest violation of a row or bound."""
    dual: float
    """Largest entry of Px + q + A'y + G'z + z_box, and of multipliers of the wrong sign."""
    gap: float
    """Largest product of a multiplier and the slack it should be zero with."""


class QPBackend(Protocol):
    """Solves QPs of one sparsity pattern, one after another; a new pattern is noticed and set up anew."""

    name: str

    def solve(self, qp: QP, warm: QPResult | None = None) -> QPResult:
        """Solve; `warm` is a solution of a QP near this one, used where the back end can."""


def residuals(qp: QP, found: QPResult) -> QPResiduals:
    """Recompute the errors of a solution; a back end's own claims are not used."""
    rows = qp.G @ found.x - qp.h
    low, high = qp.lb - found.x, found.x - qp.ub
    primal = np.concatenate([np.abs(qp.A @ found.x - qp.b), rows, low, high])
    slope = qp.hessian_dot(found.x) + qp.q + qp.pull(found.y, found.z) + found.z_box
    at_low, at_high = np.maximum(-found.z_box, 0.0), np.maximum(found.z_box, 0.0)
    products = [found.z * rows, _product(at_low, low), _product(at_high, high)]
    return QPResiduals(
        primal=_largest(np.maximum(primal, 0.0)),
        dual=max(_largest(np.abs(slope)), _largest(np.maximum(-found.z, 0.0))),
        gap=_largest(np.abs(np.concatenate(products))),
    )


def cost_scale(qp: QP) -> float:
    """Return 1 / max|P|; costs that grow as time step^-3 stop interior point solvers unless divided by their size."""
    largest = _largest(np.abs(qp.P.data))
    return 1.0 / largest if largest > 0.0 else 1.0


def same_pattern(one: sp.spmatrix, other: sp.spmatrix) -> bool:
    """Whether two compressed matrices of one format store the same entries."""
    return (
        one.shape == other.shape
        and np.array_equal(one.indptr, other.indptr)
        and (one.indices is other.indices or np.array_equal(one.indices, other.indices))
    )


def _product(multiplier: Vector, slack: Vector) -> Vector:
    # An infinite slack with a zero multiplier is no error; with any other multiplier it is one of infinite size.
    return np.where(multiplier > 0.0, multiplier * np.where(multiplier > 0.0, slack, 0.0), 0.0)


def _largest(values: NDArray[np.float64]) -> float:
    return float(values.max()) if values.size else 0.0
