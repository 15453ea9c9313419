"""How much of the negative curvature of the switches a model may keep and still have one minimum.

The rows of a switch bend both ways. Without what bends downwards a solver creeps to its solution in many small steps;
with all of it a step far from the solution may have no minimum. Whether it has one depends on the accelerations and on
the rows alone, so a small matrix tells: the least cost through the configurations at the switches, plus the curvature,
plus a high price on leaving the linearised rows (Debreu's lemma). Each direction in which a switch bends downwards
keeps a share of its own: one that bends too much takes nothing from the others.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.linalg import cho_factor, cho_solve

from lgp.path.costs import CondensedQuadratic
from reba.arrays import Array, Indices

SPARE = 0.02
"""Share of the curvature of everything else that must be left along each direction."""
ROUNDS = 30
"""Of evening out the shares of negative curvature."""
PRICE = 1e4
"""Of leaving the rows, relative to the largest entry of the cost."""
NEAR = 0.03
"""[m, rad] Violation of a row beyond which nothing is kept: multipliers then say little about the solution."""
SURE = 1e-6
"""Smallest curvature asked for, relative to the same."""


class Convexity:
    """The test for one sequence.

    Args:
        groups: joints and the quadratic on the P kept slices, as in `PathProblem`.
        columns: unknowns of each part that bends, of n.
        rows: unknowns of each block of rows that bend.
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
            matrix[:, own, :, own] = 2.0 * _onto(condensed.cost, at)
        self._cost = np.zeros((len(self._unknowns),) * 2)
        size = count * len(joints)
        self._cost[:size, :size] = matrix.reshape(size, size)
        self._scale = float(self._cost.max(initial=1e-12))
        self._cost[range(len(self._cost)), range(len(self._cost))] -= SURE * self._scale
        self._cost[range(size, len(self._cost)), range(size, len(self._cost))] += 2.0 * SURE * self._scale
        order = np.argsort(self._unknowns)
        self._columns = [order[np.searchsorted(self._unknowns, part, sorter=order)] for part in columns]
        self._rows = [order[np.searchsorted(self._unknowns, part, sorter=order)] for part in rows]

    def convexify(self, bends: Sequence[Array], jacobians: Sequence[Array], violation: float) -> list[Array]:
        """Return the curvature (m, m) of each part with as much of its negative part as the test allows.

        Args:
            bends: (m, m) of each part, by its `columns`.
            jacobians: (r, k) of each block of rows; more blocks may follow.
            violation: largest of a row.
        """
        split = [np.linalg.eigh(bend) for bend in bends]
        clipped = [(vectors * np.maximum(values, 0.0)) @ vectors.T for values, vectors in split]
        falling = [vectors[:, values < 0.0] * np.sqrt(-values[values < 0.0]) for values, vectors in split]
        if violation > NEAR or not sum(part.shape[1] for part in falling):
            return clipped
        matrix = self._cost.copy()
        for rows, jacobian in zip(self._rows, jacobians, strict=False):
            matrix[np.ix_(rows, rows)] += PRICE * self._scale * jacobian.T @ jacobian
        ends = np.cumsum([0, *(part.shape[1] for part in falling)])
        spread = np.zeros((len(matrix), ends[-1]))
        for number, (columns, block, part) in enumerate(zip(self._columns, clipped, falling, strict=True)):
            matrix[np.ix_(columns, columns)] += block
            spread[columns, ends[number] : ends[number + 1]] = part
        try:
            shares = _shares(spread.T @ cho_solve(cho_factor(matrix), spread))
        except np.linalg.LinAlgError:
            return clipped
        return [
            block - (part * shares[begin:end]) @ part.T
            for block, part, begin, end in zip(clipped, falling, ends, ends[1:], strict=False)
        ]


def _shares(response: Array) -> Array:
    """Return shares (c,) of rank-one parts that may be subtracted from a matrix M and leave it positive.

    M - sum_j share_j u_j u_j' is positive where S R S has no eigenvalue above 1, with S the roots of the shares and the
    response R = U' M^-1 U (c, c). No eigenvalue exceeds the largest sum of a row's sizes (Gershgorin), so the roots are
    made as large as these sums allow (Sinkhorn & Knopp 1967).
    """
    sizes, roots = np.abs(response), np.ones(len(response))
    for _ in range(ROUNDS):
        roots = np.minimum(np.sqrt(roots * (1.0 - SPARE) / (sizes @ roots)), 1.0)
    over = float(np.max(roots * (sizes @ roots))) / (1.0 - SPARE)
    return np.asarray(roots**2 / max(over, 1.0))


def _onto(cost: Array, at: Indices) -> Array:
    """Return the quadratic on some of the slices with all others at their best."""
    others = np.setdiff1d(np.arange(len(cost)), at)
    left = cost[np.ix_(at, at)]
    if len(others):
        across = cost[np.ix_(others, at)]
        left = left - across.T @ np.linalg.solve(cost[np.ix_(others, others)], across)
    return left


class RowBlocks:
    """A matrix in rows, made of dense blocks one below the other, each on its own columns.

    Args:
        blocks: (number of rows, columns in rising order) of each block.
        width: number of columns of the matrix.
    """

    def __init__(self, blocks: Sequence[tuple[int, Indices]], width: int) -> None:
        counts = [len(columns) for rows, columns in blocks for _ in range(rows)]
        indices = [np.tile(columns, rows) for rows, columns in blocks]
        indptr = np.concatenate([[0], np.cumsum(counts, dtype=np.intp)]).astype(np.int32)
        flat = np.concatenate([np.zeros(0, np.intp), *indices]).astype(np.int32)
        self.matrix = sp.csr_matrix((np.zeros(len(flat)), flat, indptr), shape=(len(counts), width))

    def fill(self, values: Sequence[Array]) -> sp.csr_matrix:
        """Return the matrix with the values of all blocks, in their order; the next call reuses it."""
        if len(self.matrix.data):
            np.concatenate([block.ravel() for block in values], out=self.matrix.data)
        return self.matrix


class UpperBlocks:
    """The upper triangle of a symmetric matrix, made of dense symmetric blocks and a constant part.

    Args:
        constant: rows, columns and values of the constant part, upper triangle.
        blocks: columns in rising order of each symmetric block, (m,) or (n, m) for n blocks at once.
        width: of the matrix.
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
        """Return the constant part plus all blocks, (m, m) or (n, m, m) each; the next call reuses it."""
        self.matrix.data[:] = self._constant
        for places, (i, j), block in zip(self._places, self._triangles, values, strict=True):
            self.matrix.data[places] += block[..., i, j].ravel()
        return self.matrix
