"""Write scores and postures as an Excel workbook: summary, intervals, frames, and a sheet that computes a frame's REBA.

The sheets of scores are `Summary` (`reba.writers.xlsx_summary`), `Intervals` (the worst ones), `Frames` (the table of
the other formats), `Worksheet` and `Tables`: the formulas of the worksheet (`reba.writers.xlsx_worksheet`) take the
angles of a frame to its REBA, so that an auditor can check every step in a spreadsheet. `Details` has every figure of
the summary, the metadata and the rules by their names in JSON, the hidden sheet `Record` the metadata to read back.

Needs openpyxl (extra `xlsx`).
"""

from __future__ import annotations

import datetime as dt
import re
import shutil
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import pandas as pd

from reba.analysis.exposure import summarise
from reba.analysis.score_table import ScoreTable
from reba.cells import cell_of
from reba.errors import RebaError
from reba.extras import missing
from reba.files import as_json
from reba.method.tables import TABLE_A, TABLE_B, TABLE_C
from reba.open_file import open_regular
from reba.posture.angles import against_gravity
from reba.printable import printable
from reba.provenance import generator
from reba.readers.formats.score_file import FRAMES, KEY, RECORD
from reba.writers.xlsx_summary import summary_rows
from reba.writers.xlsx_worksheet import AGAINST_GRAVITY, ARM_COLUMNS, worksheet_rows

MOST_FRAMES: Final = 1_048_575
"""Rows of a sheet in Excel, without the header."""
MOST_TEXT: Final = 32_000
"""Characters of a cell; Excel holds 32,767."""
EPOCH: Final = dt.datetime(1980, 1, 1)
"""Time of creation that a workbook states; a workbook that states none gets the present one."""
_MODIFIED: Final = re.compile(r"(<dcterms:modified[^>]*>)[^<]*")
WIDTHS: Final = {
    "Summary": (46, 70, 40),
    "Details": (34, 60),
    "Intervals": (8, 10, 10, 10, 8, 8, 100),
    "Worksheet": (40, 18, 16, 16, 60),
}
"""Sheet -> widths of its columns in characters."""
_LEFT_OUT: Final = ("worst", "accounts", "rules")
"""Parts of a summary that are no single values; the rules have rows of their own."""


def check_frames(path: Path, n: int) -> None:
    """Check that a sheet can hold n frames, and that openpyxl is installed.

    Raises:
        RebaError: it cannot.
        MissingPackageError: it is not.
    """
    try:
        import openpyxl  # noqa: F401
    except ImportError as error:
        raise missing("openpyxl", "writing Excel workbooks") from error
    if n > MOST_FRAMES:
        raise RebaError(
            f"{path}: a sheet holds at most {MOST_FRAMES} frames, these are {n}; choose .parquet or .csv, or a part "
            "with --start and --end"
        )


def write_xlsx(data: pd.DataFrame, about: Mapping[str, Any], scores: ScoreTable | None, part: Path) -> None:
    """Write a table as a workbook, with the sheets about scores if it is one of scores.

    Args:
        data: one row per frame.
        about: metadata, in the sheet `Details`.
        scores: that the table is of, None for postures.
    """
    from openpyxl import Workbook
    from openpyxl.writer.excel import ExcelWriter

    book = Workbook(write_only=True)
    book.properties.creator = generator("reba")
    book.properties.created = EPOCH
    summary = _flat({} if scores is None else summarise(scores), _LEFT_OUT)
    rules = {} if scores is None else {f"rules.{name}": value for name, value in about["rules"].items()}
    rows = {**summary, **_flat(about, (*_LEFT_OUT, "factors", "activity")), **rules}
    if scores is not None:
        _sheet(book, "Summary", (map(_cell, row) for row in summary_rows(scores)), wrapped=True)
        _sheet(book, "Intervals", _intervals(summarise(scores)["worst"]))
        if scores.rules.upper_arm_reference == "gravity":
            data = pd.concat([data, _gravity_columns(scores)], axis=1)
    _sheet(book, FRAMES, _table(data))
    if scores is not None and len(data):
        _sheet(book, "Worksheet", worksheet_rows(scores, list(data.columns), _worst_frame(scores)))
        _sheet(book, "Tables", _tables())
    _sheet(book, "Details", [("what", "value"), *((_cell(name), value) for name, value in rows.items())])
    if scores is not None:
        _sheet(book, RECORD, _record(about))
        book[RECORD].sheet_state = "hidden"
    with _Undated(part, "w", zipfile.ZIP_DEFLATED) as archive:
        ExcelWriter(book, archive).save()


