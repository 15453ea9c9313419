"""Layout of one message, and columns of numbers from all messages that share it.

Walking a message field by field takes tens of microseconds in Python, but nearly all messages of a topic have the same
layout: numbers differ, counts and names do not. So one message is walked for the places of its numbers (`FieldSpan`)
and for the bytes that determine these ("fixed": counts, lengths, relevant names). Other messages of the same length
with equal fixed bytes have their numbers in the same places, and numpy reads them from all of these messages at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array, Flags
from reba.readers.mcap.records import gather

VARINT: Final = "varint"
"""Type of a number in the base-128 encoding of protobuf."""
_NEAR: Final = 8
"""[bytes] Fixed bytes with smaller gaps are compared in one block: padding has up to 7, a time stamp, which differs in
each message, 8."""


class Undecodable(Exception):
    """A message that does not fit its schema or has no usable value; the text states where and why."""


@dataclass(frozen=True, slots=True)
class FieldSpan:
    """Place of numbers in a message: `count` of the numpy type `code` (with byte order) from byte `start`.

    A varint has the code `VARINT`, and `count` is its number of bytes. `scalar` distinguishes a field from an array of
    one.
    """

    start: int
    code: str
    count: int = 1
    scalar: bool = True

    def items(self) -> list[FieldSpan]:
        """Return a span for each number of an array."""
        if self.code == VARINT:
            return [self]
        size = int(self.code[-1])
        return [FieldSpan(self.start + index * size, self.code) for index in range(self.count)]


Tree: TypeAlias = "FieldSpan | str | float | dict[str, Tree] | list[Tree] | None"
"""A message as a tree: spans for numbers (JSON: the numbers), text, fields by name, elements in order."""


@dataclass
class Walked:
    """Tree and layout of one message.

    Attributes:
        fixed: (start, stop) of bytes that must be equal in another message of the same layout.
        varints: (start, stop) of bytes of which only the highest bit must be equal.
    """

    tree: Tree = None
    fixed: list[tuple[int, int]] = field(default_factory=list)
    varints: list[tuple[int, int]] = field(default_factory=list)


class MessageRows:
    """Messages of one length in the bytes of a segment; row i starts at `starts[i]`."""

    def __init__(self, data: NDArray[np.uint8], starts: NDArray[np.int64], length: int) -> None:
        self.data = data
        self.starts = starts
        self.length = length
        self._count = len(starts)
        steps = starts[1:] - starts[:-1]
        even = len(steps) > 0 and bool((steps == steps[0]).all())
        self._first = int(starts[0]) if even else 0
        self._step = int(steps[0]) if even else None

    def __len__(self) -> int:
        return self._count

    def select(self, chosen: Flags) -> MessageRows:
        """Return the rows for which `chosen` (n,) is true."""
        return self if chosen.all() else MessageRows(self.data, self.starts[chosen], self.length)

    def numbers(self, start: int, code: str, count: int) -> NDArray[Any]:
        """Return (n, count) numbers of type `code` that begin `start` bytes into each row."""
        kind = np.dtype(code)
        if self._step is not None:
            return np.ndarray((self._count, count), kind, self.data, self._first + start, (self._step, kind.itemsize))
        return gather(self.data, self.starts + start, count * kind.itemsize).view(kind)

    def varint(self, start: int, count: int) -> NDArray[np.int64]:
        """Return (n,) numbers from varints of `count` bytes."""
        parts = self.numbers(start, "u1", count).astype(np.uint64) & np.uint64(0x7F)
        shifts = np.arange(0, 7 * count, 7, dtype=np.uint64)
        return (parts << shifts).sum(axis=1, dtype=np.uint64).astype(np.int64)


class MessageLayout:
    """Layout of a walked message, for comparison with others of the same length."""

    def __init__(self, walked: Walked, message: bytes) -> None:
        self.tree = walked.tree
        template = np.frombuffer(message, np.uint8)
        mask = np.zeros(len(message), np.uint8)
        for start, stop in walked.fixed:
            mask[start:stop] = 0xFF
        for start, stop in walked.varints:
            mask[start:stop] = 0x80
        self._blocks = [(start, template[start:stop], mask[start:stop]) for start, stop in _blocks(mask)]

    def matches(self, rows: MessageRows) -> Flags:
        """Return (n,) whether each row has this layout."""
        equal = np.ones(len(rows), bool)
        for start, template, mask in self._blocks:
            block = rows.numbers(start, "u1", len(template))
            if (block != template).any():
                # The mask is applied only here, for speed: padding and irrelevant text may differ.
                equal &= ~((block ^ template) & mask).any(axis=1)
        return equal


def _blocks(mask: NDArray[np.uint8]) -> list[tuple[int, int]]:
    """Return (start, stop) of blocks that cover the masked bytes."""
    where = np.flatnonzero(mask)
    if not len(where):
        return []
    cuts = np.flatnonzero(np.diff(where) > _NEAR)
    starts = where[np.concatenate([[0], cuts + 1])]
    stops = where[np.concatenate([cuts, [len(where) - 1]])] + 1
    return list(zip(starts.tolist(), stops.tolist(), strict=True))


@dataclass(frozen=True)
class FieldRun:
    """Numbers that are adjacent in a message and in the result."""

    start: int
    code: str
    count: int
    column: int


def runs(spans: Sequence[FieldSpan | float | None]) -> tuple[list[FieldRun], dict[int, float]]:
    """Return the runs of adjacent spans, and the columns that are constant (None: NaN)."""
    field_runs: list[FieldRun] = []
    constant: dict[int, float] = {}
    for column, span in enumerate(spans):
        if not isinstance(span, FieldSpan):
            constant[column] = float("nan") if span is None else float(span)
            continue
        last = field_runs[-1] if field_runs else None
        if (
            last is not None
            and span.code != VARINT
            and last.code == span.code
            and last.column + last.count == column
            and last.start + last.count * int(span.code[-1]) == span.start
        ):
            field_runs[-1] = FieldRun(last.start, last.code, last.count + 1, last.column)
        else:
            field_runs.append(FieldRun(span.start, span.code, span.count, column))
    return field_runs, constant


def take(rows: MessageRows, field_runs: Sequence[FieldRun], constant: dict[int, float], width: int) -> Array:
    """Return (n, width) numbers of all rows."""
    result = np.empty((len(rows), width))
    for column, value in constant.items():
        result[:, column] = value
    with np.errstate(invalid="ignore"):  # The bits may be those of a signalling NaN.
        for run in field_runs:
            if run.code == VARINT:
                result[:, run.column] = rows.varint(run.start, run.count)
            else:
                result[:, run.column : run.column + run.count] = rows.numbers(run.start, run.code, run.count)
    return result
