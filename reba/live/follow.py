"""From a source to frames: wait for data, decide from the first seconds how they are read, yield frames."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from reba.errors import ProfileError, ReadError
from reba.live.frames import Frames, NotEnoughData, ReadingOptions
from reba.live.joint_frames import BodyFollower
from reba.live.sources import GrowingStore
from reba.live.table_rows import TableFollower
from reba.posture.factors import Factors, checked, expand_sides
from reba.readers.mcap import classified, gathered
from reba.readers.mcap.store import ChunkRef
from reba.readers.recognise import choose
from reba.readers.recording.profile import find_profile, profiles
from reba.readers.recording.stream import ReadLog

POLL_SECONDS: Final = 0.002
"""[s] Between two checks of a source without new data; a fifth of a frame at 100 Hz."""
MAX_EXTRA_SECONDS: Final = 10.0
"""[s] Of the recording after `ReadingOptions.settle` within which usable data must arrive."""
RETRY_SECONDS: Final = 0.5
"""[s] Of the recording between two attempts to decide."""
MAX_MESSAGES: Final = 20_000
"""Messages of a channel after which the decision is made even if their time stamps do not advance."""


def report_once(on_warning: Callable[[str], None]) -> Callable[[str], None]:
    """Return a callback that passes each text on once: every attempt to decide repeats the warnings of the first."""
    reported: set[str] = set()

    def report(text: str) -> None:
        if text not in reported:
            reported.add(text)
            on_warning(text)

    return report


class Follower:
    """Yields the frames of a growing source.

    Args:
        factors: load and others by name; they replace columns of the source.
        activity: value of each kind of activity without a column in the source.

    Attributes:
        converter: from segments to frames, None before the decision.
        received_at: `time.perf_counter` when the current segment was complete.
        epoch: Unix time of time 0 [s], 0.0 if the source has none.
        recognised: recognised stream and profile as one line.
    """

    def __init__(
        self,
        source: GrowingStore,
        reading: ReadingOptions,
        factors: Mapping[str, Any],
        activity: Mapping[str, bool],
        on_warning: Callable[[str], None],
    ) -> None:
        self._profiles = profiles() if reading.profile == "auto" else (find_profile(reading.profile),)
        self.source, self.reading = source, reading
        self._factors, self._activity = expand_sides(factors), activity
        self._checked = checked(Factors.of({**activity, **factors}), 1)
        self._on_warning = report_once(on_warning)
        self.converter: BodyFollower | TableFollower | None = None
        self.received_at = 0.0
        self.epoch = 0.0
        self.recognised = ""
        self._needed_seconds = reading.settle
        self._attempts = 0

    def frames(self, until_idle: float | None = None) -> Iterator[Frames]:
        """Yield frames as they arrive, until the source ends or has no new data for `until_idle` [s].

        Raises:
            ReadError, ProfileError, RebaError: the source is damaged, or contains no data that can be scored.
        """
        last_data = time.monotonic()
        while True:
            segment = self.source.grow()
            if segment is None:
                if self.source.finished or (until_idle is not None and time.monotonic() - last_data > until_idle):
                    break
                self.source.wait(POLL_SECONDS)
                continue
            last_data = time.monotonic()
            self.received_at = time.perf_counter()
            yield from self._frames_of(segment)
        if self.converter is None:
            yield from self._decide(final=True)
        if self.converter is not None:
            yield from self.converter.remaining_frames()

    def _frames_of(self, segment: ChunkRef) -> Iterator[Frames]:
        if self.converter is not None:
            yield from self._converted(self.converter, segment)
            self.source.forget()
        elif self._has_enough():
            yield from self._decide(final=False)

    def _has_enough(self) -> bool:
        """Return whether there are enough data for an attempt to decide."""
        if self.source.span is None:
            return False
        first, last = self.source.span
        needed = 0.0 if self.source.ready and not self._attempts else self._needed_seconds
        return max(self.source.counts.values()) >= MAX_MESSAGES or (last - first) / 1e9 >= needed

    def _decide(self, final: bool) -> Iterator[Frames]:
        """Try to decide, then yield the frames of the segments so far."""
        try:
            self.converter = self._converter_for(final)
        except (NotEnoughData, ProfileError, ReadError) as error:
            self._attempts += 1
            longest = self.reading.settle + MAX_EXTRA_SECONDS
            if not isinstance(error, NotEnoughData) and (final or self._needed_seconds > longest or self.source.ready):
                raise
            span = self.source.span or (0, 0)
            self._needed_seconds = (span[1] - span[0]) / 1e9 + RETRY_SECONDS
            return
        for segment in list(self.source.segments):
            yield from self._converted(self.converter, segment)
        self.source.forget()

    def _converted(self, converter: BodyFollower | TableFollower, segment: ChunkRef) -> Iterator[Frames]:
        """Yield the frames of a segment; the first message that cannot be used is reported."""
        yield from converter.frames_of(self.source, segment)
        if converter.log.first_skipped is not None:
            self._on_warning(f"skipped: {converter.log.first_skipped}; further ones are counted")

    def _converter_for(self, final: bool) -> BodyFollower | TableFollower:
        """Return the converter for the recognised stream of the segments so far."""
        if not self.source.segments:
            raise ReadError(
                self.source.path, "no data arrived that can be scored", hint="check that it is being written"
            )
        recording = gathered(self.source.path, classified(self.source), ReadLog())
        named = self.reading.profile != "auto"
        match = choose(recording, self._profiles, self.reading.topic, named=named)
        converter: BodyFollower | TableFollower
        if match.profile is None:
            converter = TableFollower(
                self.source, match, self.reading, self._factors, self._activity, final, self._on_warning
            )
        else:
            converter = BodyFollower(
                recording, match, match.profile, self.reading, self._checked, final, self._on_warning
            )
        self.epoch = match.stream.epoch
        self.recognised = match.why
        return converter
