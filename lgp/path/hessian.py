"""Convexification of the constraint curvature of switches, and the sparse blocks of Hessian and Jacobians.

Constraints of a switch have positive and negative curvature. Without the negative part the solver converges in many
small steps; with all of it the QP may have no minimum. It has one where the Hessian is positive definite on the null
space of the constraints, by Debreu's lemma where the Hessian plus a large penalty on the linearised constraints is
positive definite (Nocedal & Wright 2006, 16.1 and 17.4). That is tested on a small matrix: the acceleration cost
minimised over all other slices, plus the curvature, plus the penalty. Each direction of negative curvature gets a share
of its own, so that a large one does not reduce the others.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve

from lgp.path.costs import CondensedQuadratic
from reba.arrays import Array, Indices

MIN_CURVATURE_SHARE = 0.02
"""Share of the positive curvature that must remain along each direction."""
ROUNDS = 30
"""Iterations of the scaling of the shares of negative curvature; they change little after 30."""
PENALTY = 1e4
"""Penalty on the linearised constraints, relative to the largest entry of the cost."""
MAX_VIOLATION = 0.03
"""[m, rad] Violation beyond which no negative curvature is used: multipliers are then far from the solution's."""
MIN_CURVATURE = 1e-6
"""Smallest curvature of the convexified matrix, relative to the largest entry of the cost."""


