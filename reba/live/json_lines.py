"""JSON lines from a pipe as a message store: one line is one message of one channel.

A line is a row of the posture table, `{"time": 1.2, "trunk_flexion": 30}`, a joint state,
`{"time": 1.2, "name": ["knee_left"], "position": [0.4]}` (`stamp` is accepted for `time`), or transforms in the form of
ROS messages. The lines are decoded by the readers of JSON channels in MCAP files.
"""

from __future__ import annotations

import os
import select
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from reba.errors import ReadError, did_you_mean
from reba.posture.columns import COLUMNS
from reba.readers.mcap.decode import load_json
from reba.readers.mcap.extract import extract_angles, stamp_of
from reba.readers.mcap.layout import Undecodable
from reba.readers.mcap.meanings import meaning_of_json
from reba.readers.mcap.records import Channel, Scan, Schema
from reba.readers.mcap.store import ChunkRef, Loaded
from reba.readers.mcap.trace import JITTER
from reba.readers.recording.stream import clip

NAME: Final = "standard input"
CHANNEL: Final = 1
MAX_LINE_BYTES: Final = 1 << 20
"""[bytes] Longest line; a frame of a person has a few kilobytes."""
FEW_LINES: Final = 10
"""Lines after which it shows whether they arrive as fast as they are stamped."""
RETURN: Final = 2_500_000_000
"""[ns] After a single damaged stamp the next one is at most so far from the one before it."""
READ_BYTES: Final = 1 << 16
"""[bytes] Read at a time: the capacity of a pipe on Linux."""


class LineClock:
    """Log times of lines, which have none of their own.

    They advance as the stamps do, so that a file can be piped at once. Where the stamps jump back, or ahead of the
    time of arrival although lines arrive as fast as they are stamped, the log time goes on by the time of arrival, by
    one period at least.

    >>> clock = LineClock()
    >>> arrivals = [(5, 90), (6, 91), (0, 94), (1, 95)]
    >>> [clock.log_time(stamp * 10**9, arrival * 10**9) // 10**9 for stamp, arrival in arrivals]
    [5, 6, 9, 10]
    """

    def __init__(self) -> None:
        self._lines = 0
        self._first = (0, 0)
        self._last = self._arrived = self._shift = self._before = self._period = 0

    def log_time(self, stamp: int, arrival: int) -> int:
        """Return the log time [ns] of a line with a stamp that arrives at a Unix time [ns]."""
        if not self._lines:
            self._first = arrival, stamp
            self._last, self._arrived = stamp, arrival
        passed = max(arrival - self._arrived, 0)
        step = stamp + self._shift - self._last
        at_once = self._lines < FEW_LINES or 2 * (arrival - self._first[0]) < self._last - self._first[1]
        if step < -JITTER or step > passed + JITTER:
            if 0 <= stamp + self._before - self._last <= passed + RETURN:
                self._shift, self._before = self._before, self._shift  # one damaged stamp lies between
            elif step < -JITTER or not at_once:
                self._shift, self._before = self._last + max(passed, self._period) - stamp, self._shift
        else:
            self._period = max(step, 0)
        self._lines += 1
        self._last, self._arrived = stamp + self._shift, arrival
        return self._last


@dataclass
class LoadedLines(Loaded):
    """Lines in memory with their numbers in the input."""

    numbers: list[int]

    def where(self, payload: int) -> str:
        """Return the position of a line as text."""
        return f"line {self.numbers[int(np.searchsorted(self.scan.payloads, payload))]}"


