"""The REBA of one frame as formulas of a spreadsheet, from its angles and factors to the total.

The formulas are made from the step table (`reba.method.steps`) and printed Tables A, B, C: there is no second list of
thresholds. What was not measured is computed twice, with the angle of the lowest and with that of the highest points.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

import numpy as np

from reba.analysis.score_table import ScoreTable
from reba.method.factor_points import knees_count, leg_points
from reba.method.rules import LOAD_EDGES, Rules
from reba.method.steps import AngleSteps, Boundary, PartSteps, part_steps
from reba.method.tables import PART_MAXIMA, TABLE_A, TABLE_B
from reba.posture.columns import BEST, COLUMNS, COLUMNS_OF, GROUP_A, GROUP_B, INDEX, SIDES, WORST
from reba.posture.factors import SUPPORTS

AGAINST_GRAVITY: Final = " against gravity"
"""Ending of the column of an upper arm angle by which rules with that reference score."""
ARM_COLUMNS: Final = {
    name: INDEX[name] for angle in ("upper_arm_flexion", "upper_arm_abduction") for name in COLUMNS_OF[angle]
}
_TABLES: Final = {
    "A": f"Tables!$A$2:$L${1 + len(TABLE_A)}",
    "B": f"Tables!$A${3 + len(TABLE_A)}:$F${2 + len(TABLE_A) + len(TABLE_B)}",
    "C": f"Tables!$A${4 + len(TABLE_A) + len(TABLE_B)}:$L${15 + len(TABLE_A) + len(TABLE_B)}",
}
"""Places of the printed tables in the sheet `Tables`, below a line of text each."""
_FLAGS: Final = ("shock", "arm_supported_left", "arm_supported_right")
_ACTIVITIES: Final = ("static", "repeated", "unstable")
_FRAME: Final = "$B$1"


class _Sheet:
    """Rows of the worksheet so far, and the row of each quantity."""

    def __init__(self, columns: list[str], frames: int) -> None:
        from openpyxl.utils import get_column_letter

        self.rows: list[list[Any]] = []
        self.row: dict[str, int] = {}
        self._letters = {name: get_column_letter(number) for number, name in enumerate(columns, 1)}
        self._last = frames + 1

    def of_frame(self, column: str) -> str:
        """Return the expression of a column of `Frames` in the chosen frame."""
        letter = self._letters[column]
        return f"INDEX(Frames!${letter}$2:${letter}${self._last},{_FRAME})"

    def has(self, column: str) -> bool:
        """Return whether `Frames` has a column."""
        return column in self._letters

    def add(self, name: str, text: str, value: str = "", low: str = "", high: str = "", note: str = "") -> None:
        """Add a row; expressions without the sign of a formula, which are empty where a cell is."""
        formulas = [f"={one}" if one else None for one in (value, low, high)]
        self.rows.append([text, *formulas, note or None])
        self.row[name] = len(self.rows)

    def text(self, *cells: Any) -> None:
        """Add a row of texts."""
        self.rows.append(list(cells))

    def both(self, name: str, text: str, formula: str, note: str = "") -> None:
        """Add a row whose formula, with `{}` for the column, is computed for the lowest and the highest points."""
        self.add(name, text, "", formula.replace("{}", "C"), formula.replace("{}", "D"), note)

    def cell(self, name: str) -> str:
        """Return the place of a quantity, `{}` for the column."""
        return f"{{}}{self.row[name]}"


def worksheet_rows(scores: ScoreTable, columns: list[str], frame: int) -> Iterator[list[Any]]:
    """Yield the rows of the sheet; `columns` are those of `Frames`, `frame` is the one that it shows at first."""
    rules = scores.rules
    sheet = _Sheet(columns, len(scores.data))
    sheet.text("Frame (1 is the first of the sheet Frames)", frame + 1, None, None, "change the number in B1")
    sheet.add("time", "Time [s]", sheet.of_frame("time"))
    sheet.text("Angle [deg] or factor", "value", "lowest points", "highest points", "what counts if not measured")
    _angles(sheet, rules)
    _factors(sheet)
    sheet.text(f"Points by the rules {rules.name!r}", None, "lowest points", "highest points", "added where")
    _group_a(sheet, rules)
    for side in SIDES:
        _group_b(sheet, rules, side)
    _total(sheet, rules)
    yield from sheet.rows


def _angles(sheet: _Sheet, rules: Rules) -> None:
    for name in COLUMNS:
        column = name
        if rules.upper_arm_reference == "gravity" and name in ARM_COLUMNS:
            column = f"{name}{AGAINST_GRAVITY}"
        value = sheet.of_frame(column)
        row = len(sheet.rows) + 1
        low, high = (f"IF(ISNUMBER($B{row}),$B{row},{end[name]:g})" for end in (BEST, WORST))
        note = f"{BEST[name]:g} or {WORST[name]:g}"
        sheet.add(name, column.replace("_", " "), f'IF(ISNUMBER({value}),{value},"not measured")', low, high, note)


def _factors(sheet: _Sheet) -> None:
    for name in ("load", *_FLAGS, "support", *_ACTIVITIES):
        value = sheet.of_frame(name)
        if name != "load" and name != "support":
            value = f"IF({value},1,0)"
        row = len(sheet.rows) + 1
        sheet.add(name, f"{name.replace('_', ' ')}{' [kg]' if name == 'load' else ''}", value, f"$B{row}", f"$B{row}")


def _group_a(sheet: _Sheet, rules: Rules) -> None:
    steps = part_steps(rules)
    for part in ("trunk", "neck"):
        formula, note = _part(sheet, steps[part], "", PART_MAXIMA[part])
        sheet.both(part, f"{part.capitalize()} score", formula, note)
    knees, note = _part(sheet, steps["legs"], "", PART_MAXIMA["legs"], lowest=0)
    codes = np.arange(len(SUPPORTS))
    support = sheet.cell("support")
    standing = _by_support(support, [int(one) for one in leg_points(codes, rules)])
    bent = _by_support(support, [int(one) for one in knees_count(codes, rules)])
    sheet.both("legs", "Legs score", f"{standing}+{bent}*{knees}", f"{note}; as the body is supported")
    load, (low, high) = sheet.cell("load"), LOAD_EDGES
    sheet.both(
        "load_force", "Load/force score", f"IF({load}>={low:g},1,0)+IF({load}>{high:g},1,0)+{sheet.cell('shock')}",
        f"from {low:g} kg, over {high:g} kg, shock",
    )  # fmt: skip
    trunk, neck, legs = (sheet.cell(part) for part in GROUP_A)
    sheet.both("table_a", "Table A", f"INDEX({_TABLES['A']},{trunk},({neck}-1)*{PART_MAXIMA['legs']}+{legs})")
    sheet.both("score_a", "Score A", f"{sheet.cell('table_a')}+{sheet.cell('load_force')}")


def _by_support(cell: str, points: list[int]) -> str:
    """Return the expression of the points of a support of the body, by its name."""
    *others, last = points
    return "".join(f'IF({cell}="{name}",{one},' for name, one in zip(SUPPORTS, others, strict=False)) + (
        f"{last}{')' * len(others)}"
    )


def _group_b(sheet: _Sheet, rules: Rules, side: str) -> None:
    steps = part_steps(rules)
    for part in GROUP_B:
        name = f"{part}_{side}"
        formula, note = _part(sheet, steps[part], side, PART_MAXIMA[part])
        if part == "upper_arm":
            formula = f"MAX(1,{formula}-{sheet.cell(f'arm_supported_{side}')})"
            note += "; a supported arm takes 1 off, not below 1"
        sheet.both(name, f"{part.replace('_', ' ').capitalize()} score, {side}", formula, note)
    coupling = f"coupling_{side}"
    sheet.both(coupling, f"Coupling score, {side}", sheet.of_frame(coupling))
    upper, lower, wrist = (sheet.cell(f"{part}_{side}") for part in GROUP_B)
    table = f"INDEX({_TABLES['B']},{upper},({lower}-1)*{PART_MAXIMA['wrist']}+{wrist})"
    sheet.both(f"table_b_{side}", f"Table B, {side}", table)
    sheet.both(f"score_b_{side}", f"Score B, {side}", f"{sheet.cell(f'table_b_{side}')}+{sheet.cell(coupling)}")
    cells = sheet.cell("score_a"), sheet.cell(f"score_b_{side}")
    sheet.both(f"table_c_{side}", f"Score C (Table C), {side}", f"INDEX({_TABLES['C']},{cells[0]},{cells[1]})")


def _total(sheet: _Sheet, rules: Rules) -> None:
    sheet.both("activity", "Activity score", "+".join(sheet.cell(name) for name in _ACTIVITIES))
    for side in SIDES:
        sheet.both(f"reba_{side}", f"REBA, {side}", f"{sheet.cell(f'table_c_{side}')}+{sheet.cell('activity')}")
    left, right = (sheet.cell(f"reba_{side}") for side in SIDES)
    total = f"MAX({left},{right})" if rules.two_sides == "worse" else sheet.cell(f"reba_{rules.two_sides}")
    sheet.both("reba", "REBA", total)
    stated = [sheet.of_frame(name) for name in ("reba_low", "reba_high")]
    sheet.add("stated", "REBA in the sheet Frames", "", *stated)
    row, other = sheet.row["reba"], sheet.row["stated"]
    sheet.add("check", "The formulas agree with it", f'IF(AND(C{row}=C{other},D{row}=D{other}),"yes","NO")')


def _part(sheet: _Sheet, steps: PartSteps, side: str, highest: int, lowest: int = 1) -> tuple[str, str]:
    """Return the formula of a part score, `{}` for the column, and where its points are added as text."""
    main, *adjustments = steps.angles
    points = [str(lowest), *(f"IF({_beyond(sheet, main, one, side)},1,0)" for one in main.boundaries)]
    notes = [_text(main, one) for one in main.boundaries]
    beyond = [_beyond(sheet, one, one.boundaries[0], side) for one in adjustments]
    notes += [_text(one, one.boundaries[0]) for one in adjustments]
    if adjustments and steps.shares_point:
        points.append(f"IF(OR({','.join(beyond)}),1,0)")
    else:
        points += [f"IF({one},1,0)" for one in beyond]
    return f"MIN({highest},{'+'.join(points)})", "; ".join(notes)


def _beyond(sheet: _Sheet, steps: AngleSteps, boundary: Boundary, side: str) -> str:
    """Return the condition that an angle is outside a boundary; of two knees the one bent further counts."""
    columns = COLUMNS_OF[steps.angle]
    if len(columns) == 1 or side:
        angle = sheet.cell(columns[0] if len(columns) == 1 else f"{steps.angle}_{side}")
    else:
        angle = f"MAX({','.join(map(sheet.cell, columns))})"
    conditions = [f"{angle}{'>' if boundary.high_inside else '>='}{boundary.high:g}"]
    if boundary.high == math.inf:
        conditions = []
    if boundary.low > -math.inf:
        conditions.append(f"{angle}{'<' if boundary.low_inside else '<='}{boundary.low:g}")
    return conditions[0] if len(conditions) == 1 else f"OR({','.join(conditions)})"


def _text(steps: AngleSteps, boundary: Boundary) -> str:
    parts = []
    if boundary.high < math.inf:
        parts.append(f"{'over' if boundary.high_inside else 'from'} {boundary.high:g}")
    if boundary.low > -math.inf:
        parts.append(f"{'under' if boundary.low_inside else 'to'} {boundary.low:g}")
    name = steps.angle.replace("_", " ")
    return f"{steps.adjustment or name} {' or '.join(parts)}"
