"""The time column of a table: which one it is, in what unit it counts, and whether it is absolute."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reba.errors import ReadError
from reba.readers.memory import clip
from reba.readers.stream import ReadLog

if TYPE_CHECKING:
    import pandas as pd

NAMES = ("time", "t", "timestamp", "header.stamp", "header_stamp", "/header/stamp", "stamp", "__time", "log_time",
         "elapsed", "elapsed_time", "seconds", "datetime", "date_time")  # fmt: skip
"""Names of time columns in lower case, the likelier first; a unit may stand behind: `time_ms`, `Time [s]`."""

SECONDS: dict[str, float] = {
    **dict.fromkeys(("s", "sec", "secs", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "usec", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanoseconds"), 1e-9),
}
"""Length of a unit of time [s] by the name behind a column name."""

PAIRS = ((".sec", ".nanosec"), (".secs", ".nsecs"), ("_sec", "_nanosec"), ("_secs", "_nsecs"))
"""Ends of two columns that hold a ROS stamp: whole seconds and the nanoseconds to add."""

ABSOLUTE = 1e8
"""[s] Later than March 1973 when counted from 1970: no recording is that long, so the time is a date."""

LARGEST = 4e18
"""Just below the largest 64-bit integer."""

_NAME = re.compile(r"^(.+?)(?:[ _]?[\[(](\w+)[\])]|[ _](\w+))?$")


def time_column(path: Path, columns: list[str]) -> tuple[str, float | None, str | None]:
    """Return the name of the time column, its unit [s] if the name says it, and a column of nanoseconds to add.

    Raises:
        ReadError: there is none.
    """
    ranked: list[tuple[int, str, float | None, str | None]] = []
    for column in columns:
        lower = column.lower()
        for whole, rest in PAIRS:
            partner = column[: -len(whole)] + rest
            if lower.endswith(whole) and partner in columns and lower[: -len(whole)] in NAMES:
                ranked.append((-1, column, 1.0, partner))
        match = _NAME.match(lower)
        suffix = (match[2] or match[3] or "") if match else ""
        if lower in NAMES:
            ranked.append((NAMES.index(lower), column, 1.0 if lower == "seconds" else None, None))
        elif match and suffix in SECONDS and match[1] in NAMES:
            ranked.append((NAMES.index(match[1]), column, SECONDS[suffix], None))
    if not ranked:
        raise ReadError(
            path,
            f"no time column among its {len(columns)} columns ({', '.join(map(clip, columns[:4]))} ...)",
            hint="add a column 'time' in seconds, or 'time_ms', or name the one that holds it 'time'",
        )
    return min(ranked, key=lambda entry: entry[0])[1:]


def take_time(
    path: Path, frame: pd.DataFrame, log: ReadLog, where: Callable[[int], str]
) -> tuple[NDArray[np.float64], float, list[str]]:
    """Return the time (n,) [s], NaN where a row has none, the epoch [s] (0 if not a date), and the columns used.

    Raises:
        ReadError: no time column, or a value in it is no time; `where` says which line a row stands in.
    """
    column, unit, nanoseconds = time_column(path, list(frame.columns))
    values, dated = _as_numbers(path, frame, column, where)
    if dated:
        unit = 1e-9
    valid = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    if not len(valid):
        raise ReadError(path, f"no row has a value in the time column {clip(column)}", hint="give times in seconds")
    largest = float(np.abs(valid.astype(np.float64)).max())
    if largest > LARGEST:
        raise ReadError(path, f"column {clip(column)} holds {largest:.3g}, which is no time", hint="give seconds")
    if unit is None:
        unit = _unit_by_size(valid, largest, column, log)
    log.time_source = f"column {column}"
    extra: NDArray[np.float64] = np.zeros(len(values))
    if nanoseconds is not None:
        extra = np.asarray(_as_numbers(path, frame, nanoseconds, where)[0], dtype=np.float64) * 1e-9
    start = valid[0]
    if abs(float(start)) * unit < ABSOLUTE:
        return values * unit + extra, 0.0, [column, *([nanoseconds] if nanoseconds else [])]
    # A difference of integers keeps every nanosecond, which seconds since 1970 as floats do not.
    return (values - start) * unit + extra, float(start) * unit, [column, *([nanoseconds] if nanoseconds else [])]


def _as_numbers(
    path: Path, frame: pd.DataFrame, column: str, where: Callable[[int], str]
) -> tuple[NDArray[np.int64] | NDArray[np.float64], bool]:
    """Return integers where the column has them in every row, else floats; and whether they are dates in ns."""
    import pandas as pd

    series = frame[column]
    if not (pd.api.types.is_numeric_dtype(series) or pd.api.types.is_datetime64_any_dtype(series)):
        numbers = pd.to_numeric(series.astype(object), errors="coerce")
        if numbers.isna().equals(series.isna()):
            series = numbers
        else:
            dates = pd.to_datetime(series.astype(str), errors="coerce", utc=True, format="ISO8601")
            bad = (dates.isna() & series.notna()).to_numpy()
            if bad.any():
                at = int(np.argmax(bad))
                what = f"{where(at)}: {clip(str(series.iloc[at]))} in column {clip(column)} is not a time"
                raise ReadError(path, what, hint="give seconds, or dates such as 2024-05-01T12:00:00.5")
            series = dates
    if pd.api.types.is_datetime64_any_dtype(series):
        if series.dt.tz is not None:
            series = series.dt.tz_convert("UTC").dt.tz_localize(None)
        nanoseconds = series.to_numpy().astype("datetime64[ns]")
        if np.isnat(nanoseconds).any():
            return np.where(np.isnat(nanoseconds), np.nan, nanoseconds.astype(np.int64)), True
        return nanoseconds.astype(np.int64), True
    if series.dtype.kind == "i" and not series.isna().any():
        return series.to_numpy(dtype=np.int64), False
    floats = series.to_numpy(dtype=np.float64, na_value=np.nan)
    return np.where(np.isinf(floats), np.nan, floats), False


def _unit_by_size(valid: NDArray[np.int64] | NDArray[np.float64], largest: float, column: str, log: ReadLog) -> float:
    """Return the unit [s] of time stamps without a stated one, from their size and their steps."""
    steps = np.diff(valid)
    steps = steps[steps > 0]
    step = float(np.median(steps)) if len(steps) else 0.0
    if largest >= 1e17 or (largest < 1e14 and step >= 1e5):
        unit = "ns"
    elif largest >= 1e14 or (largest < 1e11 and step >= 2e3):
        unit = "us"
    elif largest >= 1e11:
        unit = "ms"
    else:
        if step >= 5:
            log.warn(f"column {clip(column)} steps by {step:g} s; if that is milliseconds, call it {column}_ms")
        return 1.0
    log.warn(f"column {clip(column)} was read as {unit}, from its size")
    return SECONDS[unit]
