"""The steps of the REBA part scores as data: which angle, past which threshold, in which group.

A step adds its height to a part score once an angle passes a threshold in one direction (`sense` +1: above, -1: below);
a mirrored step (`sense` 0) counts in both directions with one threshold, as for twist and side bend. Thresholds are
written along the direction of the step: extension over 20 deg has sense -1 and threshold 20, an elbow under 60 deg
sense -1 and threshold -60. Left and right arm share every step.

Source of the classes: `reba.method.rules` (Hignett & McAtamney 2000 and the open choices of a `reba.Rules` record).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from reba.arrays import Array, Indices
from reba.method.rules import KNEE_EDGES, LOWER_ARM_RANGE, NECK_EDGE, TRUNK_EDGES, UPPER_ARM_EDGES, WRIST_EDGE, Rules
from reba.posture.columns import INDEX, SIDES


class ClassStep(NamedTuple):
    """One step: the angle (a column, or its name without a side), its group, its sense and its threshold [deg]."""

    angle: str
    group: str
    sense: int
    threshold: float


def steps_of(rules: Rules) -> tuple[ClassStep, ...]:
    """Return the 27 steps under the rules; order and number do not depend on them.

    Example:
        >>> steps_of(Rules())[4]
        Step(angle='trunk_flexion', group='trunk', sense=1, threshold=60.0)
    """
    arm, wrist = UPPER_ARM_EDGES, WRIST_EDGE
    return (
        ClassStep("trunk_flexion", "trunk", -1, TRUNK_EDGES[0]),
        ClassStep("trunk_flexion", "trunk", -1, rules.trunk_upright),
        ClassStep("trunk_flexion", "trunk", 1, rules.trunk_upright),
        ClassStep("trunk_flexion", "trunk", 1, TRUNK_EDGES[0]),
        ClassStep("trunk_flexion", "trunk", 1, TRUNK_EDGES[1]),
        ClassStep("trunk_twist", "trunk+", 0, rules.trunk_twist),
        ClassStep("trunk_side_bend", "trunk++", 0, rules.trunk_side_bend),
        ClassStep("neck_flexion", "neck", -1, rules.neck_upright),
        ClassStep("neck_flexion", "neck", 1, NECK_EDGE),
        ClassStep("neck_twist", "neck+", 0, rules.neck_twist),
        ClassStep("neck_side_bend", "neck++", 0, rules.neck_side_bend),
        ClassStep(WORSE_KNEE, "legs", 1, KNEE_EDGES[0]),
        ClassStep(WORSE_KNEE, "legs", 1, KNEE_EDGES[1]),
        ClassStep("upper_arm_flexion", "upper_arm", -1, arm[0]),
        ClassStep("upper_arm_flexion", "upper_arm", 1, arm[0]),
        ClassStep("upper_arm_flexion", "upper_arm", 1, arm[1]),
        ClassStep("upper_arm_flexion", "upper_arm", 1, arm[2]),
        ClassStep("upper_arm_abduction", "upper_arm", 1, rules.abduction),
        ClassStep("shoulder_elevation", "upper_arm", 1, rules.shoulder_elevation),
        ClassStep("lower_arm_flexion", "lower_arm", -1, -LOWER_ARM_RANGE[0]),
        ClassStep("lower_arm_flexion", "lower_arm", 1, LOWER_ARM_RANGE[1]),
        ClassStep("wrist_flexion", "wrist", -1, wrist),
        ClassStep("wrist_flexion", "wrist", 1, wrist),
        ClassStep("wrist_deviation", "wrist+", -1, rules.wrist_deviation),
        ClassStep("wrist_deviation", "wrist+", 1, rules.wrist_deviation),
        ClassStep("wrist_twist", "wrist++", -1, rules.wrist_twist),
        ClassStep("wrist_twist", "wrist++", 1, rules.wrist_twist),
    )


WORSE_KNEE: Final = "worse knee"
"""Stands for the larger of both knee flexions, column 22 of the angles as the soft tables see them."""
GROUPS: Final = (
    "trunk", "neck", "wrist left", "wrist right",
    "trunk+", "neck+", "wrist+ left", "wrist+ right",
    "trunk++", "neck++", "wrist++ left", "wrist++ right",
    "legs", "upper_arm left", "upper_arm right", "lower_arm left", "lower_arm right",
)  # fmt: skip
"""Groups of steps: four parts with a class and two adjustments that share one point (+ and ++), then the others."""
PAIRED: Final = np.array([0, 3, 7, 8])
"""Places among the nine parts (see `PARTS`) of the first four groups."""
SINGLE: Final = np.array([6, 1, 2, 4, 5])
"""Places among the nine parts of the last five groups."""
PARTS: Final = (
    "trunk", "upper_arm_left", "upper_arm_right",
    "neck", "lower_arm_left", "lower_arm_right",
    "legs", "wrist_left", "wrist_right",
)  # fmt: skip
"""The parts as (index of a table, table): first, second, third index of Table A, of B left and of B right."""


class StepRows(NamedTuple):
    """Every step written out once a side and a direction.

    Attributes:
        step: (r,) number of the step each row belongs to.
        column: (r,) column among the 22 angles and the worse knee (22).
        sense: (r,) +1.0 or -1.0.
        group: (r,) number of the row's group in `GROUPS`.
    """

    step: Indices
    column: Indices
    sense: Array
    group: Indices


def _rows() -> StepRows:
    found: list[tuple[int, int, float, int]] = []
    for number, step in enumerate(STEPS):
        columns = {**INDEX, WORSE_KNEE: len(INDEX)}
        if step.angle in columns:
            places = [(columns[step.angle], step.group)]
        else:
            places = [(columns[f"{step.angle}_{side}"], f"{step.group} {side}") for side in SIDES]
        senses = (1.0, -1.0) if step.sense == 0 else (float(step.sense),)
        found += [(number, column, sense, GROUPS.index(group)) for column, group in places for sense in senses]
    table = [np.array(entries) for entries in zip(*found, strict=True)]
    return StepRows(*table)


STEPS: Final = steps_of(Rules())
"""The steps under the default rules."""
ROWS: Final = _rows()
"""The 45 rows of the steps."""
