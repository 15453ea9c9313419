"""What a solve returns: status with advice, multipliers, recomputed residuals, and the log of the iterations."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from lgp.sqp.problem import Vector


class Status(Enum):
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
class Violation:
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

    status: Status
    x: Vector
    """(n,) last point, within its bounds."""
    cost: float
    y_eq: Vector
    """(m_e,) multipliers of the equalities: gradient + J'y_eq + K'y_in + y_box = 0."""
    y_in: Vector
    """(m_i,) multipliers of the inequalities, >= 0."""
    y_box: Vector
    """(n,) multipliers of the bounds, > 0 at upper, < 0 at lower bounds."""
    kkt: float
    """Stationarity and complementarity error relative to max(1, |gradient|, |constraint forces|)."""
    equality: float
    """Largest |c(x)|."""
    inequality: float
    """Largest d(x), zero when all hold."""
    worst: tuple[Violation, ...]
    """Rows violated beyond the tolerance, largest first, at most five."""
    iterations: tuple[Iteration, ...]
    seconds: dict[str, float]
    """Wall time by part: evaluate, linearise, qp, total."""

    def __bool__(self) -> bool:
        return self.status in (Status.OPTIMAL, Status.ACCEPTABLE)

    @property
    def violation(self) -> float:
        """Largest violation of any row."""
        return max(self.equality, self.inequality)

    @property
    def message(self) -> str:
        """One line: status, advice, and the rows that fail."""
        rows = ", ".join(str(row) for row in self.worst)
        return f"{self.status.name.lower()}: {self.status.value}" + (f" ({rows})" if rows else "")
