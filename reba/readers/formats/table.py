"""Tables: CSV and Parquet files of posture angles or joint values, and exports of Vicon and OptiTrack Motive.

A table with columns of the posture table is one (`angles`, in degrees). Any other with a time column has joint values
(`joints`) under the names of its columns; a profile states their meaning.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.errors import ReadError
from reba.posture.columns import COLUMNS, SIDES
from reba.posture.factors import BOTH_SIDES, FACTORS
from reba.readers.formats.file_content import head_of, unpacked_name
from reba.readers.formats.long_points import wide_points
from reba.readers.formats.motive import is_motive, open_motive
from reba.readers.formats.score_file import recorded_with
from reba.readers.formats.table_columns import (
    DEGREES,
    LEAST_POINTS,
    coordinates,
    metres_of,
    named_units,
    near_names,
)
from reba.readers.formats.table_file import (
    PARQUET,
    SEPARATORS,
    TableFile,
    read_csv,
    read_parquet,
    separator_of,
)
from reba.readers.formats.text import LARGEST
from reba.readers.formats.vicon import is_vicon, open_vicon
from reba.readers.recording.stream import ReadLog, Recording, Stream, Topic, array_stream, check_time, clip

if TYPE_CHECKING:
    import pandas as pd

EXTENSIONS = (".csv", ".tsv", ".parquet", ".pq")
WORDED = (*FACTORS, *BOTH_SIDES, *(f"shoulder_raised_{side}" for side in SIDES))
"""Columns that may have words; factors are checked where they are scored."""
KNOWN = (*COLUMNS, *WORDED)
"""Columns with a meaning, for the hint on a misspelt name."""
FORMATS = {"csv": "CSV", "parquet": "Parquet", "xlsx": "Excel"}
"""Name of a reader -> of its format, in messages."""
MAX_CHECKED = 200
"""Columns compared with the known ones, which takes time; posture tables are not wider."""


def sniff(path: Path, head: bytes) -> bool:
    """Return whether the first bytes are Parquet, a Vicon export, or text with known column names."""
    if head.startswith(PARQUET):
        return True
    if not head.startswith((b"\xff\xfe", b"\xfe\xff")) and b"\0" in head:
        return False
    text = head.decode("utf-16" if head.startswith((b"\xff\xfe", b"\xfe\xff")) else "utf-8-sig", "replace")
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    lines = lines[1:] if lines and separator_of(lines[0]) else lines
    if not lines or is_vicon(lines[0]) or is_motive(lines[0]):
        return bool(lines)
    separator = max(SEPARATORS, key=lines[0].count)
    words = {word.strip(' "').lower() for word in lines[0].split(separator)}
    if len(words) < 2 or lines[0].lstrip()[:1] in ("<", "{", "["):
        return False
    return path.suffix.lower() in EXTENSIONS or bool(words & {*COLUMNS, *NAMES})


def open_table(path: Path, rate: float | None = None) -> Recording:
    """Open a CSV or Parquet file: `angles` with the complete table, `joints`, or, of Vicon, `points`."""
    log = ReadLog()
    try:
        head = head_of(path)
    except OSError as error:
        raise ReadError(path, error.strerror or str(error), hint="give an existing, readable file") from error
    name = unpacked_name(path).stem
    if head.startswith(PARQUET):
        return table_recording(path, "parquet", read_parquet(path, log), log, rate, name)
    first = head.removeprefix(b"\xef\xbb\xbf").decode("latin-1").lstrip().partition("\n")[0]
    for known, opener in ((is_vicon, open_vicon), (is_motive, open_motive)):
        if known(first):
            if rate is not None:
                raise ReadError(path, "it has times of its own", hint="leave the rate out")
            return opener(path, log)
    return table_recording(path, "csv", read_csv(path, log), log, rate, name)


def table_recording(path: Path, format: str, file: TableFile, log: ReadLog, rate: float | None, name: str) -> Recording:
    """Return the recording of a table, its streams under `name`: angles, or joints and points.

    Args:
        format: name of the reader.
        log: notes made on opening.
        rate: [Hz] of a table without times, else None.

    Raises:
        ReadError: it has no rows, no times or no numbers, or a cell that is no number where one is expected.
    """
    frame = file.frame
    if not len(frame):
        raise ReadError(path, "the table has no rows", hint="give at least one row of values")
    scored = recorded_with(path, map(str, frame.columns), file.scored)
    if (wide := wide_points(frame)) is not None:
        frame, file = wide, replace(file, where=lambda row: f"frame {row + 1}")
    frame, units = named_units(frame, KNOWN)
    file = replace(file, frame=frame)
    time, epoch, used = take_time(path, frame, log, file.where, rate)
    timed = ~np.isnan(time)
    if not timed.all():
        log.skip(int((~timed).sum()), f"{file.where(int(np.argmin(timed)))}: no time")
    angles = [column for column in COLUMNS if column in frame.columns]
    numbers: dict[str, np.ndarray] = {}
    texts: list[str] = []
    for column in [column for column in frame.columns if column not in used]:
        factor = bool(angles) and column in WORDED
        values = None if factor else _numbers(path, file, column, column in angles, log)
        if values is None:
            texts.append(column)
        else:
            factor_of = DEGREES.get(units.get(column, ""), 1.0) if column in angles else 1.0
            numbers[column] = values[timed] * factor_of if factor_of != 1.0 else values[timed]
    time = time[timed]
    check_time(time, log)
    others = [column for column in (*numbers, *texts)[:MAX_CHECKED] if column not in KNOWN]
    absent = [column for column in KNOWN if column not in frame.columns]
    near = "" if scored is not None else near_names(others, absent)
    if near:
        near = f"not read as columns of a posture table: {near}"
        log.warn(near)
    kind: Literal["angles", "joints"] = "angles" if angles else "joints"
    names = tuple(angles) if angles else tuple(numbers)
    if not names:
        raise ReadError(path, "no column beside the time has numbers", hint="give columns of joint values or angles")
    stream = array_stream(
        name,
        kind,
        "posture table" if angles else f"{FORMATS[format]} table",
        names,
        time,
        np.column_stack([numbers[name] for name in names]),
        opened=log,
        epoch=epoch,
        unit="deg" if angles else _unit((*names, *(f"_{units[name]}" for name in names if name in units))),
        table=(lambda: _table(frame, timed, time, numbers, used)) if angles else None,
    )
    streams = [stream]
    points = {} if angles else coordinates(numbers)
    if len(points) >= LEAST_POINTS:
        streams.append(_points(name, points, numbers, units, time, log, epoch))
    why = f"{len(names)} angle columns" if angles else f"{len(names)} columns of numbers"
    topics = [Topic(stream.name, stream.format, len(time), True, why)]
    if not angles:
        topics += [Topic(text, "column", len(time), False, "text, not numbers") for text in texts]
    hint = f"{near}; rename them" if near else ""
    return Recording(str(path), format, tuple(streams), (*topics, *file.left_out), log, hint, scored=scored)


def _points(
    name: str,
    points: dict[str, tuple[str, str, str]],
    numbers: dict[str, np.ndarray],
    units: dict[str, str],
    time: Array,
    log: ReadLog,
    epoch: float,
) -> Stream:
    """Return the stream of the points whose coordinates are columns, in metres."""
    values = np.stack([np.column_stack([numbers[name] for name in columns]) for columns in points.values()], axis=1)
    named = {units[name] for columns in points.values() for name in columns if name in units}
    note = ReadLog(time_source=log.time_source)
    values = values * metres_of(values, named, note)
    note.warnings += log.warnings
    return array_stream(name, "points", "table of points", tuple(points), time, values, opened=note, epoch=epoch)


def _numbers(path: Path, file: TableFile, column: str, angle: bool, log: ReadLog) -> np.ndarray | None:
    """Return a column as floats (n,), None if it is text.

    Raises:
        ReadError: an angle, or a cell in a column that is mostly numbers, is not a number.
    """
    import pandas as pd

    series = file.frame[column]
    if pd.api.types.is_datetime64_any_dtype(series) or pd.api.types.is_timedelta64_dtype(series):
        return None
    if not pd.api.types.is_numeric_dtype(series):
        numbers = pd.to_numeric(series.map(_plain), errors="coerce")
        bad = (numbers.isna() & series.notna()).to_numpy()
        if bad.any():
            if not angle and 2 * int(bad.sum()) > int(series.notna().sum()):
                return None
            at = int(np.argmax(bad))
            what = f"{file.where(at)}: {clip(str(series.iloc[at]))} in column {clip(column)} is not a number"
            raise ReadError(path, what, hint="correct it, or leave it blank where nothing was measured")
        series = numbers
    values: np.ndarray = series.to_numpy(dtype=np.float64, na_value=np.nan)
    large = np.abs(values) > LARGEST
    if large.any():
        at = int(np.argmax(large))
        what = f"{file.where(at)}: {values[at]:g} in column {clip(column)}"
        if angle:
            raise ReadError(path, f"{what} is not an angle", hint="correct it, or leave it blank")
        log.warn(f"{what} and {int(large.sum()) - 1} more exceed {LARGEST:g}; they were read as gaps")
        values = np.where(large, np.nan, values)
    return values


def _plain(cell: object) -> object:
    """Return a cell in a type that `to_numeric` accepts; others as text, also whole numbers beyond floats."""
    if isinstance(cell, int) and abs(cell) > 1 << 1000:
        return "beyond floats"
    return cell if isinstance(cell, (int, float, str)) or cell is None else str(cell)


def _unit(names: tuple[str, ...]) -> Literal["rad", "deg", ""]:
    """Return the unit that the column names state, "" if none does or they differ."""
    ends = {name.lower().rsplit("_", 1)[-1] for name in names}
    if "deg" in ends:
        return "" if "rad" in ends else "deg"
    return "rad" if "rad" in ends else ""


def _table(
    frame: pd.DataFrame, timed: np.ndarray, time: np.ndarray, numbers: dict[str, np.ndarray], used: list[str]
) -> pd.DataFrame:
    """Return the rows that have a time: `time` [s] first, the angles as floats, other columns unchanged."""
    table = frame[timed].drop(columns=[*used, *({"time"} & set(frame.columns))]).reset_index(drop=True)
    for column in COLUMNS:
        if column in table.columns:
            table[column] = numbers[column]
    table.insert(0, "time", time)
    return table


NAMES = ("time", "t", "timestamp", "header.stamp", "header_stamp", "/header/stamp", "stamp", "__time", "log_time",
         "elapsed", "elapsed_time", "seconds", "datetime", "date_time")  # fmt: skip
"""Names of time columns in lower case, the likelier first; a unit may follow: `time_ms`, `Time [s]`."""
SECONDS: dict[str, float] = {
    **dict.fromkeys(("s", "sec", "secs", "seconds"), 1.0),
    **dict.fromkeys(("ms", "msec", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "usec", "microseconds"), 1e-6),
    **dict.fromkeys(("ns", "nsec", "nanoseconds"), 1e-9),
}
"""Length of a unit of time [s] by the suffix of a column name."""
PAIRS = ((".sec", ".nanosec"), (".secs", ".nsecs"), ("_sec", "_nanosec"), ("_secs", "_nsecs"))
"""Suffixes of the two columns of a ROS stamp: seconds, and nanoseconds to add."""
ABSOLUTE = 1e8
"""[s] Larger times are dates: no recording lasts that long, and counted from 1970 it is March 1973."""
LARGEST_INTEGER = 4e18
"""Just below the largest 64-bit integer."""
_NAME = re.compile(r"^(.+?)(?:[ _]?[\[(](\w+)[\])]|[ _](\w+))?$")


def time_column(path: Path, columns: list[str], rate: float | None = None) -> tuple[str, float | None, str | None]:
    """Return the name of the time column, its unit [s] if the name states it, and a column of nanoseconds to add."""
    ranked: list[tuple[int, str, float | None, str | None]] = []
    for column in columns:
        lower = column.lower()
        for seconds, nanoseconds in PAIRS:
            stem = column[: -len(seconds)]
            partner = stem + nanoseconds
            if lower.endswith(seconds) and partner in columns and stem.lower() in NAMES:
                ranked.append((-1, column, 1.0, partner))
        match = _NAME.match(lower)
        suffix = (match[2] or match[3] or "") if match else ""
        if lower in NAMES:
            ranked.append((NAMES.index(lower), column, 1.0 if lower == "seconds" else None, None))
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

    `where` names the line of a row in messages. With a `rate` [Hz] the rows are numbered, and a time column is refused.
    """
    filled = [column for column in frame.columns if rate is None or frame[column].notna().any()]
    column, unit, nanoseconds = time_column(path, filled, rate)
    if rate is not None:
        log.time_source = f"rows at {rate:g} Hz, as given"
        return np.arange(len(frame)) / rate, 0.0, []
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
    start = valid[0]
    if abs(float(start)) * unit < ABSOLUTE:
        return values * unit + extra, 0.0, [column, *([nanoseconds] if nanoseconds else [])]
    # A difference of integers is exact to the nanosecond; seconds since 1970 as floats are not.
    return (values - start) * unit + extra, float(start) * unit, [column, *([nanoseconds] if nanoseconds else [])]


