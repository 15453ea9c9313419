"""JSON lines from a pipe as a store of messages: one line is one message of one channel.

A line is a row of the posture table, `{"time": 1.2, "trunk_flexion": 30}`, a joint state,
`{"time": 1.2, "name": ["knee_left"], "position": [0.4]}` (`stamp` will do for `time`), or transforms as ROS writes
them. Everything behind this is what reads JSON channels of MCAP files.
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
from reba.readers.mcap.container import ChunkRef, Loaded
from reba.readers.mcap.decode import load_json
from reba.readers.mcap.extract import extract_angles, kind_of_json, stamp_of
from reba.readers.mcap.layout import Undecodable
from reba.readers.mcap.records import Channel, Scan, Schema
from reba.readers.recording.stream import clip

NAME: Final = "standard input"
CHANNEL: Final = 1
LONGEST: Final = 1 << 20
"""[bytes] A longer line is no frame."""
_STEP: Final = 1 << 16


@dataclass
class LoadedLines(Loaded):
    """Lines at hand, and where they stood."""

    numbers: list[int]

    def where(self, payload: int) -> str:
        """Say in words where a line stands."""
        return f"line {self.numbers[int(np.searchsorted(self.scan.payloads, payload))]}"


class Lines:
    """Lines of a pipe as they come; what `reba.live.sources.GrowingStore` asks for.

    Args:
        descriptor: of the open pipe or file.
        tell: takes a warning.
    """

    def __init__(self, descriptor: int, tell: Callable[[str], None]) -> None:
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
        self._tell = tell
        self._rest = b""
        self._read = 0
        self._good = False
        self._loaded: dict[int, LoadedLines] = {}

    def grow(self) -> ChunkRef | None:
        """Return what came since as one segment, None if no whole line did.

        Raises:
            ReadError: the first line is not of use.
        """
        lines = self._new_lines()
        kept: list[tuple[int, bytes, int]] = []
        for line in lines:
            self._read += 1
            if line.strip() and (stamp := self._stamp(line)) is not None:
                kept.append((self._read, line, stamp))
        if not kept:
            return None
        lengths = np.array([len(line) for _, line, _ in kept], np.int64)
        times = np.array([stamp for _, _, stamp in kept], np.int64)
        starts = np.cumsum(lengths) - lengths
        scan = Scan(starts, lengths, np.full(len(kept), CHANNEL, np.uint16), times, (), int(lengths.sum()))
        segment = ChunkRef(kept[0][0], scan.end, None, int(times.min()))
        self._loaded[segment.offset] = LoadedLines(
            segment, b"".join(line for _, line, _ in kept), scan, [number for number, _, _ in kept]
        )
        self.segments.append(segment)
        self.counts[CHANNEL] += len(kept)
        first, last = int(times.min()), int(times.max())
        self.span = (first, last) if self.span is None else (min(first, self.span[0]), max(last, self.span[1]))
        return segment

    def load(self, segment: ChunkRef) -> Loaded:
        """Return the lines of a segment."""
        return self._loaded[segment.offset]

    def release(self) -> None:
        """Keep everything at hand: lines cannot be read again."""

    def forget(self) -> None:
        """Let go of the segments there are."""
        self.segments.clear()
        self._loaded.clear()

    def wait(self, seconds: float) -> None:
        """Wait until there is something to read."""
        select.select([self._descriptor], [], [], seconds)

    def _new_lines(self) -> list[bytes]:
        if not select.select([self._descriptor], [], [], 0)[0]:
            return []
        data = os.read(self._descriptor, _STEP)
        self.finished = not data
        *lines, self._rest = (self._rest + data).split(b"\n")
        if self.finished and self._rest:
            lines, self._rest = [*lines, self._rest], b""
        if len(self._rest) > LONGEST:
            raise ReadError(NAME, f"a line is longer than {LONGEST} bytes", hint="write one JSON object a line")
        return lines

    def _stamp(self, line: bytes) -> int | None:
        """Return the time of a line [ns], that of its arrival if it states none; None for a line of no use."""
        try:
            tree = load_json(line)
            if not isinstance(tree, dict):
                raise Undecodable("it is no JSON object")
            kind = kind_of_json(tree)
            if kind is None:
                raise Undecodable(_unknown(tree))
            stamp = stamp_of(tree)
            if stamp is None and any(key in tree and not isinstance(tree[key], dict) for key in ("time", "stamp")):
                raise Undecodable("its time is no number of seconds")
        except Undecodable as error:
            if not self._good:
                raise ReadError(
                    NAME,
                    f"line {self._read}: {error}",
                    hint='write one JSON object a line, as {"time": 0.0, "trunk_flexion": 20.0} or a joint state '
                    '{"time": 0.0, "name": [...], "position": [...]}',
                ) from error
            self.skip(f"line {self._read}: {error}")
            return None
        self._good = True
        self.ready |= kind[1] is extract_angles
        seconds, nanos = stamp if stamp is not None else (None, None)
        if not isinstance(seconds, int) or not isinstance(nanos, int):
            return time.time_ns()
        return seconds * 1_000_000_000 + nanos

    def skip(self, why: str) -> None:
        """Count a line that is left out; the first one is told."""
        if not self.skipped:
            self._tell(f"{NAME}: {why}; lines like this are left out and counted")
        self.skipped += 1


def _unknown(tree: dict[str, Any]) -> str:
    keys = [clip(str(key)) for key in tree if key not in ("time", "stamp")]
    hint = next((near for key in keys if (near := did_you_mean(key, COLUMNS))), "")
    return f"no posture column or joint state among {', '.join(keys[:4]) or 'its keys'}{hint}"