class _Undated(zipfile.ZipFile):
    """An archive without the times at which its parts were written: the same scores give the same bytes."""

    def write(self, filename: Any, arcname: Any = None, *_: Any, **__: Any) -> None:
        """Add a file; openpyxl writes each sheet into one first."""
        with open_regular(Path(filename)) as source, self.open(name=self._entry(arcname), mode="w") as target:
            shutil.copyfileobj(source, target)

    def writestr(self, zinfo_or_arcname: Any, data: Any, *_: Any, **__: Any) -> None:
        """Add a text."""
        if zinfo_or_arcname == "docProps/core.xml":
            data = _MODIFIED.sub(r"\g<1>1980-01-01T00:00:00Z", data.decode() if isinstance(data, bytes) else data)
        super().writestr(self._entry(zinfo_or_arcname), data)

    @staticmethod
    def _entry(name: str) -> zipfile.ZipInfo:
        entry = zipfile.ZipInfo(name)
        entry.compress_type = zipfile.ZIP_DEFLATED
        return entry


def _sheet(book: Any, title: str, rows: Iterable[Iterable[Any]], *, wrapped: bool = False) -> None:
    """Add a sheet; `wrapped` shows long texts in lines, and numbers below their headings."""
    from openpyxl.cell import WriteOnlyCell
    from openpyxl.styles import Alignment
    from openpyxl.utils import get_column_letter

    look = Alignment(wrap_text=True, vertical="top", horizontal="left")

    sheet = book.create_sheet(title)
    for number, width in enumerate(WIDTHS.get(title, ()), 1):
        sheet.column_dimensions[get_column_letter(number)].width = width
    sheet.freeze_panes = "A2"
    for row in rows:
        cells = list(row)
        if wrapped:
            cells = [WriteOnlyCell(sheet, value) for value in cells]
            for cell in cells:
                cell.alignment = look
        sheet.append(cells)


def _record(about: Mapping[str, Any]) -> Iterator[list[str]]:
    """Yield the metadata as JSON, from which the scores are read back, in as many cells as a text needs."""
    yield [KEY, "what reba reads back with the sheet Frames: rules, factors, assumptions"]
    for name, value in about.items():
        text = as_json(value)
        yield [name, *(text[at : at + MOST_TEXT] for at in range(0, len(text), MOST_TEXT))]


def _flat(values: Mapping[str, Any], left_out: Iterable[str]) -> dict[str, Any]:
    """Return nested values by dotted names, lists as text."""
    rows: dict[str, Any] = {}
    for name, value in values.items():
        if name in left_out:
            continue
        if isinstance(value, Mapping):
            rows |= {f"{name}.{inner}": one for inner, one in _flat(value, left_out).items()}
        else:
            rows[name] = _cell("; ".join(map(str, value)) if isinstance(value, list | tuple) else value)
    return rows


def _intervals(worst: list[dict[str, Any]]) -> Iterator[tuple[Any, ...]]:
    yield ("number", "from [s]", "to [s]", "worst [s]", "REBA", "held", "why")
    for number, one in enumerate(worst, 1):
        low, high = one["reba_low"], one["reba_high"]
        reba = low if low == high else f"{low} to {high}"
        yield (number, one["start"], one["end"], one["time"], reba, one["held"], "; ".join(one["why"]))


def _gravity_columns(scores: ScoreTable) -> pd.DataFrame:
    """Return the angles of the upper arms against gravity, from which such rules score."""
    columns = np.array(scores.angles, np.float64).T.copy()
    against_gravity(columns)
    return pd.DataFrame({f"{name}{AGAINST_GRAVITY}": columns[at] for name, at in ARM_COLUMNS.items()})


def _table(data: pd.DataFrame) -> Iterator[list[Any]]:
    yield [_cell(str(name)) for name in data.columns]
    columns = [data[name].astype(object).where(data[name].notna(), None).tolist() for name in data.columns]
    for row in zip(*columns, strict=True):
        yield [_cell(value) for value in row]


def _cell(value: Any) -> Any:
    """Return a value as a cell holds it: what is not finite is empty, and no text has characters that XML lacks."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return cell_of(printable(value, "\n\t")) if isinstance(value, str) else value


def _worst_frame(scores: ScoreTable) -> int:
    worst = summarise(scores)["worst"]
    return scores.frame_at(worst[0]["time"]) if worst else 0


def _tables() -> Iterator[list[Any]]:
    """Yield Tables A, B and C as `xlsx_worksheet` addresses them."""
    yield ["Table A: rows trunk 1 to 5; columns neck 1 (legs 1 to 4), neck 2, neck 3"]
    yield from TABLE_A.reshape(len(TABLE_A), -1).tolist()
    yield ["Table B: rows upper arm 1 to 6; columns lower arm 1 (wrist 1 to 3), lower arm 2"]
    yield from TABLE_B.reshape(len(TABLE_B), -1).tolist()
    yield ["Table C: rows Score A 1 to 12; columns Score B 1 to 12"]
    yield from TABLE_C.tolist()
