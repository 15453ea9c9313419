"""Quadratic programs: the record of a QP and of its solution, the back-end protocol, and fixed sparsity patterns."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from functools import cached_property
from typing import Final, Protocol

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from lgp.sqp.problem import Model, ProblemError
from reba.arrays import Array, Flags

HOLDS: Final = 1e-6
"""[m, rad] Value of a row that no unknown moves up to which it holds: the angles of a robot file are rounded."""
STILL: Final = 1e-12
"""Derivatives that are rounding errors."""


class QPStatus(Enum):
    """How a QP ended."""

    SOLVED = "solved"
    INFEASIBLE = "no point satisfies the linearised constraints"
    UNBOUNDED = "the quadratic model has no lower bound"
    FAILED = "the back end ended before its tolerance"


@dataclass(frozen=True)
class QP:
    """Minimise x'Px/2 + q'x with Ax = b, Gx <= h, lb <= x <= ub.

    P (n, n) holds the **upper triangle only**, with sorted indices and every diagonal entry stored, so the diagonal is
    the last entry of each column. A (m_e, n) and G (m_i, n) are in rows. Bounds may be infinite.
    """

    P: sp.csc_matrix
    q: Array
    A: sp.csr_matrix
    b: Array
    G: sp.csr_matrix
    h: Array
    lb: Array
    ub: Array

    def hessian_dot(self, x: Array) -> Array:
        """Return P x (n,) with both triangles."""
        return self.P @ x + self._lower @ x - self.P.data[self.P.indptr[1:] - 1] * x

    def transpose_product(self, y: Array, z: Array) -> Array:
        """Return A'y + G'z (n,)."""
        product = self._equality_columns @ y
        return product + self._inequality_columns @ z if z.size else product

    @cached_property
    def _lower(self) -> sp.csr_matrix:
        return self.P.T

    @cached_property
    def _equality_columns(self) -> sp.csc_matrix:
        return self.A.T

    @cached_property
    def _inequality_columns(self) -> sp.csc_matrix:
        return self.G.T

    def objective(self, x: Array) -> float:
        """Return x'Px/2 + q'x."""
        return float(0.5 * x @ self.hessian_dot(x) + self.q @ x)


def limits_of(equality: Array, inequality: Array, equal: sp.csr_matrix, below: sp.csr_matrix) -> tuple[Array, Array]:
    """Return b and h of linearised rows from their values (m_e,), (m_i,) and Jacobians, constants that hold left free.

    A row that no unknown moves holds or does not, whatever the step: taken to the last digit, a rounding error of it
    would make all rows inconsistent, and one that is just met would leave an interior point method no interior.

    Example:
        >>> rows = sp.csr_matrix([[1.0, 0.0], [0.0, 1e-17], [0.0, 0.0]])
        >>> b, h = limits_of(np.array([1e-3, 4e-9, 1e-3]), np.array([-1e-3, -4e-9, 1e-3]), rows, rows)
        >>> b.tolist(), h.tolist()
        ([-0.001, 0.0, -0.001], [0.001, 1.0, -0.001])
    """
    b = np.where(_still(equal) & (np.abs(equality) <= HOLDS), 0.0, -equality)
    return b, np.where(_still(below) & (inequality <= HOLDS), 1.0, -inequality)


def _still(rows: sp.csr_matrix) -> Flags:
    """Return which rows (m,) no unknown moves."""
    of_row = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
    return np.bincount(of_row, weights=np.abs(rows.data), minlength=rows.shape[0]) < STILL


@dataclass(frozen=True)
class QPResult:
    """Solution of a QP; multipliers follow Px + q + A'y + G'z + z_box = 0 with z >= 0, z_box > 0 at upper bounds."""

    status: QPStatus
    x: Array
    y: Array
    z: Array
    z_box: Array
    iterations: int
    solver: str

    @staticmethod
    def unsolved(qp: QP, status: QPStatus, iterations: int, solver: str) -> QPResult:
        """Return the result of a QP without a solution: zeros."""
        n, m_e, m_i = qp.q.size, qp.b.size, qp.h.size
        return QPResult(status, np.zeros(n), np.zeros(m_e), np.zeros(m_i), np.zeros(n), iterations, solver)


@dataclass(frozen=True)
class QPResiduals:
    """Errors of a solution, recomputed from the data of the QP."""

    primal: float
    """Largest violation of a row or bound."""
    dual: float
    """Largest entry of Px + q + A'y + G'z + z_box, and of multipliers of the wrong sign."""
    gap: float
    """Largest product of a multiplier and its slack (complementarity)."""


class QPBackend(Protocol):
    """Solves QPs of one sparsity pattern, one after another; a new pattern is analysed again."""

    name: str

    def solve(self, qp: QP, warm: QPResult | None = None) -> QPResult:
        """Solve one QP; `warm` is the solution of a similar one, used by back ends with warm starts."""


def residuals(qp: QP, result: QPResult) -> QPResiduals:
    """Recompute the errors of a solution; the residuals a back end reports are not used."""
    rows = qp.G @ result.x - qp.h
    low, high = qp.lb - result.x, result.x - qp.ub
    primal = np.concatenate([np.abs(qp.A @ result.x - qp.b), rows, low, high])
    gradient = qp.hessian_dot(result.x) + qp.q + qp.transpose_product(result.y, result.z) + result.z_box
    at_low, at_high = np.maximum(-result.z_box, 0.0), np.maximum(result.z_box, 0.0)
    products = [result.z * rows, _product(at_low, low), _product(at_high, high)]
    return QPResiduals(
        primal=_largest(np.maximum(primal, 0.0)),
        dual=max(_largest(np.abs(gradient)), _largest(np.maximum(-result.z, 0.0))),
        gap=_largest(np.abs(np.concatenate(products))),
    )


def cost_scale(qp: QP) -> float:
    """Return 1 / max|P|: costs that grow as time step^-3 need scaling before an interior point solver converges."""
    largest = _largest(np.abs(qp.P.data))
    return 1.0 / largest if largest > 0.0 else 1.0


def same_pattern(one: sp.spmatrix, other: sp.spmatrix) -> bool:
    """Whether two compressed matrices of one format have the same sparsity pattern."""
    return (
        one.shape == other.shape
        and np.array_equal(one.indptr, other.indptr)
        and (one.indices is other.indices or np.array_equal(one.indices, other.indices))
    )


def _product(multiplier: Array, slack: Array) -> Array:
    # An infinite slack with a zero multiplier is complementary; with any other multiplier the error is infinite.
    return np.where(multiplier > 0.0, multiplier * np.where(multiplier > 0.0, slack, 0.0), 0.0)


def _largest(values: Array) -> float:
    return float(values.max()) if values.size else 0.0


class UpperTriangle:
    """Upper triangle with a stored diagonal of symmetric matrices (full or upper) of one sparsity pattern."""

    def __init__(self, source: sp.csc_matrix) -> None:
        self._indptr, self._indices = source.indptr.copy(), source.indices.copy()
        n = source.shape[1]
        columns = np.repeat(np.arange(n), np.diff(source.indptr))
        keep = np.flatnonzero(source.indices <= columns)
        if keep.size < columns.size and keep.size == np.count_nonzero(source.indices == columns):
            raise ProblemError(
                "hessian: only its lower triangle is stored; expected the full matrix or the upper triangle"
            )
        missing = np.setdiff1d(np.arange(n), source.indices[source.indices == columns])
        rows = np.concatenate([source.indices[keep], missing])
        # Labels of the source entries are sorted with them; label 0 marks a diagonal entry that the source lacks.
        labels = np.concatenate([keep + 1.0, np.zeros(missing.size)])
        order = np.lexsort((rows, np.concatenate([columns[keep], missing])))
        counts = np.bincount(np.concatenate([columns[keep], missing]), minlength=n)
        indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        self._source_entries = labels[order].astype(np.int64) - 1
        self.matrix = sp.csc_matrix((np.zeros(order.size), rows[order].astype(np.int32), indptr), shape=(n, n))
        self.diagonal: NDArray[np.int64] = indptr[1:].astype(np.int64) - 1

    def fits(self, source: sp.csc_matrix) -> bool:
        """Whether a matrix has the sparsity pattern of this triangle."""
        return np.array_equal(source.indptr, self._indptr) and np.array_equal(source.indices, self._indices)

    def update(self, source: sp.csc_matrix, damping: float = 0.0) -> sp.csc_matrix:
        """Return the triangle of a matrix plus `damping` on the diagonal; the next update overwrites it."""
        self.matrix.data[:] = np.where(self._source_entries < 0, 0.0, source.data[self._source_entries])
        self.matrix.data[self.diagonal] += damping
        return self.matrix


class ColumnOrder:
    """Conversion of CSR matrices of one sparsity pattern to CSC; the order of the entries is computed once."""

    def __init__(self, source: sp.csr_matrix) -> None:
        labels = sp.csr_matrix((np.arange(source.nnz, dtype=float), source.indices, source.indptr), shape=source.shape)
        self.matrix = labels.tocsc()
        self._source = source.copy()
        self._source_entries = self.matrix.data.astype(np.int64)

    def fits(self, source: sp.csr_matrix) -> bool:
        """Whether a matrix has the sparsity pattern of this order."""
        return same_pattern(source, self._source)

    def update(self, source: sp.csr_matrix) -> sp.csc_matrix:
        """Return the matrix in CSC; the next update overwrites it."""
        np.take(source.data, self._source_entries, out=self.matrix.data)
        return self.matrix


def check_model(model: Model, n: int, m_e: int, m_i: int) -> None:
    """Refuse a model whose shapes do not fit the unknowns and rows of `evaluate` (ProblemError)."""
    expected = {
        "hessian": (n, n),
        "gradient": (n,),
        "eq_jac": (m_e, n),
        "eq": (m_e,),
        "in_jac": (m_i, n),
        "ineq": (m_i,),
    }
    for name, shape in expected.items():
        given = getattr(model, name).shape
        if given != shape:
            raise ProblemError(f"model {name}: shape {given} given, expected {shape}")
    for name, form in (("hessian", "csc"), ("eq_jac", "csr"), ("in_jac", "csr")):
        given = getattr(getattr(model, name), "format", "dense")
        if given != form:
            raise ProblemError(f"model {name}: a {given} matrix given, expected {form}")


def check_vector(name: str, vector: Array, size: int) -> None:
    """Refuse a vector of the wrong length or with values that are not numbers (ProblemError)."""
    if vector.shape != (size,):
        raise ProblemError(f"{name}: shape {vector.shape} given, expected ({size},)")
    if np.isnan(vector).any():
        entry = int(np.flatnonzero(np.isnan(vector))[0])
        raise ProblemError(f"{name}: entry {entry} is not a number; expected finite values")
