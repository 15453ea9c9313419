"""Non-negative least squares as a quadratic program (the weights w_i of equation 1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dreba.errors import ModelError

Array = NDArray[np.float64]
_TRACE = 1e-8
"""Added to the diagonal of the program, whose features have size 1."""
_CORRECTIONS = 20
"""Exchanges between weights on and off their bounds after the solver."""


@dataclass(frozen=True)
class LeastSquares:
    """min 1/2 w'Pw + q'w with w >= lower: the squared error of features (n, k) against targets (n,), written as a QP.

    Attributes:
        P: (k, k), features' S features / sum(S) with the sample weights S, plus a trace for features that coincide.
        q: (k,).
        lower: (k,), -inf where a weight is free.
        scale: (k,) size of each feature, by which P and q are divided.
    """

    P: Array
    q: Array
    lower: Array
    scale: Array


def build_qp(features: Array, targets: Array, sample_weight: Array, free: NDArray[np.bool_]) -> LeastSquares:
    """Return the program.

    Args:
        features: (n, k).
        targets: (n,).
        sample_weight: (n,), not negative, not all zero.
        free: (k,) whose weights may be negative.
    """
    share = sample_weight / sample_weight.sum()
    scale = np.sqrt(share @ features**2)
    scale = np.where(scale > 0, scale, 1.0)
    scaled = features / scale
    weighted = scaled * share[:, None]
    # A feature that never varies, or two that coincide, would leave the optimum open: the smallest weights are taken.
    program = weighted.T @ scaled + _TRACE * np.eye(features.shape[1])
    return LeastSquares(program, -weighted.T @ targets, np.where(free, -np.inf, 0.0), scale)


def solve(program: LeastSquares) -> Array:
    """Return the weights (k,).

    Raises:
        ModelError: the solver gives up, or what it returns is not optimal.
    """
    from qpsolvers import solve_qp
    from scipy.sparse import csc_matrix

    found = solve_qp(csc_matrix(program.P), program.q, lb=program.lower, solver="clarabel")
    if found is None:
        raise ModelError("no weights were found: the poses do not determine them; give more poses")
    weights = _polished(program, np.maximum(found, program.lower))
    if residual(program, weights) > 1e-6 * max(1.0, float(np.abs(program.q).max())):
        raise ModelError("the solver stopped before the weights were optimal; give poses that vary more")
    # A feature that is zero everywhere has no weight; its diagonal holds the added trace alone.
    return np.where(np.diag(program.P) > 2 * _TRACE, weights / program.scale, 0.0)


def _polished(program: LeastSquares, scaled: Array) -> Array:
    """Return the exact optimum near an interior point solution (k,), or that solution if none is found.

    An interior point method stops a little off the bounds. Which weights lie on them is guessed from it; the others
    then solve a linear system, and the guess is corrected until the optimality conditions hold.
    """
    bounded = np.isfinite(program.lower)
    slope = program.P @ scaled + program.q
    inside = ~bounded | (scaled > slope)
    best = scaled
    for _ in range(_CORRECTIONS):
        exact = np.zeros_like(scaled)
        exact[inside] = np.linalg.solve(program.P[np.ix_(inside, inside)], -program.q[inside])
        if residual(program, exact) < residual(program, best):
            best = exact
        wrong = bounded & np.where(inside, exact < 0, program.P @ exact + program.q < 0)
        if not wrong.any():
            break
        inside = inside ^ wrong
    return best


def residual(program: LeastSquares, scaled: Array) -> float:
    """Return by how much (scaled) weights (k,) miss the optimality conditions: 0 at the optimum."""
    slope = program.P @ scaled + program.q
    bounded = np.isfinite(program.lower)
    return float(np.abs(np.where(bounded, np.minimum(scaled, slope), slope)).max())
