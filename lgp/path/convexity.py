"""How much of the negative curvature of the switches a model may keep and still have one minimum.

The rows of a switch bend both ways. Without what bends downwards a solver creeps to its solution in many small steps;
with all of it a step far from the solution may have no minimum. Whether it has one depends on the accelerations and on
the rows alone, so a small matrix tells: the least cost through the configurations at the switches, plus the curvature,
plus a high price on leaving the linearised rows (Debreu's lemma).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lgp.path.acceleration import Condensed

Array = NDArray[np.float64]
Slices = NDArray[np.intp]

SHARES = (1.0, 0.95, 0.85, 0.7, 0.5, 0.25)
"""Shares of the negative curvature that are tried before none is kept."""
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
        groups: Sequence[tuple[Slices, Condensed]],
        columns: Sequence[Slices],
        rows: Sequence[Slices],
        sizes: tuple[int, int],
    ) -> None:
        nq, nz = sizes
        self._number = 0
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
        split = []
        for bend in bends:
            values, vectors = np.linalg.eigh(bend)
            split.append(((vectors * np.maximum(values, 0.0)) @ vectors.T, bend))
        if violation > NEAR:
            return [clipped for clipped, _ in split]
        fixed = self._cost.copy()
        for rows, jacobian in zip(self._rows, jacobians, strict=False):
            fixed[np.ix_(rows, rows)] += PRICE * self._scale * jacobian.T @ jacobian
        # What held at the last point nearly always holds at the next one; a little more is tried first.
        for number in range(max(self._number - 2, 0), len(SHARES)):
            blocks = [clipped + SHARES[number] * (bend - clipped) for clipped, bend in split]
            if self._holds(fixed, blocks):
                self._number = number
                return blocks
        self._number = len(SHARES)
        return [clipped for clipped, _ in split]

    def _holds(self, fixed: Array, blocks: Sequence[Array]) -> bool:
        matrix = fixed.copy()
        for columns, block in zip(self._columns, blocks, strict=True):
            matrix[np.ix_(columns, columns)] += block
        try:
            np.linalg.cholesky(matrix)
        except np.linalg.LinAlgError:
            return False
        return True


def _onto(cost: Array, at: Slices) -> Array:
    """Return the quadratic on some of the slices with all others at their best."""
    others = np.setdiff1d(np.arange(len(cost)), at)
    left = cost[np.ix_(at, at)]
    if len(others):
        across = cost[np.ix_(others, at)]
        left = left - across.T @ np.linalg.solve(cost[np.ix_(others, others)], across)
    return left