def _as_numbers(
    path: Path, frame: pd.DataFrame, column: str, where: Callable[[int], str]
) -> tuple[NDArray[np.int64] | Array, bool]:
    """Return integers where every row has one, else floats; and whether they are dates [ns since 1970]."""
    import pandas as pd

    series = frame[column]
    if not (pd.api.types.is_numeric_dtype(series) or pd.api.types.is_datetime64_any_dtype(series)):
        numbers = pd.to_numeric(series.astype(object).map(_plain), errors="coerce")
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


def _unit_by_size(valid: NDArray[np.int64] | Array, typical: float, column: str, log: ReadLog) -> float:
    """Return the unit [s] of time stamps without a stated one, from their size and their steps."""
    steps = np.diff(valid)
    steps = steps[steps > 0]
    step = float(np.median(steps)) if len(steps) else 0.0
    if typical >= 1e17 or (typical < 1e14 and step >= 1e5):
        unit = "ns"
    elif typical >= 1e14 or (typical < 1e11 and step >= 2e3):
        unit = "us"
    elif typical >= 1e11:
        unit = "ms"
    else:
        if step >= 5:
            log.warn(f"column {clip(column)} steps by {step:g} s; if these are milliseconds, call it {column}_ms")
        return 1.0
    log.warn(f"column {clip(column)} was read as {unit}, from its size")
    return SECONDS[unit]
