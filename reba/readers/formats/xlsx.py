"""Excel workbooks (.xlsx, .xlsm): each sheet that is a table becomes a stream, as a CSV file would.

Values are those that Excel stored last, formulas are not computed. Rows above the column names may have a title; a
sheet without a row of names, or without times, is listed and left out. Needs openpyxl (extra `xlsx`).
"""

from __future__ import annotations

import datetime as dt
import warnings
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from reba.cells import text_of
from reba.errors import ReadError, join_names
from reba.extras import missing
from reba.open_file import open_regular
from reba.readers.formats.file_content import unpacked_name
from reba.readers.formats.header_rows import MOST_ROWS as DEEPEST
from reba.readers.formats.header_rows import names_of_rows
from reba.readers.formats.motive import is_motive
from reba.readers.formats.score_file import FRAMES, RECORD, sheet_record
from reba.readers.formats.table import table_recording
from reba.readers.formats.table_file import MAX_COLUMNS, TableFile, without_decimal_commas
from reba.readers.formats.table_time import past_midnight
from reba.readers.formats.text import BLANKS
from reba.readers.formats.vicon import is_vicon
from reba.readers.formats.zip_archive import HINT, first_member, open_zip
from reba.readers.recording.stream import ReadLog, Recording, Topic, clip, unique_names

if TYPE_CHECKING:
    import pandas as pd

MOST_ROWS: Final = 1_048_576
"""Rows of a sheet in Excel."""
MOST_CELLS: Final = 25_000_000
"""Cells of a workbook that are read: all rows of Excel with the columns of a posture table."""
PARTS: Final = ("[Content_Types].xml", "_rels/", "xl/", "docProps/", "mimetype")
"""First files of an archive that is a workbook; `mimetype` is that of OpenDocument, which is refused by name."""


def sniff(path: Path, head: bytes) -> bool:
    """Return whether the first bytes are those of a workbook."""
    return first_member(head).startswith(PARTS)


def open_xlsx(path: Path, rate: float | None = None) -> Recording:
    """Open a workbook: a stream for each sheet that is a table, named as the file, or as the sheets if several are.

    Raises:
        ReadError: it is damaged, no workbook, or none of its sheets is a table.
        MissingPackageError: openpyxl is not installed.
    """
    with open_zip(path) as archive:
        names = archive.namelist()
    if not any(name.startswith("xl/") for name in names):
        kind = "an OpenDocument file" if "mimetype" in names else "an archive without a workbook"
        raise ReadError(path, kind, hint="save the table as .xlsx or .csv")
    sheets, hidden = _sheets(path)
    record = sheet_record([row for _, row in sheets[RECORD]]) if {FRAMES, RECORD} <= sheets.keys() else None
    if record is not None:
        del sheets[RECORD]
    opened: dict[str, Recording] = {}
    problems: dict[str, ReadError] = {}
    for title, rows in sheets.items():
        log = ReadLog()
        try:
            name = title if len(sheets) > 1 else unpacked_name(path).stem
            table = replace(_table(path, title, rows, log), scored=record if title == FRAMES else None)
            opened[title] = table_recording(path, "xlsx", table, log, rate, name)
        except ReadError as error:
            problems[title] = error
    if not opened.keys() <= hidden:
        for title in hidden & opened.keys():
            del opened[title]
            problems[title] = ReadError(path, "hidden beside a sheet with a table", hint="unhide it in Excel to use it")
    if not opened:
        each = [
            error.what if "sheet" in error.what else f"sheet {clip(title)}: {error.what}"
            for title, error in problems.items()
        ]
        hint = next((error.hint for error in problems.values()), "give a table with column names")
        raise ReadError(path, join_names(each, 4) or "the workbook has no sheet with values", hint=hint)
    if len(opened) == 1:
        (title, recording), *_ = opened.items()
        if problems:
            others = join_names([clip(one) + " (hidden)" * (one in hidden) for one in problems], 4)
            recording.log.warn(f"sheet {clip(title)} was read; left out: {others}")
    log = next(iter(opened.values())).log if len(opened) == 1 else ReadLog()
    streams = tuple(stream for recording in opened.values() for stream in recording.streams)
    topics = [topic for recording in opened.values() for topic in recording.topics]
    topics += [Topic(title, "sheet", None, False, error.what[:200]) for title, error in problems.items()]
    hint = next((recording.hint for recording in opened.values() if recording.hint), "")
    scored = next((recording.scored for recording in opened.values() if recording.scored is not None), None)
    return Recording(str(path), "xlsx", streams, tuple(topics), log, hint, scored=scored)


