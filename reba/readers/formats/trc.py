"""TRC (track row column) marker files: three header lines, names every third column, rows of numbers.

Source: OpenSim documentation, "Marker (.trc) files". Fields are separated by tabs; other programs write commas, blanks
or two tabs, leave out the tabs at the end of a line, or put blank lines between. A blank field or "nan" is a gap. The
vertical axis is not stated: y for OpenSim, z for most cameras.
"""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.errors import ReadError
from reba.readers.formats.lengths import metres, metres_by_size
from reba.readers.formats.marker_sets import marker_recording
from reba.readers.formats.text import BLANKS, number, number_rows, read_lines, rows_separator, with_time
from reba.readers.recording.stream import ReadLog, Recording, clip

SEPARATORS: tuple[str | None, ...] = ("\t", "\t\t", ",", None)
"""What may stand between two fields, the likeliest first; None for any blanks, which leave no gap."""


def sniff(path: Path, head: bytes) -> bool:
    """Return whether the first bytes are the header of a TRC file."""
    return head.lstrip()[:12].lower() == b"pathfiletype"


def open_trc(path: Path) -> Recording:
    """Open a TRC file: points in metres, NaN in gaps."""
    log = ReadLog(time_source="time column")
    lines = read_lines(path, log)
    filled = list(islice((index for index, line in enumerate(lines) if line.strip(" \t,")), 5))
    if not filled or not sniff(path, lines[filled[0]].encode()):
        raise ReadError(path, "line 1: 'PathFileType' expected", hint="export it as .trc again")
    if len(filled) < 5:
        at = filled[-1] + 1
        raise ReadError(path, f"the header ends at line {at} of 5", hint="the file is cut: export it again")
    _, keys_at, values_at, names_at, first = filled
    header = _keys(lines[keys_at], lines[values_at])
    coordinates = _fields(lines[first])
    if _is_numeric(coordinates):
        coordinates = []
    else:
        first += 1
    names = _names(path, lines[names_at], coordinates, f"line {names_at + 1}", f"line {filled[4] + 1}")
    width = 2 + 3 * len(names)
    separator = rows_separator(lines[first:], SEPARATORS, width)
    rows, numbers = number_rows(path, lines, first, width, log, separator=separator, gaps=True, short=True)
    if not len(rows):
        raise ReadError(path, "no row of numbers after the header", hint="export it again with its frames")
    stated = header.get("numframes")
    if stated is not None and stated.removesuffix(".0") != str(len(rows)):
        log.warn(f"the header states {clip(stated)} frames and the file has {len(rows)}; those were read")
    time, rows = _time(path, rows, numbers, header, log)
    points = rows[:, 2:].reshape(len(rows), len(names), 3)
    # A marker with a missing coordinate is a gap.
    points[np.isnan(points).any(axis=2)] = np.nan
    unit = header.get("units", "")
    points *= metres(path, unit, f"line {values_at + 1}, Units") if unit else metres_by_size(points, log, "mm")
    return marker_recording(path, ("trc", "TRC markers"), names, time, points, log)


def _split(line: str) -> list[str]:
    """Return the fields of a header line, blank ones included where tabs or commas separate them."""
    separator = "\t" if "\t" in line else ","
    return [field.strip() for field in (line.split(separator) if separator in line else line.split())]


def _fields(line: str) -> list[str]:
    return [field for field in _split(line) if field]


def _keys(keys: str, values: str) -> dict[str, str]:
    """Return the header; a blank value keeps its place where the tabs tell it."""
    named, given = _fields(keys), _fields(values)
    if len(named) != len(given):
        named, given = _split(keys), _split(values)
    return {key.lower(): value for key, value in zip(named, given, strict=False) if key}


def _is_numeric(fields: list[str]) -> bool:
    try:
        return bool([number(field) for field in fields if field.lower() not in BLANKS])
    except ValueError:
        return False


def _names(path: Path, line: str, coordinates: list[str], where: str, below: str) -> list[str]:
    """Return the marker names of a line, "" where a column of coordinates has none; `coordinates` has three of each."""
    fields = _split(line)
    start = next((at + 1 for at, field in enumerate(fields) if field.lower().startswith("time")), 2)
    placed = {index: name for index, name in enumerate(fields[start:]) if name}
    count = len(coordinates) // 3 if coordinates else len(placed)
    if len(coordinates) % 3 == 0 and placed:
        if len(placed) == count:
            return list(placed.values())
        if all(index % 3 == 0 and index < 3 * count for index in placed):
            return [placed.get(3 * marker, "") for marker in range(count)]
    raise ReadError(
        path,
        f"{where} names {len(placed)} markers and {below} has {len(coordinates)} coordinates,"
        " expected three for each marker",
        hint="export it as .trc again",
    )


def _time(
    path: Path, rows: Array, numbers: NDArray[np.int64], header: dict[str, str], log: ReadLog
) -> tuple[Array, Array]:
    """Return the times [s] and the rows that have one."""
    time = rows[:, 1]
    if np.isnan(time).all():
        try:
            rate = number(header.get("datarate", ""))
        except ValueError:
            rate = 0.0
        if not 0 < rate < 1e6:
            raise ReadError(path, "the Time column is blank and DataRate is not a rate", hint="write a DataRate in Hz")
        log.warn(f"the Time column is blank; time was counted from DataRate {rate:g} Hz")
        log.time_source = "DataRate"
        return np.arange(len(rows), dtype=np.float64) / rate, rows
    time, rows = with_time(time, rows, numbers, log)
    return time, rows
