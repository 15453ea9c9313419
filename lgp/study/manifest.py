"""A manifest: a CSV table that names the recordings of a study, one a line: file, participant, condition, trial.

Files are meant from the folder of the manifest; `trial` and `simulated` may be left out. A line with an empty `file` is
a recording that was planned and not made.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from lgp.errors import LgpError, did_you_mean
from lgp.study.labels import FIELDS, Label, label_of

COLUMNS: Final = ("file", *FIELDS, "simulated")
"""Columns that are read."""
_NEEDED: Final = COLUMNS[:3]


@dataclass(frozen=True)
class Line:
    """One line: the file, None for a recording that was not made, and its label."""

    file: Path | None
    label: Label


def read_manifest(path: str | Path) -> list[Line]:
    """Return the lines of a manifest.

    Raises:
        LgpError: it cannot be read, a column or a name is missing, or a file stands twice.
    """
    place = Path(path)
    try:
        text = place.read_text(encoding="utf-8-sig")
        rows = list(_rows(text))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise LgpError(f"{path}: cannot be read ({error}); give a CSV file with {', '.join(_NEEDED)}") from error
    if not rows:
        raise LgpError(f"{path}: the manifest is empty; its first line names the columns {', '.join(COLUMNS)}")
    header = [name.strip().lower() for name in rows[0][1]]
    _check(path, header)
    lines = [_line(place, number, header, row) for number, row in rows[1:]]
    if not lines:
        raise LgpError(f"{path}: the manifest names no recording; add a line for each")
    seen: dict[Path, Label] = {}
    for line in lines:
        if line.file is not None and line.file in seen:
            raise LgpError(f"{path}: {line.file} is {seen[line.file]} and {line.label}; name each file once")
        if line.file is not None:
            seen[line.file] = line.label
    return lines


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield number and fields of every line that is not blank; fields are parted by commas or semicolons."""
    first = text.split("\n", 1)[0]
    delimiter = ";" if first.count(";") > first.count(",") else ","
    reader = csv.reader(text.splitlines(), delimiter=delimiter, strict=True)
    for row in reader:
        if any(field.strip() for field in row):
            yield reader.line_num, row


def _check(path: str | Path, header: list[str]) -> None:
    for name in _NEEDED:
        if name not in header:
            near = did_you_mean(name, header) or f"; it has {', '.join(header)}"
            raise LgpError(f"{path}: column {name!r} is missing{near}; expected {', '.join(COLUMNS)}")
    if twice := [name for name in COLUMNS if header.count(name) > 1]:
        raise LgpError(f"{path}: column {twice[0]!r} stands twice; keep one of them")


def _line(manifest: Path, number: int, header: list[str], row: list[str]) -> Line:
    where = f"{manifest}: line {number}"
    if len(row) != len(header):
        raise LgpError(f"{where}: {len(row)} fields, expected {len(header)} as in its first line; correct it")
    values: dict[str, str | None] = dict(zip(header, row, strict=True))
    named = label_of({name: values[name] for name in COLUMNS[1:] if name in values}, where)
    file = (values["file"] or "").strip()
    return Line(manifest.parent / file if file else None, named)
