"""Streams of a recording: the channels of one topic joined, with names and clock by all of its messages.

Contents -> names, parents and zero of each stream -> blocks, decoded again where the values were not kept
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from reba.arrays import Array
from reba.readers.mcap.channels import DecodableChannel, batch_of
from reba.readers.mcap.clock import RecordingClock
from reba.readers.mcap.container import ChunkRef, Store
from reba.readers.mcap.contents import (
    TOGETHER,
    Contents,
    Interval,
    Presence,
    Signal,
    Track,
    at_once,
    clock_name,
    united,
)
from reba.readers.mcap.decode import Piece, load_json
from reba.readers.mcap.layout import Undecodable
from reba.readers.mcap.merge import MOST_SIGNALS, Merger
from reba.readers.recording.stream import Block, Kind, ReadLog, Stream

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class StreamHeader:
    """What all messages of a stream name, and when.

    Attributes:
        signals: names and parents that are read.
        clock: of the stream.
        source: where its times come from.
        zero: time of the recording [ns] at time 0 of the stream; `epoch`: its Unix time [ns].
        intervals: name -> log times [ns] between which it is there.
        messages: name -> messages that have it.
        warnings: for the user.
    """

    signals: tuple[Signal, ...]
    clock: RecordingClock
    source: str
    zero: int
    epoch: int
    intervals: Mapping[str, list[Interval]]
    messages: Mapping[str, int]
    warnings: tuple[str, ...]


def stream_header(parts: Sequence[DecodableChannel], kind: Kind, contents: Contents) -> StreamHeader | None:
    """Return the header of the stream of some channels, None if none of its messages is usable."""
    of = (kind, parts[0].group)
    present: dict[Signal, Presence] = {}
    for signals, one in contents.presence.get(of, {}).items():
        for signal in signals:
            total = present.setdefault(signal, Presence())
            total.messages += one.messages
            total.intervals += one.intervals
    clocks = [track.clock for part in parts if (track := contents.tracks.get(id(part))) and track.clock]
    if not present or not clocks:
        return None
    for piece in contents.static.get(of, []):
        for signal in zip(piece.names, piece.parents, strict=True):
            present.setdefault(signal, Presence())
    spans = {signal: united(one.intervals) for signal, one in present.items()}
    signals, warnings = _chosen(spans, present)
    intervals: dict[str, list[Interval]] = {}
    for name, parent in signals:
        intervals[name] = united([*intervals.get(name, []), *spans[name, parent]])
    messages: Counter[str] = Counter()
    for name, parent in signals:
        messages[name] += present[name, parent].messages
    clock = contents.clocks[clock_name(kind, of[1])]
    first, logged = min(clock_.first for clock_ in clocks), min(clock_.first_log for clock_ in clocks)
    if kind == "angles" and clock.source == "header.stamp":
        # Rows of a posture table keep their time; the log time gives the epoch.
        return StreamHeader(signals, clock, "time", 0, logged - first, intervals, messages, warnings)
    return StreamHeader(signals, clock, clock.source, first, first, intervals, messages, warnings)


def _chosen(
    spans: Mapping[Signal, list[Interval]], present: Mapping[Signal, Presence]
) -> tuple[tuple[Signal, ...], tuple[str, ...]]:
    """Return the signals that are read, and warnings: at most `MOST_SIGNALS`, and one parent of a frame at a time."""
    chosen: dict[str, list[str]] = {}
    warnings = []
    for name, parent in spans:
        others = chosen.setdefault(name, [])
        rival = next((other for other in others if at_once(spans[name, parent], spans[name, other]) > TOGETHER), None)
        if rival is None and not (others and not spans[name, parent]):
            others.append(parent)
        else:
            first = others[0] if rival is None else rival
            warnings.append(f"frame {name!r} has the parents {first!r} and {parent!r} at once; the first is used")
    signals = [(name, parent) for name, parents in chosen.items() for parent in parents]
    if len(signals) > MOST_SIGNALS:
        frequent = sorted(signals, key=lambda signal: -present[signal].messages)[:MOST_SIGNALS]
        signals = [signal for signal in signals if signal in set(frequent)]
        warnings.append(f"more than {MOST_SIGNALS} signals; the others are left out")
    return tuple(signals), tuple(warnings)


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
        self._renamed = renamed
        self.used = 0
        """Messages with a wanted signal."""
        self._header = header
        self._contents = contents
        self._log = log
        self._wanted = None
        if wanted is not None:
            self._wanted = wanted = wanted | {other for other, name in renamed.items() if name in wanted}
        signals = dict.fromkeys(
            (renamed.get(name, name), parent) for name, parent in header.signals if wanted is None or name in wanted
        )
        self._merger = Merger(list(signals), log, frames=kind == "frames")
        self._decoders = {id(part): part.make(wanted) for part in self._parts}
        self._tracks = {id(part): contents.tracks[id(part)] for part in self._parts}
        self._read = dict.fromkeys(map(id, self._tracks.values()), 0)
        self._newest = {id(track): track.clock.first for track in self._tracks.values() if track.clock}
        for piece in contents.static.get((kind, parts[0].group), []):
            self._merger.add_static(selected(piece, wanted))

    def take(self, container: Store, segment: ChunkRef) -> None:
        """Decode the messages of a segment."""
        for part in self._parts:
            if part.container is container:
                pieces = self._pieces(part, segment)
                times = [self._add(self._tracks[id(part)], piece) for piece in pieces]
                used = [(piece.number, time) for piece, time in zip(pieces, times, strict=True) if piece.names]
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
        """Return the messages of a channel in a segment, kept ones or decoded again; or new ones of a live source."""
        track, place = self._tracks[id(part)], self._contents.place(part, segment)
        if place is None:
            first = self._read[id(track)] = max(self._read[id(track)], track.trace.count)
            batch = batch_of(part.container, segment, part.channel, first)
            self._read[id(track)] += len(batch.starts)
            self._log.messages += len(batch.starts)
            return self._decoders[id(part)].decode(batch, self._log)
        self._read[id(track)] += place.count
        if not place.count:
            return []
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
        if self._renamed:
            piece = replace(piece, names=tuple(self._renamed.get(name, name) for name in piece.names))
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
                        if self._header.source != "time":
                            row["time"] = (time - self._header.zero) / 1e9
                        rows.append(row)
        return rows


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
        signals = dict.fromkeys((self._renamed.get(signal, signal), parent) for signal, parent in header.signals)
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
            table=self.table if self._kind == "angles" else None,
            follow=self.follow,
            seams=tuple((seam - header.zero) / 1e9 for seam in header.clock.seams),
            present={
                signal: [((first - start) / 1e9, (last - start) / 1e9) for first, last in intervals]
                for signal, intervals in header.intervals.items()
            },
            messages=header.messages,
            join=lambda renamed: StreamReader(
                self._parts, self._kind, header, self._contents, self._opened, renamed
            ).stream(name),
        )

    def read(self, log: ReadLog, names: Sequence[str] | None) -> Iterator[Block]:
        """Iterate over the blocks; one chunk and one block are in memory, and values that were kept."""
        decoder = self.follow(log, names)
        for container, segment in self._segments():
            decoder.take(container, segment)
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
        tracks = [track for part in self._parts if (track := self._contents.tracks.get(id(part))) is not None]
        for track in {id(track): track for track in tracks}.values():
            log.messages += track.log.messages
            log.skip(track.log.skipped, track.log.first_skipped or "")
            for warning in track.log.warnings:
                log.warn(warning)
        log.time_why = self._header.clock.why
        for warning in (*self._opened.warnings, *self._contents.warnings, *self._header.warnings):
            log.warn(warning)

    def _segments(self) -> Iterator[tuple[Store, ChunkRef]]:
        """Yield the segments of all files that have messages of the stream."""
        for container in self._contents.containers:
            mine = [part for part in self._parts if part.container is container and not part.static]
            for segment in self._contents.segments(container, mine):
                yield container, segment
            container.release()


def selected(piece: Piece, wanted: frozenset[str] | None) -> Piece:
    """Return a piece with the wanted names only (None: all)."""
    at = [index for index, name in enumerate(piece.names) if wanted is None or name in wanted]
    if len(at) == len(piece.names):
        return piece
    width = piece.values.shape[1] // len(piece.names)
    columns = (np.array(at, np.intp)[:, None] * width + np.arange(width)).ravel()
    names, parents = (tuple(texts[index] for index in at) if texts else () for texts in (piece.names, piece.parents))
    return Piece(piece.number, piece.stamp, piece.log, names, parents, piece.values[:, columns])
