"""What each angle may be for a given number of points: the rules written as closed intervals.

The vectorised core compares angles with edges; explaining a frame and finding the smallest change need the same rules
the other way round: up to which angle a class reaches. Both are tested against each other on every class.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from reba.method.rules import KNEE_EDGES, LOWER_ARM_RANGE, NECK_EDGE, TRUNK_EDGES, UPPER_ARM_EDGES, WRIST_EDGE, Rules
from reba.posture.columns import SIDES

INF: Final = float("inf")


@dataclass(frozen=True)
class Class:
    """A class of one angle: `points` while it lies from `low` to `high` [deg] (and in no class before it)."""

    points: int
    low: float
    high: float
    text: str


@dataclass(frozen=True)
class AngleClasses:
    """An angle as a part score sees it.

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
    classes: tuple[Class, ...]
    adjusts: str = ""

    def class_of(self, angle: float) -> Class:
        """Return the class of an angle [deg]."""
        return next(c for c in self.classes if c.low <= angle <= c.high)


def just_below(edge: float) -> float:
    """Return the next number below an edge, which stands for "less than" in a closed interval."""
    return math.nextafter(edge, -INF)


def angle_classes(rules: Rules) -> tuple[AngleClasses, ...]:
    """Return every angle with its classes under the rules.

    Example:
        >>> trunk = quantities(Rules())[0]
        >>> trunk.class_of(62.0).text
        'over 60'
    """

    def top(edge: float) -> float:
        """The highest angle of the class below a printed edge."""
        return edge if rules.edges == "lower" else just_below(edge)

    shared = "twist or bend" if rules.twist_and_bend == "one" else ""
    e1, e2, e3 = map(top, UPPER_ARM_EDGES)
    t1, t2 = map(top, TRUNK_EDGES)
    w1 = top(WRIST_EDGE)
    upright = rules.trunk_upright
    found = [
        AngleClasses(
            "trunk",
            "trunk flexion",
            ("trunk_flexion",),
            (
                Class(1, -upright, upright, f"upright (within {upright:g})"),
                Class(2, -t1, t1, f"up to {TRUNK_EDGES[0]:g} of flexion or extension"),
                Class(3, -INF, t2, f"{TRUNK_EDGES[0]:g} to {TRUNK_EDGES[1]:g} of flexion, or over 20 of extension"),
                Class(4, -INF, INF, f"over {TRUNK_EDGES[1]:g}"),
            ),
        ),
        _within("trunk", "trunk twist", "trunk_twist", rules.trunk_twist, shared or "twist", "twisted"),
        _within("trunk", "trunk side bend", "trunk_side_bend", rules.trunk_side_bend, shared or "bend", "side flexed"),
        AngleClasses(
            "neck",
            "neck flexion",
            ("neck_flexion",),
            (
                Class(1, -rules.neck_upright, top(NECK_EDGE), f"0 to {NECK_EDGE:g} of flexion"),
                Class(2, -INF, INF, f"over {NECK_EDGE:g} of flexion, or in extension"),
            ),
        ),
        _within("neck", "neck twist", "neck_twist", rules.neck_twist, shared or "twist", "twisted"),
        _within("neck", "neck side bend", "neck_side_bend", rules.neck_side_bend, shared or "bend", "side flexed"),
        AngleClasses(
            "legs",
            "knee flexion",
            tuple(f"knee_flexion_{side}" for side in SIDES),
            (
                Class(0, -INF, just_below(KNEE_EDGES[0]), f"under {KNEE_EDGES[0]:g}"),
                Class(1, -INF, top(KNEE_EDGES[1]), f"{KNEE_EDGES[0]:g} to {KNEE_EDGES[1]:g}"),
                Class(2, -INF, INF, f"over {KNEE_EDGES[1]:g}"),
            ),
            "knees",
        ),
    ]
    for side in SIDES:
        arm, forearm, wrist = f"upper_arm_{side}", f"lower_arm_{side}", f"wrist_{side}"
        found += [
            AngleClasses(
                arm,
                f"{side} upper arm flexion",
                (f"upper_arm_flexion_{side}",),
                (
                    Class(1, -e1, e1, f"{UPPER_ARM_EDGES[0]:g} of extension to {UPPER_ARM_EDGES[0]:g} of flexion"),
                    Class(2, -INF, e2, f"20 to {UPPER_ARM_EDGES[1]:g} of flexion, or over 20 of extension"),
                    Class(3, -INF, e3, f"{UPPER_ARM_EDGES[1]:g} to {UPPER_ARM_EDGES[2]:g}"),
                    Class(4, -INF, INF, f"over {UPPER_ARM_EDGES[2]:g}"),
                ),
            ),
            _up_to(arm, f"{side} upper arm abduction", f"upper_arm_abduction_{side}", rules.abduction, "abducted"),
            _up_to(arm, f"{side} shoulder elevation", f"shoulder_elevation_{side}", rules.shoulder_elevation, "raised"),
            AngleClasses(
                forearm,
                f"{side} elbow flexion",
                (f"lower_arm_flexion_{side}",),
                (
                    Class(1, LOWER_ARM_RANGE[0], top(LOWER_ARM_RANGE[1]), "60 to 100"),
                    Class(2, -INF, INF, "under 60 or over 100"),
                ),
            ),
            AngleClasses(
                wrist,
                f"{side} wrist flexion",
                (f"wrist_flexion_{side}",),
                (
                    Class(1, -w1, w1, f"within {WRIST_EDGE:g}"),
                    Class(2, -INF, INF, f"over {WRIST_EDGE:g} of flexion or extension"),
                ),
            ),
            _within(
                wrist, f"{side} wrist deviation", f"wrist_deviation_{side}", rules.wrist_deviation, "wrist", "bent"
            ),
            _within(wrist, f"{side} wrist twist", f"wrist_twist_{side}", rules.wrist_twist, "wrist", "twisted"),
        ]
    return tuple(found)


def _within(part: str, name: str, column: str, limit: float, adjusts: str, word: str) -> AngleClasses:
    classes = (Class(0, -limit, limit, f"within {limit:g}"), Class(1, -INF, INF, f"{word} (over {limit:g})"))
    return AngleClasses(part, name, (column,), classes, adjusts)


def _up_to(part: str, name: str, column: str, limit: float, word: str) -> AngleClasses:
    classes = (Class(0, -INF, limit, f"up to {limit:g}"), Class(1, -INF, INF, f"{word} (over {limit:g})"))
    return AngleClasses(part, name, (column,), classes, name)
