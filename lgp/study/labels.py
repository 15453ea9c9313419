"""Labels of recordings - participant, condition, trial - from a metadata record, the file name or a manifest.

The record is an MCAP metadata record (https://mcap.dev/spec#metadata-op0x0c) named `study` with the keys `participant`
and `condition`, and `trial` if there are several recordings of both; `simulated` = "true" marks simulated data.
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
from reba.open_file import read_settings
from reba.readers.mcap import is_mcap, sniff
from reba.readers.mcap.bytes import MAGIC, ByteSource
from reba.readers.mcap.channels import recording_files
from reba.readers.mcap.records import HEAD

RECORD: Final = "study"
"""Name of the metadata record with the label."""
FIELDS: Final = ("participant", "condition", "trial")
"""Fields of a label; the first two are required."""
_LIMIT: Final = 1 << 32
"""Largest compressed recording that is decompressed to read its record [bytes]."""
_ENDING: Final = re.compile(r"\.mcap\.zstd$|\.[A-Za-z0-9]+$")


@dataclass(frozen=True, order=True)
class Label:
    """Label of a recording; `trial` names one of several of a participant in a condition, "" for the only one."""

    participant: str
    condition: str
    trial: str = ""
    simulated: bool = False

    def __str__(self) -> str:
        return f"{self.participant} / {self.condition}" + (f" / {self.trial}" if self.trial else "")

    def record(self) -> dict[str, str]:
        """Content of the metadata record."""
        content = {"participant": self.participant, "condition": self.condition}
        content |= {"trial": self.trial} if self.trial else {}
        return content | ({"simulated": "true"} if self.simulated else {})


def label_of(values: dict[str, str | None], where: str) -> Label:
    """Label from the stripped values of a record or a manifest row; errors name their source as `where`.

    Raises:
        LgpError: participant or condition is missing or empty.

    >>> str(label_of({"participant": " p01", "condition": "ergonomic"}, "log.mcap"))
    'p01 / ergonomic'
    """
    text = {name: encodable(values.get(name) or "").strip() for name in (*FIELDS, "simulated")}
    for name in FIELDS[:2]:
        if not text[name]:
            present = ", ".join(values) or "no field"
            problem = "empty" if name in values else f"missing (present: {present})"
            raise LgpError(f"{where}: {name} is {problem}; add it")
    return Label(text["participant"], text["condition"], text["trial"], text["simulated"].lower() == "true")


def encodable(name: str) -> str:
    r"""Return a name with bytes that are not UTF-8 as escape codes: tables hold no others, file names do.

    >>> print(encodable("p\udcff1"))
    p\udcff1
    """
    return name.encode(errors="backslashreplace").decode()


def recorded_label(path: Path) -> Label | None:
    """Label in the `study` record of an MCAP recording; None without a record or for another format.

    Raises:
        LgpError: the record lacks a field or cannot be read, or the files of a recording have different labels.
        ReadError: the file cannot be opened as a recording.
    """
    if not sniff(path):
        return None
    recorded: Label | None = None
    for file in recording_files(path):
        values = _metadata(file) if is_mcap(file) else None
        if values is None:
            continue
        label = label_of(values, f"{file}: metadata record {RECORD!r}")
        if recorded is not None and label != recorded:
            raise LgpError(
                f"{path}: its files are labelled {recorded} and {label}; put each recording into its own folder"
            )
        recorded = label
    return recorded


def _metadata(path: Path) -> dict[str, str | None] | None:
    """Content of the `study` record of one file; other records are skipped, chunks are not decompressed."""
    from mcap.data_stream import ReadDataStream
    from mcap.exceptions import McapError
    from mcap.opcode import Opcode
    from mcap.records import Metadata

    source = ByteSource(path, _LIMIT)
    offset = len(MAGIC)
    while len(head := source.read_at(offset, HEAD)) == HEAD:
        opcode, length = head[0], int.from_bytes(head[1:], "little")
        if opcode in (0, Opcode.DATA_END, Opcode.FOOTER) or offset + HEAD + length > source.size:
            return None
        if opcode == Opcode.METADATA:
            content = source.read_at(offset + HEAD, length)
            try:
                record = Metadata.read(ReadDataStream(BytesIO(content)))
            except (McapError, struct.error, ValueError) as error:
                raise LgpError(f"{path}: at byte {offset}: its metadata is damaged; give a manifest") from error
            if record.name == RECORD:
                return dict(record.metadata)
        offset += HEAD + length
    return None


class Pattern:
    """Pattern of file names that hold the label.

    Args:
        text: such as `{participant}_{condition}_{trial}`, matched against the complete name without its extension; `/`
            separates folders, as in `{participant}/{condition}`. Earlier fields match as few characters as possible.

    Raises:
        LgpError: participant or condition is missing, or a field is unknown.

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
        self._regex = re.compile("".join(fields))
        self._depth = text.count("/") + 1

    def label(self, path: str) -> Label | None:
        """Label from a file name, None if it does not match."""
        parts = PurePath(path.replace("\\", "/")).parts[-self._depth :]
        match = self._regex.fullmatch(_ENDING.sub("", "/".join(parts)))
        return None if match is None else label_of(dict(match.groupdict()), path)


