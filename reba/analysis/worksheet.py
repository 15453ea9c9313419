"""The worksheet of one frame, as on paper: every point with its angle and rule."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, fields
from typing import Any, Final

import numpy as np
import pandas as pd

from reba.analysis.expected_exposure import frame_distribution
from reba.analysis.score_table import ScoreTable
from reba.method.classes import AngleClasses, angle_classes
from reba.method.factor_points import knees_count, leg_points
from reba.method.rules import load_points
from reba.method.scoring import SCORE_COLUMNS, score_angles
from reba.method.tables import ACTION_LEVELS, PART_MAXIMA
from reba.posture.angles import against_gravity
from reba.posture.columns import GROUP_A, GROUP_B, INDEX, SIDES
from reba.posture.factors import COUPLINGS, SUPPORTS, Factors

_TABLES: Final = {"table_a": ("score_a", "load_force")} | {
    f"table_{table}_{side}": (f"{total}_{side}", extra)
    for side in SIDES
    for table, total, extra in (("b", "score_b", f"coupling_{side}"), ("c", "reba", "activity"))
}
"""Table -> the score that it gives, and the points that are added to it for that."""


@dataclass(frozen=True)
class WorksheetLine:
    """One line of the worksheet.

    Attributes:
        part: column of the part score ("trunk", "wrist_left", "load_force" ...).
        points: what the line adds (or takes off); None where the angle was not measured.
        what: the quantity: "trunk flexion".
        value: its value in degrees, kilograms or words; "not measured".
        rule: the rule that applied: "20 to 60 of flexion".
        least: the points that any posture gets from this line.
        possible: lowest and highest points that an unmeasured angle may give; None where `points` are known.
    """

    part: str
    points: int | None
    what: str
    value: str
    rule: str
    least: int = 0
    possible: tuple[int, int] | None = None


@dataclass(frozen=True)
class Worksheet:
    """The worksheet of one frame.

    Attributes:
        time: [s] of the frame.
        lines: every rule that applied, in worksheet order.
        scores: the row of the score table; None where undetermined.
        risk, action: name of the action level and what it asks for; "" where undetermined.
        rules: name of the rules.
        error: name of the measurement error, "" without one.
        distribution: the columns of the score table that it adds; None where undetermined.
        ranges: lowest and highest value of every score and table, whatever the unmeasured angles are.
    """

    time: float
    lines: tuple[WorksheetLine, ...]
    scores: dict[str, int | None]
    risk: str
    action: str
    rules: str
    error: str = ""
    distribution: dict[str, float | None] = field(default_factory=dict)
    ranges: dict[str, tuple[int, int]] = field(default_factory=dict)

    def of(self, part: str) -> tuple[WorksheetLine, ...]:
        """Return the lines of one part."""
        return tuple(line for line in self.lines if line.part == part)

    @property
    def tables(self) -> dict[str, int | None]:
        """The values of Tables A, B and C, as they stand on the paper worksheet; None where undetermined."""
        values = {name: (self.scores[total], self.scores[extra]) for name, (total, extra) in _TABLES.items()}
        return {name: None if a is None or b is None else a - b for name, (a, b) in values.items()}

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {**asdict(self), "tables": self.tables}


def worksheet(scores: ScoreTable, frame: int) -> Worksheet:
    """Return the worksheet of a frame (row of the score table)."""
    row = scores.data.iloc[frame]
    known = {name: None if pd.isna(row[name]) else int(row[name]) for name in SCORE_COLUMNS}
    chances = frame_distribution(scores, frame)
    angles = np.array(scores.angles[frame], np.float64).reshape(-1, 1)
    if scores.rules.upper_arm_reference == "gravity":
        against_gravity(angles)
    by_part: dict[str, list[AngleClasses]] = {}
    for quantity in angle_classes(scores.rules):
        by_part.setdefault(quantity.part, []).append(quantity)
    lines: list[WorksheetLine] = []
    for part in GROUP_A:
        lines += _support(scores, frame) if part == "legs" else []
        lines += _part(
            by_part[part], angles[:, 0], part != "legs" or bool(knees_count(_support_code(scores, frame), scores.rules))
        )
    lines += _load(scores, frame)
    for side in SIDES:
        for part in GROUP_B:
            lines += _part(by_part[f"{part}_{side}"], angles[:, 0], True)
            if part == "upper_arm":
                lines += _supported(scores, frame, side, lines)
        lines += _coupling(scores, frame, side)
    lines += _activity(scores, frame)
    level = known["action_level"]
    risk, action = ACTION_LEVELS[level] if level is not None else ("", "")
    error = "" if scores.error is None else scores.error.name
    name, ranges = scores.rules.name, _ranges(scores, frame)
    return Worksheet(float(row["time"]), tuple(lines), known, risk, action, name, error, chances, ranges)


def _ranges(scores: ScoreTable, frame: int) -> dict[str, tuple[int, int]]:
    """Return the range of every score and table of a frame; tables and scores rise with every part."""
    used = Factors(**{one.name: _at(getattr(scores.factors, one.name), frame) for one in fields(Factors)})
    ends = [score_angles(scores.angles[[frame]], used, scores.rules, missing) for missing in ("neutral", "worst")]
    low, high = ({name: int(end[name][0]) for name in SCORE_COLUMNS} for end in ends)
    for end in (low, high):
        end |= {name: end[total] - end[extra] for name, (total, extra) in _TABLES.items()}
    return {name: (low[name], high[name]) for name in low}


def contributions(scores: ScoreTable, frame: int, most: int = 4) -> list[str]:
    """Return the largest contributions to a frame: "trunk flexion 62 deg (over 60): +3", highest first.

    Of two arms only the worse one is named, or both where they are equal.
    """
    sheet = worksheet(scores, frame)
    left, right = sheet.scores["reba_left"], sheet.scores["reba_right"]
    silent = "" if left is None or right is None or left == right else "left" if left < right else "right"
    points = []
    for line in sheet.lines:
        extra = (line.points or 0) - line.least
        if extra > 0 and not (silent and line.part.endswith(f"_{silent}")):
            rule = line.rule.replace(" (", ", ").replace(")", "")
            points.append((-extra, f"{line.what} {line.value} ({rule}): +{extra}"))
    return [text for _, text in sorted(points, key=lambda item: item[0])[:most]]


def _part(parts: list[AngleClasses], angles: np.ndarray[Any, Any], counts: bool) -> list[WorksheetLine]:
    lines = []
    counted: set[str] = set()
    for quantity in parts:
        values = [float(angles[INDEX[column]]) for column in quantity.columns]
        if all(np.isnan(values)):
            lines.append(_open_line(quantity, "not measured", quantity.classes[0].points))
            continue
        angle = float(np.nanmax(values))
        own = quantity.class_of(angle)
        if counts and any(np.isnan(values)) and own is not quantity.classes[-1]:
            # The other one of two may stand in a higher class.
            value = f"{angle:z.1f} deg, the other not measured"
            lines.append(_open_line(quantity, value, own.points))
            continue
        points, rule = own.points, own.text
        if quantity.adjusts and points:
            if not counts:
                points, rule = 0, f"{rule}; not counted while sitting"
            elif quantity.adjusts in counted:
                points, rule = 0, f"{rule}; one point together"
            counted.add(quantity.adjusts)
        so_far = sum(line.points or 0 for line in lines)
        highest = PART_MAXIMA[quantity.part.removesuffix("_left").removesuffix("_right")]
        if so_far + points > highest:
            points, rule = highest - so_far, f"{rule}; at most {highest} for this part"
        lines.append(
            WorksheetLine(
                quantity.part, points, quantity.name, _degrees(angle, quantity), rule, quantity.classes[0].points
            )
        )
    return lines


def _degrees(angle: float, quantity: AngleClasses) -> str:
    """Return an angle with a decimal, or with as many as show its class: 10.04 is over 10, 10.0 is not."""
    own = quantity.class_of(angle)
    digits = next((n for n in range(1, 7) if quantity.class_of(round(angle, n)) is own), 9)
    return f"{angle:z.{digits}f} deg"


def _open_line(quantity: AngleClasses, value: str, low: int) -> WorksheetLine:
    high = quantity.classes[-1].points
    rule = f"{low} to {high} possible"
    return WorksheetLine(quantity.part, None, quantity.name, value, rule, possible=(low, high))


def _at(value: Any, frame: int) -> Any:
    values = np.atleast_1d(np.asarray(value))
    return values[0] if len(values) == 1 else values[frame]


def _support_code(scores: ScoreTable, frame: int) -> int:
    return SUPPORTS.index(str(_at(scores.factors.support, frame)))


def _support(scores: ScoreTable, frame: int) -> list[WorksheetLine]:
    support = SUPPORTS[_support_code(scores, frame)]
    points = int(leg_points(_support_code(scores, frame), scores.rules))
    rule = "one leg or unstable" if support == "unilateral" else "both legs, walking or sitting"
    return [WorksheetLine("legs", points, "support", support, rule, least=1)]


def _load(scores: ScoreTable, frame: int) -> list[WorksheetLine]:
    load = float(_at(scores.factors.load, frame))
    points = load_points(load)
    rule = ("under 5 kg", "5 to 10 kg", "over 10 kg")[points]
    lines = [WorksheetLine("load_force", points, "load", f"{load:g} kg", rule)]
    if _at(scores.factors.shock, frame):
        lines.append(WorksheetLine("load_force", 1, "shock", "yes", "shock or rapid build-up of force"))
    return lines


def _supported(scores: ScoreTable, frame: int, side: str, lines: list[WorksheetLine]) -> list[WorksheetLine]:
    if not _at(getattr(scores.factors, f"arm_supported_{side}"), frame):
        return []
    so_far = sum(line.points or 0 for line in lines if line.part == f"upper_arm_{side}")
    points = -1 if so_far > 1 else 0
    return [
        WorksheetLine(f"upper_arm_{side}", points, f"{side} arm support", "yes", "leaning or supported, never below 1")
    ]


def _coupling(scores: ScoreTable, frame: int, side: str) -> list[WorksheetLine]:
    points = int(scores.data[f"coupling_{side}"].iloc[frame])
    return [
        WorksheetLine(f"coupling_{side}", points, f"{side} coupling", COUPLINGS[points], f"{COUPLINGS[points]} grip")
    ]


def _activity(scores: ScoreTable, frame: int) -> list[WorksheetLine]:
    rules = {
        "static": f"a part held over {scores.rules.static_seconds:g} s",
        "repeated": f"small movements over {scores.rules.repeated_per_minute:g} a minute",
        "unstable": "rapid large changes, or an unstable base",
    }
    yes = {kind: bool(_at(getattr(scores.factors, kind), frame)) for kind in rules}
    return [
        WorksheetLine("activity", int(yes[kind]), kind, "yes" if yes[kind] else "no", rule)
        for kind, rule in rules.items()
    ]
