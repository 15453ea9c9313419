"""The nearest configuration that meets the constraints of a problem: a first point for the solver, or a quick no."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lgp.path.problem import PathProblem
from lgp.world.solve import least_squares

Array = NDArray[np.float64]

CLOSE = 1e-4
"""[m, rad] Violation that counts as met; the solver removes the rest."""
STEPS, ROUNDS = 10, 4
"""Steps of a round of the search, and rounds: searches that succeed take 5 to 15 steps."""
PROGRESS = 0.8
"""A round that leaves more than this share of the violation is the last."""


def nearest(problem: PathProblem, start: Array, tolerance: float = CLOSE) -> tuple[Array, float]:
    """Return x (n,) near a start that violates the constraints least, and the largest violation left [m, rad]."""

    def residuals(x: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
        values = problem.rows.evaluate(*problem.split(x[0]))
        equal, limits = problem.rows.jacobians(values)
        broken = values.inequality > 0.0
        slopes = np.where(broken[:, None], limits.toarray(), 0.0)
        value = np.concatenate([values.equality, np.where(broken, values.inequality, 0.0)])
        return value[None], np.concatenate([equal.toarray(), slopes])[None]

    x, before = start[None], np.inf
    for _ in range(ROUNDS):
        x, left = least_squares(residuals, x, problem.lower, problem.upper, tolerance, STEPS)
        if left[0] <= tolerance or left[0] > PROGRESS * before:
            break
        before = float(left[0])
    return x[0], float(left[0])
