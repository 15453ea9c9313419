"""Globalisation: the exact l1 merit function, its penalty, and backtracking on it (Nocedal & Wright 2006, ch. 18)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lgp.sqp.problem import Model, Values
from reba.arrays import Array

SUFFICIENT = 1e-4
"""Share of the promised decrease that a step must keep (Armijo)."""
SPARED = 0.1
"""Share of the promised decrease in violation that the penalty leaves to the merit function."""
NOTICED = 1e-10
"""Relative gain in violation below which rounding, not the step, would set the penalty."""


def violation_sum(equality: Array, inequality: Array) -> float:
    """Return sum |c| + sum max(d, 0), what the merit function prices."""
    return float(np.abs(equality).sum() + np.maximum(inequality, 0.0).sum())


def violation_max(equality: Array, inequality: Array) -> float:
    """Return the largest violation of a row."""
    return max(float(np.abs(equality).max(initial=0.0)), float(inequality.max(initial=0.0)))


@dataclass(frozen=True)
class PredictedReduction:
    """What the quadratic model promises for a full step p."""

    slope: float
    """g'p."""
    curvature: float
    """p'Hp."""
    before: float
    """Violation (sum) at the point."""
    after: float
    """Violation (sum) of the linearised rows after the step."""

    def penalty(self, penalty: float) -> float:
        """Return the penalty raised, where needed, so that the step descends on the merit function (N&W eq. 18.36)."""
        gain = self.before - self.after
        if gain <= NOTICED * max(1.0, self.before):
            return penalty
        needed = (self.slope + 0.5 * max(self.curvature, 0.0)) / ((1.0 - SPARED) * gain)
        return penalty if penalty >= needed else 1.5 * needed

    def descent(self, penalty: float) -> float:
        """Return the bound on the directional derivative of the merit function, negative for a descent step."""
        return self.slope - penalty * (self.before - self.after)

    def decrease(self, penalty: float) -> float:
        """Return the decrease of the merit function that the quadratic model promises."""
        return -self.slope - 0.5 * self.curvature + penalty * (self.before - self.after)


def predict(model: Model, step: Array, curvature: float) -> PredictedReduction:
    """Return what the model promises for a step (n,) with p'Hp = curvature."""
    return PredictedReduction(
        slope=float(model.gradient @ step),
        curvature=curvature,
        before=violation_sum(model.eq, model.ineq),
        after=violation_sum(model.eq + model.eq_jac @ step, model.ineq + model.in_jac @ step),
    )


@dataclass(frozen=True)
class AcceptedStep:
    """A point the merit function accepts."""

    x: Array
    values: Values
    length: float
    corrected: bool


def line_search(
    evaluate: Callable[[Array], Values],
    x: Array,
    step: Array,
    merit: float,
    descent: float,
    penalty: float,
    *,
    longest: float,
    correct: Callable[[Values], Array | None],
    trials: int = 25,
) -> AcceptedStep | None:
    """Backtrack along a step until the merit function falls enough.

    Args:
        evaluate: the problem's values.
        merit, descent: merit function at x and the bound on its directional derivative (< 0).
        longest: first length tried, at most 1.
        correct: asked once, when the full step fails: given its values, a second-order corrected step or None.
        trials: evaluations along the step.

    Returns:
        The accepted point, or None.
    """
    slack = 1e-14 * max(1.0, abs(merit))  # differences below rounding decide nothing

    def accepts(values: Values, length: float) -> bool:
        found = values[0] + penalty * violation_sum(values[1], values[2])
        return bool(np.isfinite(found)) and found <= merit + SUFFICIENT * length * descent + slack

    length = longest
    for trial in range(trials):
        point = x + length * step
        values = evaluate(point)
        if accepts(values, length):
            return AcceptedStep(point, values, length, corrected=False)
        if trial == 0 and length == 1.0 and np.isfinite(values[0]):
            corrected = correct(values)
            if corrected is not None:
                again = evaluate(x + corrected)
                if accepts(again, 1.0):
                    return AcceptedStep(x + corrected, again, 1.0, corrected=True)
        length *= _shorter(values[0] + penalty * violation_sum(values[1], values[2]), merit, descent * length)
    return None


def _shorter(found: float, merit: float, descent: float) -> float:
    """Return the factor on the length that minimises the parabola through merit, descent and the failed value."""
    bend = found - merit - descent
    if not np.isfinite(bend) or bend <= 0.0:
        return 0.25
    return float(np.clip(-0.5 * descent / bend, 0.1, 0.5))
