"""From a source to frames: wait, settle, hand out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from reba.errors import ProfileError, ReadError
from reba.live.frames import Frames, NotYet, Reading
from reba.live.joint_frames import Bodies
from reba.live.sources import GrowingStore
from reba.live.table_rows import TableFollower
from reba.posture.factors import Factors, checked, expand_sides
from reba.readers.mcap import classified, gathered
from reba.readers.mcap.container import ChunkRef
from reba.readers.recognise import choose
from reba.readers.recording.profile import find_profile, profiles
from reba.readers.recording.stream import ReadLog

POLL: Final = 0.002
"""[s] Pause between two looks at a source that has nothing new."""
PATIENCE: Final = 10.0
"""[s] So much more of the recording than settling takes is looked at for something to score."""
AGAIN: Final = 0.5
"""[s] Of the recording between two attempts."""
MOST: Final = 20_000
"""Messages of a channel after which settling ends, whatever their times say."""


def once(tell: Callable[[str], None]) -> Callable[[str], None]:
    """Return what tells each text once: what waits for settling is looked at several times."""
    told: set[str] = set()

    def tell_once(text: str) -> None:
        if text not in told:
            told.add(text)
            tell(text)

    return tell_once


class Follower:
    """Hands out the frames of a source.

    Args:
        source: where messages come from.
        reading: what the caller chose.
        factors: load and others as the caller gave them; they replace columns.
        activity: each kind, for where no column tells it.
        tell: takes a warning.

    Attributes:
        stage: what turns segments into frames, None until the source has settled.
        seen: `time.perf_counter` when the segment at hand was complete.
        epoch: Unix time [s] of time 0, 0.0 where the source does not say.
        about: what was recognised, in one line.
    """

    def __init__(
        self,
        source: GrowingStore,
        reading: Reading,
        factors: Mapping[str, Any],
        activity: Mapping[str, bool],
        tell: Callable[[str], None],
    ) -> None:
        self._known = profiles() if reading.profile == "auto" else (find_profile(reading.profile),)
        self.source, self.reading = source, reading
        self._factors, self._activity = expand_sides(factors), activity
        self._checked = checked(Factors.of({**activity, **factors}), 1)
        self._tell = once(tell)
        self.stage: Bodies | TableFollower | None = None
        self.seen = 0.0
        self.epoch = 0.0
        self.about = ""
        self._need = reading.settle
        self._began = 0

    def frames(self, until_idle: float | None = None) -> Iterator[Frames]:
        """Yield frames as they come, until the source ends or is silent for `until_idle` seconds.

        Raises:
            ReadError, ProfileError, RebaError: the source is damaged, or holds nothing to score.
        """
        heard = time.monotonic()
        while True:
            segment = self.source.grow()
            if segment is None:
                if self.source.finished or (until_idle is not None and time.monotonic() - heard > until_idle):
                    break
                self.source.wait(POLL)
                continue
            heard = time.monotonic()
            self.seen = time.perf_counter()
            yield from self._taken(segment)
        if self.stage is None:
            yield from self._settle(final=True)
        if self.stage is not None:
            yield from self.stage.end()

    def _taken(self, segment: ChunkRef) -> Iterator[Frames]:
        if self.stage is not None:
            yield from self._staged(self.stage, segment)
            self.source.forget()
        elif self._enough():
            yield from self._settle(final=False)

    def _enough(self) -> bool:
        """Return whether there is enough to try to settle."""
        if self.source.span is None:
            return False
        first, last = self.source.span
        many = max(self.source.counts.values()) >= MOST
        return many or (last - first) / 1e9 >= (0.0 if self.source.ready and not self._began else self._need)

    def _settle(self, final: bool) -> Iterator[Frames]:
        """Try to decide, then yield what has waited."""
        try:
            self.stage = self._decided(final)
        except (NotYet, ProfileError, ReadError) as error:
            self._began += 1
            longest = self.reading.settle + PATIENCE
            if not isinstance(error, NotYet) and (final or self._need > longest or self.source.ready):
                raise
            span = self.source.span or (0, 0)
            self._need = (span[1] - span[0]) / 1e9 + AGAIN
            return
        for segment in list(self.source.segments):
            yield from self._staged(self.stage, segment)
        self.source.forget()

    def _staged(self, stage: Bodies | TableFollower, segment: ChunkRef) -> Iterator[Frames]:
        """Yield the frames of a segment; the first message that is of no use is told."""
        yield from stage.take(self.source, segment)
        if stage.log.first_skipped is not None:
            self._tell(f"left out: {stage.log.first_skipped}; further ones are counted")

    def _decided(self, final: bool) -> Bodies | TableFollower:
        """Return the stage that fits the segments there are."""
        if not self.source.segments:
            raise ReadError(
                self.source.path, "nothing came that could be scored", hint="check that it is being written"
            )
        recording = gathered(self.source.path, classified(self.source), ReadLog())
        named = self.reading.profile != "auto"
        match = choose(recording, self._known, self.reading.topic, named=named)
        stage: Bodies | TableFollower
        if match.profile is None:
            stage = TableFollower(self.source, match, self.reading, self._factors, self._activity, final, self._tell)
        else:
            stage = Bodies(recording, match, match.profile, self.reading, self._checked, final, self._tell)
        self.epoch = match.stream.epoch
        self.about = match.why
        return stage
