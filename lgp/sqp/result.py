"""What a solve returns: status with advice, multipliers, recomputed residuals, and the log of the iterations."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from lgp.sqp.problem import Model, Problem
from reba.arrays import Array


class SolveStatus(Enum):
    """How a solve ended; the text says what to try."""

    OPTIMAL = "the optimality conditions hold within the tolerances"
    ACCEPTABLE = "constraints hold and the model promises no further decrease; tighten `decrease` to go on"
    INFEASIBLE = "no step reduces the violation; relax the rows named in `worst` or start elsewhere"
    UNBOUNDED = "the cost falls without end; add bounds or a term that holds the unknowns"
    STALLED = "no step improves cost and violation together; check the derivatives or scale the rows"
    ITERATIONS = "the iteration budget is spent; raise `iterations` or start from this result"
    TIME = "the time budget is spent; raise `seconds` or start from this result"
    BROKEN = "the problem returned values that are not finite; start from a point where it is defined"


@dataclass(frozen=True)
class ConstraintViolation:
    """One violated row: which block ("equality" or "inequality"), its index, and by how much."""

    block: str
    index: int
    value: float

    def __str__(self) -> str:
        return f"{self.block}[{self.index}] = {self.value:.3g}"


@dataclass(frozen=True)
class Iteration:
    """One line of the log: the state before the step, and the step."""

    cost: float
    equality: float
    """Largest |c(x)|."""
    inequality: float
    """Largest d(x), zero when all hold."""
    kkt: float
    """Relative stationarity and complementarity error."""
    step: float = 0.0
    """Largest entry of the accepted step."""
    length: float = 0.0
    """Share of the QP step that was taken."""
    penalty: float = 0.0
    """Price of violation in the merit function."""
    damping: float = 0.0
    """Added to the diagonal of the Hessian."""
    qp_solver: str = ""
    qp_iterations: int = 0
    corrected: bool = False
    """Whether a second-order correction was taken."""


@dataclass(frozen=True)
class Result:
    """Outcome of a solve. All residuals are recomputed from the problem at `x`.

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
    """Stationarity and complementarity error relative to max(1, |gradient|, |constraint forces|)."""
    equality: float
    """Largest |c(x)|."""
    inequality: float
    """Largest d(x), zero when all hold."""
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
        """One line: status, advice, and the rows that fail."""
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


def infeasible_stationary(problem: Problem, model: Model, x: Array) -> float:
    """Return how far x is from a stationary point of the squared violation, relative to the violation; 0 at one."""
    over = np.maximum(model.ineq, 0.0)
    slope = model.eq_jac.T @ model.eq + model.in_jac.T @ over
    natural = x - np.clip(x - slope, problem.lower, problem.upper)
    size = max(float(np.abs(model.eq).max(initial=0.0)), float(over.max(initial=0.0)))
    return float(np.abs(natural).max(initial=0.0)) / size if size > 0.0 else np.inf


def worst_rows(equality: Array, inequality: Array, tolerance: float, count: int = 5) -> tuple[ConstraintViolation, ...]:
    """Name the most violated rows beyond the tolerance, largest first."""
    rows = [
        ConstraintViolation("equality", int(i), float(equality[i]))
        for i in np.flatnonzero(np.abs(equality) > tolerance)
    ]
    rows += [
        ConstraintViolation("inequality", int(i), float(inequality[i])) for i in np.flatnonzero(inequality > tolerance)
    ]
    return tuple(sorted(rows, key=lambda row: -abs(row.value))[:count])
