"""Streams of a recording: the channels of one topic joined, with names and clock by all of its messages.

Contents -> names, parents and zero of each stream -> blocks, decoded again where the values were not kept
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from reba.arrays import Array
from reba.posture.columns import on_both_sides
from reba.readers.mcap.channels import DecodableChannel, batch_of
from reba.readers.mcap.contents import (
    Contents,
    Track,
    clock_name,
)
from reba.readers.mcap.decode import Batch, Piece
from reba.readers.mcap.extract import row_stamp
from reba.readers.mcap.log_times import log_times
from reba.readers.mcap.merge import Merger
from reba.readers.mcap.records import LATEST
from reba.readers.mcap.store import ChunkRef, Store
from reba.readers.mcap.stream_header import StreamHeader, stream_header
from reba.readers.mcap.trace import NO_STAMP
from reba.readers.recording.stream import JOINED, Block, Kind, ReadLog, Stream

if TYPE_CHECKING:
    import pandas as pd


class McapBlockDecoder:
    """Decodes the `wanted` names (None: all) of the channels of one stream to blocks, segment by segment."""

    def __init__(
        self,
        parts: Sequence[DecodableChannel],
        kind: Kind,
        header: StreamHeader,
        contents: Contents,
        log: ReadLog,
        wanted: frozenset[str] | None,
        renamed: Mapping[str, str],
    ) -> None:
        self._parts = [part for part in parts if not part.static]
        self._clock = clock_name(kind, parts[0].group)
        self._renamed = renamed
        self.used = 0
        """Messages with a wanted signal."""
        self.newest_log = -LATEST
        """Log time [ns] of the newest message with a wanted signal."""
        self.origins: list[tuple[float, str]] | None = None
        """Time [s] and first wanted signal, by its name in the file, of each piece; None: not noted."""
        self._header = header
        self._contents = contents
        self._log = log
        if wanted is not None:
            wanted = frozenset(name for name, _ in header.signals if renamed.get(name, name) in wanted)
        self._wanted = wanted
        signals = dict.fromkeys(
            (renamed.get(name, name), renamed.get(parent, parent))
            for name, parent in header.signals
            if wanted is None or name in wanted
        )
        self._rows = kind == "angles"
        self._merger = Merger(list(signals), log, kind)
        self._decoders = {id(part): part.make(wanted) for part in self._parts}
        self._tracks = {id(part): contents.tracks[id(part)] for part in self._parts}
        self._read = dict.fromkeys(map(id, self._tracks.values()), 0)
        self._signals = tuple(signals)
        self._newest = {id(track): track.clock.first for track in self._tracks.values() if track.clock}
        static = [selected(piece, wanted) for piece in contents.static.get((kind, parts[0].group), [])]
        self._merger.add_static([((header.clock.at(piece.log) - header.zero) / 1e9, piece) for piece in static])

    def go_on(self, before: McapBlockDecoder) -> None:
        """Go on where the decoder `before` is: with its time 0, its columns, and what it has not yet returned."""
        later = (self._header.zero - before._header.zero) / 1e9
        self._header = replace(self._header, zero=before._header.zero)
        static, self._merger = self._merger, before._merger
        self._merger.include(self._signals, static, later)
        self.used, self.newest_log = before.used, before.newest_log

    @property
    def seams(self) -> list[float]:
        """Times [s] of the first message after each restart of the clock so far."""
        return [(seam - self._header.zero) / 1e9 for seam in self._contents.clocks[self._clock].seams]

    def take(self, container: Store, segment: ChunkRef) -> None:
        """Decode the messages of a segment."""
        for part in self._parts:
            if part.container is container:
                pieces = self._pieces(part, segment)
                times = [self._add(self._tracks[id(part)], piece) for piece in pieces]
                pairs = zip(pieces, times, strict=True)
                used = [(piece.number, time) for piece, time in pairs if piece.names or self._rows]
                if len(used) == 1:
                    self._use(used[0][1])
                elif used:
                    _, first = np.unique(np.concatenate([number for number, _ in used]), return_index=True)
                    self._use(np.concatenate([time for _, time in used])[first])

    def _use(self, times: Array) -> None:
        """Count messages with a wanted signal, by their (n,) times [s]."""
        self.used += len(times)
        if self._log.times is not None:
            self._log.times.append(times)

    def _pieces(self, part: DecodableChannel, segment: ChunkRef) -> list[Piece]:
        """Return the messages of a channel in a segment, kept ones or decoded again."""
        track, place = self._tracks[id(part)], self._contents.place(part, segment)
        if place is None or not place.count:
            return []
        self._read[id(track)] += place.count
        if place.pieces is not None:
            return [selected(piece, self._wanted) for piece in place.pieces]
        batch = batch_of(part.container, segment, part.channel, place.first)
        return self._decoders[id(part)].decode(batch, ReadLog())

    def _add(self, track: Track, piece: Piece) -> Array:
        """Add the samples of a piece, and return their (n,) times [s]."""
        if track.clock is None or not len(piece.log):
            return np.zeros(len(piece.log))
        time, unstamped = track.clock.times(piece.number, piece.log, piece.stamp)
        if unstamped:
            self._log.warn("some messages have no usable time stamp; theirs follows from the log time")
        self._newest[id(track)] = max(self._newest[id(track)], int(time.max()))
        if piece.names:
            self.newest_log = max(self.newest_log, int(piece.log.max()))
            if self.origins is not None:
                self.origins.append(((int(time.min()) - self._header.zero) / 1e9, piece.names[0]))
        if self._renamed:
            names, parents = (
                tuple(self._renamed.get(name, name) for name in texts) for texts in (piece.names, piece.parents)
            )
            piece = replace(piece, names=names, parents=parents)
        seconds = np.asarray((time - self._header.zero) / 1e9)
        if piece.names:
            self._merger.add(seconds, piece)
        return seconds

    @property
    def full(self) -> bool:
        """Whether enough messages are decoded for a block."""
        return self._merger.full

    def flush_read(self) -> Block | None:
        """Return the rows that no message of a complete recording can add to: all channels were read beyond them."""
        open_tracks = {id(track) for track in self._tracks.values() if self._read[id(track)] < track.trace.count}
        newest = min((self._newest[track] for track in open_tracks), default=None)
        return self._merger.flush(until=None if newest is None else (newest - self._header.zero) / 1e9)

    def flush(self, *, last: bool = False) -> Block | None:
        """Return the decoded messages as a block, without the newest row unless this is the `last`, see `Merger`."""
        return self._merger.flush(last=last)

    def note(self, log: ReadLog) -> None:
        """Count the messages so far in the log of a recording that is being written."""
        tracks = list({id(track): track.log for track in self._tracks.values()}.values())
        log.messages = sum(track.messages for track in tracks)
        log.skipped = sum(track.skipped for track in tracks)
        log.first_skipped = next((track.first_skipped for track in tracks if track.first_skipped), None)

    def flush_whole(self) -> Block | None:
        """Return the decoded messages as a block, with the newest row only if it has every signal."""
        return self._merger.flush(last=self._merger.newest_whole())

    def rows(self, container: Store, segment: ChunkRef) -> list[dict[str, Any]]:
        """Return the rows of posture tables in a segment, text columns included."""
        rows = []
        for part in self._parts:
            place = self._contents.place(part, segment) if part.container is container else None
            if place is not None:
                batch = batch_of(container, segment, part.channel, place.first)
                trees = self._decoders[id(part)].rows(batch)
                there = np.array([row is not None for row in trees], bool)
                mine = [dict(on_both_sides(row)) for row in trees if row is not None]
                self._set_times(self._tracks[id(part)], batch[there], mine)
                rows += mine
                if mine:
                    self.newest_log = max(self.newest_log, int(batch.times.max()))
        return rows

    def _set_times(self, track: Track, batch: Batch, rows: list[dict[str, Any]]) -> None:
        """Set the times [s] of rows: their own as they are written, unless the clock restarts or one is damaged."""
        if self._header.source != "time":
            for row, log in zip(rows, batch.times.tolist(), strict=True):
                row["time"] = (log - self._header.zero) / 1e9
        elif track.clock is not None and (track.clock.restarts or len(track.clock.damaged)):
            stamps = np.array([row_stamp(row) for row in rows], np.int64)
            times, _ = track.clock.times(batch.numbers, batch.times, stamps)
            for row, stamp, time in zip(rows, stamps.tolist(), times.tolist(), strict=True):
                if stamp not in (NO_STAMP, time):
                    row["time"] = (time - self._header.zero) / 1e9


class StreamReader:
    """Reads the channels of one stream.

    Args:
        parts: channels, of one or more files, by start time.
        opened: notes made on opening the recording.
        renamed: names of signals -> those that they have in the stream.
    """

    def __init__(
        self,
        parts: Sequence[DecodableChannel],
        kind: Kind,
        header: StreamHeader,
        contents: Contents,
        opened: ReadLog,
        renamed: Mapping[str, str] | None = None,
    ) -> None:
        self._parts = parts
        self._kind = kind
        self._header = header
        self._contents = contents
        self._opened = opened
        self._renamed = renamed or {}

    def stream(self, name: str) -> Stream:
        """Return the stream with its name."""
        counts = [part.container.counts[part.channel] for part in self._parts if not part.static]
        formats = dict.fromkeys(part.format for part in self._parts if not part.static)
        header, start = self._header, self._contents.start
        renamed = self._renamed
        signals = dict.fromkeys(
            (renamed.get(signal, signal), renamed.get(parent, parent)) for signal, parent in header.signals
        )
        return Stream(
            name,
            self._kind,
            ", ".join(formats),
            tuple(signal for signal, _ in signals),
            self.read,
            unit="rad" if self._kind == "joints" else "",
            parents=tuple(parent for _, parent in signals) if self._kind == "frames" else (),
            epoch=header.epoch / 1e9,
            count=sum(counts) if self._kind != "frames" and len(counts) == 1 else None,
            total=sum(track.log.messages for track in self._tracks()),
            table=self.table if self._kind == "angles" else None,
            follow=self.follow,
            logged=partial(log_times, self._parts, self._contents, header.zero),
            seams=tuple((seam - header.zero) / 1e9 for seam in header.clock.seams),
            present={
                signal: [((first - start) / 1e9, (last - start) / 1e9) for first, last in intervals]
                for signal, intervals in header.intervals.items()
            },
            messages=header.messages,
            join=partial(self._joined, name),
            reader=self,
            static=self._static(),
        )

    def _joined(self, name: str, renamed: Mapping[str, str], streams: Sequence[Stream]) -> Stream:
        """Return the stream of this one, of its name, and others, in which signals have other names."""
        several = [part for stream in streams for part in stream.reader._parts]
        parts = list({id(part): part for part in (*self._parts, *several)}.values())
        topics = dict.fromkeys([*name.split(JOINED), *(topic for stream in streams for topic in stream.topics)])
        header = self._header if len(parts) == len(self._parts) else stream_header(parts, self._kind, self._contents)
        reader = StreamReader(parts, self._kind, header or self._header, self._contents, self._opened, renamed)
        return reader.stream(JOINED.join(topics))

    def read(self, log: ReadLog, names: Sequence[str] | None) -> Iterator[Block]:
        """Iterate over the blocks; one chunk and one block are in memory, and values that were kept."""
        decoder = self.follow(log, names)
        for container, segment in self._segments():
            decoder.take(container, segment)
            self._contents.let_go([part for part in self._parts if part.container is container], segment)
            if decoder.full and (block := decoder.flush_read()) is not None:
                yield block
        if (block := decoder.flush(last=True)) is not None:
            yield block
        log.unused["other_signals"] += log.messages - log.skipped - decoder.used

    def follow(self, log: ReadLog, names: Sequence[str] | None) -> McapBlockDecoder:
        """Return the decoder of a recording that is still being written."""
        self._begin(log)
        wanted = None if names is None else frozenset(names)
        return McapBlockDecoder(self._parts, self._kind, self._header, self._contents, log, wanted, self._renamed)

    def table(self) -> pd.DataFrame:
        """Return all rows of posture tables, text columns included; `time` in seconds since the epoch."""
        import pandas as pd

        decoder = self.follow(ReadLog(), None)
        return pd.DataFrame(
            [row for container, segment in self._segments() for row in decoder.rows(container, segment)]
        )

    def _begin(self, log: ReadLog) -> None:
        log.time_source = self._header.source
        log.ended_abnormally = log.ended_abnormally or self._opened.ended_abnormally
        for track in self._tracks():
            log.messages += track.log.messages
            log.skip(track.log.skipped, track.log.first_skipped or "")
            for warning in track.log.warnings:
                log.warn(warning)
        for topic, static in self._static().items():
            if static.skipped:
                what = f"{static.skipped} of {static.messages} messages of {topic} cannot be decoded"
                log.warn(f"{what}, the first: {static.first_skipped}")
        log.time_why = self._header.clock.why
        for warning in (*self._opened.warnings, *self._contents.warnings, *self._header.warnings):
            log.warn(warning)

    def _static(self) -> dict[str, ReadLog]:
        """Return the reading of each topic of static transforms."""
        topics = dict.fromkeys(part.topic for part in self._parts if part.static)
        return {topic: log for topic in topics if (log := self._contents.static_logs.get(topic)) is not None}

    def _tracks(self) -> list[Track]:
        """Return the tracks of the channels, each once."""
        tracks = [self._contents.tracks[id(part)] for part in self._parts if id(part) in self._contents.tracks]
        return list({id(track): track for track in tracks}.values())

    def _segments(self) -> Iterator[tuple[Store, ChunkRef]]:
        """Yield the segments of all files that have messages of the stream."""
        for container in self._contents.containers:
            mine = [part for part in self._parts if part.container is container and not part.static]
            for segment in self._contents.segments(container, mine):
                yield container, segment
            container.release()


def selected(piece: Piece, wanted: frozenset[str] | None) -> Piece:
    """Return a piece with the wanted names only (None: all)."""
    if wanted is None or wanted.issuperset(piece.names):
        return piece
    at = [index for index, name in enumerate(piece.names) if name in wanted]
    width = piece.values.shape[1] // len(piece.names)
    columns = (np.array(at, np.intp)[:, None] * width + np.arange(width)).ravel()
    names, parents = (tuple(texts[index] for index in at) if texts else () for texts in (piece.names, piece.parents))
    return Piece(piece.number, piece.stamp, piece.log, names, parents, piece.values.take(columns, axis=1))