def _sheets(path: Path) -> tuple[dict[str, list[tuple[int, tuple[Any, ...]]]], set[str]]:
    """Return the sheets with values: title -> the number and the cells of each row that is not blank; those hidden."""
    try:
        import openpyxl
    except ImportError as error:
        raise missing("openpyxl", "reading Excel workbooks") from error
    sheets: dict[str, list[tuple[int, tuple[Any, ...]]]] = {}
    hidden: set[str] = set()
    cells = 0
    try:
        with warnings.catch_warnings(), open_regular(path) as file:
            warnings.simplefilter("ignore")  # of styles and extensions, which have no values
            book = openpyxl.load_workbook(file, read_only=True, data_only=True, keep_links=False)
            for sheet in book.worksheets:
                sheet.reset_dimensions()  # what a sheet states of its size may be wrong
                rows = []
                for number, row in enumerate(sheet.iter_rows(values_only=True), start=1):
                    cells += 1 + len(row)
                    if number > MOST_ROWS or len(row) > MAX_COLUMNS or cells > MOST_CELLS:
                        most = f"{MOST_ROWS} rows, {MAX_COLUMNS} columns or {MOST_CELLS} cells"
                        what = f"sheet {clip(sheet.title)} has more than {most}"
                        raise ReadError(path, what, hint="save the part with the recording as .csv")
                    if any(cell is not None for cell in row):
                        rows.append((number, row))
                if rows:
                    sheets[sheet.title] = rows
                if sheet.sheet_state != "visible":
                    hidden.add(sheet.title)
    except (ReadError, MemoryError):
        raise
    except Exception as error:  # openpyxl lets through whatever its parts raise at damaged XML
        what = f"not a readable workbook ({' '.join(str(error).split())[:120]})"
        raise ReadError(path, what, hint=HINT) from error
    return sheets, hidden


def _table(path: Path, title: str, rows: list[tuple[int, tuple[Any, ...]]], log: ReadLog) -> TableFile:
    """Return the table below the first row of names, which has texts only, at least two."""
    import pandas as pd

    first = str(next(cell for cell in rows[0][1] if cell is not None))
    if is_motive(first) or is_vicon(first):
        raise ReadError(path, "an export of Motive or Vicon", hint="give the .csv file that it wrote")
    header = next((at for at, (_, row) in enumerate(rows) if _is_header(row)), None)
    if header is None:
        raise ReadError(path, "no row of column names", hint="write the column names above the values")
    several = names_of_rows(
        [["" if cell is None else str(cell).strip() for cell in row] for _, row in rows[header : header + DEEPEST + 1]]
    )
    cells, used = rows[header][1], 1
    if several is not None:
        cells, used = tuple(name or None for name in several[0]), several[1]
    width = max(at + 1 for at, cell in enumerate(cells) if cell is not None)
    below = rows[header + used :]
    if any(cell is not None for _, row in below for cell in row[width:]):
        log.warn(f"sheet {clip(title)}: cells right of the last column name were left out")
    names = unique_names(
        [
            text_of(str(cell).strip()) if cell is not None else f"column_{at + 1}"
            for at, cell in enumerate(cells[:width])
        ],
        log,
    )
    columns = {name: [_value(row[at]) if at < len(row) else None for _, row in below] for at, name in enumerate(names)}
    unnamed = [name for name, cell in zip(names, cells, strict=False) if cell is None]
    frame = pd.DataFrame({name: _series(values) for name, values in columns.items()})
    frame = frame.drop(columns=[name for name in unnamed if frame[name].isna().all()])
    numbers = [number for number, _ in below]
    where = f"sheet {clip(title)} row "
    return TableFile(without_decimal_commas(frame, ";"), lambda row: f"{where}{numbers[row]}")


def _is_header(row: Iterable[Any]) -> bool:
    cells = [cell for cell in row if cell is not None]
    return len(cells) >= 2 and all(isinstance(cell, str) for cell in cells)


def _value(cell: Any) -> Any:
    """Return a cell as a table has it: durations in seconds, words for no value as None."""
    if isinstance(cell, str):
        text = text_of(cell.strip())
        return None if text.lower() in BLANKS or text == "#N/A" else text
    return cell.total_seconds() if isinstance(cell, dt.timedelta) else cell


def _seconds(cell: dt.time) -> float:
    return cell.hour * 3600.0 + cell.minute * 60.0 + cell.second + cell.microsecond * 1e-6


def _series(values: list[Any]) -> pd.Series[Any]:
    import pandas as pd

    clock = [value for value in values if isinstance(value, dt.time)]
    if clock:
        of_day = len(clock) == len(values) - values.count(None)
        values = [_seconds(value) if isinstance(value, dt.time) else value for value in values]
        if of_day:
            return pd.Series(past_midnight(np.array(values, np.float64)))
    if any(isinstance(value, dt.datetime) for value in values):
        try:
            return pd.Series(pd.to_datetime(values))
        except (ValueError, TypeError, OverflowError):
            return pd.Series([None if value is None else str(value) for value in values], dtype=object)
    return pd.Series(values, dtype=None if any(value is not None for value in values) else float)
