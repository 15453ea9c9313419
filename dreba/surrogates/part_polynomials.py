"""Polynomials of the part tables: the least-squares parabola of the points of one angle (Busch et al. 2018, II-C)."""

from __future__ import annotations

from typing import Final, Literal

import numpy as np

from dreba.domain import Bins, Domain
from reba.arrays import Array
from reba.posture.columns import BEST

Minimum = Literal["lowest", "free"]
MINIMA: Final = ("lowest", "free")
MARGIN: Final = 0.1
"""Share of the width of a class by which a minimum stays off its edges, so that rounding cannot move it outside."""
_SCALE: Final = 100.0
"""[deg] Unit of angles in the normal equations, which keeps their powers near 1."""


def lowest_class(bins: Bins, best: float = 0.0) -> tuple[float, float]:
    """Return the ends [deg] of the class of the lowest points less a margin, of several the one nearest to `best`.

    >>> lowest_class(Bins((-30.0, -10.0, 10.0, 30.0), (1, 0, 1)))
    (-8.0, 8.0)
    """
    classes = [(low, high) for low, high, points in zip(bins.edges, bins.edges[1:], bins.points, strict=False)
               if points == min(bins.points)]  # fmt: skip
    low, high = min(classes, key=lambda ends: max(ends[0] - best, best - ends[1], 0.0))
    margin = MARGIN * (high - low)
    return low + margin, high - margin


def fit_polynomial(bins: Bins, convex: bool = True, minimum: tuple[float, float] | None = None) -> Array:
    """Return (c0, c1, c2) of the least-squares polynomial c0 + c1 q + c2 q^2 of a step function, q [deg].

    The squared error is integrated exactly over the range of the angle. If c2 >= 0 is required (`convex`) and c2 < 0,
    the best convex parabola is the least-squares line. A convex parabola with its `minimum` between two angles a and b
    [deg] is a sum of (q - a)^2 and (q - b)^2 with weights of 0 or more, and a constant.

    Example:
        >>> fit_polynomial(Bins((-30.0, -10.0, 10.0, 30.0), (1, 0, 1))).round(4).tolist()
        [0.2963, 0.0, 0.0012]
    """
    edges = np.array(bins.edges) / _SCALE
    points = np.array(bins.points, np.float64)
    if edges[0] == edges[-1]:
        return np.array([points[0], 0.0, 0.0])
    moments = np.stack([np.diff(edges ** (power + 1)) / (power + 1) for power in range(5)])
    gram = np.array([[moments[i + j].sum() for j in range(3)] for i in range(3)])
    target = moments[:3] @ points
    if minimum is None:
        basis = np.eye(3)
        if convex and np.linalg.solve(gram, target)[2] < 0:
            basis = basis[:2]
        coefficients = _least_squares(gram, target, basis)
    else:
        ends = [np.array([(end / _SCALE) ** 2, -2.0 * end / _SCALE, 1.0]) for end in minimum]
        choices = [np.array([[1.0, 0.0, 0.0], *some]) for some in (ends, ends[:1], ends[1:], [])]
        # The optimum is the best of the solutions without a negative weight, each for a choice of the weights above 0.
        solutions = [_least_squares(gram, target, basis) for basis in choices if _is_sum(gram, target, basis)]
        coefficients = min(solutions, key=lambda c: c @ gram @ c - 2.0 * c @ target)
    return np.asarray(coefficients / _SCALE ** np.arange(3), np.float64)


def _weights(gram: Array, target: Array, basis: Array) -> Array:
    return np.asarray(np.linalg.lstsq(basis @ gram @ basis.T, basis @ target, rcond=None)[0])


def _least_squares(gram: Array, target: Array, basis: Array) -> Array:
    return np.asarray(_weights(gram, target, basis) @ basis)


def _is_sum(gram: Array, target: Array, basis: Array) -> bool:
    """Return whether the weights of all but the constant, the first of the basis, are 0 or more."""
    return bool((_weights(gram, target, basis)[1:] >= 0.0).all())


def part_polynomials(domain: Domain, joints: tuple[str, ...], convex: bool = True, minimum: Minimum = "free") -> Array:
    """Return coefficients (d, 3) of the polynomials of each column, fitted to its points above the lowest.

    The lowest points of all columns are a constant, which belongs to the intercept: a neutral posture then costs about
    the intercept, whatever the weights. `minimum` "lowest" puts the minimum of each into its class of lowest points.
    """
    out = []
    for joint in joints:
        bins = domain.bins_of(joint)
        lowered = Bins(bins.edges, tuple(points - min(bins.points) for points in bins.points))
        own = lowest_class(lowered, BEST[joint]) if convex and minimum == "lowest" else None
        out.append(fit_polynomial(lowered, convex, own))
    return np.array(out)
