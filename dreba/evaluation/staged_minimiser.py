"""Continuation: minimise a list of objectives under one equality constraint, each from the minimum of the last.

Each stage is solved by sequential quadratic programming, SLSQP of SciPy (Kraft 1988), in scaled variables. All stages
have the same tolerance and share one budget of evaluations, so that methods of one stage and of many can be compared.
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
SOLVER_TOLERANCE: Final = 1e-3
"""Tolerance of SLSQP on value and constraint; a value is a REBA score, so a thousandth of a point."""
BUDGET: Final = 100
"""Default number of evaluations of objectives with gradients, over all stages."""


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
    budget: int = BUDGET,
) -> Minimum:
    """Return the minimum of the last objective under an equality constraint, reached stage by stage.

    Args:
        objectives: one per stage, such as those of `reach_methods.graduated`.
        start, low, high: initial pose and limits (d,) [deg].
        free_start: minimise the first objective without the constraint before the stages. If it is convex, a few
            evaluations lead from any start to its global minimum; under the constraint a start far away ends in a
            local minimum or stays infeasible.
        budget: most evaluations of objectives; each stage has an equal share of those that are left.
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
    for place, (objective, constraints) in enumerate(stages):
        limited = _LimitedObjective(objective, (budget - evaluations) // (len(stages) - place))
        try:
            end = minimize(
                limited, x, jac=True, method="SLSQP", bounds=bounds, constraints=constraints,
                options={"ftol": SOLVER_TOLERANCE},
            ).x  # fmt: skip
        except _Spent:
            end = limited.last
        evaluations += limited.evaluations
        if np.isfinite(end).all():
            x = np.clip(end, bounds[:, 0], bounds[:, 1])
        projected = _project(counted, x, bounds)
        ends.append((projected if constraints else x) * SCALE)
        x = projected
    return Minimum(ends[-1], counted.largest(ends[-1]), evaluations, counted.calls, np.array(ends))


class _Spent(Exception):
    """The evaluations of a stage are spent."""


class _LimitedObjective:
    """Objective in scaled variables that ends its stage after a number of evaluations, with the last point."""

    def __init__(self, objective: Objective, most: int) -> None:
        self.objective, self.most = objective, most
        self.evaluations = 0
        self.last: Array = np.empty(0)

    def __call__(self, x: Array) -> tuple[float, Array]:
        if self.evaluations and self.evaluations >= self.most:
            raise _Spent
        self.evaluations, self.last = self.evaluations + 1, x.copy()
        value, gradient = self.objective(x * SCALE)
        return value, gradient * SCALE


def _project(counted: _CountedConstraint, x: Array, bounds: Array) -> Array:
    """Return a point projected onto the constraint by bounded least squares, or the point itself if that fails.

    The projection completes stages that ended early and makes the end of a free start feasible.
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
