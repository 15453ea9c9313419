"""A recording that is being written: channels, contents and clock of all segments so far.

segment -> channels that appear with it -> contents -> what changed -> the recording so far, as of a complete file
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from reba.errors import ReadError
from reba.readers.mcap.channels import DecodableChannel, Unused, classify
from reba.readers.mcap.contents import Contents, Track
from reba.readers.mcap.decode import Decoder, Piece
from reba.readers.mcap.gather import recording_of
from reba.readers.mcap.presence import Signal
from reba.readers.mcap.store import ChunkRef, Store
from reba.readers.recording.stream import ReadLog, Recording

CONTRADICTED: Final = "the time stamps are not those that the first seconds promised; the first clock is kept"


class GrowingRecording:
    """Takes in segment by segment; `gathered` of all messages so far, without reading them again.

    Attributes:
        contents: of all segments so far.
        newest_log: latest log time [ns] of the newest segment.
        uneven: whether a clock, a static transform or a channel changed since `settle`.
        uneven_since: log time [ns] from which on it did.
        appeared: signals that appeared since `settle` -> log time [ns] of their first message.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.contents = Contents((), strict=False)
        self.newest_log = 0
        self.uneven = False
        self.uneven_since = 0
        self.appeared: dict[Signal, int] = {}
        self._parts: list[DecodableChannel] = []
        self._unused: dict[tuple[int, int], Unused] = {}
        self._decoders: dict[tuple[int, int], tuple[DecodableChannel, Decoder]] = {}
        self._named = 0
        self._known: set[Signal] = set()
        self._settled: dict[int, int] = {}
        self._static: dict[Signal, bytes] = {}

    def add(self, store: Store, segment: ChunkRef) -> None:
        """Take in a segment.

        Raises:
            ReadError: it is damaged.
        """
        times = store.load(segment).scan.times
        if len(times):
            self.newest_log = int(times.max())
            self.uneven_since = self.uneven_since if self.uneven else int(times.min())
        for number in sorted(store.channels):
            key = (id(store), number)
            if key not in self._decoders and store.counts[number]:
                self._classify(store, number)
            if key in self._decoders:
                part, decoder = self._decoders[key]
                pieces = self.contents.static.get((part.kind, part.group), [])
                known = len(pieces)
                self.contents.take(part, segment, decoder)
                if part.static:
                    pieces = self.contents.static[part.kind, part.group]
                    pieces[known:] = [piece for piece in pieces[known:] if self._is_new(piece)]
                    self.uneven |= len(pieces) > known
        self.uneven |= bool(self._uneven_tracks())
        self._find_new_signals()

    def _is_new(self, piece: Piece) -> bool:
        """Return whether a piece of static transforms says more than those before: many are sent again and again."""
        width = piece.values.shape[1] // max(len(piece.names), 1)
        new = {
            signal: piece.values[-1, at * width : (at + 1) * width].tobytes()
            for at, signal in enumerate(zip(piece.names, piece.parents, strict=True))
        }
        differs = any(self._static.get(signal) != value for signal, value in new.items())
        self._static |= new
        return differs

    def _classify(self, store: Store, number: int) -> None:
        key = (id(store), number)
        part = self._unused.get(key) or classify(store, store.channels[number])
        if isinstance(part, Unused):
            self._unused[key] = part
            return
        self.uneven |= bool(self._parts)
        self._parts.append(part)
        self._decoders[key] = part, part.make(None)
        self.contents.include(part)

    def _find_new_signals(self) -> None:
        named = sum(group.named for group in self.contents.presence.values())
        if named != self._named:
            self._named = named
            for (kind, _), groups in self.contents.presence.items():
                if kind != "angles":
                    for signals, one in groups.sets.items():
                        for signal in signals:
                            if signal not in self._known and one.intervals:
                                self._known.add(signal)
                                self.appeared[signal] = one.intervals[0][0]

    def _uneven_tracks(self) -> list[Track]:
        """Return the tracks whose times have been uneven since `settle`."""
        tracks = {id(track): track for track in self.contents.tracks.values()}
        return [track for key, track in tracks.items() if track.trace.jumped > self._settled.get(key, -1)]

    @property
    def open_end(self) -> bool:
        """Whether the newest message of a track is uneven, so that only the next one shows what it is."""
        return any(track.trace.jumped == track.trace.count - 1 for track in self._uneven_tracks())

    def settle(self) -> str:
        """Decide the clocks by all messages so far; return a warning if that would change what was decided before."""
        clocks = dict(self.contents.clocks)
        tracks = {id(track): track for track in self.contents.tracks.values()}
        before = {key: track.clock for key, track in tracks.items()}
        self.uneven, self.appeared = False, {}
        self._settled = {key: track.trace.jumped for key, track in tracks.items()}
        self.contents.set_clocks()
        if all(clock.source == self.contents.clocks[name].source for name, clock in clocks.items()):
            return ""
        self.contents.clocks.update(clocks)
        for key, clock in before.items():
            tracks[key].clock = clock or tracks[key].clock
        return CONTRADICTED

    def recording(self) -> Recording:
        """Return the recording of all segments so far; those in memory can be read.

        Raises:
            ReadError: there is none.
        """
        if not self._parts and not self._unused:
            raise ReadError(self.path, "no data arrived that can be scored", hint="check that it is being written")
        return recording_of(self.path, self._parts, list(self._unused.values()), self.contents, ReadLog())

    def forget(self) -> None:
        """Remove the values of all segments so far from memory."""
        self.contents.forget()
