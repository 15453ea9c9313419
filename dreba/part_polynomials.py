"""Second-order polynomials Q_i(q_i) fitted to the step function of one angle in the part tables (section II-C)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dreba.domain import Bins, Domain

Array = NDArray[np.float64]
_SCALE = 100.0
"""[deg] Unit in which the normal equations are solved, so that powers of an angle stay near 1."""


def fit_polynomial(bins: Bins, convex: bool = True) -> Array:
    """Return (c0, c1, c2) of the polynomial c0 + c1 q + c2 q^2 nearest to a step function, q in degrees.

    Least squares over the whole range of the angle, every degree counting the same; the integrals are exact. With
    `convex` the curvature c2 is kept from being negative, where the best parabola is the best line.

    Args:
        bins: k + 1 edges [deg] and the k points between them.
        convex: whether c2 must not be negative.

    Example:
        >>> fit_polynomial(Bins((-30.0, -10.0, 10.0, 30.0), (1, 0, 1))).round(4).tolist()
        [0.2963, 0.0, 0.0012]
    """
    edges = np.array(bins.edges) / _SCALE
    points = np.array(bins.points, np.float64)
    if edges[0] == edges[-1]:
        return np.array([points[0], 0.0, 0.0])
    moments = np.stack([np.diff(edges ** (power + 1)) / (power + 1) for power in range(5)])
    size = 3
    gram = np.array([[moments[i + j].sum() for j in range(size)] for i in range(size)])
    target = moments[:size] @ points
    found = np.linalg.solve(gram, target)
    if convex and found[2] < 0:
        found = np.append(np.linalg.solve(gram[:2, :2], target[:2]), 0.0)
    return np.asarray(found / _SCALE ** np.arange(size), np.float64)


def part_polynomials(domain: Domain, joints: tuple[str, ...], convex: bool = True) -> Array:
    """Return (d, 3) coefficients, one row per column, for the points above the lowest that the column can get.

    Leaving out the lowest score moves a constant from the polynomials to the model's intercept: a posture at rest then
    costs about the intercept, and a model without one is not tied to it by its weights.
    """
    steps = [domain.bins_of(joint) for joint in joints]
    lowered = [Bins(bins.edges, tuple(points - min(bins.points) for points in bins.points)) for bins in steps]
    return np.array([fit_polynomial(bins, convex) for bins in lowered])
