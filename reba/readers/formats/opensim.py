"""OpenSim motion and storage files (.mot, .sto): a header of keys, a line of names, rows of numbers.

Source: OpenSim documentation, "Storage (.sto) files" and "Motion (.mot) files". `inDegrees` states the unit of
rotations; translations (`_tx`, `_ty`, `_tz`, and marker columns of SIMM files) are in metres; y is up. Columns are
separated by tabs, spaces or, after a spreadsheet, commas or semicolons. A blank field or "nan" is a gap.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from reba.errors import ReadError
from reba.readers.formats.file_content import unpacked_name
from reba.readers.formats.text import number_rows, read_lines, rows_separator, with_time
from reba.readers.recording.stream import ReadLog, Recording, Topic, array_stream, clip, unique_names

KEYS = (b"indegrees", b"nrows", b"datarows", b"ncolumns", b"datacolumns")
"""Header keys that identify an OpenSim file whose `endheader` is beyond its first bytes."""
UNITS: dict[str, Literal["deg", "rad", ""]] = {"yes": "deg", "y": "deg", "true": "deg", "no": "rad", "n": "rad"}
"""Values of `inDegrees`; with any other the unit is not stated."""
SEPARATORS: tuple[str | None, ...] = ("\t", ";", ",", None)
"""What may stand between two fields."""
TIMES = ("time", "t")
"""Names of the first column, in lower case."""


def sniff(path: Path, head: bytes) -> bool:
    """Return whether the first bytes are the header of an OpenSim file."""
    lines = [line.strip(b" \t\r,") for line in head.lower().split(b"\n")]
    if b"endheader" in lines:
        return True
    return path.suffix.lower() in (".mot", ".sto") and any(line.startswith(KEYS) for line in lines)


def open_opensim(path: Path) -> Recording:
    """Open a .mot or .sto file: one stream of joints, named as its columns, in degrees, radians or "" (not stated)."""
    log = ReadLog(time_source="time column")
    lines = read_lines(path, log)
    keys, labels_at = _header(path, lines)
    line = lines[labels_at]
    split = line.split("\t" if "\t" in line else ";" if ";" in line else "," if "," in line else None)
    labels = [label.strip() for label in split]
    while labels and not labels[-1]:
        labels.pop()
    if len(labels) < 2 or labels[0].lower() not in TIMES or not all(labels):
        raise ReadError(
            path,
            f"line {labels_at + 1}: column names expected after 'endheader', 'time' first, but it is {clip(line)}",
            hint="export the motion again with its header",
        )
    names = unique_names(labels[1:], log)
    separator = rows_separator(lines[labels_at + 1 :], SEPARATORS, len(labels))
    rows, numbers = number_rows(path, lines, labels_at + 1, len(labels), log, separator=separator, gaps=True)
    if not len(rows):
        raise ReadError(path, f"no complete row of numbers after line {labels_at + 1}", hint="export the motion again")
    _check_counts(keys, len(rows), len(labels), log)
    time, rows = with_time(rows[:, 0], rows, numbers, log)
    unit = _unit(keys, log)
    stream = array_stream(
        unpacked_name(path).stem, "joints", "OpenSim", names, time, rows[:, 1:], opened=log, unit=unit, up="y"
    )
    stated = {"deg": "inDegrees=yes", "rad": "inDegrees=no", "": "inDegrees not stated"}[unit]
    topic = Topic(stream.name, "OpenSim table", len(rows), True, f"{len(names)} columns, {stated}")
    return Recording(str(path), "opensim", (stream,), (topic,), log)


def _header(path: Path, lines: list[str]) -> tuple[dict[str, str], int]:
    """Return the header's keys in lower case and the index of the line with the column names."""
    keys: dict[str, str] = {}
    for index, raw in enumerate(lines):
        line = raw.strip(" \t,")
        if line.lower() == "endheader":
            for at in range(index + 1, len(lines)):
                if lines[at].strip(" \t,"):
                    return _check_type(path, keys), at
            raise ReadError(path, f"the file ends after 'endheader', line {index + 1}", hint="export the motion again")
        # OpenSim writes key=value, SIMM "key value".
        key, _, value = line.partition("=") if "=" in line else line.partition(" ")
        keys.setdefault(key.strip().lower(), value.strip())
    raise ReadError(
        path,
        "no line 'endheader', which ends the header of an OpenSim file",
        hint="export the motion again, or give tables of another kind as .csv",
    )


def _check_type(path: Path, keys: dict[str, str]) -> dict[str, str]:
    kind = keys.get("datatype", "double")
    if kind.lower() != "double":
        raise ReadError(
            path, f"DataType is {clip(kind)}, expected double", hint="give the joint angles of inverse kinematics"
        )
    return keys


def _check_counts(keys: dict[str, str], rows: int, columns: int, log: ReadLog) -> None:
    """Note header counts that differ from the table; the table decides."""
    for what, names, count in (
        ("rows", ("nrows", "datarows"), rows),
        ("columns", ("ncolumns", "datacolumns"), columns),
    ):
        for name in names:
            stated = keys.get(name)
            if stated is not None and stated != str(count):
                log.warn(f"the header states {clip(stated)} {what} and the file has {count}; those were read")
                break


def _unit(keys: dict[str, str], log: ReadLog) -> Literal["rad", "deg", ""]:
    stated = keys.get("indegrees")
    unit = UNITS.get(stated.lower(), "") if stated is not None else ""
    if stated is not None and not unit:
        log.warn(f"inDegrees is {clip(stated)}, expected yes or no; the unit is taken from the data")
    return unit
