"""The posture table: one row per frame, angles in degrees, NaN = not measured.

Columns, signs and units are public (README, "The posture table"); everything else in the package speaks in them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

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


@dataclass(frozen=True)
class Quality:
    """How good a recording is: what was read, what was skipped, how regular it is.

    Attributes:
        messages: samples or messages seen.
        skipped: of these, not usable.
        first_skipped: where and why the first one was skipped.
        ended_abnormally: None, or how the recording breaks off.
        time_source: where the time column comes from.
        rate: median sampling rate [Hz].
        gaps: (start, end) [s] of stretches without samples, longer than 0.2 s and five sample periods.
        warnings: other things a user must know.
        sha256: of the file, "" for a folder.
    """

    messages: int = 0
    skipped: int = 0
    first_skipped: str | None = None
    ended_abnormally: str | None = None
    time_source: str = ""
    rate: float = float("nan")
    gaps: tuple[tuple[float, float], ...] = ()
    warnings: tuple[str, ...] = ()
    sha256: str = ""

    def notes(self) -> list[str]:
        """Return what a user must know in one line each: how it breaks off, what was skipped, and the warnings."""
        found = [f"the recording breaks off: {self.ended_abnormally}"] if self.ended_abnormally else []
        if self.skipped:
            first = f", the first: {self.first_skipped}" if self.first_skipped else ""
            found.append(f"{self.skipped} of {self.messages} messages could not be used{first}")
        return [*found, *self.warnings]


@dataclass(frozen=True)
class PostureTable:
    """Postures of one recording.

    Attributes:
        data: `time` [s], the 22 columns of `COLUMNS` [deg], and factor columns if the source has them.
        profile: name of the profile that gave the angles meaning ("table" for a posture table).
        source: path or name of what was read.
        topic: stream that was used.
        unmeasured: angle columns without any value.
        why_unmeasured: for some of them the reason ("constant 0", "no head frame").
        assumed: what had to be assumed to get angles ("pelvis assumed upright").
        recognised: why this profile was chosen.
        quality: what was read and how regular it is.
        epoch: Unix time [s] of time 0, 0.0 where the source does not say.
    """

    data: pd.DataFrame
    profile: str = "table"
    source: str = ""
    topic: str = ""
    unmeasured: tuple[str, ...] = ()
    why_unmeasured: dict[str, str] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    recognised: str = ""
    quality: Quality = field(default_factory=Quality)
    epoch: float = 0.0
