"""From a source to frames: wait for data, decide from the first seconds how they are read, yield frames and notices.

segments -> recording so far -> converter (decided once, renewed where names or clock change) -> frames, notices
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from typing import Any, Final

import numpy as np

from reba.errors import ProfileError, ReadError
from reba.live.bodies import FollowedBody
from reba.live.frames import Frames, NotEnoughData, ReadingOptions, UnitCheck
from reba.live.joint_frames import BodyFollower
from reba.live.notices import FrameWatch, Notice
from reba.live.sources import GrowingMcap, GrowingStore, SourceChanged, opened_again
from reba.live.table_rows import TableFollower
from reba.posture.factors import Factors, checked, expand_sides
from reba.posture.named_angles import RADIANS_TEXT
from reba.readers.mcap.growing import GrowingRecording
from reba.readers.mcap.store import ChunkRef, Store
from reba.readers.recognise import NoMatch, SeveralBodies, choose
from reba.readers.recording.profile import find_profile, profiles

POLL_SECONDS: Final = 0.002
"""[s] Between two checks of a source without new data; a fifth of a frame at 100 Hz."""
MAX_EXTRA_SECONDS: Final = 10.0
"""[s] Of the recording after `ReadingOptions.settle` after which a notice says what is missing."""
RETRY_SECONDS: Final = 0.5
"""[s] Of the recording between two attempts to decide."""
MAX_MESSAGES: Final = 20_000
"""Messages of a channel after which the decision is made even if their time stamps do not advance."""
UNSETTLED: Final = 600_000_000
"""[ns] Of log time after a jump of the clock or a new name in which frames wait: by then it shows what it is."""
LONGEST_UNSETTLED: Final = 1_500_000_000
"""[ns] The same if the newest message is itself uneven."""
IDLE: Final = 1.0
"""[s] Without data after which frames no longer wait."""
NEVER: Final = 1 << 62


class Follower:
    """Yields the frames of a growing source, and notices of what happens to its signal.

    Args:
        factors: load and others by name; they replace columns of the source.
        activity: value of each kind of activity without a column in the source.
        monotonic: seconds of a clock that never runs back.

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
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        self._profiles = profiles() if reading.profile == "auto" else (find_profile(reading.profile),)
        self.source, self.reading = source, reading
        self._factors, self._activity = expand_sides(factors), activity
        self._checked = checked(Factors.of({**activity, **factors}), 1)
        self._on_warning = report_once(on_warning)
        self._now = monotonic
        self.converter: BodyFollower | TableFollower | None = None
        self.received_at = 0.0
        self.epoch = 0.0
        self.recognised = ""
        self._recording = GrowingRecording(source.path)
        self._watch = FrameWatch()
        self._unit = UnitCheck()
        self._body: FollowedBody | None = None
        self._pending: list[tuple[Store, ChunkRef]] = []
        self._since = NEVER
        self._cuts: list[tuple[float, Notice]] = []
        self._seams = 0
        self._needed_seconds = reading.settle
        self._attempts = self._attempted = 0
        self._waiting = False

    @property
    def missing(self) -> float:
        """Time since the newest frame in which a signal is missing [s]."""
        return self._watch.silent_for(self._now())

    def follow(self, until_idle: float | None = None) -> Iterator[Frames | Notice]:
        """Yield frames and notices as they arrive, until the source ends or has no new data for `until_idle` [s].

        Raises:
            ReadError, ProfileError, RebaError: the source is damaged, or contains no data that can be scored.
        """
        last_data = self._now()
        while True:
            try:
                segment = self.source.grow()
            except SourceChanged as change:
                yield from self._file_ended(change.what)
                if not self._has_next_file(last_data, until_idle):
                    break
                continue
            if segment is not None:
                last_data = self._now()
                self.received_at = time.perf_counter()
                yield from self._take(segment)
                continue
            idle = self._now() - last_data
            if self.source.finished or (until_idle is not None and idle > until_idle):
                break
            if self._pending and idle > IDLE:
                yield from self._release()
            yield from self._silence(idle)
            self.source.wait(POLL_SECONDS)
        yield from self._finish()

    def _finish(self) -> Iterator[Frames | Notice]:
        """Yield what waits at the end of the source."""
        if self.converter is None:
            yield from self._decide(final=True)
        yield from self._release()
        if self.converter is not None:
            yield from self._split(self.converter.remaining_frames())
            if self._unit.ends_in_radians():
                self._warn(RADIANS_TEXT)

    def _warn(self, text: str) -> None:
        """Report a warning about all frames, which the summary repeats."""
        assert self.converter is not None
        self.converter.log.warn(text)
        self._on_warning(text)

    def _file_ended(self, why: str) -> Iterator[Frames | Notice]:
        with suppress(ReadError):  # what was not read of a file that was cut is lost
            yield from self._release()
        yield self._watch.lose("new_file", f"{why}: waiting for the file that is written next", 0.0)

    def _has_next_file(self, last_data: float, until_idle: float | None) -> bool:
        """Wait for the file that is now under the path; return whether there is one."""
        while isinstance(self.source, GrowingMcap):
            after = opened_again(self.source)
            if after is not None:
                self.source = after
                return True
            if until_idle is not None and self._now() - last_data > until_idle:
                break
            self.source.wait(POLL_SECONDS)
        return False

    def _silence(self, idle: float) -> Iterator[Notice]:
        """Yield a notice if no frame has arrived for too long; `idle`: time without any data [s]."""
        silence = self._watch.silent_for(self._now())
        if not silence or self._watch.lost:
            return
        if idle < self._watch.limit:
            yield self._left(silence)
        else:
            text = f"no data for {silence:.1f} s: the newest score, of {self._watch.last:.2f} s, is out of date"
            yield self._watch.lose("silent", text, silence)

    def _take(self, segment: ChunkRef) -> Iterator[Frames | Notice]:
        self._recording.add(self.source, segment)
        if self.converter is None:
            if self._has_enough():
                yield from self._decide(final=False)
            return
        self._pending.append((self.source, segment))
        if not self._is_unsettled():
            yield from self._release()

    def _is_unsettled(self) -> bool:
        """Return whether the next messages have to show what a jump of the clock or a new name is."""
        recording, body = self._recording, self._body
        if body is not None:
            first = [log for (name, _), log in recording.appeared.items() if body.concerns(name)]
            self._since = min([self._since, *first])
            if (since := body.unsettled_since(recording.contents)) is not None:
                self._since = min(self._since, since)
            elif body.overlap(recording.contents):
                self._since = min(self._since, recording.newest_log - UNSETTLED)
        if recording.uneven:
            self._since = min(self._since, recording.uneven_since)
        if self._since == NEVER:
            return False
        waited = abs(recording.newest_log - self._since)
        return waited < UNSETTLED or (recording.open_end and waited < LONGEST_UNSETTLED)

    def _release(self) -> Iterator[Frames | Notice]:
        """Yield the frames of the segments that waited, after what changed was decided."""
        pending, self._pending = self._pending, []
        if not pending or self.converter is None:
            return
        if self._since != NEVER:
            self._since = NEVER
            yield from self._renew()
        for store, segment in pending:
            yield from self._converted(store, segment)
        self._forget()
        yield from self._look_for_body()

    def _renew(self) -> Iterator[Notice]:
        """Decide by all messages so far about clock and names."""
        if warning := self._recording.settle():
            self._on_warning(warning)
        body = self._body
        if body is not None and isinstance(self.converter, BodyFollower):
            recording = self._recording.recording()
            body.settle(self._recording.contents)
            for other in body.renew(recording):
                text = f"{other} is there beside {body.current}, which is followed"
                yield self._notice("second_body", f"{text}; to follow {other}, start again with --topic {other}")
            for text in self.converter.renew(recording, body.match):
                yield self._notice("appeared", f"{text} from here on")
        self._note_seams()

    def _note_seams(self) -> None:
        assert self.converter is not None
        seams = self.converter.decoder.seams
        for seam in seams[self._seams :]:
            text = f"the clock of the source jumps at {seam:.2f} s: a new segment begins, time goes on by the log time"
            self._cuts.append((seam, Notice("restarted", text, segment=True)))
        self._seams = len(seams)

    def _notice(self, kind: str, text: str) -> Notice:
        return Notice(kind, text, self._watch.last, followed=not self._watch.lost)

    def _look_for_body(self) -> Iterator[Notice]:
        """Yield a notice if the source goes on without the body."""
        assert self.converter is not None
        since = (self._recording.newest_log - self.converter.decoder.newest_log) / 1e9
        if self._watch.lost or self._watch.last is None or since <= self._watch.limit:
            return
        yield self._left(since)

    def _left(self, since: float) -> Notice:
        """Return the notice that the source goes on, but not with the body."""
        name = self._body.current if self._body is not None else self.recognised
        others = self._body.others() if self._body is not None else []
        text = f"no frame of {name} since {self._watch.last:.2f} s, other messages arrive"
        if others:
            text += f"; {', '.join(others)} was there beside it and is not followed: choose with --topic {others[0]}"
        return self._watch.lose("left", text, since)

    def _has_enough(self) -> bool:
        """Return whether there are enough data for an attempt to decide."""
        if self.source.span is None:
            return False
        first, last = self.source.span
        needed = 0.0 if self.source.ready and not self._attempts else self._needed_seconds
        return self._many() or (last - first) / 1e9 >= needed

    def _many(self) -> bool:
        return max(self.source.counts.values()) - self._attempted >= MAX_MESSAGES

    def _decide(self, final: bool) -> Iterator[Frames | Notice]:
        """Try to decide, then yield the frames of the segments so far."""
        many = self._many() if self.source.counts else False
        self._recording.settle()
        try:
            self.converter = self._converter_for(final or many)
        except (NotEnoughData, ProfileError, ReadError) as error:
            self._attempts += 1
            unclear = isinstance(error, ProfileError) and not isinstance(error, NoMatch) and self._is_late()
            if final or self.source.ready or unclear or isinstance(error, SeveralBodies):
                raise
            if not isinstance(error, NotEnoughData) and (self._is_late() or many):
                if not self._waiting:
                    self._waiting = True
                    yield self._notice("waiting", f"{error}; waiting until it arrives")
                self._forget()
            span = self.source.span or (0, 0)
            self._needed_seconds = (span[1] - span[0]) / 1e9 + RETRY_SECONDS
            self._attempted = max(self.source.counts.values(), default=0)
            return
        self._note_seams()
        for segment in list(self.source.segments):
            yield from self._converted(self.source, segment)
        self._forget()

    def _is_late(self) -> bool:
        return self._needed_seconds > self.reading.settle + MAX_EXTRA_SECONDS

    def _forget(self) -> None:
        self.source.forget()
        self._recording.forget()

    def _converted(self, store: Store, segment: ChunkRef) -> Iterator[Frames | Notice]:
        """Yield the frames of a segment; the first message that cannot be used is reported."""
        converter = self.converter
        assert converter is not None
        frames = list(converter.frames_of(store, segment))
        self._note_ids()
        yield from self._split(frames, chunked=segment.chunk is not None)
        if converter.log.first_skipped is not None:
            self._on_warning(f"skipped: {converter.log.first_skipped}; further ones are counted")

    def _note_ids(self) -> None:
        """Note where the body has another id."""
        body = self._body
        if body is None or self.converter is None or not self.converter.decoder.origins:
            return
        for moment, signal in sorted(self.converter.decoder.origins):
            before, label = body.current, body.ids.get(signal, body.current)
            if body.follows(label, moment):
                text = f"{label} follows {before} at {moment:.2f} s, never both at once: one person"
                self._cuts.append((moment, Notice("new_id", text, segment=True)))
        self.converter.decoder.origins.clear()

    def _split(self, several: Iterable[Frames], *, chunked: bool = False) -> Iterator[Frames | Notice]:
        """Yield frames, and between them the notices that belong there."""
        for frames in several:
            if self._unit.finds_radians(frames):
                self._warn(RADIANS_TEXT)
            last = self._watch.last
            cuts = sorted(self._cuts, key=lambda cut: cut[0])
            cuts += self._watch.gaps(frames.time, self._now(), chunked=chunked)
            cuts += self._watch.columns(frames.time, frames.angles)
            self._cuts = [cut for cut in cuts if cut[0] > frames.time[-1]]
            start = 0
            for moment, notice in sorted(cuts, key=lambda cut: cut[0]):
                if moment > frames.time[-1]:
                    continue
                stop = max(int(np.searchsorted(frames.time, moment - 1e-9)), start)
                if stop > start:
                    yield frames.part(slice(start, stop))
                before = float(frames.time[stop - 1]) if stop else last
                yield notice.after(before)
                start = stop
            yield frames.part(slice(start, None)) if start else frames

    def _converter_for(self, final: bool) -> BodyFollower | TableFollower:
        """Return the converter for the recognised stream of the segments so far."""
        recording = self._recording.recording()
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
            self._body = FollowedBody(recording, match, match.profile, self.reading.topic)
            self._body.settle(self._recording.contents)
        self.epoch = match.stream.epoch
        self.recognised = match.why
        return converter


def report_once(on_warning: Callable[[str], None]) -> Callable[[str], None]:
    """Return a callback that passes each text on once: every attempt to decide repeats the warnings of the first."""
    reported: set[str] = set()

    def report(text: str) -> None:
        if text not in reported:
            reported.add(text)
            on_warning(text)

    return report
