"""Joint angles or segment poses of a person as they arrive -> postures, as decided from the first seconds."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from reba.arrays import Array, Flags
from reba.errors import ProfileError, ReadError
from reba.live.frames import Frames, NotEnoughData, ReadingOptions, is_later, neutral_until
from reba.live.sources import GrowingStore, block_decoder
from reba.posture.columns import COLUMNS
from reba.posture.factors import Factors
from reba.readers.build_table import pelvis_streams
from reba.readers.mapping import Mapper, Samples, block_angles, collect, mapper_for
from reba.readers.mapping.gap_codes import GapCodes
from reba.readers.mapping.joints import JointMapper
from reba.readers.mapping.reference_frames import HOLD, FrameTree, PelvisPose, pelvis_samples, read_pelvis_pose
from reba.readers.mapping.segments import AXES
from reba.readers.mcap.store import ChunkRef
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


class BodyFollower:
    """Converts segments of joint angles or segment poses to frames.

    Args:
        recording: the first segments.
        match: the stream with its profile.
        factors: checked, one value each.
        final: no more segments will arrive.

    Attributes:
        pelvis: pose of the pelvis over time, None without a root frame.

    Raises:
        NotEnoughData: the interval of the neutral posture has not ended.
        ReadError, ProfileError, RebaError: as `reba.read`.
    """

    def __init__(
        self,
        recording: Recording,
        match: Match,
        profile: Profile,
        reading: ReadingOptions,
        factors: Factors,
        final: bool,
        on_warning: Callable[[str], None],
    ) -> None:
        self.factors = factors
        self.log = ReadLog()
        self.late = 0
        self.profile = profile.name
        self._on_warning = on_warning
        self._epoch = match.stream.epoch
        self._last = -np.inf
        self._waiting: list[Block] = []
        self.pelvis, pose = self._pelvis_follower(recording, match, profile)
        mapper = mapper_for(profile, match.names or {}, match.stream, pose)
        samples = collect(match.stream, mapper)
        if not len(samples.table):
            first = f": {samples.log.first_skipped}" if samples.log.first_skipped else ""
            raise ReadError(recording.path, f"no sample can be used{first}", hint="see `reba info`")
        if not final and samples.time[-1] <= neutral_until(reading.neutral, float(samples.time[0])):
            raise NotEnoughData
        self._decide(samples, mapper, match, profile, reading, recording.path)
        mapper.begin()
        self._mapper = mapper
        self._gaps = GapCodes(match.stream.kind)
        self._monitor = DecisionMonitor(
            mapper, profile, match.stream.kind, reading.neutral, self._corrections, on_warning
        )
        self._decoder = block_decoder(match.stream, mapper.wanted, self.log)

    def _decide(
        self, samples: Samples, mapper: Mapper, match: Match, profile: Profile, reading: ReadingOptions, path: str
    ) -> None:
        """Decide from the first samples what `reba.readers.build_table` decides from a complete recording."""
        self._corrections = quality_control(samples, mapper, profile, match.stream.kind, reading.neutral)
        reasons = self._corrections.reasons
        self.unmeasured = [column for column in COLUMNS if column in reasons]
        if len(self.unmeasured) == len(COLUMNS):
            why = "; ".join(dict.fromkeys(reasons.values()))
            raise ProfileError(f"{path}: {match.why}, but no angle was measured: {why}; record it again")
        self._offsets: dict[int, float] = {}
        window = parse_neutral(reading.neutral)
        if window is not None:
            # Also raises the error for an interval without a frame.
            mapper.assumed.append(apply_neutral(samples.time, samples.angles.copy(), reading.neutral))
            self._offsets = neutral_offsets(samples.angles[window(samples.time)])
        self.assumed = list(dict.fromkeys(mapper.assumed))
        for text in [*samples.log.warnings, *mapper.warnings]:
            self._on_warning(text)

    @staticmethod
    def _pelvis_follower(
        recording: Recording, match: Match, profile: Profile
    ) -> tuple[PelvisFollower | None, PelvisPose | None]:
        for stream, name in pelvis_streams(recording, match, profile):
            pose = read_pelvis_pose(profile, [(stream, name)], AXES[profile.root_axes])
            if pose is not None:
                return PelvisFollower(pose, stream, name), pose
        return None, None

    def frames_of(self, source: GrowingStore, segment: ChunkRef) -> Iterator[Frames]:
        """Yield the frames that a segment completes."""
        self._decoder.take(source, segment)
        if self.pelvis is not None:
            self.pelvis.add_segment(source, segment)
        block = self._decoder.flush_whole()
        if block is not None:
            self._waiting.append(block)
        yield from self._release()

    def remaining_frames(self) -> Iterator[Frames]:
        """Yield the waiting frames at the end of the source."""
        block = self._decoder.flush(last=True)
        if block is not None:
            self._waiting.append(block)
        yield from self._release(last=True)
        self._monitor.check()

    def _release(self, last: bool = False) -> Iterator[Frames]:
        """Yield the waiting frames, except those whose pose of the pelvis has not arrived."""
        until = np.inf
        if self.pelvis is not None and self._waiting and not last:
            until = self.pelvis.available_until(float(self._waiting[-1].time[-1]) + self._epoch)
        incomplete: list[Block] = []
        for block in self._waiting:
            count = int(np.searchsorted(block.time + self._epoch, until, side="right"))
            if count:
                yield from self._frames(_rows(block, slice(0, count)))
            if count < len(block.time):
                incomplete.append(_rows(block, slice(count, None)))
        self._waiting = incomplete
        if self.pelvis is not None and np.isfinite(self._last):
            self.pelvis.forget(self._last + self._epoch)

    def _frames(self, block: Block) -> Iterator[Frames]:
        if self.pelvis is not None and isinstance(self._mapper, JointMapper):
            self._mapper.root = self.pelvis.pose
        angles: Array = block_angles(self._mapper, self._gaps.without(block))
        increasing = is_later(block.time, self._last)
        if not increasing.all():
            if not self.late:
                self._on_warning(
                    f"time does not increase at {block.time[~increasing][0]:.3f} s; such frames are skipped and counted"
                )
            self.late += int(np.sum(~increasing))
            block, angles = _rows(block, increasing), angles[increasing]
        if not len(block.time):
            return
        self._last = float(block.time[-1])
        self._monitor.add(block.time, angles)
        self._corrections.apply(angles)
        subtract(angles, self._offsets)
        yield Frames(block.time, angles, self.factors)


def _rows(block: Block, rows: slice | Flags) -> Block:
    return replace(block, time=block.time[rows], values=block.values[rows])


MAX_AGE = 60.0
"""[s] Poses of the pelvis that are this much older than the newest one are removed even if a frame waits for them."""
MARGIN = 2.0
"""[s] Poses of the pelvis that are this much older than the oldest waiting frame are removed."""


class PelvisFollower:
    """Pose of the pelvis over time, from the frame `name` of `stream`.

    Args:
        pose: axes and vertical, decided from the first samples.
    """

    def __init__(self, pose: PelvisPose, stream: Stream, name: str) -> None:
        self._poses = FrameTree(stream, (name,))
        self._decoder = block_decoder(stream, self._poses.wanted, ReadLog())
        self._stream, self._name = stream, name
        self.pose = replace(pose, time=np.empty(0), quaternions=np.empty((0, 4)))

    def add_segment(self, source: GrowingStore, segment: ChunkRef) -> None:
        """Add the samples of a segment."""
        self._decoder.take(source, segment)
        block = self._decoder.flush_whole()
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
            self.forget(float(time[-1]) - MAX_AGE)

    def available_until(self, newest: float) -> float:
        """Return the time [s] up to which frames need not wait.

        It is the time of the latest pose, or `HOLD` before the newest waiting frame at `newest` [s].
        """
        last = float(self.pose.time[-1]) if len(self.pose.time) else -np.inf
        return max(last, newest - HOLD)

    def forget(self, before: float) -> None:
        """Remove samples that no frame from time `before` [s] on needs."""
        first = max(int(np.searchsorted(self.pose.time, before - MARGIN)) - 1, 0)
        self.pose = replace(self.pose, time=self.pose.time[first:], quaternions=self.pose.quaternions[first:])


CHECK_SECONDS: Final = 10.0
"""[s] Of the recording between two checks."""
MAX_FRAMES: Final = 1024
"""Frames of the history: all at first, later every second, fourth, ... frame of the recording."""


class DecisionMonitor:
    """Repeats the decisions of the first seconds on a thinned history of angles, and warns once of a different one.

    Args:
        mapper: from samples to angles; it stores the ranges of its joints.
        profile, kind, neutral: as for `reba.readers.quality_control.quality_control`.
        decided: corrections decided from the first seconds.
    """

    def __init__(
        self,
        mapper: Mapper,
        profile: Profile,
        kind: Kind,
        neutral: str,
        decided: Corrections,
        on_warning: Callable[[str], None],
    ) -> None:
        self._mapper, self._profile, self._kind, self._neutral = mapper, profile, kind, neutral
        self._decided = decided
        self._on_warning = on_warning
        self._table = np.empty((MAX_FRAMES, 1 + len(COLUMNS)))
        self._stored = self._added = 0
        self._step = 1
        self._next_check: float | None = None
        self.reported = False

    def add(self, time: Array, angles: Array) -> None:
        """Add (n,) times [s] and (n, 22) uncorrected angles [deg]."""
        if self.reported:
            return
        first = -self._added % self._step
        for at in range(first, len(time), self._step):
            if self._stored == MAX_FRAMES:
                self._table[: MAX_FRAMES // 2] = self._table[::2]
                self._stored, self._step = MAX_FRAMES // 2, self._step * 2
            self._table[self._stored, 0] = time[at]
            self._table[self._stored, 1:] = angles[at]
            self._stored += 1
        self._added += len(time)
        if self._next_check is None:
            self._next_check = float(time[0]) + CHECK_SECONDS
        if time[-1] >= self._next_check:
            self._next_check = float(time[-1]) + CHECK_SECONDS
            self.check()

    def check(self) -> None:
        """Decide again from the history, and report a different decision once."""
        if self.reported or not self._stored:
            return
        mapper = self._mapper_copy()
        before = len(mapper.warnings)
        consistent = mapper.is_consistent()
        corrections = quality_control(
            Samples(self._table[: self._stored].copy(), ReadLog()), mapper, self._profile, self._kind, self._neutral
        )
        if not consistent:
            contradiction = "; ".join(mapper.warnings[before:][:1]) or "the unit or the vertical differs"
        elif shown := set(self._decided.hidden) - set(corrections.hidden):
            name = COLUMNS[min(shown)]
            contradiction = f"{name} counted as not measured ({self._decided.reasons[name]}), but it moves"
        elif hidden := set(corrections.hidden) - set(self._decided.hidden):
            name = COLUMNS[min(hidden)]
            contradiction = f"{name} counted as measured, but it is not ({corrections.reasons[name]})"
        elif corrections.turned != self._decided.turned:
            names = ", ".join(COLUMNS[at] for at in corrections.turned or self._decided.turned)
            contradiction = f"the sign of {names} is the opposite"
        else:
            return
        self.reported = True
        self._on_warning(
            f"later frames contradict the first seconds: {contradiction}; give a longer --settle, or use `reba score`, "
            "which decides from the complete recording"
        )

    def _mapper_copy(self) -> Mapper:
        """Return a copy of the mapper: a decision changes its state. Profile, stream and root are shared."""
        shared = [getattr(self._mapper, name, None) for name in ("profile", "stream", "root")]
        return copy.deepcopy(self._mapper, {id(value): value for value in shared if value is not None})
