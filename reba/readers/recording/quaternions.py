"""Unit quaternions qx qy qz qw (scalar last, as in ROS): product, rotation of vectors, rotation matrices."""

from __future__ import annotations

import numpy as np

from reba.arrays import Array
from reba.posture.angles import cross


def about_axis(axis: int, angle: Array) -> Array:
    """Return the (n, 4) quaternions of rotations by (n,) angles [rad] about the axis 0, 1 or 2.

    >>> about_axis(2, np.array([np.pi])).round(9).tolist()
    [[0.0, 0.0, 1.0, 0.0]]
    """
    quaternions = np.zeros((len(angle), 4))
    quaternions[:, axis] = np.sin(angle / 2)
    quaternions[:, 3] = np.cos(angle / 2)
    return quaternions


def product(a: Array, b: Array) -> Array:
    """Return the (n, 4) Hamilton product of (n, 4) quaternions: rotation b, then rotation a."""
    av, aw, bv, bw = a[:, :3], a[:, 3:], b[:, :3], b[:, 3:]
    vector = aw * bv + bw * av + cross(av, bv)
    return np.concatenate([vector, aw * bw - np.sum(av * bv, axis=1, keepdims=True)], axis=1)


def rotated(quaternions: Array, vectors: Array) -> Array:
    """Return (n, 3) vectors rotated by (n, 4) unit quaternions."""
    across = 2.0 * cross(quaternions[:, :3], vectors)
    return vectors + quaternions[:, 3:] * across + cross(quaternions[:, :3], across)


def matrices(quaternions: Array) -> Array:
    """Return the (n, 3, 3) rotation matrices of (n, 4) unit quaternions."""
    x, y, z, w = np.ascontiguousarray(quaternions.T)
    # Each of the nine numbers lies together for all frames, for speed.
    result = np.empty((3, 3, len(quaternions)))
    for index, (i, j, k) in enumerate(((x, y, z), (y, z, x), (z, x, y))):
        after = (index + 1) % 3
        result[index, index] = 1.0 - 2.0 * (j * j + k * k)
        result[index, after] = 2.0 * (i * j - k * w)
        result[after, index] = 2.0 * (i * j + k * w)
    return result.transpose(2, 0, 1)
