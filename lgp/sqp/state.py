"""The point of a solve with its multipliers, and the residuals recomputed there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lgp.sqp.problem import Model, Problem, Vector
from lgp.sqp.result import Violation


@dataclass(frozen=True)
class Residuals:
    """Errors of a point with multipliers; see `Result` for the units."""

    kkt: float
    equality: float
    inequality: float
    y_box: Vector

    @property
    def violation(self) -> float:
        return max(self.equality, self.inequality)


def residuals(problem: Problem, model: Model, x: Vector, y_eq: Vector, y_in: Vector) -> Residuals:
    """Recompute stationarity, complementarity and violation at x (n,) from the model there.

    Stationarity is the natural residual |x - clip(x - r, lower, upper)| with r the gradient of the Lagrangian, which
    needs no multipliers of the bounds; those are what r leaves at a bound.
    """
    force = model.eq_jac.T @ y_eq + model.in_jac.T @ y_in
    slope = model.gradient + force
    natural = x - np.clip(x - slope, problem.lower, problem.upper)
    held = np.minimum(y_in, -model.ineq)
    size = max(1.0, float(np.abs(model.gradient).max(initial=0.0)), float(np.abs(force).max(initial=0.0)))
    error = max(
        float(np.abs(natural).max(initial=0.0)), float(np.where(y_in > 0.0, np.abs(held), 0.0).max(initial=0.0))
    )
    return Residuals(
        kkt=error / size,
        equality=float(np.abs(model.eq).max(initial=0.0)),
        inequality=float(model.ineq.max(initial=0.0)),
        y_box=np.where((x - slope > problem.lower) & (x - slope < problem.upper), 0.0, natural - slope),
    )


def infeasible_stationary(problem: Problem, model: Model, x: Vector) -> float:
    """Return how far x is from a stationary point of the squared violation, relative to the violation; 0 at one."""
    over = np.maximum(model.ineq, 0.0)
    slope = model.eq_jac.T @ model.eq + model.in_jac.T @ over
    natural = x - np.clip(x - slope, problem.lower, problem.upper)
    size = max(float(np.abs(model.eq).max(initial=0.0)), float(over.max(initial=0.0)))
    return float(np.abs(natural).max(initial=0.0)) / size if size > 0.0 else np.inf


def worst_rows(equality: Vector, inequality: Vector, tolerance: float, count: int = 5) -> tuple[Violation, ...]:
    """Name the most violated rows beyond the tolerance, largest first."""
    rows = [Violation("equality", int(i), float(equality[i])) for i in np.flatnonzero(np.abs(equality) > tolerance)]
    rows += [Violation("inequality", int(i), float(inequality[i])) for i in np.flatnonzero(inequality > tolerance)]
    return tuple(sorted(rows, key=lambda row: -abs(row.value))[:count])
