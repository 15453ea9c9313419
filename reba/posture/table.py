"""The posture table: one row per frame, angles in degrees, NaN = not measured.

Columns, signs and units are public (README, "The posture table"); everything else in the package speaks in them.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from reba.arrays import Array
from reba.errors import PostureError, did_you_mean
from reba.posture.columns import ANGLES, COLUMNS, INDEX, SIDES
from reba.posture.factors import BOTH_SIDES, FACTORS, flag

if TYPE_CHECKING:
    import pandas as pd


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


RAISED = tuple(f"shoulder_raised_{side}" for side in SIDES)
"""Boolean columns that may stand in for `shoulder_elevation_*`."""
_ELEVATION = next(angle for angle in ANGLES if angle.name == "shoulder_elevation")


def table_of(frame: pd.DataFrame) -> PostureTable:
    """Return a DataFrame as a posture table.

    Raises:
        PostureError: it is no DataFrame, no column is known, one stands twice or is no number, or time does not
            increase.
    """
    if not isinstance(frame, pd.DataFrame):
        raise PostureError(
            f"postures are of type {type(frame).__name__}; expected what reba.read returns or a DataFrame "
            "(arrays of angles go to reba.score_array)"
        )
    known = ("time", *COLUMNS, *FACTORS, *BOTH_SIDES, *RAISED)
    if not any(name in COLUMNS or name in RAISED for name in frame.columns):
        names = ", ".join(str(name) for name in list(frame.columns)[:6])
        hint = did_you_mean(str(frame.columns[0]), COLUMNS) if len(frame.columns) else ""
        raise PostureError(
            f"no angle column among: {names or 'none'}; expected some of {', '.join(COLUMNS[:3])}, ...{hint}"
        )
    columns: dict[str, Any] = {"time": np.arange(len(frame), dtype=np.float64)}
    used = [str(name) for name in frame.columns if str(name) in known]
    if twice := [name for name in dict.fromkeys(used) if used.count(name) > 1]:
        raise PostureError(f"column {twice[0]} stands {used.count(twice[0])} times; keep one of them")
    for name in used:
        if name in COLUMNS or name == "time":
            columns[name] = _numbers(frame, name)
        else:
            columns[name] = frame[name].to_numpy()
    time = columns["time"]
    bad = ~np.isfinite(time)
    if bad.any():
        where = int(np.argmax(bad))
        raise PostureError(f"time is {time[where]} at frame {where}; expected seconds at every frame")
    back = np.diff(time) <= 0
    if back.any():
        where = int(np.argmax(back))
        raise PostureError(
            f"time does not increase after frame {where} ({time[where]} s); sort the rows and drop duplicates"
        )
    # A misspelt column would otherwise only show as "not measured".
    near = [(str(n), did_you_mean(str(n), COLUMNS)) for n in frame.columns if str(n) not in known]
    wrong = [f"column {name!r} is not used{hint}" for name, hint in near if hint]
    table = PostureTable(pd.DataFrame(columns), source="DataFrame", recognised="posture table columns")
    table = dataclasses.replace(table, quality=dataclasses.replace(table.quality, warnings=tuple(wrong)))
    empty = np.isnan(angles_of(table.data)).all(axis=0)
    return dataclasses.replace(table, unmeasured=tuple(np.array(COLUMNS)[empty].tolist()))


def _numbers(frame: pd.DataFrame, name: str) -> Array:
    if (kind := frame[name].dtype.kind) in "mMc":
        what = "complex numbers" if kind == "c" else "dates"
        raise PostureError(f"column {name} holds {what}; expected {'seconds' if name == 'time' else 'degrees'}")
    try:
        return pd.to_numeric(frame[name]).to_numpy(np.float64, na_value=np.nan)
    except (TypeError, ValueError) as error:
        raise PostureError(f"column {name} holds something that is no number ({error}); expected degrees") from error


def angles_of(data: pd.DataFrame) -> Array:
    """Return the (n, 22) angles of a posture table, without a copy where its columns stand in one block."""
    if tuple(data.columns) == ("time", *COLUMNS):
        return data.to_numpy()[:, 1:]
    angles = np.full((len(data), len(COLUMNS)), np.nan)
    for index, name in enumerate(COLUMNS):
        if name in data:
            angles[:, index] = data[name]
    for side, name in enumerate(RAISED):
        if name in data:
            column = angles[:, INDEX["shoulder_elevation_left"] + side]
            raised = np.where(flag(name, data[name].to_numpy(), len(data)), _ELEVATION.worst, _ELEVATION.best)
            column[:] = np.where(np.isnan(column), raised, column)
    return angles


def refuse_infinite(angles: Array, start: int = 0) -> None:
    """Raise `PostureError` where angles (n, 22) are infinite; `start` is the number of their first frame."""
    infinite = np.isinf(angles)
    if infinite.any():
        frame, column = np.argwhere(infinite)[0]
        raise PostureError(
            f"{COLUMNS[column]} is infinite at frame {start + frame}; expected degrees, or NaN if not measured"
        )
