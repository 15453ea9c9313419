"""The step table: every edge at which an angle raises a part score, once, for scores, classes and smooth models.

A part score rises by one where an angle passes an edge in the direction of the step. Edges are written along that
direction: extension over 20 deg has sense -1 and edge 20, an elbow under 60 deg sense -1 and edge -60. Edges are
printed in [HM2000] or open choices of a `Rules` record; left and right share every step.
"""

from __future__ import annotations

import functools
import itertools
import math
import operator
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.method.rules import Rules
from reba.posture.columns import COLUMNS_OF, INDEX


class ClassStep(NamedTuple):
    """One step of a part score.

    Attributes:
        angle: angle name without a side; of two knees the one bent further counts.
        part: body part without a side.
        sense: +1 above the edge, -1 below minus the edge, 0 either.
        edge: [deg] a printed number, or the field of `Rules` that holds it.
        adjustment: "" for a class of the part's main angle, else the word for the point that is added.
        inclusive: whether an angle on the edge passes it; None: as `Rules.edges` says.
    """

    angle: str
    part: str
    sense: int
    edge: float | str
    adjustment: str = ""
    inclusive: bool | None = False

    def threshold(self, rules: Rules) -> float:
        """Return the edge under the rules [deg], along the direction of the step."""
        return float(getattr(rules, self.edge) if isinstance(self.edge, str) else self.edge)

    def includes_edge(self, rules: Rules) -> bool:
        """Return whether an angle on the edge passes it under the rules."""
        return rules.edges == "upper" if self.inclusive is None else self.inclusive


STEPS: Final[tuple[ClassStep, ...]] = (
    ClassStep("trunk_flexion", "trunk", -1, 20.0, inclusive=None),
    ClassStep("trunk_flexion", "trunk", -1, "trunk_upright"),
    ClassStep("trunk_flexion", "trunk", +1, "trunk_upright"),
    ClassStep("trunk_flexion", "trunk", +1, 20.0, inclusive=None),
    ClassStep("trunk_flexion", "trunk", +1, 60.0, inclusive=None),
    ClassStep("trunk_twist", "trunk", 0, "trunk_twist", "twisted"),
    ClassStep("trunk_side_bend", "trunk", 0, "trunk_side_bend", "side flexed"),
    ClassStep("neck_flexion", "neck", -1, "neck_upright"),
    ClassStep("neck_flexion", "neck", +1, 20.0, inclusive=None),
    ClassStep("neck_twist", "neck", 0, "neck_twist", "twisted"),
    ClassStep("neck_side_bend", "neck", 0, "neck_side_bend", "side flexed"),
    ClassStep("knee_flexion", "legs", +1, 30.0, inclusive=True),  # printed "30 to 60": 30 is inside
    ClassStep("knee_flexion", "legs", +1, 60.0, inclusive=None),
    ClassStep("upper_arm_flexion", "upper_arm", -1, 20.0, inclusive=None),
    ClassStep("upper_arm_flexion", "upper_arm", +1, 20.0, inclusive=None),
    ClassStep("upper_arm_flexion", "upper_arm", +1, 45.0, inclusive=None),
    ClassStep("upper_arm_flexion", "upper_arm", +1, 90.0, inclusive=None),
    ClassStep("upper_arm_abduction", "upper_arm", +1, "abduction", "abducted"),
    ClassStep("shoulder_elevation", "upper_arm", +1, "shoulder_elevation", "raised"),
    ClassStep("lower_arm_flexion", "lower_arm", -1, -60.0),  # printed "60 to 100": 60 is inside
    ClassStep("lower_arm_flexion", "lower_arm", +1, 100.0, inclusive=None),
    ClassStep("wrist_flexion", "wrist", -1, 15.0, inclusive=None),
    ClassStep("wrist_flexion", "wrist", +1, 15.0, inclusive=None),
    ClassStep("wrist_deviation", "wrist", -1, "wrist_deviation", "bent"),
    ClassStep("wrist_deviation", "wrist", +1, "wrist_deviation", "bent"),
    ClassStep("wrist_twist", "wrist", -1, "wrist_twist", "twisted"),
    ClassStep("wrist_twist", "wrist", +1, "wrist_twist", "twisted"),
)
"""The 27 steps; model files of soft tables hold one number for each, in this order."""


class Boundary(NamedTuple):
    """The edges between one class of an angle and the next: an angle outside low to high [deg] is in the next one.

    Attributes:
        low, high: infinite where only the other direction counts.
        low_inside, high_inside: whether an angle on the edge still belongs to the lower class.
    """

    low: float
    high: float
    low_inside: bool
    high_inside: bool


def outside(angle: Array, boundary: Boundary) -> NDArray[np.uint8]:
    """Return 1 where angles lie outside a boundary, that is in a higher class, else 0.

    >>> outside(np.array([20.0, 21.0]), Boundary(-5.0, 20.0, True, True)).tolist()
    [0, 1]
    """
    low, high, low_inside, high_inside = boundary
    beyond = np.asarray(angle > high if high_inside else angle >= high)
    if low > -np.inf:
        beyond |= angle < low if low_inside else angle <= low
    return beyond.view(np.uint8)  # adding booleans would cast them again and again


class AngleSteps(NamedTuple):
    """The steps of one angle.

    Attributes:
        angle: name without a side.
        rows: place of its column in `COLUMNS`, or a slice of the left and the right one.
        boundaries: from the lowest class up.
        adjustment: as in `ClassStep`.
    """

    angle: str
    rows: int | slice
    boundaries: tuple[Boundary, ...]
    adjustment: str


class PartSteps(NamedTuple):
    """The steps of a body part: main angle first, and whether its two adjustments give one point together."""

    angles: tuple[AngleSteps, ...]
    shares_point: bool


@functools.lru_cache(maxsize=64)
def part_steps(rules: Rules) -> dict[str, PartSteps]:
    """Return the steps of each body part under the rules.

    The wrist gives +1 for bent from the midline or twisted, as printed; trunk and neck as `Rules.twist_and_bend` says;
    the upper arm one point each for abducted and raised.

    Example:
        >>> part_steps(Rules())["neck"].angles[0].boundaries
        (Boundary(low=-5.0, high=20.0, low_inside=True, high_inside=True),)
    """
    angles: dict[str, list[AngleSteps]] = {}
    for (angle, part, adjustment), steps in itertools.groupby(STEPS, operator.itemgetter(0, 1, 4)):
        edges = sorted((step.threshold(rules), not step.includes_edge(rules), step.sense) for step in steps)
        up = [(edge, inside) for edge, inside, sense in edges if sense >= 0]
        down = [(-edge, inside) for edge, inside, sense in edges if sense <= 0]
        pairs = itertools.zip_longest(down, up)
        boundaries = tuple(
            Boundary(low, high, low_inside, high_inside)
            for (low, low_inside), (high, high_inside) in (
                (below or (-math.inf, True), above or (math.inf, True)) for below, above in pairs
            )
        )
        columns = COLUMNS_OF[angle]
        first = INDEX[columns[0]]
        rows = first if len(columns) == 1 else slice(first, first + 2)
        angles.setdefault(part, []).append(AngleSteps(angle, rows, boundaries, adjustment))
    shared = ("trunk", "neck", "wrist") if rules.twist_and_bend == "one" else ("wrist",)
    return {part: PartSteps(tuple(steps), part in shared) for part, steps in angles.items()}
