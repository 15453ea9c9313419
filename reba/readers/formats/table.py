"""Tables: CSV and Parquet files of posture angles, of joint values, or of Vicon trajectories.

A table with columns of the posture table is one (`angles`, in degrees); any other with a time column holds joint
values (`joints`) under the names of its columns, which a profile gives a meaning.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from reba.errors import ReadError, did_you_mean
from reba.factors import BOTH_SIDES, FACTORS
from reba.posture import COLUMNS, SIDES
from reba.readers.memory import array_stream, check_time, clip
from reba.readers.stream import ReadLog, Recording, Topic
from reba.readers.table_file import PARQUET, SEPARATORS, TableFile, read_csv, read_parquet
from reba.readers.table_time import NAMES, take_time
from reba.readers.text import LARGEST
from reba.readers.vicon import is_vicon, open_vicon

if TYPE_CHECKING:
    import pandas as pd

EXTENSIONS = (".csv", ".tsv", ".parquet", ".pq")

WORDED = (*FACTORS, *BOTH_SIDES, *(f"shoulder_raised_{side}" for side in SIDES))
"""Columns that may hold words; what is wrong with a factor is said where it is scored."""

KNOWN = (*COLUMNS, *WORDED)
"""Columns with a meaning, to tell a slip of the pen from a column of another kind."""

MAX_CHECKED = 200
"""Columns compared with the known ones, which takes time; a wider table is no posture table."""


def sniff(path: Path, head: bytes) -> bool:
    """Return whether the first bytes are Parquet, a Vicon export, or text with columns that fit."""
    if head.startswith(PARQUET):
        return True
    if not head.startswith((b"\xff\xfe", b"\xfe\xff")) and b"\0" in head:
        return False
    text = head.decode("utf-16" if head.startswith((b"\xff\xfe", b"\xfe\xff")) else "utf-8-sig", "replace")
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if not lines or is_vicon(lines[0]):
        return bool(lines)
    separator = max(SEPARATORS, key=lines[0].count)
    words = {word.strip(' "').lower() for word in lines[0].split(separator)}
    if len(words) < 2 or lines[0].lstrip()[:1] in ("<", "{", "["):
        return False
    return path.suffix.lower() in EXTENSIONS or bool(words & {*COLUMNS, *NAMES})


def open_table(path: Path) -> Recording:
    """Open a CSV or Parquet file: `angles` with the whole table, `joints`, or, of Vicon, `points`.

    Raises:
        ReadError: no header, no time column, no number column, or a cell that is no number.
    """
    log = ReadLog()
    try:
        with path.open("rb") as file:
            head = file.read(4096)
    except OSError as error:
        raise ReadError(path, error.strerror or str(error), hint="give an existing, readable file") from error
    if head.startswith(PARQUET):
        return _recording(path, "parquet", read_parquet(path), log)
    if is_vicon(head.removeprefix(b"\xef\xbb\xbf").decode("latin-1").lstrip().partition("\n")[0]):
        return open_vicon(path, log)
    return _recording(path, "csv", read_csv(path, log), log)


def _recording(path: Path, format: str, file: TableFile, log: ReadLog) -> Recording:
    frame = file.frame
    if not len(frame):
        raise ReadError(path, "the table has no rows", hint="give at least one row of values")
    time, epoch, used = take_time(path, frame, log, file.where)
    timed = ~np.isnan(time)
    if not timed.all():
        log.skip(int((~timed).sum()), f"{file.where(int(np.argmin(timed)))}: no time")
    angles = [column for column in COLUMNS if column in frame.columns]
    numbers: dict[str, np.ndarray] = {}
    texts: list[str] = []
    for column in [column for column in frame.columns if column not in used]:
        worded = bool(angles) and column in WORDED
        values = None if worded else _numbers(path, file, column, column in angles, log)
        if values is None:
            texts.append(column)
        else:
            numbers[column] = values[timed]
    time = time[timed]
    check_time(time, log)
    for column in (*numbers, *texts)[:MAX_CHECKED]:
        if column not in KNOWN and (near := did_you_mean(column, KNOWN)):
            log.warn(f"column {clip(column)} is not one of the posture table{near}")
    kind: Literal["angles", "joints"] = "angles" if angles else "joints"
    names = tuple(angles) if angles else tuple(numbers)
    if not names:
        raise ReadError(path, "no column beside the time holds numbers", hint="give columns of joint values or angles")
    stream = array_stream(
        path.stem,
        kind,
        "posture table" if angles else f"{format.upper() if format == 'csv' else 'Parquet'} table",
        names,
        time,
        np.column_stack([numbers[name] for name in names]),
        opened=log,
        epoch=epoch,
        unit="deg" if angles else _unit(names),
        table=(lambda: _table(frame, timed, time, numbers, used)) if angles else None,
    )
    why = f"{len(names)} angle columns" if angles else f"{len(names)} columns of numbers"
    topics = [Topic(stream.name, stream.format, len(time), True, why)]
    if not angles:
        topics += [Topic(text, "column", len(time), False, "text, no numbers") for text in texts]
    return Recording(str(path), format, (stream,), (*topics, *file.left_out), log)


def _numbers(path: Path, file: TableFile, column: str, angle: bool, log: ReadLog) -> np.ndarray | None:
    """Return a column as floats (n,), None if it is text.

    Raises:
        ReadError: an angle, or a cell of a column that mostly holds numbers, is none.
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
            raise ReadError(path, f"{what} is no angle", hint="correct it, or leave it blank")
        log.warn(f"{what} and {int(large.sum()) - 1} more are no plausible numbers; they were read as gaps")
        values = np.where(large, np.nan, values)
    return values


def _plain(cell: object) -> object:
    """Return a cell as what `to_numeric` takes; bytes and the like stay no number."""
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
    """Return the rows that have a time: `time` [s] first, the angles as floats, every other column as it is."""
    table = frame[timed].drop(columns=[*used, *({"time"} & set(frame.columns))]).reset_index(drop=True)
    for column in COLUMNS:
        if column in table.columns:
            table[column] = numbers[column]
    table.insert(0, "time", time)
    return table
