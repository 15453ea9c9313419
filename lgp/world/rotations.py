"""Rotation vectors for batches: exponential, logarithm and their derivatives.

Formulas: Chirikjian (2012), Stochastic Models, Information Theory, and Lie Groups 2, section 10.6; series near angle 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

IDENTITY = np.eye(3)
SMALL = 1e-4
"""[rad] Below this angle the series are exact to rounding."""


def skew(vectors: Array) -> Array:
    """Return (..., 3, 3) matrices S with S b = a x b for (..., 3) vectors a."""
    out = np.zeros((*vectors.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -vectors[..., 2], vectors[..., 1], -vectors[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = vectors[..., 2], -vectors[..., 1], vectors[..., 0]
    return out


def cross(turns: Array, arms: Array) -> Array:
    """Return turns x arms: (n, 3, k) columns each crossed with the (n, 3) vector of its row (faster than np.cross)."""
    out = np.empty_like(turns)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(turns[:, j], arms[:, k, None], out=out[:, i])
        out[:, i] -= turns[:, k] * arms[:, j, None]
    return out


def exponential(vectors: Array) -> Array:
    """Return (..., 3, 3) rotations about (..., 3) vectors by their lengths [rad].

    >>> exponential(np.array([0.0, 0.0, np.pi / 2])).round(9)[:, 0].tolist()
    [0.0, 1.0, 0.0]
    """
    return exponential_with_slope(vectors)[0]


def exponential_with_slope(vectors: Array) -> tuple[Array, Array]:
    """Return the rotations as `exponential` does, and the left Jacobians.

    These are (..., 3, 3) matrices from a change of (..., 3) rotation vectors to the turn it makes, in outer axes.
    """
    squared = np.einsum("...i,...i->...", vectors, vectors)[..., None, None]
    angle = np.sqrt(squared)
    safe = np.maximum(angle, SMALL)
    small, sine = angle < SMALL, np.sin(safe)
    first = np.where(small, 1.0 - squared / 6.0, sine / safe)
    second = np.where(small, 0.5 - squared / 24.0, (1.0 - np.cos(safe)) / safe**2)
    third = np.where(small, 1.0 / 6.0 - squared / 120.0, (safe - sine) / safe**3)
    cross = skew(vectors)
    twice = cross @ cross
    return IDENTITY + first * cross + second * twice, IDENTITY + second * cross + third * twice


def logarithm(rotations: Array) -> Array:
    """Return (..., 3) rotation vectors, of length at most pi; at pi their sense is arbitrary."""
    sine = np.stack(
        [
            rotations[..., 2, 1] - rotations[..., 1, 2],
            rotations[..., 0, 2] - rotations[..., 2, 0],
            rotations[..., 1, 0] - rotations[..., 0, 1],
        ],
        axis=-1,
    )
    trace = np.trace(rotations, axis1=-2, axis2=-1)
    twice = np.linalg.norm(sine, axis=-1)
    angle = np.arctan2(twice, trace - 1.0)
    factor = np.where(twice < 2.0 * SMALL, 0.5 + angle**2 / 12.0, angle / np.maximum(twice, 2.0 * SMALL))
    out = factor[..., None] * sine
    turned = (twice < 2.0 * SMALL) & (trace < 0.0)
    if np.any(turned):
        # Half a turn: the axis is the column of R + 1 that is longest.
        both = rotations[turned] + IDENTITY
        longest = np.argmax(np.linalg.norm(both, axis=-2), axis=-1)
        axis = np.take_along_axis(both, longest[:, None, None], axis=-1)[..., 0]
        axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
        sense = np.where(np.sum(axis * sine[turned], axis=-1) < 0.0, -1.0, 1.0)
        out[turned] = axis * (sense * angle[turned])[:, None]
    return out


def inverse_right_jacobian(vectors: Array) -> Array:
    """Return (..., 3, 3) matrices that map a turn in inner axes to the change of (..., 3) rotation vectors."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    safe = np.maximum(angle, SMALL)
    half = safe / 2.0
    second = np.where(angle < SMALL, 1.0 / 12.0 + angle**2 / 720.0, (1.0 - half / np.tan(half)) / safe**2)
    cross = skew(vectors)
    return IDENTITY + 0.5 * cross + second * (cross @ cross)
