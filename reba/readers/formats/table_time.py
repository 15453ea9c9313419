"""Time columns of tables: seconds, other units, dates, or the two columns of a ROS stamp."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.errors import ReadError
from reba.readers.formats.text import BLANKS
from reba.readers.recording.row_times import CENTURY, ROWS_PER_RESTART
from reba.readers.recording.stream import ReadLog, clip

if TYPE_CHECKING:
    import pandas as pd

NAMES = ("time", "t", "timestamp", "header.stamp", "header_stamp", "/header/stamp", "stamp", "__time", "log_time",
         "elapsed", "elapsed_time", "sim_time", "seconds", "secs", "sec", "datetime", "date_time")  # fmt: skip
"""Names of time columns in lower case, the likelier first; a unit may follow: `time_ms`, `Time [s]`."""
FRAMES = (
    "frame",
    "frame#",
    "frame_number",
    "frame_index",
    "frame_idx",
    "frame_id",
    "frame_no",
    "frame_num",
    "framenumber",
)
"""Names of columns of the numbers of frames in lower case."""
SECONDS: dict[str, float] = {
    **dict.fromkeys(("s", "sec", "secs", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "usec", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanoseconds"), 1e-9),
    **dict.fromkeys(("min", "mins", "minutes"), 60.0),
    **dict.fromkeys(("h", "hr", "hours"), 3600.0),
}
"""Length of a unit of time [s] by the suffix of a column name."""
PAIRS = ((".sec", ".nanosec"), (".secs", ".nsecs"), ("_sec", "_nanosec"), ("_secs", "_nsecs"),
         ("sec", "nanosec"), ("secs", "nsecs"))  # fmt: skip
"""Suffixes of the two columns of a ROS stamp, or their names: seconds, and nanoseconds to add."""
ABSOLUTE = 1e8
"""[s] Larger times are dates: no recording lasts that long, and counted from 1970 it is March 1973."""
SHORTEST_STEP = 5e-4
"""[s] Steps of time that are shorter are of another unit: no posture is measured 2000 times a second; a choice."""
LARGEST_INTEGER = 4e18
"""Just below the largest 64-bit integer."""
DAY = 86_400.0
"""[s] Length of a day."""
_CLOCK = re.compile(r"^(?:(?P<h>\d{1,3}):)?(?P<m>\d{1,2}):(?P<s>\d{2})(?:[.,:](?P<f>\d+))?$")
_DAY = re.compile(r"^(?:(?P<y>\d{4})[./](?P<m>\d\d)[./](?P<d>\d\d)|(?P<d2>\d\d)\.(?P<m2>\d\d)\.(?P<y2>\d{4}))")
_FRACTION = re.compile(r"(?<=:\d\d),(?=\d)")
_NAME = re.compile(r"^(.+?)(?:[ _]?[\[(](\w+)[\])]|[ _](\w+))?$")


def time_column(path: Path, columns: list[str], rate: float | None = None) -> tuple[str, float | None, str | None]:
    """Return the name of the time column, its unit [s] if the name states it, and a column of nanoseconds to add."""
    ranked: list[tuple[int, str, float | None, str | None]] = []
    for column in columns:
        lower = column.lower()
        for seconds, nanoseconds in PAIRS:
            stem = column[: -len(seconds)]
            partner = stem + nanoseconds
            if lower.endswith(seconds) and partner in columns and stem.lower() in ("", *NAMES):
                ranked.append((-1, column, 1.0, partner))
        match = _NAME.match(lower)
        suffix = (match[2] or match[3] or "") if match else ""
        if lower in NAMES:
            ranked.append((NAMES.index(lower), column, SECONDS.get(lower), None))
        elif match and suffix in SECONDS and match[1] in NAMES:
            ranked.append((NAMES.index(match[1]), column, SECONDS[suffix], None))
    if rate is not None:
        if ranked:
            raise ReadError(path, f"it has times in column {clip(ranked[0][1])}", hint="leave the rate out")
        return "", None, None
    if not ranked:
        raise ReadError(
            path,
            f"no time column among its {len(columns)} columns ({', '.join(map(clip, columns[:4]))} ...)",
            hint="add a column 'time' in seconds, rename the column of times, or give the rate (--rate 30)",
        )
    return min(ranked, key=lambda entry: entry[0])[1:]


def take_time(
    path: Path, frame: pd.DataFrame, log: ReadLog, where: Callable[[int], str], rate: float | None = None
) -> tuple[Array, float, list[str]]:
    """Return the time (n,) [s], NaN where a row has none, the epoch [s] (0 if not a date), and the columns used.

    `where` names the line of a row in messages. With a `rate` [Hz] the times follow from the numbers of the frames,
    without such a column from those of the rows, and a time column is refused.
    """
    filled = [column for column in frame.columns if rate is None or frame[column].notna().any()]
    column, unit, nanoseconds = time_column(path, filled, rate)
    if rate is not None:
        if (numbered := frame_numbers(frame)) is None:
            log.time_source = f"rows at {rate:g} Hz, as given"
            return np.arange(len(frame)) / rate, 0.0, []
        log.time_source = f"column {clip(numbered[0])} at {rate:g} Hz, as given"
        return numbered[1] / rate, 0.0, []
    values, dated = _as_numbers(path, frame, column, where)
    if dated:
        unit = 1e-9
    valid = values[np.isfinite(values)] if values.dtype.kind == "f" else values
    if not len(valid):
        raise ReadError(
            path,
            f"no row has a value in the time column {clip(column)}",
            hint="give times in seconds, or their rate (--rate 30)",
        )
    largest = float(np.abs(valid.astype(np.float64)).max())
    if largest > LARGEST_INTEGER:
        raise ReadError(path, f"column {clip(column)} has {largest:.3g}, which is not a time", hint="give seconds")
    if unit is None:
        # One damaged time must not decide the unit of the others.
        unit = _unit_by_size(valid, float(np.median(np.abs(valid.astype(np.float64)))), column, log)
    log.time_source = f"column {column}"
    extra: Array = np.zeros(len(values))
    if nanoseconds is not None:
        extra = np.asarray(_as_numbers(path, frame, nanoseconds, where)[0], dtype=np.float64) * 1e-9
    typical = np.sort(valid)[len(valid) // 2]  # one of them: two may be centuries apart
    start = valid[np.abs(valid - typical) * unit < CENTURY][0]
    if abs(float(start)) * unit < ABSOLUTE:
        return values * unit + extra, 0.0, [column, *([nanoseconds] if nanoseconds else [])]
    # A difference of integers is exact to the nanosecond; seconds since 1970 as floats are not.
    return (values - start) * unit + extra, float(start) * unit, [column, *([nanoseconds] if nanoseconds else [])]


def plain(cell: object) -> object:
    """Return a cell in a type that `to_numeric` accepts; others as text, also whole numbers beyond floats."""
    if isinstance(cell, int) and abs(cell) > 1 << 1000:
        return "beyond floats"
    return cell if isinstance(cell, (int, float, str)) or cell is None else str(cell)


def without_blank_words(cells: pd.Series) -> pd.Series:
    """Return cells in types that `to_numeric` accepts, without words for "no value"."""
    known = cells.astype(object).map(plain)
    return known.mask(known.map(lambda cell: isinstance(cell, str) and cell.strip().lower() in BLANKS))


def frame_numbers(frame: pd.DataFrame) -> tuple[str, Array] | None:
    """Return the column of numbers of frames, and these (n,) in steps of one from that of the first row; None without.

    Frames without a person have no row in many tables; the others keep their time.
    """
    import pandas as pd

    for column in frame.columns:
        if str(column).strip().lower().replace(" ", "_") in FRAMES and pd.api.types.is_numeric_dtype(frame[column]):
            numbers = frame[column].to_numpy(dtype=np.float64, na_value=np.nan)
            steps = np.diff(np.unique(numbers))
            if len(steps) and np.isfinite(numbers).all() and (numbers == np.rint(numbers)).all():
                return str(column), (numbers - numbers[0]) / float(np.median(steps))
    return None


def _as_numbers(
    path: Path, frame: pd.DataFrame, column: str, where: Callable[[int], str]
) -> tuple[NDArray[np.int64] | Array, bool]:
    """Return integers where every row has one, else floats; and whether they are dates [ns since 1970]."""
    import pandas as pd

    series = frame[column]
    if pd.api.types.is_timedelta64_dtype(series):
        return np.where(series.isna(), np.nan, series.to_numpy().astype("timedelta64[ns]").astype(np.int64)), True
    if not (pd.api.types.is_numeric_dtype(series) or pd.api.types.is_datetime64_any_dtype(series)):
        series = without_blank_words(series)
        numbers = pd.to_numeric(series, errors="coerce")
        if numbers.isna().equals(series.isna()):
            series = numbers
        else:
            if (clock := _of_day(series)) is not None:
                return clock, True
            texts = series.astype(str).str.strip().str.replace(_DAY, _iso_day, regex=True)
            texts = texts.str.replace(_FRACTION, ".", regex=True)
            dates = pd.to_datetime(texts, errors="coerce", utc=True, format="ISO8601")
            bad = (dates.isna() & series.notna()).to_numpy()
            # Where nearly all cells are numbers, the others are wrong.
            words = (numbers.isna() & series.notna()).to_numpy()
            bad = words if 10 * int(words.sum()) < len(words) else bad
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


def _iso_day(match: re.Match[str]) -> str:
    year, month, day, *other = match.groups()
    return "-".join((year, month, day) if year else reversed(other))


def _of_day(series: pd.Series) -> Array | None:
    """Return times of day, or lengths of time, as nanoseconds; None for other texts. After midnight they go on."""
    parsed = series.astype(str).str.strip().str.extract(_CLOCK)
    if (parsed["s"].isna() & series.notna()).any() or parsed["s"].isna().all():
        return None
    parts = parsed.fillna("0").astype(float)
    fractions = ("0." + parsed["f"].fillna("0")).astype(float)
    seconds = (parts["h"] * 3600 + parts["m"] * 60 + parts["s"] + fractions).to_numpy()
    seconds = np.where(series.isna(), np.nan, seconds)
    return np.rint((past_midnight(seconds) if (parts["h"] < 24).all() else seconds) * 1e9)


def past_midnight(seconds: Array) -> Array:
    """Return times of day (n,) [s], NaN where there is none, that go on after midnight.

    >>> past_midnight(np.array([86399.0, np.nan, 1.0])).tolist()
    [86399.0, nan, 86401.0]
    """
    there = np.flatnonzero(np.isfinite(seconds))
    days = np.zeros(len(seconds))
    days[there[1:]] = np.cumsum(np.diff(seconds[there]) < -DAY / 2)
    return seconds + DAY * days


def _unit_by_size(valid: NDArray[np.int64] | Array, typical: float, column: str, log: ReadLog) -> float:
    """Return the unit [s] of time stamps without a stated one, from their size and their steps."""
    steps = np.diff(valid)
    if np.count_nonzero(steps < 0) * ROWS_PER_RESTART > len(valid):
        steps = np.diff(np.sort(valid))
    steps = steps[steps > 0]
    step = float(np.median(steps)) if len(steps) else 0.0
    if typical >= 1e17 or (typical < 1e14 and step >= SHORTEST_STEP * 1e9):
        unit = "ns"
    elif typical >= 1e14 or (typical < 1e11 and step >= 2e3):
        unit = "us"
    elif typical >= 1e11:
        unit = "ms"
    else:
        if step >= 5:
            log.warn(f"column {clip(column)} steps by {step:g} s; if these are milliseconds, call it {column}_ms")
        elif 0 < step < SHORTEST_STEP:
            log.warn(f"column {clip(column)} steps by {step:.2g} s; if these are minutes or days, give seconds")
        return 1.0
    log.warn(f"column {clip(column)} was read as {unit}, from its size")
    return SECONDS[unit]
