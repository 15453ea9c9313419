"""Streams of a recording: channels of one topic joined, peeked for their names, read segment by segment."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from reba.errors import ReadError
from reba.readers.mcap.channels import DecodableChannel, batch_of, segments_of
from reba.readers.mcap.container import ChunkRef, Store
from reba.readers.mcap.decode import NO_STAMP, Decoder, Piece, load_json
from reba.readers.mcap.layout import Undecodable
from reba.readers.mcap.merge import MOST_SIGNALS, Clock, Merger
from reba.readers.recording.stream import Block, Kind, ReadLog, Stream

if TYPE_CHECKING:
    import pandas as pd

HEADER_MESSAGES: Final = 1000
"""Messages of each channel that are looked at on opening."""
_HEADER_SEGMENTS: Final = 16
_HEADER_BYTES: Final = 1 << 24
"""So much is looked through on opening; a recording that is being written may stand in many small segments."""
_JUMP_BACK: Final = 500_000_000
"""Stamps that run back by more than this [ns] are not used as time; less is jitter between publishers."""


@dataclass(frozen=True)
class StreamHeader:
    """What the first messages of the channels of a stream tell."""

    names: tuple[str, ...]
    parents: tuple[str, ...]
    clock: Clock


def first_header(parts: Sequence[DecodableChannel], kind: Kind, log: ReadLog) -> StreamHeader | None:
    """Peek into the first file that holds usable messages; None if there is none.

    Raises:
        ReadError: a chunk is damaged and no other file is there.
    """
    containers = list(dict.fromkeys(part.container for part in parts))
    for container in containers:
        try:
            found = read_header([part for part in parts if part.container is container], kind, log)
        except ReadError:
            if container is containers[-1]:
                raise
            continue
        if found is not None:
            return found
    return None


def read_header(parts: Sequence[DecodableChannel], kind: Kind, log: ReadLog) -> StreamHeader | None:
    """Look at the first messages of each channel; None if none of them is of use, the log then says why.

    Raises:
        ReadError: a chunk is damaged.
    """
    moving: list[Piece] = []
    static: list[Piece] = []
    for part in parts:
        (static if part.static else moving).extend(_first_pieces(part, part.make(None), log))
    if not any(len(piece.log) for piece in moving):
        return None
    parents = {
        name: piece.parents[at] if piece.parents else ""
        for piece in reversed(moving + static)
        for at, name in enumerate(piece.names)
    }
    names = tuple(dict.fromkeys(name for piece in moving + static for name in piece.names))[:MOST_SIGNALS]
    clock = _clock(moving, "time" if kind == "angles" else "header.stamp")
    return StreamHeader(names, tuple(parents[name] for name in names) if kind == "frames" else (), clock)


def _first_pieces(part: DecodableChannel, decoder: Decoder, log: ReadLog) -> list[Piece]:
    pieces, seen = [], 0
    looked = 0
    for number, segment in enumerate(segments_of(part.container, part.channel), 1):
        batch = batch_of(part.container, segment, part.channel)
        pieces.extend(decoder.decode(batch, log))
        seen += len(batch.starts)
        looked += segment.chunk.size if segment.chunk else segment.size
        if seen >= HEADER_MESSAGES or (number >= _HEADER_SEGMENTS and looked >= _HEADER_BYTES):
            break
    return pieces


def _clock(pieces: Sequence[Piece], stamped: str) -> Clock:
    """Choose the time: the stamps in the messages if all are there and do not run back, else the log time."""
    log = np.concatenate([piece.log for piece in pieces])
    stamps = np.concatenate([piece.stamp for piece in pieces])
    stamps = stamps[np.argsort(log, kind="stable")]
    back = -np.diff(stamps.astype(np.float64), prepend=float(stamps[0])).min()
    moves = len(stamps) == 1 or stamps[-1] > stamps[0]
    if (stamps == NO_STAMP).any() or not moves or back > _JUMP_BACK:
        return Clock("log_time", int(log.min()), int(log.min()))
    first = int(stamps.min())
    if stamped == "time":
        # Rows of a posture table keep the time they were written with; the log says when that was.
        return Clock(stamped, 0, int(log.min()) - first)
    return Clock(stamped, first, first)


class McapBlockDecoder:
    """Turns segments of the channels of one stream into blocks, one segment after the other.

    Args:
        parts: channels.
        kind: as in `Stream`.
        first: what peeking found.
        log: where notes go.
        wanted: names to keep, None for all.
    """

    def __init__(
        self,
        parts: Sequence[DecodableChannel],
        kind: Kind,
        first: StreamHeader,
        log: ReadLog,
        wanted: frozenset[str] | None,
    ) -> None:
        kept = [at for at, name in enumerate(first.names) if wanted is None or name in wanted]
        self._parts = parts
        self._log = log
        self._clock = Clock(first.clock.source, first.clock.zero, first.clock.epoch)
        self._merger = Merger(
            [first.names[at] for at in kept],
            [first.parents[at] for at in kept] if first.parents else [],
            self._clock,
            log,
            frames=kind == "frames",
        )
        self._decoders = {id(part): part.make(wanted) for part in parts}
        for part in parts:
            if part.static:
                for piece in _first_pieces(part, self._decoders[id(part)], ReadLog()):
                    self._merger.add(piece, static=True)

    def take(self, container: Store, segment: ChunkRef) -> None:
        """Take up the messages of a segment.

        Raises:
            ReadError: it is damaged.
        """
        for part in self._parts:
            if part.container is container:
                batch = batch_of(container, segment, part.channel)
                self._log.messages += len(batch.starts)
                for piece in self._decoders[id(part)].decode(batch, self._log):
                    self._merger.add(piece, static=part.static)

    @property
    def full(self) -> bool:
        """Whether enough is gathered for a block."""
        return self._merger.full

    def flush(self, *, last: bool = False) -> Block | None:
        """Return what is gathered as a block, but for the newest row unless this is the `last`, see `Merger`."""
        return self._merger.flush(last=last)

    def flush_whole(self) -> Block | None:
        """Return what is gathered; the newest row only if it has every signal, so that no more of it can come."""
        return self._merger.flush(last=self._merger.newest_whole())

    def rows(self, container: Store, segment: ChunkRef) -> list[dict[str, Any]]:
        """Return the rows of posture tables in a segment, text columns included.

        Raises:
            ReadError: it is damaged.
        """
        rows = []
        for part in self._parts:
            if part.container is container:
                batch = batch_of(container, segment, part.channel)
                for index, time in enumerate(batch.times.tolist()):
                    try:
                        row = load_json(batch.payload(index))
                    except Undecodable:
                        continue
                    if isinstance(row, dict):
                        if self._clock.source == "log_time":
                            row["time"] = (time - self._clock.zero) / 1e9
                        rows.append(row)
        return rows


class StreamReader:
    """Reads the channels of one stream.

    Args:
        parts: channels, of one or more files, by start time.
        kind: as in `Stream`.
        first: what peeking found.
        opened: what was noted on opening the recording.
        strict: whether a damaged file of several is an error.
    """

    def __init__(
        self, parts: Sequence[DecodableChannel], kind: Kind, first: StreamHeader, opened: ReadLog, *, strict: bool
    ) -> None:
        self._parts = parts
        self._kind = kind
        self._first = first
        self._opened = opened
        self._strict = strict

    def stream(self, name: str) -> Stream:
        """Return the stream under a name."""
        counts = [part.container.counts[part.channel] for part in self._parts if not part.static]
        formats = dict.fromkeys(part.format for part in self._parts if not part.static)
        clock = self._first.clock
        return Stream(
            name,
            self._kind,
            ", ".join(formats),
            self._first.names,
            self.read,
            unit="rad" if self._kind == "joints" else "",
            parents=self._first.parents,
            epoch=clock.epoch / 1e9,
            count=sum(counts) if self._kind != "frames" and len(counts) == 1 else None,
            table=self.table if self._kind == "angles" else None,
            follow=self.follow,
        )

    def read(self, log: ReadLog, names: Sequence[str] | None) -> Iterator[Block]:
        """Iterate over the blocks, holding one chunk and one block in memory."""
        decoder = self.follow(log, names)
        for container, segment in self._segments(log):
            decoder.take(container, segment)
            if decoder.full and (block := decoder.flush()) is not None:
                yield block
        if (block := decoder.flush(last=True)) is not None:
            yield block

    def follow(self, log: ReadLog, names: Sequence[str] | None) -> McapBlockDecoder:
        """Return what turns segments into blocks, for whoever hands it one segment after the other."""
        self._begin(log)
        return McapBlockDecoder(self._parts, self._kind, self._first, log, None if names is None else frozenset(names))

    def table(self) -> pd.DataFrame:
        """Return all rows of posture tables, text columns included; `time` in seconds since the epoch."""
        import pandas as pd

        decoder = self.follow(ReadLog(), None)
        return pd.DataFrame(
            [row for container, segment in self._segments(ReadLog()) for row in decoder.rows(container, segment)]
        )

    def _begin(self, log: ReadLog) -> None:
        log.time_source = self._first.clock.source
        log.ended_abnormally = log.ended_abnormally or self._opened.ended_abnormally
        for warning in self._opened.warnings:
            log.warn(warning)

    def _segments(self, log: ReadLog) -> Iterator[tuple[Store, ChunkRef]]:
        """Yield the segments of all files; a file of several that is damaged on the way is left there."""
        containers = list(dict.fromkeys(part.container for part in self._parts))
        for container in containers:
            for segment in container.segments:
                try:
                    container.load(segment)
                except ReadError as error:
                    if self._strict or len(containers) == 1:
                        raise
                    log.warn(f"{error}; the rest of this file is left out")
                    break
                yield container, segment
            container.release()
