"""Joints or frames of a person as they come -> postures, by what the first seconds decided."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reba.errors import ProfileError, ReadError
from reba.factors import Factors
from reba.live.frames import Array, Frames, later
from reba.live.reading import NotYet, Reading, neutral_until
from reba.live.root import LiveRoot
from reba.live.source import Source, followed
from reba.live.watch import Watch
from reba.posture import COLUMNS
from reba.readers.collect import Samples, collect
from reba.readers.correct import correct
from reba.readers.finish import root_streams
from reba.readers.frames import AXES
from reba.readers.joints import JointMapper
from reba.readers.mapping import Mapper, block_angles, mapper_for
from reba.readers.mcap.container import Segment
from reba.readers.neutral import apply_neutral, neutral_offsets, parse_neutral, subtract
from reba.readers.profile import Profile
from reba.readers.recognise import Match
from reba.readers.root import RootPose, read_root
from reba.readers.stream import Block, ReadLog, Recording


class Bodies:
    """Turns segments into frames of posture.

    Args:
        recording: what the first segments hold.
        match: the stream and what its names mean.
        profile: the profile of the match.
        reading: what the caller chose.
        factors: checked, one value each.
        final: whether no more is going to come, so that nothing is worth waiting for.
        tell: takes a warning.

    Raises:
        NotYet: the neutral posture is not over yet.
        ReadError, ProfileError, RebaError: as `reba.read`.
    """

    def __init__(
        self,
        recording: Recording,
        match: Match,
        profile: Profile,
        reading: Reading,
        factors: Factors,
        final: bool,
        tell: Callable[[str], None],
    ) -> None:
        self.factors = factors
        self.log = ReadLog()
        self.late = 0
        self.profile = profile.name
        self._tell = tell
        self._epoch = match.stream.epoch
        self._last = -np.inf
        self._waiting: list[Block] = []
        self._root, pose = self._live_root(recording, match, profile)
        mapper = mapper_for(profile, match.names or {}, match.stream, pose)
        samples = collect(match.stream, mapper)
        if not len(samples.table):
            first = f": {samples.log.first_skipped}" if samples.log.first_skipped else ""
            raise ReadError(recording.path, f"no sample can be used{first}", hint="see `reba info`")
        if not final and samples.time[-1] <= neutral_until(reading.neutral, float(samples.time[0])):
            raise NotYet
        self._decide(samples, mapper, match, profile, reading, recording.path)
        mapper.begin()
        self._mapper = mapper
        self._watch = Watch(mapper, profile, match.stream.kind, reading.neutral, self._corrections, tell)
        self._intake = followed(match.stream, mapper.wanted, self.log)

    def _decide(
        self, samples: Samples, mapper: Mapper, match: Match, profile: Profile, reading: Reading, path: str
    ) -> None:
        """Decide what `reba.readers.finish` decides from a whole recording."""
        self._corrections = correct(samples, mapper, profile, match.stream.kind, reading.neutral)
        reasons = self._corrections.reasons
        self.unmeasured = [column for column in COLUMNS if column in reasons]
        if len(self.unmeasured) == len(COLUMNS):
            why = "; ".join(dict.fromkeys(reasons.values()))
            raise ProfileError(f"{path}: {match.why}, but nothing was measured: {why}; record it again")
        self._offsets: dict[int, float] = {}
        window = parse_neutral(reading.neutral)
        if window is not None:
            # The text of what was done also refuses a stretch without a frame.
            mapper.assumed.append(apply_neutral(samples.time, samples.angles.copy(), reading.neutral))
            self._offsets = neutral_offsets(samples.angles[window(samples.time)])
        self.assumed = list(dict.fromkeys(mapper.assumed))
        for text in [*samples.log.warnings, *mapper.warnings]:
            self._tell(text)

    @staticmethod
    def _live_root(recording: Recording, match: Match, profile: Profile) -> tuple[LiveRoot | None, RootPose | None]:
        for stream, name in root_streams(recording, match, profile):
            pose = read_root(profile, [(stream, name)], AXES[profile.root_axes])
            if pose is not None:
                return LiveRoot(pose, stream, name), pose
        return None, None

    def take(self, source: Source, segment: Segment) -> Iterator[Frames]:
        """Yield the frames that a segment completes."""
        self._intake.take(source, segment)
        if self._root is not None:
            self._root.take(source, segment)
        block = self._intake.flush_whole()
        if block is not None:
            self._waiting.append(block)
        yield from self._release()

    def end(self) -> Iterator[Frames]:
        """Yield what still waits: nothing more comes."""
        block = self._intake.flush(last=True)
        if block is not None:
            self._waiting.append(block)
        yield from self._release(last=True)
        self._watch.look()

    def _release(self, last: bool = False) -> Iterator[Frames]:
        """Yield the waiting frames, those that wait for a pose of the pelvis only if it has come."""
        until = np.inf
        if self._root is not None and self._waiting and not last:
            until = self._root.until(float(self._waiting[-1].time[-1]) + self._epoch)
        kept: list[Block] = []
        for block in self._waiting:
            count = int(np.searchsorted(block.time + self._epoch, until, side="right"))
            if count:
                yield from self._frames(_rows(block, slice(0, count)))
            if count < len(block.time):
                kept.append(_rows(block, slice(count, None)))
        self._waiting = kept
        if self._root is not None and np.isfinite(self._last):
            self._root.forget(self._last + self._epoch)

    def _frames(self, block: Block) -> Iterator[Frames]:
        if self._root is not None and isinstance(self._mapper, JointMapper):
            self._mapper.root = self._root.pose
        angles: Array = block_angles(self._mapper, block)
        fresh = later(block.time, self._last)
        if not fresh.all():
            if not self.late:
                self._tell(f"time runs backwards or stands still at {block.time[~fresh][0]:.3f} s; such frames are "
                           "left out and counted")  # fmt: skip
            self.late += int(np.sum(~fresh))
            block, angles = _rows(block, fresh), angles[fresh]
        if not len(block.time):
            return
        self._last = float(block.time[-1])
        self._watch.add(block.time, angles)
        self._corrections.apply(angles)
        subtract(angles, self._offsets)
        yield Frames(block.time, angles, self.factors)


def _rows(block: Block, which: slice | NDArray[np.bool_]) -> Block:
    return replace(block, time=block.time[which], values=block.values[which])
