"""Fixed sparsity patterns: analysed once, then only `.data` moves."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from lgp.sqp.problem import Model, ProblemError, Vector
from lgp.sqp.qp import same_pattern


class UpperTriangle:
    """Copies a symmetric matrix of fixed pattern (full or upper) into an upper triangle with a stored diagonal."""

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
        # Labels of the source entries travel through the sort; label 0 marks a diagonal entry that the source lacks.
        labels = np.concatenate([keep + 1.0, np.zeros(missing.size)])
        order = np.lexsort((rows, np.concatenate([columns[keep], missing])))
        counts = np.bincount(np.concatenate([columns[keep], missing]), minlength=n)
        indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        self._from = labels[order].astype(np.int64) - 1
        self.matrix = sp.csc_matrix((np.zeros(order.size), rows[order].astype(np.int32), indptr), shape=(n, n))
        self.diagonal: NDArray[np.int64] = indptr[1:].astype(np.int64) - 1

    def fits(self, source: sp.csc_matrix) -> bool:
        """Whether a matrix has the pattern this triangle was made for."""
        return np.array_equal(source.indptr, self._indptr) and np.array_equal(source.indices, self._indices)

    def update(self, source: sp.csc_matrix, damping: float = 0.0) -> sp.csc_matrix:
        """Copy the values, add `damping` to the diagonal; the returned matrix is reused by the next update."""
        self.matrix.data[:] = np.where(self._from < 0, 0.0, source.data[self._from])
        self.matrix.data[self.diagonal] += damping
        return self.matrix


class ColumnOrder:
    """Copies a matrix stored in rows into one stored in columns; the order of its entries is worked out once."""

    def __init__(self, source: sp.csr_matrix) -> None:
        labels = sp.csr_matrix((np.arange(source.nnz, dtype=float), source.indices, source.indptr), shape=source.shape)
        self.matrix = labels.tocsc()
        self._source = source.copy()
        self._from = self.matrix.data.astype(np.int64)

    def fits(self, source: sp.csr_matrix) -> bool:
        """Whether a matrix has the pattern this order was made for."""
        return same_pattern(source, self._source)

    def update(self, source: sp.csr_matrix) -> sp.csc_matrix:
        """Copy the values; the returned matrix is reused by the next update."""
        np.take(source.data, self._from, out=self.matrix.data)
        return self.matrix


def check_model(model: Model, n: int, m_e: int, m_i: int) -> None:
    """Refuse a model whose parts do not fit the unknowns and rows that `evaluate` gave.

    Raises:
        ProblemError: naming the part, its shape and the shape expected.
    """
    wanted = {"hessian": (n, n), "gradient": (n,), "eq_jac": (m_e, n), "eq": (m_e,), "in_jac": (m_i, n), "ineq": (m_i,)}
    for name, shape in wanted.items():
        found = getattr(model, name).shape
        if found != shape:
            raise ProblemError(f"model {name}: shape {found} given, {shape} expected")
    for name, form in (("hessian", "csc"), ("eq_jac", "csr"), ("in_jac", "csr")):
        found = getattr(getattr(model, name), "format", "dense")
        if found != form:
            raise ProblemError(f"model {name}: a {found} matrix given, {form} expected")


def check_vector(name: str, given: Vector, size: int) -> None:
    """Refuse a vector of the wrong length or with values that are not numbers.

    Raises:
        ProblemError: naming the vector, what it is and what was expected.
    """
    if given.shape != (size,):
        raise ProblemError(f"{name}: shape {given.shape} given, ({size},) expected")
    if np.isnan(given).any():
        raise ProblemError(f"{name}: entry {int(np.flatnonzero(np.isnan(given))[0])} is not a number")
