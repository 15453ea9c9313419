"""Result of a solve: status with advice, multipliers, recomputed residuals, and the iteration log."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from lgp.sqp.problem import Model, Problem
from reba.arrays import Array


class SolveStatus(Enum):
    """How a solve ended; the text names the next step."""

    OPTIMAL = "the optimality conditions hold within the tolerances"
    ACCEPTABLE = "constraints hold, and the model or steps show no further decrease; tighten `decrease` to go on"
    INFEASIBLE = "no step reduces the violation; relax the rows named in `worst` or use another initial point"
    UNBOUNDED = "the cost has no lower bound; add bounds or a regularising term"
    STALLED = "no step improves cost and violation together; check the derivatives or scale the rows"
    ITERATIONS = "the iteration limit is reached; raise `iterations` or start from this result"
    TIME = "the time limit is reached; raise `seconds` or start from this result"
    BROKEN = "values are not finite; use an initial point at which the problem is defined"


@dataclass(frozen=True)
class ConstraintViolation:
    """One violated row: its block ("equality" or "inequality"), index and value."""

    block: str
    index: int
    value: float

    def __str__(self) -> str:
        return f"{self.block}[{self.index}] = {self.value:.3g}"


@dataclass(frozen=True)
class Iteration:
    """One line of the iteration log: the state before the step, and the step; costs in cost units of the problem."""

    cost: float
    equality: float
    """Largest |c(x)|."""
    inequality: float
    """Largest d(x), at least 0."""
    kkt: float
    """Relative stationarity and complementarity error."""
    step: float = 0.0
    """Largest entry of the accepted step."""
    length: float = 0.0
    """Step length: share of the QP step that was taken."""
    penalty: float = 0.0
    """Penalty parameter of the merit function."""
    damping: float = 0.0
    """Added to the diagonal of the Hessian."""
    qp_solver: str = ""
    qp_iterations: int = 0
    corrected: bool = False
    """Whether the step is a second-order correction."""


@dataclass(frozen=True)
class Result:
    """Outcome of a solve. All residuals are recomputed from the problem at `x`; multipliers are by its cost units.

    Example: `if not result: print(result.status.value, result.worst)`.
    """

    status: SolveStatus
    x: Array
    """(n,) last point, within its bounds."""
    cost: float
    y_eq: Array
    """(m_e,) multipliers of the equalities: gradient + J'y_eq + K'y_in + y_box = 0."""
    y_in: Array
    """(m_i,) multipliers of the inequalities, >= 0."""
    y_box: Array
    """(n,) multipliers of the bounds, > 0 at upper, < 0 at lower bounds."""
    kkt: float
    """Stationarity and complementarity error relative to max(1, |gradient|, |J'y_eq + K'y_in|)."""
    equality: float
    """Largest |c(x)|."""
    inequality: float
    """Largest d(x), at least 0."""
    worst: tuple[ConstraintViolation, ...]
    """Rows violated beyond the tolerance, largest first, at most five."""
    iterations: tuple[Iteration, ...]
    seconds: dict[str, float]
    """Wall time by part: evaluate, linearise, qp, total."""

    def __bool__(self) -> bool:
        return self.status in (SolveStatus.OPTIMAL, SolveStatus.ACCEPTABLE)

    @property
    def violation(self) -> float:
        """Largest violation of any row."""
        return max(self.equality, self.inequality)

    @property
    def message(self) -> str:
        """One line: status, advice, and the most violated rows."""
        rows = ", ".join(str(row) for row in self.worst)
        return f"{self.status.name.lower()}: {self.status.value}" + (f" ({rows})" if rows else "")


@dataclass(frozen=True)
class Residuals:
    """Errors of a point with multipliers; see `Result` for the units."""

    kkt: float
    equality: float
    inequality: float
    y_box: Array

    @property
    def violation(self) -> float:
        return max(self.equality, self.inequality)


def residuals(problem: Problem, model: Model, x: Array, y_eq: Array, y_in: Array) -> Residuals:
    """Recompute stationarity, complementarity and violation at x (n,) from the model there.

    Stationarity is the natural residual |x - clip(x - r, lower, upper)| with r the gradient of the Lagrangian without
    the bounds; the multipliers of the bounds follow from it.
    """
    constraint_gradient = model.eq_jac.T @ y_eq + model.in_jac.T @ y_in
    gradient = model.gradient + constraint_gradient
    natural = x - np.clip(x - gradient, problem.lower, problem.upper)
    complementarity = np.minimum(y_in, -model.ineq)
    size = max(1.0, float(np.abs(model.gradient).max(initial=0.0)), float(np.abs(constraint_gradient).max(initial=0.0)))
    error = max(
        float(np.abs(natural).max(initial=0.0)),
        float(np.where(y_in > 0.0, np.abs(complementarity), 0.0).max(initial=0.0)),
    )
    return Residuals(
        kkt=error / size,
        equality=float(np.abs(model.eq).max(initial=0.0)),
        inequality=float(model.ineq.max(initial=0.0)),
        y_box=np.where((x - gradient > problem.lower) & (x - gradient < problem.upper), 0.0, natural - gradient),
    )


def infeasible_stationarity(problem: Problem, model: Model, x: Array) -> float:
    """Return the stationarity error of the squared violation at x, relative to the violation; inf at a feasible x."""
    excess = np.maximum(model.ineq, 0.0)
    gradient = model.eq_jac.T @ model.eq + model.in_jac.T @ excess
    natural = x - np.clip(x - gradient, problem.lower, problem.upper)
    size = max(float(np.abs(model.eq).max(initial=0.0)), float(excess.max(initial=0.0)))
    return float(np.abs(natural).max(initial=0.0)) / size if size > 0.0 else np.inf


WORST_ROWS = 5
"""Violated rows named in a result: more do not fit into a message."""


def worst_rows(equality: Array, inequality: Array, tolerance: float) -> tuple[ConstraintViolation, ...]:
    """Return the most violated rows beyond the tolerance, largest first."""
    rows = [
        ConstraintViolation("equality", int(i), float(equality[i]))
        for i in np.flatnonzero(np.abs(equality) > tolerance)
    ]
    rows += [
        ConstraintViolation("inequality", int(i), float(inequality[i])) for i in np.flatnonzero(inequality > tolerance)
    ]
    return tuple(sorted(rows, key=lambda row: -abs(row.value))[:WORST_ROWS])
