"""The posture table: one row per frame, angles in degrees, NaN = not measured.

Columns, signs and units are public (README, "The posture table"); everything else in the package speaks in them.
"""

from __future__ import annotations

from dataclasses import dataclass

SIDES: tuple[str, str] = ("left", "right")


@dataclass(frozen=True)
class Angle:
    """One angle of the posture table, for one or both sides.

    Attributes:
        name: column name without a side.
        sided: whether there are a `_left` and a `_right` column.
        positive: the positive sense.
        best: an angle [deg] that gives the lowest part score.
        worst: an angle [deg] that gives the highest part score.
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
