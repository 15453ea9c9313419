"""Whose recording of what: labels from a metadata record in the recording itself, or from the name of its file.

The record is an MCAP metadata record (https://mcap.dev/spec#metadata-op0x0c) named `study` with the keys `participant`
and `condition`, and where there are several recordings of both, `trial`; `simulated` = "true" marks data of no person.
"""

from __future__ import annotations

import csv
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path, PurePath
from typing import Final

from lgp.errors import LgpError
from reba.errors import did_you_mean
from reba.readers.mcap import sniff
from reba.readers.mcap.bytes import MAGIC, ByteSource
from reba.readers.mcap.channels import recording_files
from reba.readers.mcap.records import HEAD

RECORD: Final = "study"
"""Name of the metadata record."""
FIELDS: Final = ("participant", "condition", "trial")
"""What a label says; the first two it must."""
_LIMIT: Final = 1 << 32
"""[bytes] Largest compressed recording that is unpacked to look for its record."""
_ENDING: Final = re.compile(r"\.mcap\.zstd$|\.[A-Za-z0-9]+$")


@dataclass(frozen=True, order=True)
class Label:
    """A recording's place in a study.

    Attributes:
        participant: who.
        condition: doing what.
        trial: which of several recordings of both, "" for the only one.
        simulated: whether it is data of no person.
    """

    participant: str
    condition: str
    trial: str = ""
    simulated: bool = False

    def __str__(self) -> str:
        return f"{self.participant} / {self.condition}" + (f" / {self.trial}" if self.trial else "")

    def record(self) -> dict[str, str]:
        """Return the content of the metadata record."""
        found = {"participant": self.participant, "condition": self.condition}
        found |= {"trial": self.trial} if self.trial else {}
        return found | ({"simulated": "true"} if self.simulated else {})


def label_of(values: dict[str, str | None], where: str) -> Label:
    """Return the label that named values give.

    Args:
        values: text by name, as in a record or a line of a manifest; blanks around it do not count.
        where: what holds them, for the error.

    Raises:
        LgpError: participant or condition is missing or empty.

    >>> str(label_of({"participant": " p01", "condition": "ergonomic"}, "log.mcap"))
    'p01 / ergonomic'
    """
    text = {name: (values.get(name) or "").strip() for name in (*FIELDS, "simulated")}
    for name in FIELDS[:2]:
        if not text[name]:
            known = ", ".join(values) or "nothing"
            raise LgpError(f"{where}: {name} is {'empty' if name in values else f'missing (it holds {known})'}; add it")
    return Label(text["participant"], text["condition"], text["trial"], text["simulated"].lower() == "true")


def recorded_label(path: Path) -> Label | None:
    """Return the label in the `study` record of an MCAP recording, None without one or for another format.

    Raises:
        LgpError: the record lacks a name, cannot be read, or the parts of a recording contradict each other.
        ReadError: the file cannot be opened as a recording.
    """
    if not sniff(path):
        return None
    found: Label | None = None
    for file in recording_files(path):
        values = _metadata(file)
        if values is None:
            continue
        label = label_of(values, f"{file}: metadata record {RECORD!r}")
        if found is not None and label != found:
            raise LgpError(f"{path}: its files are labelled {found} and {label}; put them into folders of their own")
        found = label
    return found


def _metadata(path: Path) -> dict[str, str | None] | None:
    """Return the `study` record of one file: its records are stepped over, chunks are not unpacked."""
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError
    from mcap.opcode import Opcode
    from mcap.records import Metadata

    source = ByteSource(path, _LIMIT)
    at = len(MAGIC)
    while len(head := source.read_at(at, HEAD)) == HEAD:
        opcode, length = head[0], int.from_bytes(head[1:], "little")
        if opcode in (0, Opcode.DATA_END, Opcode.FOOTER) or at + HEAD + length > source.size:
            return None
        if opcode == Opcode.METADATA:
            content = source.read_at(at + HEAD, length)
            try:
                record = Metadata.read(ReadDataStream(BytesIO(content)))
            except (McapError, struct.error, ValueError) as error:
                raise LgpError(f"{path}: at byte {at}: its metadata is damaged; give a manifest") from error
            if record.name == RECORD:
                return dict(record.metadata)
        at += HEAD + length
    return None


class Pattern:
    """File names that say whose recording they are.

    Args:
        text: such as `{participant}_{condition}_{trial}`, to fit the whole name without its ending; `/` stands for
            folders, as in `{participant}/{condition}`. What stands first is as short as it can be.

    Raises:
        LgpError: participant or condition is not in it, or something else is.

    >>> str(Pattern("{participant}_{condition}").label("logs/p01_non_ergonomic.mcap"))
    'p01 / non_ergonomic'
    """

    def __init__(self, text: str) -> None:
        self.text = text
        parts = re.split(r"\{(\w*)\}", text)
        names = parts[1::2]
        for name in names:
            if name not in FIELDS:
                raise LgpError(f"--pattern {text!r}: {{{name}}} is unknown{did_you_mean(name, FIELDS)}; use {_USE}")
        if len(set(names)) < len(names) or not {*FIELDS[:2]} <= set(names):
            raise LgpError(f"--pattern {text!r}: expected {{participant}} and {{condition}} once each; use {_USE}")
        fields = (f"(?P<{part}>[^/]+?)" if odd % 2 else re.escape(part) for odd, part in enumerate(parts))
        self._fits = re.compile("".join(fields))
        self._depth = text.count("/") + 1

    def label(self, path: str) -> Label | None:
        """Return the label that a file's name gives, None where it does not fit."""
        parts = PurePath(path.replace("\\", "/")).parts[-self._depth :]
        found = self._fits.fullmatch(_ENDING.sub("", "/".join(parts)))
        return None if found is None else label_of(dict(found.groupdict()), path)


_USE: Final = "{participant}_{condition} or {participant}/{condition}_{trial}"
COLUMNS: Final = ("file", *FIELDS, "simulated")
"""Columns that are read."""
_NEEDED: Final = COLUMNS[:3]


@dataclass(frozen=True)
class ManifestRow:
    """One line: the file, None for a recording that was not made, and its label."""

    file: Path | None
    label: Label


def read_manifest(path: str | Path) -> list[ManifestRow]:
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


def _line(manifest: Path, number: int, header: list[str], row: list[str]) -> ManifestRow:
    where = f"{manifest}: line {number}"
    if len(row) != len(header):
        raise LgpError(f"{where}: {len(row)} fields, expected {len(header)} as in its first line; correct it")
    values: dict[str, str | None] = dict(zip(header, row, strict=True))
    named = label_of({name: values[name] for name in COLUMNS[1:] if name in values}, where)
    file = (values["file"] or "").strip()
    return ManifestRow(manifest.parent / file if file else None, named)
