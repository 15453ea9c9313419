"""Configurations between the slices of a path: monotone cubic Hermite interpolation of every joint.

A joint never passes the values it has in the two slices around (Fritsch & Butland 1984, the "pchip" of many libraries),
so it rests where both are equal and keeps its limits; speeds are continuous. Agents rest before the first slice and
after the last.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from reba.arrays import Array, Indices

NAME: Final = "monotone cubic (pchip), at rest at both ends"
"""How a plan states it."""
AROUND: Final = (-1, 0, 1, 2)
"""Knots that a point between knot 0 and 1 depends on, relative to the one before it."""


def interpolate(knots: Array, before: Indices, share: Array) -> Array:
    """Return the configurations (m, n) at points between equally spaced knots (k, n).

    Args:
        before: (m,) number of the knot before each point, 0 to k - 2.
        share: (m,) of the way to the next one, 0 to 1.

    >>> interpolate(np.array([[0.0], [1.0], [1.0]]), np.array([0, 1]), np.array([0.5, 0.5])).ravel().tolist()
    [0.5, 1.0]
    """
    start, end, left, right = _around(knots, before)
    u = share[:, None]
    slope_start, slope_end = _slope(left, end - start), _slope(end - start, right)
    return np.asarray(
        (1.0 + 2.0 * u) * (1.0 - u) ** 2 * start
        + u**2 * (3.0 - 2.0 * u) * end
        + u * (1.0 - u) ** 2 * slope_start
        - u**2 * (1.0 - u) * slope_end
    )


def interpolation_speed(knots: Array, before: Indices, share: Array) -> Array:
    """Return the derivative (m, n) of the points by `share`: divided by the time between knots it is a velocity.

    >>> interpolation_speed(np.array([[0.0], [1.0], [1.0]]), np.array([0, 0]), np.array([0.0, 0.5])).ravel().tolist()
    [0.0, 1.5]
    """
    start, end, left, right = _around(knots, before)
    u = share[:, None]
    slope_start, slope_end = _slope(left, end - start), _slope(end - start, right)
    return np.asarray(
        6.0 * u * (1.0 - u) * (end - start)
        + (1.0 - u) * (1.0 - 3.0 * u) * slope_start
        - u * (2.0 - 3.0 * u) * slope_end
    )


def interpolation_weights(knots: Array, before: Indices, share: Array) -> Array:
    """Return the derivative (m, 4, n) of each point by the knots `AROUND` it; 0 for those that do not exist."""
    start, end, left, right = _around(knots, before)
    u = share[:, None]
    by_start, by_end = u * (1.0 - u) ** 2, -(u**2) * (1.0 - u)
    step = end - start
    (left_by_left, left_by_step), (right_by_step, right_by_right) = _slopes(left, step), _slopes(step, right)
    by_step = by_start * left_by_step + by_end * right_by_step
    by_left, by_right = by_start * left_by_left, by_end * right_by_right
    at_start = (1.0 + 2.0 * u) * (1.0 - u) ** 2
    return np.stack([-by_left, at_start + by_left - by_step, 1.0 - at_start + by_step - by_right, by_right], axis=1)


def _around(knots: Array, before: Indices) -> tuple[Array, Array, Array, Array]:
    """Return the knots before and after each point, and the steps to and from these two; at rest outside."""
    padded = np.concatenate([knots[:1], knots, knots[-1:]])
    start, end = padded[before + 1], padded[before + 2]
    return start, end, start - padded[before], padded[before + 3] - end


def _slope(one: Array, other: Array) -> Array:
    """Return the slope at a knot, per step, between two steps: their harmonic mean, 0 where their signs differ."""
    same = one * other > 0.0
    return np.where(same, 2.0 * one * other / np.where(same, one + other, 1.0), 0.0)


def _slopes(one: Array, other: Array) -> tuple[Array, Array]:
    """Return the derivatives of `_slope` by both steps."""
    same = one * other > 0.0
    total = np.where(same, one + other, 1.0)
    return np.where(same, 2.0 * (other / total) ** 2, 0.0), np.where(same, 2.0 * (one / total) ** 2, 0.0)
