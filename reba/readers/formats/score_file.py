"""Score tables that `reba score -o` wrote: they hold the angles and factors that the scores came from, and the rules.

What is written with the numbers (Parquet metadata, `<name>.meta.json` beside a CSV, an MCAP metadata record, a
sheet of a workbook) is read
back as it is; whoever scores again checks it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from reba.errors import ReadError
from reba.open_file import open_regular, read_settings
from reba.posture.columns import COLUMNS
from reba.provenance import MEMBER
from reba.readers.formats.zip_archive import first_member, open_zip

ABOUT: Final = ".meta.json"
"""Ending of the file beside a CSV, added to its name."""
MARKS: Final = ("reba_low", "reba_high")
"""Columns of every score table that always have a value: in MCAP the others may be absent."""
_SHEETS: Final = "xl/workbook.xml"
HEAD: Final = 8192
"""[bytes] In which a CSV has the names of its columns."""
KEY: Final = "reba"
"""Of the metadata in Parquet and MCAP, and first cell of the sheet `RECORD`."""
FRAMES, RECORD = "Frames", "Record"
"""Sheets of a workbook of scores: their table, and the metadata."""


def is_score_table(columns: Iterable[str]) -> bool:
    """Return whether columns are those of a score table."""
    return set(MARKS) <= set(columns)


def is_score_file(path: Path) -> bool:
    """Return whether a CSV, Parquet or Excel file is a score table, by the names of its columns or sheets."""
    try:
        with open_regular(path) as file:
            head = file.read(HEAD)
            if head.startswith(b"PAR1"):
                import pyarrow.parquet as pq

                return is_score_table(pq.read_schema(file).names)
        if first_member(head):
            with open_zip(path) as archive:
                return f'"{RECORD}"'.encode() in archive.read(_SHEETS)
    except KeyError:  # an archive without such a part
        return False
    except (OSError, ValueError, ReadError):  # errors of Arrow are ValueErrors
        return False
    return is_score_table(head.partition(b"\n")[0].decode("utf-8", "replace").strip().split(","))


def recorded_with(path: Path, columns: Iterable[str], metadata: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Return what was written with a score table: rules, factors, assumptions; None for other tables.

    Args:
        columns: of the table.
        metadata: in the file itself; None for a CSV, which has it in a file beside.

    Raises:
        ReadError: scores without angles, as earlier versions wrote them.
    """
    names = set(columns)
    if not is_score_table(names):
        return None
    if not names & set(COLUMNS):
        raise ReadError(
            path,
            "it holds scores without the angles that they came from",
            hint="score the recording again: `reba score RECORDING -o FILE` writes both",
        )
    if metadata is not None:
        return dict(metadata)
    try:
        return _object(read_settings(f"{path}{ABOUT}"))
    except (OSError, UnicodeDecodeError):
        return {}


def parquet_record(metadata: Mapping[bytes, bytes] | None) -> dict[str, Any]:
    """Return the metadata of a Parquet schema that was written with a score table."""
    texts = {key: (metadata or {}).get(key.encode(), b"").decode("utf-8", "replace") for key in (KEY, MEMBER)}
    return {**_object(texts[KEY]), MEMBER: _object(texts[MEMBER])}


def sheet_record(rows: Iterable[Sequence[Any]]) -> dict[str, Any] | None:
    """Return the metadata that the rows of the sheet `RECORD` hold; None for a sheet of another program."""
    first, *others = (["" if cell is None else str(cell) for cell in row] for row in rows)
    return {name: _value("".join(parts)) for name, *parts in others} if first[0] == KEY else None


def mcap_record(record: Mapping[str, str]) -> dict[str, Any]:
    """Return a metadata record of MCAP, whose values are texts, as what they were written from."""
    return {name: _value(text) for name, text in record.items()}


def _object(text: str) -> dict[str, Any]:
    value = _value(text)
    return value if isinstance(value, dict) else {}


def _value(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return text
