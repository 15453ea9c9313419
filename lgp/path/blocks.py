"""Sparse matrices of fixed pattern from blocks: places are worked out once, then only values move."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


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
