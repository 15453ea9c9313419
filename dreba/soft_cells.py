"""Multilinear interpolation in Tables A, B and C: corners of their cells, and polynomials inside a cell."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def _corner_numbers(shape: tuple[int, ...], first: int) -> NDArray[np.intp]:
    """Return (2^k, cells): numbers of the corners of every cell of a table, first index slowest."""
    numbers = np.arange(np.prod(shape)).reshape(shape) + first
    k = len(shape)
    corners = []
    for corner in range(2**k):
        shifts = [(corner >> (k - 1 - axis)) & 1 for axis in range(k)]
        part = numbers[tuple(slice(s, size - 1 + s) for s, size in zip(shifts, shape, strict=True))]
        corners.append(part.ravel())
    return np.array(corners)


_ONE: Final = np.array([[1.0, 0.0], [-1.0, 1.0]])
CORNERS_AB: Final = np.hstack([_corner_numbers((5, 3, 4), 0), _corner_numbers((6, 2, 3), 60)])
"""(8, 34) cell corners among the 60 cells of A followed by the 36 of B; 24 cells of A, 10 of B."""
CORNERS_C: Final = _corner_numbers((12, 12), 0)
"""(4, 121) cell corners among the 144 cells of C."""
MONOMIALS_AB: Final = np.kron(_ONE, np.kron(_ONE, _ONE))
"""(8, 8) corner values -> coefficients of 1, c, b, bc, a, ac, ab, abc inside a cell."""
MONOMIALS_C: Final = np.kron(_ONE, _ONE)
"""(4, 4) corner values -> coefficients of 1, y, x, xy."""


def trilinear(coef: Array, place: Array) -> tuple[Array, Array]:
    """Return (3, n) interpolated values and (3, 3, n) slopes from the coefficients of 1, c, b, bc, a, ac, ab, abc."""
    a, b, c = place[:3], place[3:6], place[6:]
    slopes = np.empty((3, *a.shape))
    low_b = coef[2] + coef[3] * c
    low = coef[0] + coef[1] * c + low_b * b
    high_b = coef[6] + coef[7] * c
    slopes[0] = coef[4] + coef[5] * c + high_b * b
    slopes[1] = low_b + high_b * a
    slopes[2] = coef[1] + coef[3] * b + (coef[5] + coef[7] * b) * a
    return low + slopes[0] * a, slopes
