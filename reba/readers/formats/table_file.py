"""CSV and Parquet files -> a data frame with unique column names, and the place of each row in the file."""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reba.cells import text_of, texts_of
from reba.errors import ReadError
from reba.open_file import open_regular
from reba.readers.formats.score_file import parquet_record
from reba.readers.formats.text import decode, file_bytes
from reba.readers.recording.stream import ReadLog, Topic, clip, unique_names

if TYPE_CHECKING:
    import pandas as pd

PARQUET = b"PAR1"
SEPARATORS = ",;\t"
MAX_COLUMNS = 10_000


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
    """Read separated values: comma, semicolon or tab, decimal point or comma, `#` lines before the header."""
    import pandas as pd

    data = file_bytes(path)
    if b"\n" not in data:
        data = data.replace(b"\r", b"\n")
    text = decode(path, data, log)
    line, header, sample = _header(path, text)
    if data.startswith((b"\xff\xfe", b"\xfe\xff")) or any("not UTF-8" in note for note in log.warnings):
        data = text.encode()
    del text
    separator = max(SEPARATORS, key=header.count)
    names = _names(path, header, separator, line, log)
    comma = separator != "," and re.search(r"\d,\d", sample) and not re.search(r"\d\.\d", sample)
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
    frame = texts_of(frame.dropna(how="all").infer_objects())
    lines = frame.index.to_numpy() + line + 1
    return TableFile(frame.reset_index(drop=True), lambda row: f"line {lines[row]}")


def read_parquet(path: Path) -> TableFile:
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
        table = attempt(lambda: file.read(columns=columns))
    # Text that is not UTF-8 passes the reading and fails much later.
    attempt(lambda: table.validate(full=True))
    frame = attempt(lambda: table.to_pandas(ignore_metadata=True))
    for name in [name for name in frame.columns if frame[name].dtype == "category"]:
        frame[name] = frame[name].astype(object)
    left_out = tuple(
        Topic(name, "Parquet column", len(frame), False, "lists or records, not numbers") for name in nested
    )
    return TableFile(frame, lambda row: f"row {row + 1}", left_out, parquet_record(schema.metadata))


def _header(path: Path, text: str) -> tuple[int, str, str]:
    """Return the number of the header line, the line, and a sample of the rows."""
    start, number = 0, 0
    while start < len(text):
        end = text.find("\n", start)
        end = len(text) if end < 0 else end
        line = text[start:end].strip("\r\ufeff ")
        number += 1
        if line.strip() and not line.startswith("#"):
            return number, line, text[end + 1 : end + 20_000]
        start = end + 1
    raise ReadError(path, "no line with column names", hint="write the column names in the first line")


def _names(path: Path, header: str, separator: str, line: int, log: ReadLog) -> tuple[str, ...]:
    try:
        fields = next(csv.reader([header], delimiter=separator))
    except csv.Error as error:
        raise ReadError(path, f"line {line}: {error}", hint="write the column names in the first line") from error
    names = [text_of(field.strip()) or f"column_{index + 1}" for index, field in enumerate(fields)]
    if len(names) < 2 or len(names) > MAX_COLUMNS:
        what = f"line {line} has {len(names)} column names ({clip(header)}), expected 2 to {MAX_COLUMNS}"
        raise ReadError(path, what, hint="separate columns by comma, semicolon or tab")
    if all(_is_number(name) for name in names):
        raise ReadError(
            path, f"line {line} has numbers, expected column names", hint="write the column names in the first line"
        )
    return unique_names(names, log)


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
