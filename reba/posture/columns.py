"""The 22 angles of the posture table: names, sides, signs, ends, and the body parts that they belong to."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from reba.checks import items_of, shown
from reba.errors import PostureError, did_you_mean

SIDES: tuple[str, str] = ("left", "right")


@dataclass(frozen=True)
class Angle:
    """One angle of the posture table, for one or both sides.

    Attributes:
        name: column name without a side.
        sided: whether there are a `_left` and a `_right` column.
        positive: the positive sense.
        best, worst: angles [deg] that give the lowest and the highest part score.
    """

    name: str
    sided: bool
    positive: str
    best: float
    worst: float

    @property
    def columns(self) -> tuple[str, ...]:
        """The column names: one, or left then right."""
        return tuple(f"{self.name}_{side}" for side in SIDES) if self.sided else (self.name,)


ANGLES: tuple[Angle, ...] = (
    Angle("trunk_flexion", False, "forward, inclination from vertical where the source gives it", 0.0, 180.0),
    Angle("trunk_side_bend", False, "to the right", 0.0, 180.0),
    Angle("trunk_twist", False, "to the left, counter-clockwise seen from above", 0.0, 180.0),
    Angle("neck_flexion", False, "forward, head relative to trunk", 0.0, 180.0),
    Angle("neck_side_bend", False, "to the right", 0.0, 180.0),
    Angle("neck_twist", False, "to the left", 0.0, 180.0),
    Angle("knee_flexion", True, "flexion, 0 straight", 0.0, 180.0),
    Angle("upper_arm_flexion", True, "forward of the trunk line, 0 hanging", 0.0, 180.0),
    Angle("upper_arm_abduction", True, "away from the body", 0.0, 180.0),
    Angle("shoulder_elevation", True, "girdle raised", 0.0, 180.0),
    Angle("lower_arm_flexion", True, "elbow flexion, 0 straight", 80.0, 0.0),
    Angle("wrist_flexion", True, "palmar", 0.0, 180.0),
    Angle("wrist_deviation", True, "ulnar", 0.0, 180.0),
    Angle("wrist_twist", True, "pronation from the thumb-up mid position", 0.0, 180.0),
)
"""The angles in their public order, with the ends that bound every score (the tables are monotone)."""
COLUMNS: tuple[str, ...] = tuple(column for angle in ANGLES for column in angle.columns)
"""The 22 angle columns in their public order."""
INDEX: dict[str, int] = {column: index for index, column in enumerate(COLUMNS)}
"""Position of each angle column in `COLUMNS`."""
COLUMNS_OF: dict[str, tuple[str, ...]] = {angle.name: angle.columns for angle in ANGLES}
"""Columns of each angle name without a side."""
WORST: dict[str, float] = {column: angle.worst for angle in ANGLES for column in angle.columns}
"""[deg] The angle of the highest part score of each column."""
SIDELESS: tuple[str, ...] = tuple(angle.name for angle in ANGLES if angle.sided)
"""Names without a side, which stand for both."""
BEST: dict[str, float] = {column: angle.best for angle in ANGLES for column in angle.columns}
"""[deg] The angle of the lowest part score of each column."""
MIRRORED: tuple[str, ...] = tuple(a.name for a in ANGLES if not a.sided and not a.name.endswith("_flexion"))
"""Angles that change sign in a mirror: side bends and twists of the trunk and neck."""
GROUP_A: tuple[str, ...] = ("trunk", "neck", "legs")
"""Body parts of Table A, in the order of its indices."""
GROUP_B: tuple[str, ...] = ("upper_arm", "lower_arm", "wrist")
"""Body parts of Table B, in the order of its indices; one of each on either side."""
PARTS: dict[str, tuple[str, ...]] = {
    "trunk": ("trunk_flexion", "trunk_side_bend", "trunk_twist"),
    "neck": ("neck_flexion", "neck_side_bend", "neck_twist"),
    "legs": ("knee_flexion",),
    "upper_arm": ("upper_arm_flexion", "upper_arm_abduction", "shoulder_elevation"),
    "lower_arm": ("lower_arm_flexion",),
    "wrist": ("wrist_flexion", "wrist_deviation", "wrist_twist"),
}
"""Body part -> its angles, both without a side."""
PART_COLUMNS: dict[str, tuple[str, ...]] = {
    **{part: tuple(column for name in PARTS[part] for column in COLUMNS_OF[name]) for part in GROUP_A},
    **{f"{part}_{side}": tuple(f"{name}_{side}" for name in PARTS[part]) for side in SIDES for part in GROUP_B},
}
"""Column of a body part's score -> the angle columns that it depends on."""


def on_both_sides(row: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return values by name in which one without a side stands for each side that has none of its own.

    >>> on_both_sides({"knee_flexion": 60, "knee_flexion_left": 5, "load": 3})["knee_flexion_right"]
    60
    """
    sideless = [name for name in SIDELESS if name in row]
    return {**{column: row[name] for name in sideless for column in COLUMNS_OF[name]}, **row} if sideless else row


def by_column(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values by column; one by a name without a side is that of each side that has none of its own.

    >>> by_column({"knee_flexion_left": 5, "knee_flexion": 60})
    {'knee_flexion_left': 5, 'knee_flexion_right': 60}
    """
    return {name: value for name, value in on_both_sides(values).items() if name not in SIDELESS}


def columns_named(names: Iterable[str], error: type[ValueError] = PostureError) -> tuple[str, ...]:
    """Return columns by their names in the order of `COLUMNS`; a name without a side stands for both.

    Raises:
        PostureError: a name is unknown, or there are none.

    Example:
        >>> columns_named(["knee_flexion", "trunk_flexion"])
        ('trunk_flexion', 'knee_flexion_left', 'knee_flexion_right')
    """
    given = items_of(names)
    if given is None:
        raise error(f"columns are {shown(names)}; expected a list of names of reba.COLUMNS")
    selected: set[str] = set()
    for name in given:
        columns = COLUMNS_OF.get(name, (name,)) if isinstance(name, str) else ()
        if not columns or columns[0] not in INDEX:
            near = did_you_mean(name, (*COLUMNS_OF, *COLUMNS))
            raise error(f"column {shown(name)} is unknown{near}; expected names of reba.COLUMNS")
        selected.update(columns)
    if not selected:
        raise error("no joint is named; expected columns such as trunk_flexion,knee_flexion")
    return tuple(column for column in COLUMNS if column in selected)
