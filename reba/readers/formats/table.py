"""Tables: CSV and Parquet files of posture angles or joint values, and exports of Vicon and OptiTrack Motive.

A table with columns of the posture table is one (`angles`, in degrees). Any other with a time column has joint values
(`joints`) under the names of its columns; a profile states their meaning.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.errors import ReadError
from reba.posture.columns import COLUMNS, COLUMNS_OF, SIDELESS, SIDES
from reba.posture.factors import BOTH_SIDES, FACTORS
from reba.readers.formats.file_content import head_of, unpacked_name
from reba.readers.formats.long_points import wide_points
from reba.readers.formats.motive import is_motive, open_motive
from reba.readers.formats.score_file import recorded_with
from reba.readers.formats.table_columns import (
    DEGREES,
    KILOGRAMS,
    LEAST_POINTS,
    coordinates,
    metres_of,
    named_units,
    near_names,
    numbered_landmarks,
    without_depth,
)
from reba.readers.formats.table_file import (
    PARQUET,
    SEPARATORS,
    TableFile,
    read_csv,
    read_parquet,
    separator_of,
)
from reba.readers.formats.table_people import is_id, rows_of_people
from reba.readers.formats.table_time import NAMES, frame_numbers, plain, take_time, without_blank_words
from reba.readers.formats.text import LARGEST
from reba.readers.formats.vicon import is_vicon, open_vicon
from reba.readers.recording.row_times import row_times
from reba.readers.recording.stream import ReadLog, Recording, Stream, Topic, array_stream, clip

if TYPE_CHECKING:
    import pandas as pd

EXTENSIONS = (".csv", ".tsv", ".parquet", ".pq")
WORDED = (*FACTORS, *BOTH_SIDES, *(f"shoulder_raised_{side}" for side in SIDES))
"""Columns that may have words; factors are checked where they are scored."""
KNOWN = (*COLUMNS, *WORDED, *SIDELESS)
"""Columns with a meaning, for their spelling and the hint on a misspelt name."""
FORMATS = {"csv": "CSV", "parquet": "Parquet", "xlsx": "Excel"}
"""Name of a reader -> of its format, in messages."""
MAX_CHECKED = 200
"""Columns compared with the known ones, which takes time; posture tables are not wider."""


def sniff(path: Path, head: bytes) -> bool:
    """Return whether the first bytes are Parquet, a Vicon export, or text with known column names."""
    if head.startswith(PARQUET):
        return True
    if b"\0" in head:
        return False
    text = head.decode("utf-8", "replace")
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
    first = head.decode("latin-1").lstrip().partition("\n")[0]
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
    frame, units = named_units(frame, KNOWN)
    frame = _in_kilograms(_on_both_sides(frame, units), units)
    file = replace(file, frame=frame)
    people = None
    if scored is None and any(map(is_id, frame.columns)):
        numbered = rate is None or frame_numbers(frame) is not None
        time = take_time(path, frame, ReadLog(), file.where, rate)[0] if numbered else None
        people = rows_of_people(path, frame, time, log)
    if people is None:
        return _of_one(path, format, file, units, log, rate, name, scored)
    recordings = [
        _of_one(path, format, _rows(file, rows), units, ReadLog(warnings=[*log.warnings]), rate, label, scored)
        for label, rows in people.items()
    ]
    streams = tuple(stream for recording in recordings for stream in recording.streams)
    topics = tuple(topic for recording in recordings for topic in recording.topics)
    return Recording(str(path), format, streams, topics, ReadLog(), recordings[0].hint)


def _on_both_sides(frame: pd.DataFrame, units: dict[str, str]) -> pd.DataFrame:
    """Return a table in which an angle without a side stands for each side that has no column of its own."""
    for name in SIDELESS:
        if name in frame.columns:
            absent = [column for column in COLUMNS_OF[name] if column not in frame.columns]
            units |= {column: units[name] for column in absent if name in units}
            frame = frame.assign(**dict.fromkeys(absent, frame[name])).drop(columns=[name] if absent else [])
    return frame


def _in_kilograms(frame: pd.DataFrame, units: dict[str, str]) -> pd.DataFrame:
    """Return a table whose load is in kilograms, where another unit is named; texts stay for the scoring."""
    import pandas as pd

    if "load" not in frame.columns:
        return frame
    numbers = pd.to_numeric(frame["load"].map(plain), errors="coerce")
    if not numbers.isna().equals(frame["load"].isna()):
        return frame
    return frame.assign(load=numbers * KILOGRAMS.get(units.get("load", ""), 1.0))


def _rows(file: TableFile, rows: NDArray[np.intp]) -> TableFile:
    """Return some rows of a table."""
    frame = file.frame.iloc[rows].reset_index(drop=True)
    return replace(file, frame=frame, where=lambda row: file.where(int(rows[row])))


def _of_one(
    path: Path,
    format: str,
    file: TableFile,
    units: dict[str, str],
    log: ReadLog,
    rate: float | None,
    name: str,
    scored: dict[str, Any] | None,
) -> Recording:
    """Return the recording of the rows of one person."""
    if (wide := wide_points(file.frame, log)) is not None:
        file = replace(file, frame=wide, where=lambda row: f"frame {row + 1}")
        axes = {axis.lower(): unit for axis, unit in units.items() if axis.lower() in "xyz"}
        units |= {
            str(column): axes[column[-1]] for column in wide.columns if column[-2:-1] == "_" and column[-1] in axes
        }
    frame = file.frame
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
        table=(lambda: _table(frame, timed, row_times(time).time, numbers, used)) if angles else None,
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
    if not angles and (flat := without_depth(numbers)) >= LEAST_POINTS:
        hint = f"{flat} points have x and y and no z, as 2D keypoints: give 3D keypoints"
    elif len(points) >= LEAST_POINTS and all(point[-1].isdigit() for point in points):
        first = next(iter(points))
        hint = f'{len(points)} numbered points: say in a profile which is which, as hip_left = "{first}" under [points]'
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
    names = tuple(points)
    if (landmarks := numbered_landmarks(names)) and not set(landmarks.values()) & set(names):
        note.warn(f"the {len(landmarks)} numbered points were read as those of MediaPipe's pose, in its order")
        names = tuple(landmarks.get(point, point) for point in names)
    return array_stream(name, "points", "table of points", names, time, values, opened=note, epoch=epoch)


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
        series = without_blank_words(series)
        numbers = pd.to_numeric(series, errors="coerce")
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


def _unit(names: tuple[str, ...]) -> Literal["rad", "deg", ""]:
    """Return the unit that the column names state, "" if none does or they differ."""
    ends = {name.lower().rsplit("_", 1)[-1] for name in names}
    if "deg" in ends:
        return "" if "rad" in ends else "deg"
    return "rad" if "rad" in ends else ""


def _table(
    frame: pd.DataFrame, timed: np.ndarray, time: np.ndarray, numbers: dict[str, np.ndarray], used: list[str]
) -> pd.DataFrame:
    """Return the rows that have a time: `time` [s] first, the angles as floats, other columns unchanged.

    Args:
        timed: which rows of the frame have a time.
        time: of these rows [s], NaN where it is damaged.
    """
    table = frame[timed].drop(columns=[*used, *({"time"} & set(frame.columns))]).reset_index(drop=True)
    for column in COLUMNS:
        if column in table.columns:
            table[column] = numbers[column]
    table.insert(0, "time", time)
    return table if np.isfinite(time).all() else table[np.isfinite(time)].reset_index(drop=True)
