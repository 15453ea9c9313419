"""Globalisation: exact l1 merit function, penalty parameter, backtracking (Nocedal & Wright 2006, NW, ch. 18)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lgp.sqp.problem import Model, Values
from reba.arrays import Array

ARMIJO = 1e-4
"""Share of the predicted decrease that a step must achieve (sufficient decrease, NW eq. 3.4)."""
RHO = 0.1
"""rho of NW eq. 18.36: share of the penalised decrease in violation by which the merit function must fall."""
MIN_GAIN = 1e-10
"""Relative decrease in violation below which rounding, not the step, would set the penalty."""
TRIALS = 25
"""Points evaluated along a step; the last is shorter than 2^-24 of it."""


def violation_sum(equality: Array, inequality: Array) -> float:
    """Return sum |c| + sum max(d, 0), the l1 violation of the merit function."""
    return float(np.abs(equality).sum() + np.maximum(inequality, 0.0).sum())


def violation_max(equality: Array, inequality: Array) -> float:
    """Return the largest violation of a row."""
    return max(float(np.abs(equality).max(initial=0.0)), float(inequality.max(initial=0.0)))


@dataclass(frozen=True)
class PredictedReduction:
    """Terms of the decrease that the quadratic model predicts for a full step p."""

    slope: float
    """g'p."""
    curvature: float
    """p'Hp."""
    before: float
    """l1 violation at the point."""
    after: float
    """l1 violation of the linearised rows after the step."""

    def penalty(self, penalty: float) -> float:
        """Return the penalty, raised where the step would not descend on the merit function (NW eq. 18.36)."""
        gain = self.before - self.after
        if gain <= MIN_GAIN * max(1.0, self.before):
            return penalty
        needed = (self.slope + 0.5 * max(self.curvature, 0.0)) / ((1.0 - RHO) * gain)
        return penalty if penalty >= needed else 1.5 * needed

    def descent(self, penalty: float) -> float:
        """Return the bound on the directional derivative of the merit function, negative for a descent step."""
        return self.slope - penalty * (self.before - self.after)

    def decrease(self, penalty: float) -> float:
        """Return the predicted decrease of the merit function."""
        return -self.slope - 0.5 * self.curvature + penalty * (self.before - self.after)


def predict(model: Model, step: Array, curvature: float) -> PredictedReduction:
    """Return the predicted reduction of a step (n,) with p'Hp = curvature."""
    return PredictedReduction(
        slope=float(model.gradient @ step),
        curvature=curvature,
        before=violation_sum(model.eq, model.ineq),
        after=violation_sum(model.eq + model.eq_jac @ step, model.ineq + model.in_jac @ step),
    )


@dataclass(frozen=True)
class AcceptedStep:
    """A point with sufficient decrease of the merit function."""

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
    max_length: float,
    correct: Callable[[Values], Array | None],
) -> AcceptedStep | None:
    """Backtrack along a step until the merit function decreases sufficiently; None after `TRIALS` points.

    Args:
        merit, descent: merit function at x and the bound on its directional derivative (< 0).
        max_length: first step length, at most 1.
        correct: values of a failed full step -> second-order corrected step, or None; called once.
    """
    slack = 1e-14 * max(1.0, abs(merit))  # rounding error of the merit function

    def accepts(values: Values, length: float) -> bool:
        value = values[0] + penalty * violation_sum(values[1], values[2])
        return bool(np.isfinite(value)) and value <= merit + ARMIJO * length * descent + slack

    length = max_length
    for trial in range(TRIALS):
        point = x + length * step
        values = evaluate(point)
        if accepts(values, length):
            return AcceptedStep(point, values, length, corrected=False)
        if trial == 0 and length == 1.0 and np.isfinite(values[0]):
            corrected = correct(values)
            if corrected is not None:
                corrected_values = evaluate(x + corrected)
                if accepts(corrected_values, 1.0):
                    return AcceptedStep(x + corrected, corrected_values, 1.0, corrected=True)
        length *= _interpolated_factor(
            values[0] + penalty * violation_sum(values[1], values[2]), merit, descent * length
        )
    return None


def _interpolated_factor(value: float, merit: float, descent: float) -> float:
    """Return the factor on the length at the minimum of the interpolated quadratic (NW eq. 3.58), in [0.1, 0.5]."""
    curvature = value - merit - descent
    if not np.isfinite(curvature) or curvature <= 0.0:
        return 0.25
    return float(np.clip(-0.5 * descent / curvature, 0.1, 0.5))
