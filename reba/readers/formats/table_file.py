"""CSV and Parquet files -> a data frame with unique column names, and the place of each row in the file."""

from __future__ import annotations

import csv
import io
import json
import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reba.cells import text_of, texts_of
from reba.errors import ReadError
from reba.open_file import open_regular
from reba.posture.columns import COLUMNS
from reba.posture.factors import BOTH_SIDES, FACTORS
from reba.readers.formats.file_content import file_bytes
from reba.readers.formats.header_rows import MOST_ROWS, fields_of, names_of_levels, names_of_rows
from reba.readers.formats.score_file import parquet_record
from reba.readers.formats.text import check_fields, decode
from reba.readers.recording.stream import ReadLog, Topic, clip, unique_names

if TYPE_CHECKING:
    import pandas as pd

PARQUET = b"PAR1"
SEPARATORS = ",;\t"
MAX_COLUMNS = 10_000
INDEX = "__index_level_0__"
"""Name that pandas gives to an index without one."""


@dataclass(frozen=True)
class TableFile:
    """Table of a file.

    Attributes:
        frame: the columns under unique names; blank rows are left out.
        where: position of a row in `frame` -> "line 12" or "row 12".
        left_out: columns that are not read (lists, records).
        scored: what a file of scores was written with if it is in the file itself, else None.
    """

    frame: pd.DataFrame
    where: Callable[[int], str]
    left_out: tuple[Topic, ...] = ()
    scored: dict[str, Any] | None = None


def read_csv(path: Path, log: ReadLog) -> TableFile:
    """Read separated values: comma, semicolon or tab, decimal point or comma.

    `#` lines and a line `sep=;`, which Excel writes, may stand before the header.
    """
    import pandas as pd

    data = file_bytes(path, log)
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    text = decode(path, data, log)
    line, header, sample, separator = _header(path, text)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")) or any("not UTF-8" in note for note in log.warnings):
        data = text.encode()
    del text
    first = [header, *sample.split("\n", MOST_ROWS)[:MOST_ROWS]]
    separated = next((row for row in first if any(mark in row for mark in SEPARATORS)), header)  # below a title
    separator = separator or max(SEPARATORS, key=separated.count)
    rows = names_of_rows(fields_of(first, separator))
    if rows is None:
        names = _names(path, header, separator, line, log)
    else:
        names, line = _named(path, rows[0], log), line + rows[1] - 1
    check_fields(path, data.count(b"\n"), len(names), len(data))
    # The faster way for most; columns that are written otherwise stay texts and are converted below or where used.
    comma = separator != "," and re.search(r"\d,\d", sample)
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always", pd.errors.ParserWarning)
        try:
            frame = pd.read_csv(
                io.BytesIO(data),
                sep=separator,
                decimal="," if comma else ".",
                header=None,
                names=list(names),
                skiprows=line,
                index_col=False,
                skip_blank_lines=False,
                skipinitialspace=True,
                low_memory=False,
                encoding="utf-8-sig",
            )
        except (pd.errors.ParserError, pd.errors.EmptyDataError, ValueError, OverflowError) as error:
            what = " ".join(str(error).split()).removeprefix("Error tokenizing data. C error: ")
            hint = f"give {len(names)} values in each line, as in line {line}, or export it again"
            raise ReadError(path, what[:200], hint=hint) from error
    if notes:
        log.warn("rows have more fields than the header has names; these fields were left out")
    frame = _without_truncated_row(data, frame, separator, log)
    frame = without_decimal_commas(texts_of(frame.dropna(how="all").infer_objects()), separator)
    lines = frame.index.to_numpy() + line + 1
    if comma:
        _refuse_thousands(path, frame, line + 1)
    return TableFile(frame.reset_index(drop=True), lambda row: f"line {lines[row]}")


