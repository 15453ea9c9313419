"""CSV export of OptiTrack Motive: poses of skeleton bones and of rigid bodies, and marker positions.

Source: OptiTrack documentation, "Data Export: CSV": a line of keys and values; below it rows of types, labels, ids and,
since version 1.25, parents; a row of components (Rotation, Position ...) and one of axes; then a row for each frame. A
blank cell is a gap. Markers are measured; "Bone Marker" and "Rigid Body Marker" are where the solved body expects them.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.errors import ReadError
from reba.readers.formats.file_content import unpacked_name
from reba.readers.formats.lengths import metres
from reba.readers.formats.marker_sets import marker_recording
from reba.readers.formats.motive_bones import FORMAT, BoneFrames
from reba.readers.formats.text import number, number_rows, read_lines, with_time
from reba.readers.recording.stream import ReadLog, Recording, Stream, Topic, clip

MOST_HEADER_LINES: Final = 20
MAX_COLUMNS: Final = 20_000
"""More than 2000 markers or 1000 bones have."""
MEASURED: Final = "marker"
"""Type of the columns of markers as the cameras saw them."""


def is_motive(line: str) -> bool:
    """Return whether a line is the first one of a Motive export.

    >>> is_motive("Format Version,1.23,Take Name,walk"), is_motive("time,knee")
    (True, False)
    """
    return line.lstrip('\ufeff" ').lower().startswith("format version")


@dataclass
class Signal:
    """One bone, rigid body or marker: its type, its label, and component and axis ("position x") -> column."""

    kind: str
    label: str
    columns: dict[str, int] = field(default_factory=dict)

    @property
    def subject(self) -> str:
        """The skeleton or rigid body before the colon, "" without one."""
        return self.label.rpartition(":")[0].strip()

    @property
    def name(self) -> str:
        """The label without its subject."""
        return self.label.rpartition(":")[2].strip()

    @property
    def is_pose(self) -> bool:
        """Whether it has an orientation and a place: a bone or a rigid body."""
        return not self.kind.endswith(("marker", "constraint"))


def open_motive(path: Path, log: ReadLog) -> Recording:
    """Open an export: frames of each skeleton and of rigid bodies, points of each subject, in metres."""
    log.time_source = "time column"
    lines = read_lines(path, log)
    separator = max(",;\t", key=lines[0].count)
    header = _pairs(lines[0], separator)
    first, width, signals = _signals(path, lines, separator)
    scale = metres(path, header.get("length units", ""), "line 1, Length Units")
    markers, unlabelled, solved = _measured_markers(signals)
    bones = [signal for signal in signals if signal.is_pose and signal.kind.endswith("bone")]
    bodies = [signal for signal in signals if signal.is_pose and signal.kind == "rigid body"]
    if separator != "," and re.search(r"\d,\d", lines[first] if first < len(lines) else ""):
        lines = [*lines[:first], *(line.replace(",", ".") for line in lines[first:])]  # saved again by a spreadsheet
    used = [1, *(column for signal in (*bones, *bodies, *markers) for column in signal.columns.values())]
    rows, numbers = number_rows(
        path, lines, first, width, log, separator=separator, gaps=True, short=True, columns=used
    )
    at = {column: index for index, column in enumerate(used)}
    time, rows = _time(path, rows, numbers, header, log)
    frames = BoneFrames(header.get("rotation type", ""), header.get("coordinate space", "").lower() == "local", scale)
    streams: list[Stream] = []
    topics: list[Topic] = []
    for name, skeleton, group in _groups(path, bones, bodies):
        columns = {signal.name: {key: at[column] for key, column in signal.columns.items()} for signal in group}
        stream, topic = frames.stream(path, name, skeleton, columns, rows, time, log)
        streams += [stream] if stream else []
        topics.append(topic)
    if markers:
        points = np.stack(
            [rows[:, [at[signal.columns[f"position {axis}"]] for axis in "xyz"]] for signal in markers], axis=1
        )
        points[np.isnan(points).any(axis=2)] = np.nan
        labels = [signal.label for signal in markers]
        recorded = marker_recording(path, ("csv", f"{FORMAT} markers"), labels, time, points * scale, log)
        streams += recorded.streams
        topics += recorded.topics
    if not streams:
        what = "neither skeleton bones nor rigid bodies nor labelled markers"
        raise ReadError(path, what, hint="export the take again with Markers and Skeleton Bones")
    for count, name, why in ((unlabelled, "unlabeled markers", "without a label"), (solved, "solved markers", SOLVED)):
        if count:
            topics.append(Topic(name, FORMAT, len(time), False, f"{count} {why}"))
    stated = header.get("total exported frames", "")
    if stated.isdigit() and len(stated) < 19 and int(stated) != len(rows):
        log.warn(f"the header states {stated} frames and the file has {len(rows)}; those were read")
    return Recording(str(path), "csv", tuple(streams), tuple(topics), log)


SOLVED: Final = "where the solved body expects markers that are also measured"


def _fields(line: str, separator: str) -> list[str]:
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error:
        return [cell.strip() for cell in line.split(separator)]


def _pairs(line: str, separator: str) -> dict[str, str]:
    cells = _fields(line.lstrip("\ufeff"), separator)
    return {key.lower(): value for key, value in zip(cells[::2], cells[1::2], strict=False) if key}


def _signals(path: Path, lines: list[str], separator: str) -> tuple[int, int, list[Signal]]:
    """Return the index of the first row of numbers, the number of columns and the signals."""
    top: list[list[str]] = []
    for index in range(1, min(len(lines), MOST_HEADER_LINES)):
        cells = _fields(lines[index], separator)
        if len(cells) > 2 and cells[0].lower() == "frame" and cells[1].lower().startswith("time"):
            break
        top += [cells] if any(cells) else []
    else:
        raise ReadError(
            path,
            f"no line with 'Frame' and 'Time' among the first {MOST_HEADER_LINES}, which begins the columns",
            hint="export the take again with its header",
        )
    axes = cells
    width = max(at + 1 for row in (*top, axes) for at, cell in enumerate(row) if cell)
    named = {row[1].lower(): row for row in top if len(row) > 1 and row[1].lower() in ("type", "name")}
    if len(top) < 3 or width > MAX_COLUMNS:
        what = f"line {index + 1}: {len(top)} rows of names above {width} columns"
        raise ReadError(path, f"{what}, expected Type, Name and ID", hint="export the take again with its header")
    kinds, labels, components = named.get("type", top[0]), named.get("name", top[1]), top[-1]
    signals: list[Signal] = []
    for column in range(2, len(axes)):
        kind, label, component = (row[column] if column < len(row) else "" for row in (kinds, labels, components))
        kind, key = kind.lower(), f"{component} {axes[column]}".strip().lower()
        if not kind or not label:
            continue
        if not signals or (signals[-1].kind, signals[-1].label) != (kind, label) or key in signals[-1].columns:
            signals.append(Signal(kind, label))
        if component.lower() in ("position", "rotation"):
            signals[-1].columns[key] = column
    placed = {f"position {axis}" for axis in "xyz"}
    return index + 1, width, [signal for signal in signals if placed <= set(signal.columns)]


def _measured_markers(signals: Sequence[Signal]) -> tuple[list[Signal], int, int]:
    """Return the labelled markers, measured before solved, and how many unlabelled and other solved ones there are."""
    markers = [signal for signal in signals if not signal.is_pose]
    labelled = [signal for signal in markers if not signal.name.lower().startswith("unlabeled")]
    ordered = sorted(labelled, key=lambda signal: signal.kind != MEASURED)
    chosen: dict[str, Signal] = {}
    for signal in ordered:
        chosen.setdefault(signal.label, signal)
    kept = [signal for signal in labelled if chosen[signal.label] is signal]
    return kept, len(markers) - len(labelled), len(labelled) - len(kept)


def _groups(
    path: Path, bones: Sequence[Signal], bodies: Sequence[Signal]
) -> list[tuple[str, str | None, list[Signal]]]:
    """Return the name, the skeleton (None: rigid bodies) and the signals of each stream of frames."""
    skeletons: dict[str, list[Signal]] = {}
    for signal in bones:
        skeletons.setdefault(signal.subject, []).append(signal)
    stem = unpacked_name(path).stem
    groups: list[tuple[str, str | None, list[Signal]]] = [
        (f"{subject if len(skeletons) > 1 else stem} bones", subject, group) for subject, group in skeletons.items()
    ]
    return [*groups, *([(f"{stem} rigid bodies", None, list(bodies))] if bodies else [])]


def _time(
    path: Path, rows: Array, numbers: NDArray[np.int64], header: Mapping[str, str], log: ReadLog
) -> tuple[Array, Array]:
    """Return the times [s] and the rows that have one."""
    if not len(rows):
        raise ReadError(path, "no row of numbers after the header", hint="export the take again with its frames")
    blank = np.isnan(rows[:, 0])
    if blank.all():
        try:
            rate = number(header.get("export frame rate", header.get("capture frame rate", "")))
        except ValueError:
            rate = 0.0
        if not 0 < rate < 1e6:
            rate_text = clip(header.get("export frame rate", ""))
            what = f"no times, and Export Frame Rate is {rate_text}"
            raise ReadError(path, what, hint="export the take again with its times")
        log.time_source = "Export Frame Rate"
        return np.arange(len(rows)) / rate, rows
    time, rows = with_time(rows[:, 0], rows, numbers, log)
    return time, rows
