"""Streams of a recording: the channels of one topic joined; names and clock by the first messages; read by segments."""

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
"""Messages of each channel that are decoded on opening."""
_HEADER_SEGMENTS: Final = 16
_HEADER_BYTES: Final = 1 << 24
"""[bytes] Read at least on opening: a recording that is being written may have many small segments."""
_JUMP_BACK: Final = 500_000_000
"""[ns] Stamps that run back by more are not used as time; less is jitter between publishers."""


@dataclass(frozen=True)
class StreamHeader:
    """Names, parents and clock of a stream by the first messages of its channels."""

    names: tuple[str, ...]
    parents: tuple[str, ...]
    clock: Clock


def first_header(parts: Sequence[DecodableChannel], kind: Kind, log: ReadLog) -> StreamHeader | None:
    """Return the header of the first file with usable messages, None without any.

    Raises:
        ReadError: a chunk is damaged and no file follows.
    """
    containers = list(dict.fromkeys(part.container for part in parts))
    for container in containers:
        try:
            header = read_header([part for part in parts if part.container is container], kind, log)
        except ReadError:
            if container is containers[-1]:
                raise
            continue
        if header is not None:
            return header
    return None


def read_header(parts: Sequence[DecodableChannel], kind: Kind, log: ReadLog) -> StreamHeader | None:
    """Return the header by the first messages of each channel, None if none is usable; the log then has the reason."""
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
    pieces, messages, size = [], 0, 0
    for number, segment in enumerate(segments_of(part.container, part.channel), 1):
        batch = batch_of(part.container, segment, part.channel)
        pieces.extend(decoder.decode(batch, log))
        messages += len(batch.starts)
        size += segment.chunk.size if segment.chunk else segment.size
        if messages >= HEADER_MESSAGES or (number >= _HEADER_SEGMENTS and size >= _HEADER_BYTES):
            break
    return pieces


def _clock(pieces: Sequence[Piece], stamped: str) -> Clock:
    """Return the clock: the stamps in the messages if all have one and they increase, else the log time."""
    log = np.concatenate([piece.log for piece in pieces])
    stamps = np.concatenate([piece.stamp for piece in pieces])
    stamps = stamps[np.argsort(log, kind="stable")]
    back = -np.diff(stamps.astype(np.float64), prepend=float(stamps[0])).min()
    moves = len(stamps) == 1 or stamps[-1] > stamps[0]
    if (stamps == NO_STAMP).any() or not moves or back > _JUMP_BACK:
        return Clock("log_time", int(log.min()), int(log.min()))
    first = int(stamps.min())
    if stamped == "time":
        # Rows of a posture table keep their time; the log time gives the epoch.
        return Clock(stamped, 0, int(log.min()) - first)
    return Clock(stamped, first, first)


class McapBlockDecoder:
    """Decodes the `wanted` names (None: all) of the channels of one stream to blocks, segment by segment."""

    def __init__(
        self,
        parts: Sequence[DecodableChannel],
        kind: Kind,
        header: StreamHeader,
        log: ReadLog,
        wanted: frozenset[str] | None,
    ) -> None:
        chosen = [at for at, name in enumerate(header.names) if wanted is None or name in wanted]
        self._parts = parts
        self._log = log
        self._clock = Clock(header.clock.source, header.clock.zero, header.clock.epoch)
        self._merger = Merger(
            [header.names[at] for at in chosen],
            [header.parents[at] for at in chosen] if header.parents else [],
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
        """Decode the messages of a segment."""
        for part in self._parts:
            if part.container is container:
                batch = batch_of(container, segment, part.channel)
                self._log.messages += len(batch.starts)
                for piece in self._decoders[id(part)].decode(batch, self._log):
                    self._merger.add(piece, static=part.static)

    @property
    def full(self) -> bool:
        """Whether enough messages are decoded for a block."""
        return self._merger.full

    def flush(self, *, last: bool = False) -> Block | None:
        """Return the decoded messages as a block, without the newest row unless this is the `last`, see `Merger`."""
        return self._merger.flush(last=last)

    def flush_whole(self) -> Block | None:
        """Return the decoded messages as a block, with the newest row only if it has every signal."""
        return self._merger.flush(last=self._merger.newest_whole())

    def rows(self, container: Store, segment: ChunkRef) -> list[dict[str, Any]]:
        """Return the rows of posture tables in a segment, text columns included."""
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
        opened: notes made on opening the recording.
        strict: whether a damaged file of several is an error.
    """

    def __init__(
        self, parts: Sequence[DecodableChannel], kind: Kind, header: StreamHeader, opened: ReadLog, *, strict: bool
    ) -> None:
        self._parts = parts
        self._kind = kind
        self._header = header
        self._opened = opened
        self._strict = strict

    def stream(self, name: str) -> Stream:
        """Return the stream with its name."""
        counts = [part.container.counts[part.channel] for part in self._parts if not part.static]
        formats = dict.fromkeys(part.format for part in self._parts if not part.static)
        clock = self._header.clock
        return Stream(
            name,
            self._kind,
            ", ".join(formats),
            self._header.names,
            self.read,
            unit="rad" if self._kind == "joints" else "",
            parents=self._header.parents,
            epoch=clock.epoch / 1e9,
            count=sum(counts) if self._kind != "frames" and len(counts) == 1 else None,
            table=self.table if self._kind == "angles" else None,
            follow=self.follow,
        )

    def read(self, log: ReadLog, names: Sequence[str] | None) -> Iterator[Block]:
        """Iterate over the blocks; one chunk and one block are in memory."""
        decoder = self.follow(log, names)
        for container, segment in self._segments(log):
            decoder.take(container, segment)
            if decoder.full and (block := decoder.flush()) is not None:
                yield block
        if (block := decoder.flush(last=True)) is not None:
            yield block

    def follow(self, log: ReadLog, names: Sequence[str] | None) -> McapBlockDecoder:
        """Return the decoder of a recording that is still being written."""
        self._begin(log)
        return McapBlockDecoder(self._parts, self._kind, self._header, log, None if names is None else frozenset(names))

    def table(self) -> pd.DataFrame:
        """Return all rows of posture tables, text columns included; `time` in seconds since the epoch."""
        import pandas as pd

        decoder = self.follow(ReadLog(), None)
        return pd.DataFrame(
            [row for container, segment in self._segments(ReadLog()) for row in decoder.rows(container, segment)]
        )

    def _begin(self, log: ReadLog) -> None:
        log.time_source = self._header.clock.source
        log.ended_abnormally = log.ended_abnormally or self._opened.ended_abnormally
        for warning in self._opened.warnings:
            log.warn(warning)

    def _segments(self, log: ReadLog) -> Iterator[tuple[Store, ChunkRef]]:
        """Yield the segments of all files; of several files a damaged one is read up to its damage."""
        containers = list(dict.fromkeys(part.container for part in self._parts))
        for container in containers:
            mine = [part for part in self._parts if part.container is container]
            read = dict.fromkeys((part.channel for part in mine), 0)
            for segment in container.segments:
                try:
                    channels = container.load(segment).scan.channels
                    for number in read:
                        read[number] += int(np.count_nonzero(channels == number))
                except ReadError as error:
                    if self._strict or len(containers) == 1:
                        raise
                    log.warn(f"{error}; the rest of this file is left out")
                    break
                yield container, segment
            else:
                for part in mine:
                    count = container.counts[part.channel]
                    if read[part.channel] < count:
                        missing = f"{count - read[part.channel]} of the {count} messages of {part.topic}"
                        self._opened.lose(f"{missing} that {container.path.name} states are missing")
            container.release()
