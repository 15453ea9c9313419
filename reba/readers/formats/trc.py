"""TRC (track row column) marker files: three header lines, names every third column, rows of numbers.

Source: OpenSim documentation, "Marker (.trc) files". Fields are separated by tabs, or by commas after a spreadsheet. A
blank field or "nan" is a gap. The vertical axis is not stated: y for OpenSim, z for most cameras.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.errors import ReadError
from reba.readers.formats.marker_sets import marker_recording, metres
from reba.readers.formats.text import number_rows, read_lines
from reba.readers.recording.stream import ReadLog, Recording, check_time, clip

NAMES_AT = 3
"""Index of the line with the marker names."""


def sniff(path: Path, head: bytes) -> bool:
    """Return whether the first bytes are the header of a TRC file."""
    return head.removeprefix(b"\xef\xbb\xbf").lstrip()[:12].lower() == b"pathfiletype"


def open_trc(path: Path) -> Recording:
    """Open a TRC file: points in metres, NaN in gaps."""
    log = ReadLog(time_source="time column")
    lines = read_lines(path, log)
    if not sniff(path, lines[0].encode()):
        raise ReadError(path, "line 1: 'PathFileType' expected", hint="export it as .trc again")
    if len(lines) <= NAMES_AT + 1:
        raise ReadError(path, f"the header ends at line {len(lines)} of 5", hint="the file is cut: export it again")
    separator = "," if lines[NAMES_AT].count(",") > lines[NAMES_AT].count("\t") else "\t"
    header = _keys(lines[1], lines[2], separator)
    scale = metres(path, header.get("units", ""), "line 3, Units")
    names = _names(path, lines, separator)
    rows, numbers = number_rows(path, lines, NAMES_AT + 2, 2 + 3 * len(names), log, separator=separator, gaps=True)
    if not len(rows):
        raise ReadError(path, "no row of numbers after the header", hint="export it again with its frames")
    stated = header.get("numframes")
    if stated is not None and stated.removesuffix(".0") != str(len(rows)):
        log.warn(f"the header states {clip(stated)} frames and the file has {len(rows)}; those were read")
    time, rows = _time(path, rows, numbers, header, log)
    points = rows[:, 2:].reshape(len(rows), len(names), 3) * scale
    # A marker with a missing coordinate is a gap.
    points[np.isnan(points).any(axis=2)] = np.nan
    return marker_recording(path, ("trc", "TRC markers"), names, time, points, log)


def _keys(keys: str, values: str, separator: str) -> dict[str, str]:
    pairs = zip(keys.split(separator), values.split(separator), strict=False)
    return {key.strip().lower(): value.strip() for key, value in pairs if key.strip()}


def _names(path: Path, lines: list[str], separator: str) -> list[str]:
    """Return the marker names, "" where a column of coordinates has none."""
    fields = [field.strip() for field in lines[NAMES_AT].split(separator)]
    coordinates = [field for field in lines[NAMES_AT + 1].split(separator) if field.strip()]
    count = len(coordinates) // 3
    placed = {index: name for index, name in enumerate(fields[2:]) if name}
    if coordinates and len(coordinates) % 3 == 0 and placed:
        if all(index % 3 == 0 and index < 3 * count for index in placed):
            return [placed.get(3 * marker, "") for marker in range(count)]
        if len(placed) == count:
            return list(placed.values())
    raise ReadError(
        path,
        f"line {NAMES_AT + 1} names {len(placed)} markers and line {NAMES_AT + 2} has {len(coordinates)} coordinates,"
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
            rate = float(header.get("datarate", ""))
        except ValueError:
            rate = 0.0
        if not 0 < rate < 1e6:
            raise ReadError(path, "the Time column is blank and DataRate is not a rate", hint="write a DataRate in Hz")
        log.warn(f"the Time column is blank; time was counted from DataRate {rate:g} Hz")
        log.time_source = "DataRate"
        return np.arange(len(rows), dtype=np.float64) / rate, rows
    blank = np.isnan(time)
    if blank.any():
        log.skip(int(blank.sum()), f"line {numbers[np.argmax(blank)]}: no time")
        rows = rows[~blank]
    time = np.ascontiguousarray(rows[:, 1])
    check_time(time, log)
    return time, rows
