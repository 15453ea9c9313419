"""Bounded least squares as a quadratic program, solved to its optimality conditions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dreba.errors import ModelError
from reba.arrays import Array, Flags

_RIDGE = 1e-7
"""Ridge of the QP, whose features have root mean square 1; it makes the optimum unique."""
_CORRECTIONS = 20
"""Maximum number of active-set corrections after the interior point solver: more than the sign changes it leaves."""


@dataclass(frozen=True)
class BoundedQP:
    """Bounded least squares of features (n, k) and targets (n,) as a QP: min 1/2 w'Pw + q'w subject to w >= lower.

    Attributes:
        P: (k, k), features' S features / sum(S) with the sample weights S, plus a ridge.
        q: (k,) -features' S targets / sum(S).
        lower: (k,), -inf where a weight is free.
        scale: (k,) root mean square of each feature, by which P and q are divided.
    """

    P: Array
    q: Array
    lower: Array
    scale: Array


def build_qp(features: Array, targets: Array, sample_weight: Array, free: Flags) -> BoundedQP:
    """Return the QP of features (n, k), targets (n,) and sample weights (n,); `free` (k,) weights have no bound."""
    share = sample_weight / sample_weight.sum()
    scale = np.sqrt(share @ features**2)
    scale = np.where(scale > 0, scale, 1.0)
    scaled = features / scale
    weighted = scaled * share[:, None]
    # With the ridge, features that are constant or equal get the smallest weights instead of arbitrary ones.
    program = weighted.T @ scaled + _RIDGE * np.eye(features.shape[1])
    return BoundedQP(program, -weighted.T @ targets, np.where(free, -np.inf, 0.0), scale)


def solve(program: BoundedQP) -> Array:
    """Return the optimal weights (k,); ModelError unless the solution satisfies the optimality conditions."""
    from qpsolvers import solve_qp
    from scipy.sparse import csc_matrix

    solution = solve_qp(csc_matrix(program.P), program.q, lb=program.lower, solver="clarabel")
    if solution is None:
        raise ModelError("the QP of the weights has no solution: the poses do not determine them; give more poses")
    weights = _polished(program, np.maximum(solution, program.lower))
    if residual(program, weights) > 1e-6 * max(1.0, float(np.abs(program.q).max())):
        raise ModelError("the weights do not satisfy the optimality conditions; give poses that vary more")
    # A feature that is zero in all poses gets weight 0; its diagonal is the ridge alone.
    return np.where(np.diag(program.P) > 2 * _RIDGE, weights / program.scale, 0.0)


def _polished(program: BoundedQP, scaled: Array) -> Array:
    """Return the exact optimum near an interior point solution (k,), by a primal-dual active set method.

    An interior point solution is slightly off the bounds. It gives the first active set; the free weights then solve a
    linear system, and the active set is corrected until the optimality conditions are satisfied. The solution of the
    smallest residual is returned.
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


def residual(program: BoundedQP, scaled: Array) -> float:
    """Return the largest violation of the optimality conditions by scaled weights (k,): 0 at the optimum."""
    slope = program.P @ scaled + program.q
    bounded = np.isfinite(program.lower)
    return float(np.abs(np.where(bounded, np.minimum(scaled, slope), slope)).max())
