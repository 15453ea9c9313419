"""Configurations between the slices of a path: cubic Hermite interpolation of every joint.

In a slice a joint has the mean speed of the two steps beside it, and none where it keeps its value in one of these:
what rests stays where it is. Speeds are continuous, and agents rest before the first slice and after the last.

A point is a linear function of the knots around it, so constraints between slices are as smooth as those in slices. A
monotone interpolation ("pchip") is not: where a joint turns back or comes to rest its derivatives jump, and an
optimiser takes ever shorter steps there. A joint may pass the values of both slices by a little; its limits are
constraints between slices too (`lgp.path.joint_constraints`).
"""

from __future__ import annotations

from typing import Final

import numpy as np

from reba.arrays import Array, Indices

NAME: Final = "cubic Hermite, mean speeds of neighbouring steps, at rest where a joint keeps its value and at both ends"
"""How a plan states it."""
AROUND: Final = (-1, 0, 1, 2)
"""Knots that a point between knot 0 and 1 depends on, relative to the one before it."""
REST: Final = 1e-9
"""[rad, m] Steps up to this are none: plans are rounded to less."""


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


def interpolation_acceleration(knots: Array, before: Indices, share: Array) -> Array:
    """Return the second derivative (m, n) of the points by `share`; it jumps from one step to the next.

    >>> interpolation_acceleration(np.array([[0.0], [1.0]]), np.array([0, 0]), np.array([0.0, 0.5])).ravel().tolist()
    [6.0, 0.0]
    """
    start, end, left, right = _around(knots, before)
    u = share[:, None]
    slope_start, slope_end = _slope(left, end - start), _slope(end - start, right)
    return np.asarray(
        6.0 * (1.0 - 2.0 * u) * (end - start) + (6.0 * u - 4.0) * slope_start + (6.0 * u - 2.0) * slope_end
    )


def interpolation_weights(knots: Array, before: Indices, share: Array) -> Array:
    """Return the derivative (m, 4, n) of each point by the knots `AROUND` it; 0 for those that do not exist."""
    start, end, left, right = _around(knots, before)
    u = share[:, None]
    by_start, by_end = u * (1.0 - u) ** 2, -(u**2) * (1.0 - u)
    step = end - start
    by_left, by_right = by_start * _half(left, step), by_end * _half(step, right)
    by_step = by_left + by_right
    at_start = (1.0 + 2.0 * u) * (1.0 - u) ** 2
    return np.stack([-by_left, at_start + by_left - by_step, 1.0 - at_start + by_step - by_right, by_right], axis=1)


def _around(knots: Array, before: Indices) -> tuple[Array, Array, Array, Array]:
    """Return the knots before and after each point, and the steps to and from these two; at rest outside."""
    padded = np.concatenate([knots[:1], knots, knots[-1:]])
    start, end = padded[before + 1], padded[before + 2]
    return start, end, start - padded[before], padded[before + 3] - end


def _slope(one: Array, other: Array) -> Array:
    """Return the slope at a knot, per step, between two steps: their mean, 0 where one of them is none."""
    return _half(one, other) * (one + other)


def _half(one: Array, other: Array) -> Array:
    """Return the derivative of `_slope` by each of both steps."""
    return np.where((np.abs(one) <= REST) | (np.abs(other) <= REST), 0.0, 0.5)
