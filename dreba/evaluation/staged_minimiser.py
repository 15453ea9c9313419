"""Minimise a list of objectives one after the other, each from the result of the last, under one constraint.

Sequential quadratic programming: SLSQP of SciPy (Kraft 1988), in variables scaled to `SCALE` degrees.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from reba.arrays import Array

Objective = Callable[[Array], tuple[float, Array]]
"""(d,) -> value and gradient (d,)."""
Constraint = Callable[[Array], tuple[Array, Array]]
"""(d,) -> residuals (m,), 0 where it is met, and their Jacobian (m, d)."""
SCALE: Final = 30.0
"""[deg] One unit of the scaled variables."""
ONTO: Final = 50
"""Steps at most to get onto the constraint."""


@dataclass(frozen=True)
class Effort:
    """How hard a stage is tried: iterations of SLSQP, and its tolerance on value and constraint."""

    iterations: int = 30
    tolerance: float = 1e-3


@dataclass(frozen=True)
class Minimum:
    """Where a staged minimisation ended.

    Attributes:
        x: (d,) degrees.
        residual: largest constraint residual there.
        evaluations: of an objective with its gradient, over all stages.
        constraint_evaluations: of the constraint with its Jacobian.
        stages: (k, d) where each stage ended, the free start included.
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
    tolerance: float = 1e-3,
) -> Minimum:
    """Minimise stage by stage.

    Args:
        objectives: the stages, such as those of `GraduatedModel.stages_`.
        start: (d,) degrees.
        low, high: (d,) limits [deg].
        constraint: what has to be 0.
        free_start: minimise the first objective once without the constraint before the stages. For a convex one this
            costs a few evaluations and leads from any start to its minimum, from where the task then pulls: under the
            constraint itself a bad start ends in a twisted local minimum, or never reaches.
        effort: of every stage.
        score: the true score of a pose; the best stage end by it that meets the constraint is then the result.
        tolerance: largest residual that meets the constraint.
    """
    from scipy.optimize import minimize

    counted = _Counted(constraint)
    x = np.clip(start, low, high) / SCALE
    bounds = np.stack([low, high], axis=1) / SCALE
    ends, evaluations = [], 0
    kept = [{"type": "eq", "fun": counted.residuals, "jac": counted.jacobian}]
    plan = [(objective, kept) for objective in objectives]
    if free_start:
        plan.insert(0, (objectives[0], []))
    for objective, constraints in plan:
        found = minimize(
            _scaled(objective), x, jac=True, method="SLSQP", bounds=bounds, constraints=constraints,
            options={"maxiter": effort.iterations, "ftol": effort.tolerance},
        )  # fmt: skip
        evaluations += int(found.nfev)
        if np.isfinite(found.x).all():
            x = np.clip(found.x, bounds[:, 0], bounds[:, 1])
        onto = _onto(counted, x, bounds, tolerance)
        ends.append((onto if constraints else x) * SCALE)
        x = onto
    best = ends[-1]
    if score is not None:
        met = [end for end in ends if counted.largest(end) <= tolerance]
        best = min(reversed(met), key=score, default=best)
    return Minimum(best, counted.largest(best), evaluations, counted.calls, np.array(ends))


def _onto(counted: _Counted, x: Array, bounds: Array, tolerance: float) -> Array:
    """Return the point moved onto the constraint by bounded least squares, if that succeeds.

    It repairs stages that ran out of iterations, and brings the end of a free start to where the next one begins.
    """
    from scipy.optimize import least_squares

    if counted.largest(x * SCALE) <= tolerance:
        return x
    found = least_squares(counted.residuals, x, counted.jacobian, bounds=bounds.T, max_nfev=ONTO, xtol=1e-6)
    return found.x if counted.largest(found.x * SCALE) <= tolerance else x


class _Counted:
    """A constraint in scaled variables that is computed once per point and counts how often."""

    def __init__(self, constraint: Constraint) -> None:
        self.constraint = constraint
        self.calls = 0
        self._at: bytes = b""
        self._found: tuple[Array, Array] = (np.empty(0), np.empty((0, 0)))

    def residuals(self, x: Array) -> Array:
        if x.tobytes() != self._at:
            self._at, self.calls = x.tobytes(), self.calls + 1
            residuals, jacobian = self.constraint(x * SCALE)
            self._found = residuals, jacobian * SCALE
        return self._found[0]

    def jacobian(self, x: Array) -> Array:
        self.residuals(x)
        return self._found[1]

    def largest(self, degrees: Array) -> float:
        return float(np.max(np.abs(self.residuals(degrees / SCALE)), initial=0.0))


def _scaled(objective: Objective) -> Objective:
    def evaluate(x: Array) -> tuple[float, Array]:
        value, gradient = objective(x * SCALE)
        return value, gradient * SCALE

    return evaluate
