"""Joints or frames of a person as they come -> postures, by what the first seconds decided."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from reba.arrays import Array, Flags
from reba.errors import ProfileError, ReadError
from reba.live.frames import Frames, NotYet, Reading, later, neutral_until
from reba.live.sources import GrowingStore, followed
from reba.posture.columns import COLUMNS
from reba.posture.factors import Factors
from reba.readers.build_table import pelvis_streams
from reba.readers.mapping import Mapper, Samples, block_angles, collect, mapper_for
from reba.readers.mapping.joints import JointMapper
from reba.readers.mapping.reference_frames import HOLD, FrameTree, PelvisPose, pelvis_samples, read_pelvis_pose
from reba.readers.mapping.segments import AXES
from reba.readers.mcap.container import ChunkRef
from reba.readers.quality_control import (
    Corrections,
    apply_neutral,
    neutral_offsets,
    parse_neutral,
    quality_control,
    subtract,
)
from reba.readers.recognise import Match
from reba.readers.recording.profile import Profile
from reba.readers.recording.stream import Block, Kind, ReadLog, Recording, Stream


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
        self._watch = DecisionMonitor(mapper, profile, match.stream.kind, reading.neutral, self._corrections, tell)
        self._intake = followed(match.stream, mapper.wanted, self.log)

    def _decide(
        self, samples: Samples, mapper: Mapper, match: Match, profile: Profile, reading: Reading, path: str
    ) -> None:
        """Decide what `reba.readers.build_table` decides from a whole recording."""
        self._corrections = quality_control(samples, mapper, profile, match.stream.kind, reading.neutral)
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
    def _live_root(recording: Recording, match: Match, profile: Profile) -> tuple[LiveRoot | None, PelvisPose | None]:
        for stream, name in pelvis_streams(recording, match, profile):
            pose = read_pelvis_pose(profile, [(stream, name)], AXES[profile.root_axes])
            if pose is not None:
                return LiveRoot(pose, stream, name), pose
        return None, None

    def take(self, source: GrowingStore, segment: ChunkRef) -> Iterator[Frames]:
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


def _rows(block: Block, which: slice | Flags) -> Block:
    return replace(block, time=block.time[which], values=block.values[which])


LONGEST = 60.0
"""[s] Samples older than this behind the newest one are let go in any case."""
KEPT = 2.0
"""[s] Samples older than this behind the oldest waiting frame are let go."""


class LiveRoot:
    """Follows the frame of the pelvis.

    Args:
        pose: what the first samples gave: axes and vertical.
        stream: where the frame is.
        name: the frame.
    """

    def __init__(self, pose: PelvisPose, stream: Stream, name: str) -> None:
        self._poses = FrameTree(stream, (name,))
        self._intake = followed(stream, self._poses.wanted, ReadLog())
        self._stream, self._name = stream, name
        self.pose = replace(pose, time=np.empty(0), quaternions=np.empty((0, 4)))

    def take(self, source: GrowingStore, segment: ChunkRef) -> None:
        """Take up the samples of a segment."""
        self._intake.take(source, segment)
        block = self._intake.flush_whole()
        if block is None:
            return
        rows = pelvis_samples(self._poses, self._stream, self._name, block)
        time = np.concatenate([self.pose.time, rows[:, 0]])
        quaternions = np.concatenate([self.pose.quaternions, rows[:, 1:]])
        order = np.argsort(time, kind="stable")
        time, quaternions = time[order], quaternions[order]
        flips = np.cumprod(np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0, -1.0, 1.0))
        quaternions[1:] *= flips[:, None]
        self.pose = replace(self.pose, time=time, quaternions=quaternions)
        if len(time):
            self.forget(float(time[-1]) - LONGEST)

    def until(self, newest: float) -> float:
        """Return the time up to which frames need not wait: a later sample is there, or none came for too long.

        Args:
            newest: time of the newest frame that waits.
        """
        last = float(self.pose.time[-1]) if len(self.pose.time) else -np.inf
        return max(last, newest - HOLD)

    def forget(self, before: float) -> None:
        """Let go of samples that no frame from time `before` on can need."""
        kept = max(int(np.searchsorted(self.pose.time, before - KEPT)) - 1, 0)
        self.pose = replace(self.pose, time=self.pose.time[kept:], quaternions=self.pose.quaternions[kept:])


EVERY: Final = 10.0
"""[s] Of the recording between two looks."""
MOST: Final = 1024
"""Frames kept for it: every second, fourth, ... of the recording."""


class DecisionMonitor:
    """Keeps a thinned history of angles and says once where a decision would be another now.

    Args:
        mapper: what maps the recording; it keeps the ranges of its joints.
        profile, kind, neutral: as `reba.readers.quality_control.quality_control`.
        decided: what the first seconds gave.
        tell: takes the warning.
    """

    def __init__(
        self,
        mapper: Mapper,
        profile: Profile,
        kind: Kind,
        neutral: str,
        decided: Corrections,
        tell: Callable[[str], None],
    ) -> None:
        self._mapper, self._profile, self._kind, self._neutral = mapper, profile, kind, neutral
        self._decided = decided
        self._tell = tell
        self._table = np.empty((MOST, 1 + len(COLUMNS)))
        self._kept = self._seen = 0
        self._step = 1
        self._next: float | None = None
        self.told = False

    def add(self, time: Array, angles: Array) -> None:
        """Take up (n,) times [s] and (n, 22) angles [deg] before any correction."""
        if self.told:
            return
        first = -self._seen % self._step
        for at in range(first, len(time), self._step):
            if self._kept == MOST:
                self._table[: MOST // 2] = self._table[::2]
                self._kept, self._step = MOST // 2, self._step * 2
            self._table[self._kept, 0] = time[at]
            self._table[self._kept, 1:] = angles[at]
            self._kept += 1
        self._seen += len(time)
        if self._next is None:
            self._next = float(time[0]) + EVERY
        if time[-1] >= self._next:
            self._next = float(time[-1]) + EVERY
            self.look()

    def look(self) -> None:
        """Decide again, and say what would be otherwise, once."""
        if self.told or not self._kept:
            return
        mapper = self._copied()
        before = len(mapper.warnings)
        consistent = mapper.is_consistent()
        found = quality_control(
            Samples(self._table[: self._kept].copy(), ReadLog()), mapper, self._profile, self._kind, self._neutral
        )
        if not consistent:
            what = "; ".join(mapper.warnings[before:][:1]) or "the unit or the vertical is another"
        elif shown := set(self._decided.hidden) - set(found.hidden):
            name = COLUMNS[min(shown)]
            what = f"{name} was taken as not measured ({self._decided.reasons[name]}), and moves"
        elif hidden := set(found.hidden) - set(self._decided.hidden):
            name = COLUMNS[min(hidden)]
            what = f"{name} was taken as measured, and counts as not measured ({found.reasons[name]})"
        elif found.turned != self._decided.turned:
            what = f"the sign of {', '.join(COLUMNS[at] for at in found.turned or self._decided.turned)} is the other"
        else:
            return
        self.told = True
        self._tell(
            f"what came later contradicts the first seconds: {what}; `reba score` decides from the whole recording, "
            "a longer --settle from more of it"
        )

    def _copied(self) -> Mapper:
        """Return a copy of the mapper to ask, which leaves the one at work as it is."""
        shared = [getattr(self._mapper, name, None) for name in ("profile", "stream", "root")]
        return copy.deepcopy(self._mapper, {id(thing): thing for thing in shared if thing is not None})
