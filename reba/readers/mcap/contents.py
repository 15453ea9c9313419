"""Contents of a recording: what all of its messages name and when, before anything is decided about them.

Every message with postures is decoded once, on opening. Names, parents and times are kept of all of them, and the first
`KEPT_BYTES` of decoded values until they are read: what is beyond that, or read again, is decoded again. A recording
that is being written is taken in segment by segment.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from reba.errors import ReadError
from reba.readers.mcap.channels import DecodableChannel, batch_of
from reba.readers.mcap.clock import ChannelClock, RecordingClock
from reba.readers.mcap.container import Container
from reba.readers.mcap.decode import Decoder, Piece
from reba.readers.mcap.presence import Presences
from reba.readers.mcap.store import ChunkRef, Store
from reba.readers.mcap.trace import NO_STAMP, Trace
from reba.readers.recording.stream import Kind, ReadLog

KEPT_BYTES: Final = 3 << 24
"""[bytes] Decoded values that are kept until they are read; all others are unpacked and decoded again."""


@dataclass
class Track:
    """The channels of one topic and publisher in all files of a recording, in the order of the files.

    Attributes:
        log: messages of the track, and those that could not be decoded.
        clock: its times; None without messages.
    """

    trace: Trace = field(default_factory=Trace)
    log: ReadLog = field(default_factory=ReadLog)
    clock: ChannelClock | None = None


def clock_name(kind: Kind, group: str) -> str:
    """Return the name of the clock of a stream: rows of a posture table have their own time, all else shares one."""
    return group if kind == "angles" else ""


@dataclass(frozen=True)
class Place:
    """Messages of a channel in a segment: number of the first, count, and what was decoded if it was kept."""

    first: int
    count: int
    pieces: list[Piece] | None


class Contents:
    """All messages of the channels of a recording.

    Attributes:
        containers: files in the order of time.
        tracks: `id` of a channel -> its track; channels of static transforms have none.
        presence: kind and group of channels -> when their names and parents are there.
        static: kind and group of channels -> pieces of static transforms.
        static_logs: topic of static transforms -> its reading.
        clocks: by `clock_name`; channels without messages have none.
        start: earliest log time [ns].
        warnings: for the user.
        lost: what files state to have and do not.

    Raises:
        ReadError: a chunk is damaged, and the recording is one file or `strict`.
    """

    def __init__(self, parts: Sequence[DecodableChannel], *, strict: bool) -> None:
        self.clocks: dict[str, RecordingClock] = {}
        self._read_all(parts, strict)
        if self._has_no_log_time():
            for container in self.containers:
                if isinstance(container, Container) and container.format == "mcap":
                    container.publish_time = True
            self._read_all(parts, strict)
        self.set_clocks()

    def set_clocks(self) -> None:
        """Set the clocks by all messages so far."""
        logs = [one.intervals[0][0] for group in self.presence.values() for one in group.sets.values() if one.intervals]
        self.start = min(logs, default=0)
        of_clock: dict[str, dict[int, Track]] = {}
        for part in self._parts:
            if (track := self.tracks.get(id(part))) is not None and track.trace.count:
                of_clock.setdefault(clock_name(part.kind, part.group), {})[id(track)] = track
        published = any(isinstance(store, Container) and store.publish_time for store in self.containers)
        for name, tracks in of_clock.items():
            self.clocks[name] = clock = RecordingClock([track.trace for track in tracks.values()], published=published)
            for track, one in zip(tracks.values(), clock.channels, strict=True):
                track.clock = one

    def _read_all(self, parts: Sequence[DecodableChannel], strict: bool) -> None:
        self.containers: list[Store] = []
        self._parts: list[DecodableChannel] = []
        self._by_key: dict[tuple[str, str, str, int], Track] = {}
        self.tracks: dict[int, Track] = {}
        self.presence: dict[tuple[str, str], Presences] = {}
        self.static: dict[tuple[str, str], list[Piece]] = {}
        self.static_logs: dict[str, ReadLog] = {}
        self.warnings: list[str] = []
        self.lost: list[str] = []
        self._places: dict[tuple[int, int], Place] = {}
        self._kept_bytes = 0
        for part in parts:
            self.include(part)
        for container in self.containers:
            self._read(container, [part for part in parts if part.container is container], strict)

    def include(self, part: DecodableChannel) -> None:
        """Add a channel; its track is that of the same topic, type and publisher (by order) in every file."""
        if part.container not in self.containers:
            self.containers.append(part.container)
        self._parts.append(part)
        if part.static:
            return
        key = (part.kind, part.topic, part.type)
        same = [other for other in self._parts if other.container is part.container and not other.static]
        place = sum((other.kind, other.topic, other.type) == key for other in same)
        self.tracks[id(part)] = self._by_key.setdefault((*key, place), Track())

    def forget(self) -> None:
        """Remove the decoded values of all segments so far from memory."""
        self._places.clear()
        self._kept_bytes = 0
        for track in self._by_key.values():
            track.trace.thin()

    def _has_no_log_time(self) -> bool:
        """Return whether all messages with postures, more than one, have one log time: a converter left it empty."""
        points = [track.trace.points().log for track in self.tracks.values()]
        logs = np.concatenate([*points, np.zeros(0, np.int64)])
        return len(logs) > 1 and bool((logs == logs[0]).all())

    def place(self, part: DecodableChannel, segment: ChunkRef) -> Place | None:
        """Return the messages of a channel in a segment, None for a segment that came later."""
        return self._places.get((id(part), segment.offset))

    def let_go(self, parts: Sequence[DecodableChannel], segment: ChunkRef) -> None:
        """Remove the decoded values of some channels in a segment from memory."""
        for part in parts:
            place = self.place(part, segment)
            if place is not None and place.pieces is not None:
                self._places[id(part), segment.offset] = replace(place, pieces=None)

    def segments(self, container: Store, parts: Sequence[DecodableChannel]) -> list[ChunkRef]:
        """Return the segments with messages of some channels of a file in the order of time."""
        ordered = []
        for segment in container.segments:
            passes = []
            for part in parts:
                place = self.place(part, segment)
                if place is None:
                    passes.append(0)
                elif place.count and (clock := self.tracks[id(part)].clock) is not None:
                    passes.append(clock.pass_of(place.first))
            if passes:
                ordered.append((min(passes), segment.start, segment.offset, segment))
        return [segment for *_, segment in sorted(ordered, key=lambda row: row[:3])]

    def _read(self, container: Store, parts: Sequence[DecodableChannel], strict: bool) -> None:
        """Decode all messages of a file; of several files a damaged one is read up to its damage."""
        decoders = [(part, part.make(None)) for part in parts]
        read: Counter[int] = Counter()
        # In the order of the file: where log times repeat, it is that of recording.
        for segment in sorted(container.segments, key=lambda segment: segment.offset):
            try:
                container.load(segment)
            except ReadError as error:
                if strict or len(self.containers) == 1:
                    raise
                self.warnings.append(f"{error}; the rest of this file is left out")
                container.segments[:] = [one for one in container.segments if one.offset < segment.offset]
                break
            for part, decoder in decoders:
                read[part.channel] += self.take(part, segment, decoder)
        else:
            for part in parts:
                count = container.counts[part.channel]
                if read[part.channel] < count:
                    missing = f"{count - read[part.channel]} of the {count} messages of {part.topic}"
                    self.lost.append(f"{missing} that {container.path.name} states are missing")
        container.release()

    def take(self, part: DecodableChannel, segment: ChunkRef, decoder: Decoder) -> int:
        """Decode the messages of a channel in a segment, and return how many they are."""
        if part.static:
            log = self.static_logs.setdefault(part.topic, ReadLog())
            batch = batch_of(part.container, segment, part.channel, log.messages)
            self.static.setdefault((part.kind, part.group), []).extend(decoder.decode(batch, log))
            log.messages += len(batch.times)
            return len(batch.times)
        track = self.tracks[id(part)]
        first = track.trace.count
        batch = batch_of(part.container, segment, part.channel, first)
        pieces = decoder.decode(batch, track.log)
        stamps = np.full(len(batch.times), NO_STAMP)
        for piece in reversed(pieces):
            stamps[piece.number - first] = piece.stamp
        track.trace.add(batch.times, stamps)
        track.log.messages += len(batch.times)
        presences = self.presence.setdefault((part.kind, part.group), Presences())
        for piece in pieces:
            presences.add(tuple(zip(piece.names, piece.parents or ("",) * len(piece.names), strict=True)), piece.log)
        self._places[id(part), segment.offset] = Place(first, len(batch.times), self._kept(pieces))
        return len(batch.times)

    def _kept(self, pieces: list[Piece]) -> list[Piece] | None:
        """Return the pieces if there is still room for them in `KEPT_BYTES`, else None."""
        size = sum(piece.values.nbytes + 3 * piece.log.nbytes for piece in pieces)
        if self._kept_bytes + size > KEPT_BYTES:
            return None
        self._kept_bytes += size
        return pieces
