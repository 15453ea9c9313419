"""Text files of motion capture: decoding, and rows of numbers; every error names its line."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.errors import ReadError
from reba.readers.formats.file_content import file_bytes
from reba.readers.recording.stream import ReadLog, clip

FIELDS_PER_BYTE: Final = 64
"""Most fields of a table per byte of its file, those included that rows leave out; a choice: rows of a hundred markers
that are not seen have thirty."""
FIELDS_ALWAYS: Final = 10_000_000
"""Fields of a table that any file may have: they take 80 MB."""
CHUNK = 20_000
"""Lines converted at once; limits the words in memory."""
MARKS = {b"\xef\xbb\xbf": "utf-8-sig", b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
"""Byte order marks and the encodings that they announce."""
LARGEST = 1e12
"""Largest angle, length or time that is read; far above real ones, and squares of it cannot overflow."""
_NOT_A_NUMBER = ("nan", "nan(ind)", "nan(snan)", "1.#ind", "1.#qnan", "1.#snan", "1.#j")
BLANKS = frozenset(
    (
        *(
            "",
            "na",
            "n/a",
            "#n/a",
            "#n/a n/a",
            "#na",
            "<na>",
            "null",
            "none",
            "missing",
            "-",
            "--",
            "---",
            ".",
            "..",
            "...",
        ),
        *(sign + word for sign in ("", "-", "+") for word in _NOT_A_NUMBER),
    )
)
"""Words for "no value", in lower case: of C and its compilers, spreadsheets and statistics, dashes and dots."""
_COMMA = re.compile(r"[-+]?\d*,\d+([eE][-+]?\d+)?")


def decode(path: Path, data: bytes, log: ReadLog) -> str:
    """Return text from UTF-8 or UTF-16 with a byte order mark, else Latin-1, which is noted."""
    encoding = next((MARKS[mark] for mark in MARKS if data.startswith(mark)), "utf-8")
    if encoding != "utf-16" and (at := data.find(b"\0")) >= 0:
        raise ReadError(path, "binary data where text was expected", offset=at, hint="give a text file")
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding == "utf-16":
            raise ReadError(path, "damaged UTF-16 text", offset=error.start, hint="save it as UTF-8") from error
        log.warn(f"byte {error.start} is not UTF-8; names were read as Latin-1")
        return data.decode("latin-1")


def read_lines(path: Path, log: ReadLog) -> list[str]:
    """Return the lines of a text file without their ends (LF, CRLF or CR)."""
    text = decode(path, file_bytes(path, log), log)
    # splitlines() also splits at form feeds and Unicode separators, and lines would be miscounted.
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def number_rows(
    path: Path,
    lines: Sequence[str],
    first: int,
    width: int,
    log: ReadLog,
    *,
    separator: str | None = None,
    gaps: bool = False,
    short: bool = False,
    columns: Sequence[int] | None = None,
) -> tuple[Array, NDArray[np.int64]]:
    """Return rows of numbers (n, width or number of `columns`) and the line number (n,) of each, counted from 1.

    Blank lines are skipped. A truncated last row is left out and noted; an incomplete row before it is an error.

    Args:
        lines: every line of the file, which is at `path`.
        first: index of the first line with numbers.
        separator: None for any white space.
        gaps: blank fields and "nan" are NaN.
        short: rows may lack blank fields at their end, but not where blanks separate.
        columns: positions of the fields to return; the others may be texts. None for all.

    Raises:
        ReadError: a word is not a finite number, or a row has too many or too few.
    """
    parts: list[Array] = []
    numbers: list[int] = []
    if short:
        check_fields(path, len(lines) - first, width, sum(map(len, lines)))
    last = next((index for index in range(len(lines) - 1, first - 1, -1) if _is_row(lines[index], separator)), -1)
    for start in range(first, len(lines), CHUNK):
        rows: list[list[str]] = []
        stop = min(start + CHUNK, last + 1)
        for index in range(start, stop):
            if not _is_row(lines[index], separator):
                continue
            row = _row(lines[index], width, separator)
            if len(row) != width:
                if index == last and len(row) < width and (not short or index == len(lines) - 1):
                    log.ended_abnormally = (
                        f"line {index + 1} ends after {len(row)} of {width} numbers; the rows before it were read"
                    )
                    continue
                if len(row) > width or not short or separator is None:
                    raise ReadError(
                        path,
                        f"line {index + 1} has {len(row)} numbers, expected {width}",
                        hint="the file is damaged there: export it again",
                    )
                row += [""] * (width - len(row))
            rows.append(row if columns is None else [row[column] for column in columns])
            numbers.append(index + 1)
        if rows:
            parts.append(_convert(path, rows, numbers[-len(rows) :], gaps))
    table = np.concatenate(parts) if parts else np.empty((0, width if columns is None else len(columns)))
    return table, np.array(numbers, dtype=np.int64)


def check_fields(path: Path, rows: int, width: int, size: int) -> None:
    """Check that a table has not many more fields than its file has bytes, as rows may lack some, or repeat others.

    Raises:
        ReadError: it has, and would take much more memory than an honest file of this size.
    """
    if rows * width > max(FIELDS_ALWAYS, FIELDS_PER_BYTE * size):
        raise ReadError(
            path,
            f"has {rows} rows of {width} fields, which no recording in a file of {size} bytes has",
            hint="the file is damaged: export it again",
        )


def _is_row(line: str, separator: str | None) -> bool:
    return bool(line.strip() if separator is None else line.replace(separator, "").strip())


def _row(line: str, width: int, separator: str | None) -> list[str]:
    """Return the fields of a line without empty ones beyond the width, or between fields that fill it."""
    row = line.split(separator)
    while len(row) > width and not row[-1].strip():
        row.pop()
    if len(row) > width:
        filled = [field for field in row if field.strip()]
        return filled if len(filled) == width else row
    return row


def _convert(path: Path, rows: list[list[str]], numbers: list[int], gaps: bool) -> Array:
    """Return (n, width) numbers of rows of equal length; all words at once, one by one only where this fails."""
    words: Iterable[str] = chain.from_iterable(rows)
    if gaps:
        words = (word or "nan" for word in words)
    try:
        table = np.array(list(words), dtype=np.float64).reshape(len(rows), -1)
    except ValueError:
        table = np.array(
            [[_cell(path, word, line, gaps) for word in row] for row, line in zip(rows, numbers, strict=True)]
        )
    bad = np.abs(table) > LARGEST
    if not gaps:
        bad |= np.isnan(table)
    if bad.any():
        row_index, column = (int(index) for index in np.argwhere(bad)[0])
        word = clip(rows[row_index][column].strip())
        raise ReadError(
            path,
            f"line {numbers[row_index]}: {word} is not a finite number below {LARGEST:g}",
            hint="export the recording again",
        )
    return table


def _cell(path: Path, word: str, line: int, gaps: bool) -> float:
    text = word.strip()
    if gaps and text.lower() in BLANKS:
        return float("nan")
    try:
        return number(text)
    except ValueError:
        raise ReadError(
            path, f"line {line}: {clip(text)} is not a number", hint="the file is damaged there: export it again"
        ) from None


def number(text: str) -> float:
    """Return the number of a text with a decimal point or comma.

    Raises:
        ValueError: it is none.

    >>> number("1.5"), number("-0,25")
    (1.5, -0.25)
    """
    return float(text.replace(",", ".") if _COMMA.fullmatch(text.strip()) else text)


def rows_separator(lines: Sequence[str], separators: Sequence[str | None], width: int) -> str | None:
    """Return which of some separators gives most of the first rows of numbers `width` fields, the first of equal ones.

    None stands for any blanks, which leave no gap.
    """
    rows = [line.strip(" \r") for line in islice((line for line in lines if line.strip(" \t,")), LOOK)]
    return max(separators, key=lambda separator: sum(len(_row(row, width, separator)) == width for row in rows))


LOOK = 200
"""Lines of numbers that decide the separator."""


def with_time(time: Array, rows: Array, numbers: NDArray[np.int64], log: ReadLog) -> tuple[Array, Array]:
    """Return the (n,) times [s] and the rows that have one; the others are counted, with the first of their lines."""
    blank = np.isnan(time)
    if blank.any():
        log.skip(int(blank.sum()), f"line {numbers[np.argmax(blank)]}: no time")
        rows, time = rows[~blank], time[~blank]
    return np.ascontiguousarray(time), rows