def read_parquet(path: Path, log: ReadLog) -> TableFile:
    """Read a Parquet file; columns of lists or records are left out."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    def attempt(step: Callable[[], Any]) -> Any:
        try:
            return step()
        except (pa.ArrowException, OSError, ValueError, TypeError, OverflowError) as error:
            what = f"not a readable Parquet file ({' '.join(str(error).split())[:120]})"
            raise ReadError(path, what, hint="the file is truncated or damaged: write or copy it again") from error

    with attempt(lambda: open_regular(path)) as source:
        file = attempt(lambda: pq.ParquetFile(source))
        schema = attempt(lambda: file.schema_arrow)
        nested = [field.name for field in schema if pa.types.is_nested(field.type)]
        columns = [field.name for field in schema if field.name not in nested]
        check_fields(path, file.metadata.num_rows, len(columns), path.stat().st_size)
        table = attempt(lambda: file.read(columns=columns))
    # Text that is not UTF-8 passes the reading and fails much later.
    attempt(lambda: table.validate(full=True))
    frame = attempt(lambda: table.to_pandas(ignore_metadata=True))
    names = names_of_levels([str(name) for name in frame.columns], _levels(schema.metadata))
    frame.columns = list(_distinct(path, names, log))
    if "time" not in frame.columns and any(frame[name].dtype.kind in "mM" for name in frame.columns if name == INDEX):
        frame = frame.rename(columns={INDEX: "time"})
    for name in [name for name in frame.columns if frame[name].dtype == "category"]:
        frame[name] = frame[name].astype(object)
    left_out = tuple(
        Topic(name, "Parquet column", len(frame), False, "lists or records, not numbers") for name in nested
    )
    return TableFile(frame, lambda row: f"row {row + 1}", left_out, parquet_record(schema.metadata))


def _levels(metadata: Mapping[bytes, bytes] | None) -> list[str]:
    """Return the names of the levels of columns that pandas wrote beside them, none where it did not."""
    try:
        indexes = json.loads((metadata or {}).get(b"pandas", b"{}")).get("column_indexes", [])
        return [str(index.get("name") or "") for index in indexes]
    except (ValueError, AttributeError, TypeError, RecursionError):
        return []


def separator_of(line: str) -> str:
    """Return the separator that a line `sep=;` states, "" if it is no such line.

    >>> separator_of("sep=;"), separator_of('"sep=,"'), separator_of("sep;time")
    (';', ',', '')
    """
    match = re.fullmatch(r'"?sep=([,;\t])"?[,;\t ]*', line.strip("\r\n\ufeff "), re.IGNORECASE)
    return match[1] if match else ""


def _header(path: Path, text: str) -> tuple[int, str, str, str]:
    """Return the number of the header line, the line, a sample of the rows, and the separator, "" if not stated."""
    start, number, separator = 0, 0, ""
    while start < len(text):
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        line = text[start:end].strip("\r\ufeff ")
        number += 1
        if not separator and (separator := separator_of(line)):
            start = end + 1
            continue
        if line.strip() and not line.startswith("#"):
            return number, line, text[end + 1 : end + 20_000], separator
        start = end + 1
    raise ReadError(path, "no line with column names", hint="write the column names in the first line")


def _names(path: Path, header: str, separator: str, line: int, log: ReadLog) -> tuple[str, ...]:
    try:
        fields = next(csv.reader([header], delimiter=separator))
    except csv.Error as error:
        raise ReadError(path, f"line {line}: {error}", hint="write the column names in the first line") from error
    names = [text_of(field.strip()) for field in fields]
    if len(names) < 2 or len(names) > MAX_COLUMNS:
        what = f"line {line} has {len(names)} column names ({clip(header)}), expected 2 to {MAX_COLUMNS}"
        raise ReadError(path, what, hint="separate columns by comma, semicolon or tab")
    if all(_is_number(name) for name in names):
        raise ReadError(
            path, f"line {line} has numbers, expected column names", hint="write the column names in the first line"
        )
    return _named(path, names, log)


def _named(path: Path, names: Sequence[str], log: ReadLog) -> tuple[str, ...]:
    """Return distinct names, by its number for a column without one."""
    return _distinct(path, [name or f"column_{index + 1}" for index, name in enumerate(names)], log)


def _distinct(path: Path, names: Sequence[str], log: ReadLog) -> tuple[str, ...]:
    """Return names without repetition; an angle or a factor that stands twice is refused: one of them is wrong."""
    for name in (*COLUMNS, *FACTORS, *BOTH_SIDES):
        if (times := names.count(name)) > 1:
            raise ReadError(path, f"column {name!r} stands {times} times", hint="keep one of them")
    return unique_names(names, log)


_DECIMAL_COMMA = re.compile(r"[-+]?(\d{1,3}(\.\d{3})+|\d*),\d+([eE][-+]?\d+)?")
_GROUPS = re.compile(r"[-+]?\d{1,3}(,\d{3})+")


def without_decimal_commas(frame: pd.DataFrame, separator: str) -> pd.DataFrame:
    """Return a table in which cells like `1.234,5` or `0,5` are numbers, in columns that are mostly numbers.

    Between commas, where such cells are quoted, `"1,234"` may also be a thousand; a column of those stays text.
    """
    import pandas as pd

    for name in [name for name in frame.columns if not pd.api.types.is_numeric_dtype(frame[name])]:
        cells = frame[name].dropna().astype(str)
        if not any("," in cell for cell in cells.unique()):
            continue
        cells = cells.str.strip()
        commas = cells[cells.map(lambda cell: bool(_DECIMAL_COMMA.fullmatch(cell)))]
        others = int(pd.to_numeric(cells.drop(commas.index), errors="coerce").isna().sum())
        if not len(commas) or 2 * others > len(cells):
            continue
        if separator == "," and commas.map(lambda cell: bool(_GROUPS.fullmatch(cell))).all():
            continue
        plain = commas.str.replace(".", "", regex=False).str.replace(",", ".", regex=False)
        changed = frame[name].astype(object)
        changed[plain.index] = plain.astype(float).astype(object)
        frame[name] = changed if others else pd.to_numeric(changed)
    return frame


_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(\.\d{3})+")


def _refuse_thousands(path: Path, frame: pd.DataFrame, first: int) -> None:
    """Refuse a column like `980`, `1.020` beside decimal commas, which would be read as 980 and 1.02."""
    import pandas as pd

    for name in [name for name in frame.columns if not pd.api.types.is_numeric_dtype(frame[name])]:
        cells = frame[name].dropna().astype(str)
        points = [cell for cell in cells.unique() if "." in cell]
        if points and all(_THOUSANDS.fullmatch(cell) for cell in points):
            at, cell = int(cells.index[cells == points[0]][0]), points[0]
            what = f"line {at + first}: {clip(cell)} in column {clip(name)}, beside decimal commas, may be a thousand"
            raise ReadError(path, what, hint="write numbers without separators of thousands")


def _is_number(text: str) -> bool:
    return bool(re.fullmatch(r"[-+]?[\d.,]+([eE][-+]?\d+)?|nan", text))


def _without_truncated_row(data: bytes, frame: pd.DataFrame, separator: str, log: ReadLog) -> pd.DataFrame:
    """Return the rows without a truncated last one: its line has no end and too few fields."""
    if data.endswith((b"\n", b"\r")) or not len(frame):
        return frame
    last = data[data.rfind(b"\n") + 1 :]
    fields = last.count(separator.encode()) + 1
    if fields >= len(frame.columns):
        return frame
    log.ended_abnormally = (
        f"the last line ends after {fields} of {len(frame.columns)} values; the rows before it were read"
    )
    return frame.iloc[:-1]
