"""Settings of a solve, with their defaults."""

from __future__ import annotations

from dataclasses import dataclass, fields

from lgp.sqp.problem import ProblemError


@dataclass(frozen=True)
class Options:
    """Tolerances and budgets; rows are taken as scaled by the problem (metres, radians).

    Raises:
        ProblemError: a tolerance or budget that is not positive.
    """

    violation: float = 1e-6
    """Largest violation of a row at a solution."""
    kkt: float = 1e-6
    """Largest relative stationarity and complementarity error of an OPTIMAL point."""
    decrease: float = 1e-10
    """Promised decrease, relative to max(1, |cost|), below which a point that holds its rows is ACCEPTABLE."""
    iterations: int = 100
    seconds: float = float("inf")
    """Wall time; checked between iterations."""
    longest_step: float = float("inf")
    """Largest change of an unknown in one iteration, e.g. 0.5 rad where constraints turn quickly."""
    patience: int = 6
    """Iterations without a tenth less violation before the end where rows contradict; the penalty is raised later."""
    penalty: float = 1.0
    """First price of violation; raised automatically."""

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not value > 0:
                raise ProblemError(f"option {field.name}: {value} given, a positive number expected")
