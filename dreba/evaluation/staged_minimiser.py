"""Continuation: minimise a list of objectives under one equality constraint, each from the minimum of the last.

Each stage is solved by sequential quadratic programming, SLSQP of SciPy (Kraft 1988), in scaled variables.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from reba.arrays import Array

Objective = Callable[[Array], tuple[float, Array]]
"""Angles (d,) [deg] -> value and gradient (d,) [1/deg]."""
Constraint = Callable[[Array], tuple[Array, Array]]
"""Angles (d,) [deg] -> residuals (m,), 0 where it is satisfied, and their Jacobian (m, d)."""
SCALE: Final = 30.0
"""[deg] Unit of the scaled variables, about the width of an angle class, so that derivatives are of order 1."""
PROJECTION_STEPS: Final = 50
"""Maximum number of least-squares evaluations of a projection onto the constraint."""
TOLERANCE: Final = 1e-3
"""Largest residual of a satisfied constraint: 1 mm for hand positions in metres."""


@dataclass(frozen=True)
class Effort:
    """Limits of a stage: maximum iterations of SLSQP and its tolerance on value and constraint."""

    iterations: int = 30
    tolerance: float = 1e-3


@dataclass(frozen=True)
class Minimum:
    """Result of a staged minimisation: the point x (d,) [deg] and the stage ends (k, d) [deg], the free start included.

    Attributes:
        residual: largest absolute constraint residual at x.
        evaluations: number of evaluations of objectives with gradients, over all stages.
        constraint_evaluations: number of evaluations of the constraint with its Jacobian.
    """

    x: Array
    residual: float
    evaluations: int
    constraint_evaluations: int
    stages: Array


def minimise(
    objectives: Sequence[Objective],
    start: Array,
    low: Array,
    high: Array,
    constraint: Constraint,
    *,
    free_start: bool = False,
    effort: Effort = Effort(),
    score: Callable[[Array], float] | None = None,
) -> Minimum:
    """Return the minimum of the last objective under an equality constraint, reached stage by stage.

    Args:
        objectives: one per stage, such as those of `GraduatedModel.stages_`.
        start, low, high: initial pose and limits (d,) [deg].
        free_start: minimise the first objective without the constraint before the stages. If it is convex, a few
            evaluations lead from any start to its global minimum; under the constraint a start far away ends in a
            local minimum or stays infeasible.
        effort: limits of every stage.
        score: true score of a pose; the result is then the stage end of the lowest score that satisfies the
            constraint.
    """
    from scipy.optimize import minimize

    counted = _CountedConstraint(constraint)
    x = np.clip(start, low, high) / SCALE
    bounds = np.stack([low, high], axis=1) / SCALE
    ends, evaluations = [], 0
    equality = [{"type": "eq", "fun": counted.residuals, "jac": counted.jacobian}]
    stages = [(objective, equality) for objective in objectives]
    if free_start:
        stages.insert(0, (objectives[0], []))
    for objective, constraints in stages:
        result = minimize(
            _scaled(objective), x, jac=True, method="SLSQP", bounds=bounds, constraints=constraints,
            options={"maxiter": effort.iterations, "ftol": effort.tolerance},
        )  # fmt: skip
        evaluations += int(result.nfev)
        if np.isfinite(result.x).all():
            x = np.clip(result.x, bounds[:, 0], bounds[:, 1])
        projected = _project(counted, x, bounds)
        ends.append((projected if constraints else x) * SCALE)
        x = projected
    best = ends[-1]
    if score is not None:
        feasible = [end for end in ends if counted.largest(end) <= TOLERANCE]
        best = min(reversed(feasible), key=score, default=best)
    return Minimum(best, counted.largest(best), evaluations, counted.calls, np.array(ends))


def _project(counted: _CountedConstraint, x: Array, bounds: Array) -> Array:
    """Return a point projected onto the constraint by bounded least squares, or the point itself if that fails.

    The projection completes stages that reached the iteration limit and makes the end of a free start feasible.
    """
    from scipy.optimize import least_squares

    if counted.largest(x * SCALE) <= TOLERANCE:
        return x
    result = least_squares(
        counted.residuals, x, counted.jacobian, bounds=bounds.T, max_nfev=PROJECTION_STEPS, xtol=1e-6
    )
    return result.x if counted.largest(result.x * SCALE) <= TOLERANCE else x


class _CountedConstraint:
    """Constraint in scaled variables with a cache of the last point and a count of its evaluations."""

    def __init__(self, constraint: Constraint) -> None:
        self.constraint = constraint
        self.calls = 0
        self._point: bytes = b""
        self._cached: tuple[Array, Array] = (np.empty(0), np.empty((0, 0)))

    def residuals(self, x: Array) -> Array:
        if x.tobytes() != self._point:
            self._point, self.calls = x.tobytes(), self.calls + 1
            residuals, jacobian = self.constraint(x * SCALE)
            self._cached = residuals, jacobian * SCALE
        return self._cached[0]

    def jacobian(self, x: Array) -> Array:
        self.residuals(x)
        return self._cached[1]

    def largest(self, degrees: Array) -> float:
        return float(np.max(np.abs(self.residuals(degrees / SCALE)), initial=0.0))


def _scaled(objective: Objective) -> Objective:
    def evaluate(x: Array) -> tuple[float, Array]:
        value, gradient = objective(x * SCALE)
        return value, gradient * SCALE

    return evaluate