_USE: Final = "{participant}_{condition} or {participant}/{condition}_{trial}"
COLUMNS: Final = ("file", *FIELDS, "simulated")
"""Columns of a manifest."""
_REQUIRED: Final = COLUMNS[:3]


@dataclass(frozen=True)
class ManifestRow:
    """Row of a manifest: the file, None for a planned recording that was not made, and its label."""

    file: Path | None
    label: Label


def read_manifest(path: str | Path) -> list[ManifestRow]:
    """Rows of a manifest.

    Raises:
        LgpError: it cannot be read, a column or a field is missing, or a file is listed more than once.
    """
    file = Path(path)
    try:
        text = read_settings(file, "utf-8-sig")
        rows = list(_rows(text))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise LgpError(f"{path}: cannot be read ({error}); give a CSV file with {', '.join(_REQUIRED)}") from error
    if not rows:
        raise LgpError(f"{path}: the manifest is empty; its first line names the columns {', '.join(COLUMNS)}")
    header = [name.strip().lower() for name in rows[0][1]]
    _check(path, header)
    lines = [_line(file, number, header, row) for number, row in rows[1:]]
    if not lines:
        raise LgpError(f"{path}: the manifest names no recording; add a row for each")
    labels: dict[Path, Label] = {}
    for line in lines:
        if line.file is not None and line.file in labels:
            raise LgpError(f"{path}: {line.file} is {labels[line.file]} and {line.label}; name each file once")
        if line.file is not None:
            labels[line.file] = line.label
    return lines


def _rows(text: str) -> Iterator[tuple[int, list[str]]]:
    """Yield line number and fields of every non-blank line; the delimiter is a comma or a semicolon."""
    first = text.split("\n", 1)[0]
    delimiter = ";" if first.count(";") > first.count(",") else ","
    reader = csv.reader(text.splitlines(), delimiter=delimiter, strict=True)
    for row in reader:
        if any(field.strip() for field in row):
            yield reader.line_num, row


def _check(path: str | Path, header: list[str]) -> None:
    for name in _REQUIRED:
        if name not in header:
            near = did_you_mean(name, header) or f"; it has {', '.join(header)}"
            raise LgpError(f"{path}: column {name!r} is missing{near}; expected {', '.join(COLUMNS)}")
    if repeated := [name for name in COLUMNS if header.count(name) > 1]:
        raise LgpError(f"{path}: {header.count(repeated[0])} columns are named {repeated[0]!r}; keep one of them")


def _line(manifest: Path, number: int, header: list[str], row: list[str]) -> ManifestRow:
    where = f"{manifest}: line {number}"
    if len(row) != len(header):
        raise LgpError(f"{where}: {len(row)} fields, expected {len(header)} as in its first line; correct it")
    values: dict[str, str | None] = dict(zip(header, row, strict=True))
    label = label_of({name: values[name] for name in COLUMNS[1:] if name in values}, where)
    file = (values["file"] or "").strip()
    return ManifestRow(manifest.parent / file if file else None, label)
