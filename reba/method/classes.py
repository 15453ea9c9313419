"""The rules as closed intervals: up to which angle each class of points reaches, with its text.

The vectorised scores compare angles with edges; a worksheet, the smallest improvement and sampling need the interval of
a class instead. Both come from the step table `reba.method.steps`.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass
from typing import Final

from reba.method.rules import Rules
from reba.method.steps import AngleSteps, Boundary, part_steps
from reba.posture.columns import COLUMNS_OF, GROUP_A, GROUP_B, SIDES

INF: Final = float("inf")
CLASS_TEXTS: Final[dict[str, tuple[str, ...]]] = {
    "trunk_flexion": (
        "upright (within {0:g})", "up to {1:g} of flexion or extension",
        "{1:g} to {2:g} of flexion, or over {1:g} of extension", "over {2:g}",
    ),
    "neck_flexion": ("0 to {0:g} of flexion", "over {0:g} of flexion, or in extension"),
    "knee_flexion": ("under {0:g}", "{0:g} to {1:g}", "over {1:g}"),
    "upper_arm_flexion": (
        "{0:g} of extension to {0:g} of flexion", "{0:g} to {1:g} of flexion, or over {0:g} of extension",
        "{1:g} to {2:g}", "over {2:g}",
    ),
    "lower_arm_flexion": ("{low:g} to {0:g}", "under {low:g} or over {0:g}"),
    "wrist_flexion": ("within {0:g}", "over {0:g} of flexion or extension"),
}  # fmt: skip
"""Class texts of the main angle of each part: {0}, {1}, {2} are the edges upwards, {low} is the first downwards."""


@dataclass(frozen=True)
class AngleClass:
    """A class of one angle: `points` while it lies from `low` to `high` [deg] (and in no class before it)."""

    points: int
    low: float
    high: float
    text: str


@dataclass(frozen=True)
class AngleClasses:
    """The classes of one angle.

    Attributes:
        part: column of the part score it counts for.
        name: for people: "trunk flexion".
        columns: angle columns (two knees count by the worse one).
        classes: nested, lowest points first; the last one holds every angle.
        adjusts: "" for the class of the part itself, else the group of adjustments that share one point.
    """

    part: str
    name: str
    columns: tuple[str, ...]
    classes: tuple[AngleClass, ...]
    adjusts: str = ""

    def class_of(self, angle: float) -> AngleClass:
        """Return the class of an angle [deg]."""
        return next(c for c in self.classes if c.low <= angle <= c.high)


@functools.lru_cache(maxsize=64)
def angle_classes(rules: Rules) -> tuple[AngleClasses, ...]:
    """Return the classes of every angle under the rules: Group A, then Group B of the left and of the right arm.

    Example:
        >>> trunk = angle_classes(Rules())[0]
        >>> trunk.class_of(62.0).text
        'over 60'
    """
    steps = part_steps(rules)
    places = [(part, "") for part in GROUP_A] + [(part, side) for side in SIDES for part in GROUP_B]
    return tuple(
        _classes(part, side, angle, steps[part].shares_point) for part, side in places for angle in steps[part].angles
    )


def _classes(part: str, side: str, steps: AngleSteps, shares_point: bool) -> AngleClasses:
    name = f"{side} {steps.angle}".strip().replace("_", " ").replace("lower arm", "elbow")
    # Adjustments add to the part's class, and bent knees to the support of the legs; other classes start at 1.
    adds = bool(steps.adjustment) or part == "legs"
    intervals = [*map(_closed, steps.boundaries), (-INF, INF)]
    classes = tuple(
        AngleClass(points, *interval, text)
        for points, (interval, text) in enumerate(zip(intervals, _texts(steps), strict=True), start=0 if adds else 1)
    )
    return AngleClasses(
        part=f"{part}_{side}" if side else part,
        name=name,
        columns=(f"{steps.angle}_{side}",) if side else COLUMNS_OF[steps.angle],
        classes=classes,
        adjusts="shared" if steps.adjustment and shares_point else name if adds else "",
    )


def _closed(boundary: Boundary) -> tuple[float, float]:
    """Return the interval inside a boundary; "less than" ends at the next number below the edge."""
    low = boundary.low if boundary.low_inside else math.nextafter(boundary.low, INF)
    high = boundary.high if boundary.high_inside else math.nextafter(boundary.high, -INF)
    return low, high


def _texts(steps: AngleSteps) -> tuple[str, ...]:
    first = steps.boundaries[0]
    if steps.adjustment:
        lowest = "up to" if first.low == -INF else "within"
        return (f"{lowest} {first.high:g}", f"{steps.adjustment} (over {first.high:g})")
    edges = [boundary.high for boundary in steps.boundaries]
    return tuple(text.format(*edges, low=first.low) for text in CLASS_TEXTS[steps.angle])
