"""The step table of `reba.method.steps` as arrays: one row for each step, side and direction, in groups that add up."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from reba.arrays import Array, Indices
from reba.method.steps import STEPS, ClassStep
from reba.posture.columns import GROUP_A, INDEX, SIDES

GROUPS: Final = (
    "trunk", "neck", "wrist left", "wrist right",
    "trunk+", "neck+", "wrist+ left", "wrist+ right",
    "trunk++", "neck++", "wrist++ left", "wrist++ right",
    "legs", "upper_arm left", "upper_arm right", "lower_arm left", "lower_arm right",
)  # fmt: skip
"""Groups of steps: four parts with a class and two adjustments that share one point (+ and ++), then the others."""
PAIRED: Final = np.array([0, 3, 7, 8])
"""Places of the first four groups among the nine parts: first, second, third index of Table A, of B left, B right."""
SINGLE: Final = np.array([6, 1, 2, 4, 5])
"""Places among the nine parts of the last five groups."""


class StepRows(NamedTuple):
    """Every step written out once a side and a direction, r rows.

    Attributes:
        step: number of the step each row belongs to.
        column: column among the 22 angles and the larger of both knee flexions (22).
        sense: +1.0 or -1.0.
        group: number of the row's group in `GROUPS`.
    """

    step: Indices
    column: Indices
    sense: Array
    group: Indices


def _group(step: ClassStep) -> str:
    """Return the group of a step without its side; abducted and raised add up with the classes of the upper arm."""
    if not step.adjustment or step.part == "upper_arm":
        return step.part
    adjustments = list(dict.fromkeys(one.adjustment for one in STEPS if one.part == step.part and one.adjustment))
    return step.part + "+" * (1 + adjustments.index(step.adjustment))


def _rows() -> StepRows:
    rows: list[tuple[int, int, float, int]] = []
    for number, step in enumerate(STEPS):
        group = _group(step)
        if step.part in GROUP_A:
            places = [(INDEX.get(step.angle, len(INDEX)), group)]
        else:
            places = [(INDEX[f"{step.angle}_{side}"], f"{group} {side}") for side in SIDES]
        senses = (1.0, -1.0) if step.sense == 0 else (float(step.sense),)
        rows += [(number, column, sense, GROUPS.index(name)) for column, name in places for sense in senses]
    return StepRows(*(np.array(entries) for entries in zip(*rows, strict=True)))


ROWS: Final = _rows()
"""The 45 rows of the steps."""
