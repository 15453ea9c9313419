"""Column names in several rows: points above their axes, as pandas and DeepLabCut write them; groups above angles."""

from __future__ import annotations

import ast
import csv
from collections.abc import Sequence
from itertools import islice, takewhile
from typing import Final

from reba.readers.formats.table_columns import is_column

MOST_ROWS: Final = 4
"""Rows that names may take: scorer, individual, point, axis."""
LEAST_AXES: Final = 12
"""Fields x, y and z of a row of axes: those of four points; fewer are no body."""
_PERSONS: Final = frozenset({"individual", "individuals", "animal", "animals", "person", "persons", "people"})
"""First fields of a row that says whose a point is."""
_CORNERS: Final = frozenset({"coord", "coords", "coordinate", "coordinates", "axis", "axes"})
"""First fields of a row of axes, above the numbers of the frames."""


def names_of_rows(rows: Sequence[Sequence[str]]) -> tuple[list[str], int] | None:
    """Return the names of columns, `POINT_x`, and how many rows they take; None where the first row has them.

    A point stands above each of its axes or above the first of them, as merged cells are written. A last row that has
    one field only names the first column. Columns beside the points are called as in the lowest row that names them.
    Without axes the names are in the row that has most columns of a posture table, if that is not the first one.

    Args:
        rows: the fields of the first rows of a table.

    >>> lines = ["time,hip,,,knee,,,ankle,,,toe,,", ",x,y,z,x,y,z,x,y,z,x,y,z", "0,1,2,3,4,5,6,7,8,9,10,11,12"]
    >>> names, used = names_of_rows(fields_of(lines, ","))
    >>> names[:5], used
    (['time', 'hip_x', 'hip_y', 'hip_z', 'knee_x'], 2)
    """
    at = next((number for number, row in enumerate(rows[:MOST_ROWS]) if _is_axes(row)), 0)
    if not at or any(_is_numeric(field) for row in rows[:at] for field in row[1:]):
        return _below_groups(rows[:MOST_ROWS])
    axes, width = rows[at], max(map(len, rows[: at + 1]))
    above = [[*row, *[""] * (width - len(row))] for row in rows[:at]]
    axes = [*axes, *[""] * (width - len(axes))]
    first = next(column for column, field in enumerate(axes) if field.lower() in ("x", "y", "z"))
    points = _filled(above[-1], axes, first)
    persons = next((row for row in above[:-1] if row[0].lower() in _PERSONS), None)
    people = [""] * width if persons is None else _filled(persons, axes, first)
    names = []
    for column, axis in enumerate(axes):
        if column >= first and axis and points[column]:
            person = people[column]
            names.append(f"{person}/{points[column]}_{axis}" if person else f"{points[column]}_{axis}")
        elif column == 0 and axis.lower() in _CORNERS:
            names.append("frame")
        else:
            names.append(axis or next((row[column] for row in reversed(above) if row[column]), ""))
    used = at + 1
    if used < len(rows) and any(rows[used][:1]) and not any(rows[used][1:]):
        names[0] = rows[used][0]
        used += 1
    return names, used


def _below_groups(rows: Sequence[Sequence[str]]) -> tuple[list[str], int] | None:
    """Return the names in a row below titles or groups, a blank field called as above it; None for those in the first.

    >>> _below_groups([["Time", "Trunk", ""], ["", "trunk_flexion", "trunk_twist"]])
    (['Time', 'trunk_flexion', 'trunk_twist'], 2)
    """
    texts = list(takewhile(lambda row: not any(map(_is_numeric, row)), rows))
    counts = [sum(map(is_column, row)) for row in texts]
    at = counts.index(max(counts)) if counts else 0
    if not at:
        return None
    above = [[*row, *[""] * len(rows[at])] for row in rows[:at]]
    names = [
        field or next((row[column] for row in reversed(above) if row[column]), "")
        for column, field in enumerate(rows[at])
    ]
    return names, at + 1


def fields_of(lines: Sequence[str], separator: str) -> list[list[str]]:
    """Return the fields of the lines that names may take; none of lines that are not separated values."""
    try:
        rows = list(islice(csv.reader(lines, delimiter=separator), MOST_ROWS + 1))
    except csv.Error:
        return []
    return [[field.strip() for field in row] for row in rows]


def names_of_levels(columns: Sequence[str], levels: Sequence[str]) -> list[str]:
    """Return the names of columns of several levels, which pandas writes as the texts of tuples.

    Args:
        levels: names of the levels.

    >>> names_of_levels(["time", "('trunk', 'flexion')"], ["", ""])
    ['time', 'trunk_flexion']
    """
    parts = [_parts(column) for column in columns]
    depth = max(map(len, parts), default=0)
    if depth < 2:
        return list(columns)
    rows = [
        [name, *(part[at] if at < len(part) else "" for part in parts)]
        for at, name in enumerate(_padded(levels, depth))
    ]
    named = names_of_rows(rows)
    if named is not None and named[1] == depth:
        return named[0][1:]
    return ["_".join(filter(None, part)) for part in parts]


def _padded(levels: Sequence[str], depth: int) -> list[str]:
    return [*levels, *[""] * depth][:depth]


def _parts(column: str) -> tuple[str, ...]:
    if column.startswith("("):
        try:
            value = ast.literal_eval(column)
        except (ValueError, SyntaxError, MemoryError, RecursionError):
            return (column,)
        if isinstance(value, tuple) and value:
            return tuple(map(str, value))
    return (column,)


def _is_axes(row: Sequence[str]) -> bool:
    """Return whether a row names x, y and z equally often, and has no number."""
    words = [field.lower() for field in row]
    counts = {words.count(axis) for axis in "xyz"}
    return len(counts) == 1 and 3 * counts.pop() >= LEAST_AXES and not any(map(_is_numeric, row))


def _is_numeric(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


def _filled(row: Sequence[str], axes: Sequence[str], first: int) -> list[str]:
    """Return a row in which a blank field above an axis has the name to the left of it."""
    filled, name = [], ""
    for column, field in enumerate(row):
        name = field or (name if column >= first and axes[column] else "")
        filled.append(name)
    return filled
