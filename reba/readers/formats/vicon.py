"""The "Trajectories" section of a Vicon Nexus ASCII export (.csv): marker positions.

A section is a line with its name, its rate in Hz, a line of names above their first columns, a line of column names
(Frame, Sub Frame, X, Y, Z ...), a line of units, and rows until a blank line or the end.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from reba.errors import ReadError
from reba.readers.formats.lengths import metres
from reba.readers.formats.marker_sets import marker_recording
from reba.readers.formats.text import number, number_rows, read_lines
from reba.readers.recording.stream import ReadLog, Recording, Topic, clip

SECTIONS = ("trajectories", "devices", "joints", "model outputs", "segments", "events", "segments outputs")
"""First lines of a Vicon export in lower case."""
HEADER = 5
"""Lines of a section before its rows."""


def is_vicon(line: str) -> bool:
    """Return whether a line is the name of a section of a Vicon export.

    >>> is_vicon("Trajectories,,,"), is_vicon("time,joints")
    (True, False)
    """
    return line.strip(' \t\r\n,;"\ufeff').lower() in SECTIONS


def open_vicon(path: Path, log: ReadLog) -> Recording:
    """Open a Vicon export: points in metres, one stream per subject; frame 1 is at time 0."""
    log.time_source = "frame rate"
    lines = read_lines(path, log)
    sections = {
        line.strip(' \t,;"').lower(): index for index, line in reversed(list(enumerate(lines))) if is_vicon(line)
    }
    if "trajectories" not in sections:
        raise ReadError(
            path, "a Vicon export without its section 'Trajectories'", hint="export the trajectories with it"
        )
    start = sections.pop("trajectories")
    if len(lines) <= start + HEADER:
        raise ReadError(path, f"line {start + 1}: the section is truncated", hint="export it again")
    separator = max(",;\t", key=lines[start + 3].count)
    rate_text, names, columns, units = (
        [field.strip() for field in _fields(lines[start + offset], separator)] for offset in range(1, HEADER)
    )
    width = len(columns)
    while width and not columns[width - 1]:
        width -= 1
    if [column.lower() for column in columns[2:width]] != ["x", "y", "z"] * ((width - 2) // 3) or width < 5:
        what = f"line {start + 4}: {clip(lines[start + 3])}, expected Frame, Sub Frame, then X, Y, Z for each marker"
        raise ReadError(path, what, hint="export the trajectories again")
    rate = _rate(path, rate_text, start + 2)
    scales = {metres(path, unit, f"line {start + 5}") for unit in units[2:width]}
    if len(scales) != 1:
        raise ReadError(path, f"line {start + 5} has {len(scales)} units, expected one", hint="export it again")
    end = next((at for at in range(start + HEADER, len(lines)) if not lines[at].strip(" ,;\t")), len(lines))
    rows, _ = number_rows(
        path, lines[: end + 1], start + HEADER, width, log, separator=separator, gaps=True, short=True
    )
    rows = rows[~np.isnan(rows[:, 0])]
    if not len(rows):
        raise ReadError(path, f"line {start + 1}: no row of trajectories", hint="export the trial with its frames")
    time = (rows[:, 0] - 1.0) / rate
    points = rows[:, 2:].reshape(len(rows), -1, 3) * scales.pop()
    points[np.isnan(points).any(axis=2)] = np.nan
    labels = (names[2:] + [""] * width)[: width - 2 : 3]
    topics = [Topic(name, "Vicon section", None, False, "no marker positions") for name in sections]
    return marker_recording(path, ("csv", "Vicon trajectories"), labels, time, points, log, topics=topics)


def _fields(line: str, separator: str) -> list[str]:
    try:
        return next(csv.reader([line], delimiter=separator), [])
    except csv.Error:
        return line.split(separator)


def _rate(path: Path, fields: list[str], line: int) -> float:
    try:
        rate = number(fields[0])
    except (ValueError, IndexError):
        rate = 0.0
    if not 0 < rate < 1e5:
        raise ReadError(path, f"line {line}: expected the rate in Hz", hint="export the trajectories again")
    return rate