class LineStore:
    """Lines of a pipe as a growing message store; satisfies `reba.live.sources.GrowingStore`.

    Args:
        descriptor: of the open pipe or file.
    """

    def __init__(self, descriptor: int, on_warning: Callable[[str], None]) -> None:
        self.path = Path(NAME)
        self.segments: list[ChunkRef] = []
        self.schemas: dict[int, Schema] = {}
        self.channels = {CHANNEL: Channel(CHANNEL, 0, NAME, "json")}
        self.counts: Counter[int] = Counter()
        self.span: tuple[int, int] | None = None
        self.finished = False
        self.ready = False
        self.skipped = 0
        self._descriptor = descriptor
        self._on_warning = on_warning
        self._incomplete = b""
        self._line_number = 0
        self._any_accepted = False
        self._clock = LineClock()
        self._loaded: dict[int, LoadedLines] = {}

    def grow(self) -> ChunkRef | None:
        """Return the lines since the last call as one segment, None without a complete line.

        Raises:
            ReadError: the first line cannot be used.
        """
        usable: list[tuple[int, bytes, int]] = []
        for line in self._new_lines():
            self._line_number += 1
            if line.strip() and (stamp := self._stamp(line)) is not None:
                usable.append((self._line_number, line, stamp))
        if not usable:
            return None
        lengths = np.array([len(line) for _, line, _ in usable], np.int64)
        times = np.array([stamp for _, _, stamp in usable], np.int64)
        starts = np.cumsum(lengths) - lengths
        scan = Scan(starts, lengths, np.full(len(usable), CHANNEL, np.uint16), times, (), int(lengths.sum()))
        segment = ChunkRef(usable[0][0], scan.end, None, int(times.min()))
        self._loaded[segment.offset] = LoadedLines(
            segment, b"".join(line for _, line, _ in usable), scan, [number for number, _, _ in usable]
        )
        self.segments.append(segment)
        self.counts[CHANNEL] += len(usable)
        first, last = int(times.min()), int(times.max())
        self.span = (first, last) if self.span is None else (min(first, self.span[0]), max(last, self.span[1]))
        return segment

    def load(self, segment: ChunkRef) -> Loaded:
        """Return the lines of a segment."""
        return self._loaded[segment.offset]

    def release(self) -> None:
        """Keep the lines in memory: a pipe cannot be read again."""

    def forget(self) -> None:
        """Remove all segments from memory."""
        self.segments.clear()
        self._loaded.clear()

    def wait(self, seconds: float) -> None:
        """Wait until the pipe has data, at most this long [s]."""
        select.select([self._descriptor], [], [], seconds)

    def _new_lines(self) -> list[bytes]:
        if not select.select([self._descriptor], [], [], 0)[0]:
            return []
        data = os.read(self._descriptor, READ_BYTES)
        self.finished = not data
        *lines, self._incomplete = (self._incomplete + data).split(b"\n")
        if self.finished and self._incomplete:
            lines, self._incomplete = [*lines, self._incomplete], b""
        if len(self._incomplete) > MAX_LINE_BYTES:
            raise ReadError(
                NAME, f"a line is longer than {MAX_LINE_BYTES} bytes", hint="write one JSON object per line"
            )
        return lines

    def _stamp(self, line: bytes) -> int | None:
        """Return the log time of a line [ns], see `LineClock`, or None for a line that cannot be used."""
        try:
            tree = load_json(line)
            if not isinstance(tree, dict):
                raise Undecodable("not a JSON object")
            meaning = meaning_of_json(tree)
            if meaning is None:
                raise Undecodable(_unknown(tree))
            stamp = stamp_of(tree)
            bare = [tree[key] for key in ("time", "timestamp", "stamp") if key in tree]
            if stamp is None and any(not isinstance(given, dict) for given in bare):
                raise Undecodable("time is neither a number of seconds nor a date and time of ISO 8601")
            if meaning.extract is extract_angles and isinstance(tree.get("time"), str):
                raise Undecodable("time of a posture is not a number of seconds")
        except Undecodable as error:
            if not self._any_accepted:
                raise ReadError(
                    NAME,
                    f"line {self._line_number}: {error}",
                    hint='write one JSON object per line, as {"time": 0.0, "trunk_flexion": 20.0} or a joint state '
                    '{"time": 0.0, "name": [...], "position": [...]}',
                ) from error
            self.skip(f"line {self._line_number}: {error}")
            return None
        self._any_accepted = True
        self.ready |= meaning.extract is extract_angles
        seconds, nanos = stamp if stamp is not None else (None, None)
        arrival = time.time_ns()
        if not isinstance(seconds, int) or not isinstance(nanos, int):
            return arrival
        return self._clock.log_time(seconds * 1_000_000_000 + nanos, arrival)

    def skip(self, why: str) -> None:
        """Count a skipped line; the first one is reported."""
        if not self.skipped:
            self._on_warning(f"{NAME}: {why}; such lines are skipped and counted")
        self.skipped += 1


def _unknown(tree: dict[str, Any]) -> str:
    keys = [clip(str(key)) for key in tree if key not in ("time", "stamp")]
    hint = next((text for key in keys if (text := did_you_mean(key, COLUMNS))), "")
    return f"no posture column or joint state among {', '.join(keys[:4]) or 'its keys'}{hint}"