class Convexity:
    """Convexification for one sequence.

    Args:
        groups: joints and the acceleration cost on the P knots, as in `PathProblem`.
        columns: unknowns of each part of the Hessian, of n.
        rows: unknowns of each block of constraints with curvature.
        sizes: number of joints, and of variables after the P configurations.
    """

    def __init__(
        self,
        groups: Sequence[tuple[Indices, CondensedQuadratic]],
        columns: Sequence[Indices],
        rows: Sequence[Indices],
        sizes: tuple[int, int],
    ) -> None:
        nq, nz = sizes
        tail = len(groups[0][1].cost) * nq
        every = np.concatenate([np.zeros(0, np.intp), *columns, *rows])
        joints, at = (np.unique(part) for part in (every[every < tail] % nq, every[every < tail] // nq))
        self._unknowns = np.concatenate([*(place * nq + joints for place in at), tail + np.arange(nz)]).astype(np.intp)
        count = len(at)
        matrix = np.zeros((count, len(joints), count, len(joints)))
        for members, condensed in groups:
            own = np.flatnonzero(np.isin(joints, members))
            matrix[:, own, :, own] = 2.0 * _restricted(condensed.cost, at)
        self._cost = np.zeros((len(self._unknowns),) * 2)
        size = count * len(joints)
        self._cost[:size, :size] = matrix.reshape(size, size)
        self._scale = float(self._cost.max(initial=1e-12))
        self._cost[range(len(self._cost)), range(len(self._cost))] -= MIN_CURVATURE * self._scale
        self._cost[range(size, len(self._cost)), range(size, len(self._cost))] += 2.0 * MIN_CURVATURE * self._scale
        order = np.argsort(self._unknowns)
        self._columns = [order[np.searchsorted(self._unknowns, part, sorter=order)] for part in columns]
        self._rows = [order[np.searchsorted(self._unknowns, part, sorter=order)] for part in rows]

    def convexify(self, hessians: Sequence[Array], jacobians: Sequence[Array], violation: float) -> list[Array]:
        """Return each part (m, m) with the admissible share of its negative curvature.

        Args:
            hessians: (m, m) of each part, by its `columns`.
            jacobians: (r, k) of each block of rows; more blocks may follow.
            violation: largest of a row [m, rad].
        """
        spectra = [np.linalg.eigh(hessian) for hessian in hessians]
        clipped = [(vectors * np.maximum(values, 0.0)) @ vectors.T for values, vectors in spectra]
        negative = [vectors[:, values < 0.0] * np.sqrt(-values[values < 0.0]) for values, vectors in spectra]
        if violation > MAX_VIOLATION or not sum(part.shape[1] for part in negative):
            return clipped
        matrix = self._cost.copy()
        for rows, jacobian in zip(self._rows, jacobians, strict=False):
            matrix[np.ix_(rows, rows)] += PENALTY * self._scale * jacobian.T @ jacobian
        ends = np.cumsum([0, *(part.shape[1] for part in negative)])
        factor = np.zeros((len(matrix), ends[-1]))
        for number, (columns, block, part) in enumerate(zip(self._columns, clipped, negative, strict=True)):
            matrix[np.ix_(columns, columns)] += block
            factor[columns, ends[number] : ends[number + 1]] = part
        try:
            shares = admissible_shares(factor.T @ cho_solve(cho_factor(matrix), factor))
        except np.linalg.LinAlgError:
            return clipped
        return [
            block - (part * shares[begin:end]) @ part.T
            for block, part, begin, end in zip(clipped, negative, ends, ends[1:], strict=False)
        ]


def admissible_shares(response: Array) -> Array:
    """Return shares (..., c) of rank-one parts that may be subtracted from a matrix M and leave it positive definite.

    M - sum_j share_j u_j u_j' is positive definite where S R S has no eigenvalue above 1, with S the roots of the
    shares and the response R = U' M^-1 U (..., c, c). No eigenvalue exceeds the largest absolute row sum (Gershgorin),
    so the roots are made as large as these sums allow (Sinkhorn & Knopp 1967).
    """
    sizes, roots = np.abs(response), np.ones(response.shape[:-1])
    # A part without a response is no part: its share does not matter.
    sizes += np.where(np.einsum("...ii->...i", sizes) > 0.0, 0.0, 1.0)[..., None] * np.eye(sizes.shape[-1])
    for _ in range(ROUNDS):
        sums = (sizes @ roots[..., None])[..., 0]
        roots = np.minimum(np.sqrt(roots * (1.0 - MIN_CURVATURE_SHARE) / sums), 1.0)
    sums = (sizes @ roots[..., None])[..., 0]
    excess = np.max(roots * sums, axis=-1, keepdims=True) / (1.0 - MIN_CURVATURE_SHARE)
    return np.asarray(roots**2 / np.maximum(excess, 1.0))


def _restricted(cost: Array, at: Indices) -> Array:
    """Return the quadratic on some of the knots, minimised over all others (Schur complement)."""
    others = np.setdiff1d(np.arange(len(cost)), at)
    left = cost[np.ix_(at, at)]
    if len(others):
        across = cost[np.ix_(others, at)]
        left = left - across.T @ np.linalg.solve(cost[np.ix_(others, others)], across)
    return left


class RowBlocks:
    """A sparse matrix (CSR) of dense blocks one below the other, each on its own of the `width` columns.

    A block is given by its number of rows and its columns in rising order.
    """

    def __init__(self, blocks: Sequence[tuple[int, Indices]], width: int) -> None:
        counts = [len(columns) for rows, columns in blocks for _ in range(rows)]
        indices = [np.tile(columns, rows) for rows, columns in blocks]
        indptr = np.concatenate([[0], np.cumsum(counts, dtype=np.intp)]).astype(np.int32)
        flat = np.concatenate([np.zeros(0, np.intp), *indices]).astype(np.int32)
        self.matrix = sp.csr_matrix((np.zeros(len(flat)), flat, indptr), shape=(len(counts), width))

    def fill(self, values: Sequence[Array]) -> sp.csr_matrix:
        """Return the matrix with the values of all blocks, in their order; the next call overwrites it."""
        if len(self.matrix.data):
            np.concatenate([block.ravel() for block in values], out=self.matrix.data)
        return self.matrix


class UpperBlocks:
    """The upper triangle of a sparse symmetric matrix (CSC): dense symmetric blocks plus a constant part.

    Args:
        constant: rows, columns and values of the constant part, upper triangle.
        blocks: columns in rising order of each symmetric block, (m,) or (n, m) for n blocks at once.
    """

    def __init__(self, constant: tuple[Indices, Indices, Array], blocks: Sequence[Indices], width: int) -> None:
        rows, columns, values = constant
        self._triangles = [np.triu_indices(block.shape[-1]) for block in blocks]
        keys = [columns * width + rows]
        for block, (i, j) in zip(blocks, self._triangles, strict=True):
            keys.append((block[..., j] * width + block[..., i]).ravel())
        every = np.unique(np.concatenate(keys))
        self._places = [np.searchsorted(every, key) for key in keys[1:]]
        self._constant = np.zeros(len(every))
        np.add.at(self._constant, np.searchsorted(every, keys[0]), values)
        indptr = np.searchsorted(every, np.arange(width + 1) * width).astype(np.int32)
        indices = (every % width).astype(np.int32)
        self.matrix = sp.csc_matrix((self._constant.copy(), indices, indptr), shape=(width, width))

    def fill(self, values: Sequence[Array]) -> sp.csc_matrix:
        """Return the constant part plus all blocks, (m, m) or (n, m, m) each; the next call overwrites it."""
        self.matrix.data[:] = self._constant
        for places, (i, j), block in zip(self._places, self._triangles, values, strict=True):
            self.matrix.data[places] += block[..., i, j].ravel()
        return self.matrix
