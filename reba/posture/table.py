"""The posture table: one row per frame, angles in degrees, NaN = not measured.

`table_of` builds one from a DataFrame or other data with column names; readers build theirs from recordings.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd

from reba.arrays import Array
from reba.errors import PostureError, did_you_mean
from reba.posture.columns import COLUMNS, COLUMNS_OF
from reba.posture.factors import BOTH_SIDES, FACTORS
from reba.posture.named_angles import (
    RADIANS_TEXT,
    RAISED,
    check_angles,
    column_numbers,
    read_angles,
)
from reba.posture.named_data import named_columns


@dataclass(frozen=True)
class Quality:
    """Quality of a recording: messages read and skipped, sampling rate, gaps.

    Attributes:
        messages: samples or messages seen.
        skipped: of these, not usable.
        first_skipped: where and why the first one was skipped.
        ended_abnormally: None, or how the recording is truncated.
        time_source: where the time column comes from; `time_why`: why not from the header stamps of messages.
        rate: median sampling rate [Hz].
        gaps: (start, end) [s] of intervals without samples, longer than 0.2 s and five sample periods.
        seams: times [s] of the first frame after each restart of the clock; nothing reaches across them.
        warnings: other facts that limit the use of the scores.
        sha256: of the file, "" for a folder.
        accounts: for each stream its `stream` name, messages `read`, `used`, and `not_used` by reason, and the
            `seconds` of both: nothing that was recorded is left out without a line here.
    """

    messages: int = 0
    skipped: int = 0
    first_skipped: str | None = None
    ended_abnormally: str | None = None
    time_source: str = ""
    time_why: str = ""
    rate: float = float("nan")
    gaps: tuple[tuple[float, float], ...] = ()
    seams: tuple[float, ...] = ()
    warnings: tuple[str, ...] = ()
    sha256: str = ""
    accounts: tuple[dict[str, Any], ...] = ()

    def notes(self, *, radians: bool = True) -> list[str]:
        """Return one line each for the reader of a report: truncated input, skipped messages, then the warnings.

        Args:
            radians: with what `reba.RadiansWarning` says.
        """
        notes = [f"the recording is truncated: {self.ended_abnormally}"] if self.ended_abnormally else []
        if self.skipped:
            first = f", the first: {self.first_skipped}" if self.first_skipped else ""
            notes.append(f"{self.skipped} of {self.messages} messages could not be used{first}")
        return [*notes, *(one for one in self.warnings if radians or RADIANS_TEXT not in one)]


@dataclass(eq=False)
class Movement:
    """Movement of a recording that is read in blocks: activity of a frame depends on frames of other blocks.

    Attributes:
        time: (n,) [s] of all frames.
        column: returns the (n,) angles [deg] of a column by name.
        seams: as in `Quality`.
        support: (n,) of the body by the legs where the recording has it, else None.
        known: what was detected before, by what it depends on.
    """

    time: Array
    column: Callable[[str], Array]
    seams: tuple[float, ...] = ()
    support: Any = None
    known: dict[Any, Any] = field(default_factory=dict)


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
        signals: names of the joints, frames or points that were read, none for a posture table.
        files: paths of what was read where that were several files, else empty.
        people: names that the recording gives to bodies, subjects and streams.
        scored: what a file of scores was written with (rules, factors, version), None for other recordings.
        movement: of the recording that this is a block of, None for others; the block begins at its `first_frame`.
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
    signals: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    people: tuple[str, ...] = ()
    scored: Mapping[str, Any] | None = field(default=None, repr=False)
    movement: Movement | None = field(default=None, repr=False, compare=False)
    first_frame: int = 0

    def __post_init__(self) -> None:
        if not isinstance(self.data, pd.DataFrame) or "time" not in self.data:
            raise PostureError(
                f"data of a posture table is a {type(self.data).__name__} without time; expected a DataFrame with the "
                "columns time [s] and angles [deg] by name"
            )

    @property
    def inputs(self) -> tuple[str, ...]:
        """Every path that was read."""
        return self.files or (self.source,)


def table_of(data: Any) -> PostureTable:
    """Return named data as a posture table.

    Args:
        data: a DataFrame, a mapping of columns or a list of rows by name. Absent columns are not measured, a name
            without a side stands for both, and without `time` frames are numbered by seconds.

    Raises:
        PostureError: no column is known, one stands twice, is not a number or holds an angle that no body has, or time
            does not increase.
    """
    frame = _frame(data)
    known = {"time", *COLUMNS, *COLUMNS_OF, *FACTORS, *BOTH_SIDES, *RAISED}
    used = [str(name) for name in frame.columns if str(name) in known]
    if not any(name in COLUMNS_OF or name in COLUMNS or name in RAISED for name in used):
        names = ", ".join(str(name) for name in list(frame.columns)[:6])
        hint = did_you_mean(str(frame.columns[0]), COLUMNS) if len(frame.columns) else ""
        raise PostureError(
            f"no angle column among: {names or 'none'}; expected some of {', '.join(COLUMNS[:3])}, ...{hint}"
        )
    if twice := [name for name in dict.fromkeys(used) if used.count(name) > 1]:
        raise PostureError(f"column {twice[0]} stands {used.count(twice[0])} times; keep one of them")
    columns: dict[str, Any] = {"time": np.arange(len(frame), dtype=np.float64)}
    for name in used:
        if name == "time" or name in COLUMNS:
            columns[name] = column_numbers(name, frame[name])
        elif name in COLUMNS_OF:
            numbers = column_numbers(name, frame[name])
            columns |= {column: numbers for column in COLUMNS_OF[name] if column not in used}
        else:
            columns[name] = frame[name].to_numpy()
    _check_time(columns["time"])
    # A misspelt column would otherwise only show as "not measured".
    near = [(str(n), did_you_mean(str(n), COLUMNS)) for n in frame.columns if str(n) not in known]
    wrong = [f"column {name!r} is not used{hint}" for name, hint in near if hint]
    table = PostureTable(pd.DataFrame(columns), source="DataFrame", recognised="posture table columns")
    table = dataclasses.replace(table, quality=dataclasses.replace(table.quality, warnings=tuple(wrong)))
    angles = angles_of(table.data)
    check_angles(angles)
    empty = np.isnan(angles).all(axis=0)
    return dataclasses.replace(table, unmeasured=tuple(np.array(COLUMNS)[empty].tolist()))


def _frame(data: Any) -> pd.DataFrame:
    if isinstance(data, pd.DataFrame):
        return data
    named = named_columns(data)
    if named is None:
        raise PostureError(
            f"postures are of type {type(data).__name__}; expected what reba.read returns, a DataFrame or other data "
            "with column names (arrays of angles go to reba.score_array)"
        )
    try:
        return pd.DataFrame({name: np.atleast_1d(np.asarray(values)) for name, values in named.items()})
    except ValueError as error:
        raise PostureError(f"columns do not fit together ({error}); expected one value per frame in each") from error


def _check_time(time: Array) -> None:
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


def angles_of(data: pd.DataFrame) -> Array:
    """Return the (n, 22) angles of a posture table, without a copy where its columns stand in one block."""
    if tuple(data.columns) == ("time", *COLUMNS):
        return data.to_numpy()[:, 1:]
    return read_angles(data, COLUMNS)[0]
