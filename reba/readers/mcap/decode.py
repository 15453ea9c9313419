"""Messages of one channel -> pieces: arrays of time and values that share their names.

`ColumnDecoder` decodes encodings with a layout (CDR, ROS 1, protobuf) column by column, `JsonDecoder` JSON.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array, Flags
from reba.posture.factors import SUPPORTS
from reba.readers.mcap.extract import Extractor, SignalGroup, Stamp, Value, extract_numbers
from reba.readers.mcap.layout import (
    VARINT,
    FieldRun,
    FieldSpan,
    MessageLayout,
    MessageRows,
    Undecodable,
    Walked,
    runs,
    take,
)
from reba.readers.mcap.records import LATEST
from reba.readers.mcap.store import Loaded
from reba.readers.mcap.trace import NO_STAMP
from reba.readers.recording.stream import ReadLog

_MOST_LAYOUTS: Final = 64
"""Layouts cached for one message length; messages with further ones are walked one by one."""
_MOST_LENGTHS: Final = 64
"""Message lengths whose layouts are cached."""
_NANO: Final = 1_000_000_000
_SUPPORTS: Final = dict(enumerate(SUPPORTS))
_ERRORS: Final = (ValueError, TypeError, OverflowError, RecursionError)


@dataclass(frozen=True)
class Piece:
    """n samples of the same k names.

    Attributes:
        number: (n,) number of the message in its channel.
        stamp: (n,) time in the message [ns since 1970], `NO_STAMP` where it has none.
        log: (n,) log time [ns since 1970].
        parents: frames only: k parents.
        values: (n, k), of points (n, 3 k), of frames (n, 7 k).
    """

    number: NDArray[np.int64]
    stamp: NDArray[np.int64]
    log: NDArray[np.int64]
    names: tuple[str, ...]
    parents: tuple[str, ...]
    values: Array


@dataclass(frozen=True)
class Batch:
    """Messages of one channel in a loaded segment: (n,) starts and lengths of payloads, log times [ns], numbers."""

    loaded: Loaded
    starts: NDArray[np.int64]
    lengths: NDArray[np.int64]
    times: NDArray[np.int64]
    numbers: NDArray[np.int64]

    def __getitem__(self, chosen: Flags | slice) -> Batch:
        """Return the messages for which `chosen` (n,) is true, or those of a slice."""
        return Batch(self.loaded, self.starts[chosen], self.lengths[chosen], self.times[chosen], self.numbers[chosen])

    def payload(self, index: int) -> bytes:
        """Return the bytes of one message."""
        start = int(self.starts[index])
        return self.loaded.data[start : start + int(self.lengths[index])]


class Decoder(Protocol):
    """Converts messages to pieces; messages without usable value are counted in the log."""

    def decode(self, batch: Batch, log: ReadLog) -> list[Piece]:
        """Return the pieces of a batch, in any order."""

    def rows(self, batch: Batch) -> list[dict[str, Any] | None]:
        """Return the messages of a batch as rows of a table, texts included; None for one that is no row."""


@dataclass
class _LayoutPlan:
    """Numbers to read from messages of one layout; `joined`: all names and parents; `error`: why it is not usable."""

    layout: MessageLayout
    groups: list[SignalGroup] = field(default_factory=list)
    runs: list[FieldRun] = field(default_factory=list)
    constant: dict[int, float] = field(default_factory=dict)
    joined: tuple[tuple[str, ...], tuple[str, ...]] | None = None
    error: str = ""
    alone: bool = False


class ColumnDecoder:
    """Decodes the `wanted` names (None: all) of messages whose layout can be walked.

    Args:
        walk: returns the fields of one message.
        extract: returns its usable numbers.
    """

    def __init__(self, walk: Callable[[bytes], Walked], extract: Extractor, wanted: frozenset[str] | None) -> None:
        self._walk = walk
        self._extract = extract
        self._wanted = wanted
        self._plans: dict[int, list[_LayoutPlan]] = {}

    def decode(self, batch: Batch, log: ReadLog) -> list[Piece]:
        """Return the pieces of a batch, in any order."""
        pieces: list[Piece] = []
        data = np.frombuffer(batch.loaded.data, np.uint8)
        lengths = batch.lengths
        alike = len(lengths) > 0 and bool((lengths == lengths[0]).all())
        for length in dict.fromkeys((lengths[:1] if alike else lengths).tolist()):
            self._decode_group(batch if alike else batch[lengths == length], data, length, pieces, log)
        return pieces

    def rows(self, batch: Batch) -> list[dict[str, Any] | None]:
        """Return the numbers of each message by name, without those that are NaN; the support as its word."""
        rows: list[dict[str, Any] | None] = [None] * len(batch.numbers)
        for piece in ColumnDecoder(self._walk, extract_numbers, None).decode(batch, ReadLog()):
            for at, values in zip((piece.number - batch.numbers[0]).tolist(), piece.values.tolist(), strict=True):
                row = {name: value for name, value in zip(piece.names, values, strict=True) if value == value}
                if (code := row.get("support")) in _SUPPORTS:
                    row["support"] = _SUPPORTS[code]
                rows[at] = row
        return rows

    def _decode_group(
        self, batch: Batch, data: NDArray[np.uint8], length: int, pieces: list[Piece], log: ReadLog
    ) -> None:
        """Decode messages of one length: by the cached layouts, then by the layouts of those left."""
        if len(self._plans) >= _MOST_LENGTHS and length not in self._plans:
            self._plans.pop(next(iter(self._plans)))
        plans = self._plans.setdefault(length, [])
        for plan in plans:
            if not len(batch.starts):
                return
            batch = self._use(plan, batch, data, length, pieces, log)
        while len(batch.starts):
            plan = self._new_plan(batch.payload(0))
            if plan.alone or len(plans) >= _MOST_LAYOUTS:
                # Not compared with the others: otherwise time would be quadratic in the number of damaged messages.
                self._use(plan, batch[:1], data, length, pieces, log)
                batch = batch[1:]
            else:
                plans.append(plan)
                batch = self._use(plan, batch, data, length, pieces, log)

    @staticmethod
    def _use(
        plan: _LayoutPlan, batch: Batch, data: NDArray[np.uint8], length: int, pieces: list[Piece], log: ReadLog
    ) -> Batch:
        """Decode the messages that have the layout of the plan, return the others."""
        rows = MessageRows(data, batch.starts, length)
        fits = plan.layout.matches(rows)
        if not fits.any():
            return batch
        if plan.error:
            where = batch.loaded.where(int(batch.starts[np.argmax(fits)]))
            log.skip(int(fits.sum()), f"message at {where}: {plan.error}")
        else:
            pieces.extend(_pieces(plan, rows.select(fits), batch if fits.all() else batch[fits]))
        return batch[~fits]

    def _new_plan(self, message: bytes) -> _LayoutPlan:
        """Return the plan of the layout of one message; the plan of a damaged one fits this message alone."""
        alone = Walked(fixed=[(0, len(message))])
        try:
            walked = self._walk(message)
        except Undecodable as error:
            return _LayoutPlan(MessageLayout(alone, message), error=str(error), alone=True)
        try:
            groups = self._extract(walked.tree)
        except Undecodable as error:
            return _LayoutPlan(MessageLayout(walked, message), error=str(error))
        groups = [group for each in groups if (group := each.select(self._wanted)).names]
        plan = _LayoutPlan(MessageLayout(walked, message), groups)
        plan.runs, plan.constant = runs([value for group in groups for value in group.values])
        names = tuple(name for group in groups for name in group.names)
        if len(set(names)) == len(names):
            plan.joined = names, tuple(parent for group in groups for parent in group.parents)
        return plan


def _pieces(plan: _LayoutPlan, rows: MessageRows, batch: Batch) -> list[Piece]:
    """Return the pieces of messages of one layout: one if all groups share their time, else one for each."""
    if not plan.groups:
        return []
    width = sum(len(group.values) for group in plan.groups)
    values = take(rows, plan.runs, plan.constant, width)
    if plan.joined is not None and _share_time(plan.groups, rows):
        stamp = _stamp(plan.groups[0].stamp, rows)
        return [Piece(batch.numbers, stamp, batch.times, *plan.joined, values)]
    pieces, column = [], 0
    for group in plan.groups:
        part = values[:, column : column + len(group.values)]
        pieces.append(Piece(batch.numbers, _stamp(group.stamp, rows), batch.times, group.names, group.parents, part))
        column += len(group.values)
    return pieces


def _share_time(groups: list[SignalGroup], rows: MessageRows) -> bool:
    """Return whether all groups of each row have one time."""
    first = _raw_stamp(groups[0].stamp, rows)
    return all(bool((_raw_stamp(group.stamp, rows) == first).all()) for group in groups[1:])


def _raw_stamp(stamp: Stamp | None, rows: MessageRows) -> NDArray[Any]:
    """Return (n,) the bytes of a time as one number if they are adjacent, else the time."""
    seconds, nanos = stamp or (None, None)
    if not isinstance(seconds, FieldSpan) or not isinstance(nanos, FieldSpan):
        return _stamp(stamp, rows)
    together = seconds.code[1:] == "i4" and nanos.start == seconds.start + 4
    return rows.numbers(seconds.start, "u8", 1)[:, 0] if together else _stamp(stamp, rows)


def _stamp(stamp: Stamp | None, rows: MessageRows) -> NDArray[np.int64]:
    if stamp is None:
        return np.full(len(rows), NO_STAMP)
    if isinstance(stamp[0], FieldSpan) and stamp[0].code[-2] == "f":
        time = rows.numbers(stamp[0].start, stamp[0].code, 1)[:, 0].astype(np.float64)
        there = np.abs(time) < LATEST / _NANO  # False for NaN
        return np.where(there, np.rint(np.where(there, time, 0.0) * _NANO), NO_STAMP).astype(np.int64)
    seconds, nanos = (_whole(part, rows) for part in stamp)
    total = seconds * _NANO + nanos
    total[(seconds < 0) | (seconds >= LATEST // _NANO)] = NO_STAMP
    return total


def _whole(value: Value, rows: MessageRows) -> NDArray[np.int64]:
    if not isinstance(value, FieldSpan):
        return np.full(len(rows), int(value or 0), np.int64)
    if value.code == VARINT:
        return rows.varint(value.start, value.count)
    return rows.numbers(value.start, value.code, 1)[:, 0].astype(np.int64)


class JsonDecoder:
    """Decodes the `wanted` names (None: all) of JSON messages one by one; `extract` returns their usable numbers."""

    def __init__(self, extract: Extractor, wanted: frozenset[str] | None) -> None:
        self._extract = extract
        self._wanted = wanted

    def decode(self, batch: Batch, log: ReadLog) -> list[Piece]:
        """Return the pieces of a batch, in any order."""
        columns: dict[tuple[tuple[str, ...], tuple[str, ...]], list[tuple[int, int, tuple[Value, ...]]]] = {}
        for index in range(len(batch.times)):
            try:
                groups = self._extract(load_json(batch.payload(index)))
            except Undecodable as error:
                log.skip(1, f"message at {batch.loaded.where(int(batch.starts[index]))}: {error}")
                continue
            for group in groups:
                chosen = group.select(self._wanted)
                if chosen.names or not group.names:
                    sample = (index, _json_stamp(chosen.stamp), chosen.values)
                    columns.setdefault((chosen.names, chosen.parents), []).append(sample)
        pieces = []
        for (names, parents), samples in columns.items():
            rows = np.array([index for index, _, _ in samples], np.int64)
            stamp = np.array([stamp for _, stamp, _ in samples], np.int64)
            values = np.array([values for _, _, values in samples], np.float64)
            pieces.append(Piece(batch.numbers[rows], stamp, batch.times[rows], names, parents, values))
        return pieces

    def rows(self, batch: Batch) -> list[dict[str, Any] | None]:
        """Return the object of each message."""
        trees: list[Any] = []
        for index in range(len(batch.times)):
            try:
                trees.append(load_json(batch.payload(index)))
            except Undecodable:
                trees.append(None)
        return [tree if isinstance(tree, dict) else None for tree in trees]


def _json_stamp(stamp: Stamp | None) -> int:
    if stamp is None:
        return NO_STAMP
    seconds, nanos = stamp
    if not isinstance(seconds, int) or not isinstance(nanos, int):
        return NO_STAMP
    total = seconds * _NANO + nanos
    return total if abs(total) < LATEST else NO_STAMP


def load_json(message: bytes) -> Any:
    """Return a JSON value; orjson reads it if installed, the standard library what orjson refuses (NaN).

    Raises:
        Undecodable: it is not JSON text.
    """
    try:
        return _fast_loads(message)
    except _ERRORS:
        pass
    import json

    try:
        return json.loads(message)
    except _ERRORS as error:
        raise Undecodable(f"it is not JSON text ({str(error)[:60]})") from error


def _fast_loads(message: bytes) -> Any:
    try:
        import orjson
    except ImportError:
        import json

        return json.loads(message)
    return orjson.loads(message)
