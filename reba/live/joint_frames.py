"""Joint angles or segment poses of a person as they arrive -> postures, as decided from the first seconds."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from reba.arrays import Array, Flags
from reba.errors import ProfileError, ReadError, join_names
from reba.live.decision_monitor import DecisionMonitor
from reba.live.frames import Frames, NotEnoughData, ReadingOptions, is_later, neutral_until
from reba.live.sources import block_decoder
from reba.posture.columns import COLUMNS
from reba.posture.factors import Factors
from reba.readers.build_table import pelvis_streams
from reba.readers.mapping import (
    Mapper,
    Samples,
    block_angles,
    collect,
    extend,
    mapper_for,
    obtainable_columns,
)
from reba.readers.mapping.gap_codes import GapCodes
from reba.readers.mapping.joints import MOST_NAMES, JointMapper
from reba.readers.mapping.reference_frames import HOLD, FrameTree, PelvisPose, pelvis_samples, read_pelvis_pose
from reba.readers.mapping.segments import AXES
from reba.readers.mcap.store import ChunkRef, Store
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
from reba.readers.recording.stream import Block, ReadLog, Recording, Stream

SHORT = 0.9
"""Share of `ReadingOptions.settle` that the frames of the body must last for the decision."""


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

    unmeasured: list[str]
    assumed: list[str]
    _corrections: Corrections

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
        until = neutral_until(reading.neutral, float(samples.time[0]))
        if not final and (samples.time[-1] <= until or samples.seconds < SHORT * reading.settle):
            raise NotEnoughData
        self._decide(samples, mapper, match, profile, reading, recording.path)
        mapper.begin()
        self._mapper = mapper
        self._gaps = GapCodes(match.stream.kind)
        self._monitor = DecisionMonitor(
            mapper, profile, match.stream.kind, reading.neutral, self._corrections, on_warning
        )
        self.decoder = block_decoder(match.stream, mapper.wanted, self.log)
        self.decoder.origins = []
        self._profile, self._names = profile, dict(match.names or {})

    def renew(self, recording: Recording, match: Match) -> list[str]:
        """Go on with what appeared since the decision: joints, segments, ids, parents, the pelvis.

        Returns:
            What is used from here on, as sentences.
        """
        names = dict(match.names or {})
        before = obtainable_columns(self._profile, self._names)
        gained = [column for column in obtainable_columns(self._profile, names) if column not in before]
        added = [slot for slot in names if slot not in self._names]
        self._names = names
        extend(self._mapper, names, match.stream)
        decoder = block_decoder(match.stream, self._mapper.wanted, ReadLog())
        decoder.go_on(self.decoder)
        decoder.origins = []
        self.decoder = decoder
        self._waiting = [with_gaps(block, self._mapper.wanted) for block in self._waiting]
        reasons = {name: why for name, why in self._corrections.reasons.items() if name not in gained}
        hidden = tuple(at for at in self._corrections.hidden if COLUMNS[at] not in gained)
        self._corrections = replace(self._corrections, hidden=hidden, reasons=reasons)
        self._monitor.go_on(self._corrections)
        self.unmeasured = [column for column in self.unmeasured if column not in gained]
        texts = [f"{join_names(added, MOST_NAMES)} appear: {join_names(gained, MOST_NAMES)} measured"] if gained else []
        return texts + self._renew_pelvis(recording, match)

    def _renew_pelvis(self, recording: Recording, match: Match) -> list[str]:
        if self.pelvis is None:
            self.pelvis, pose = self._pelvis_follower(recording, match, self._profile)
            return [f"{pose.assumed}; it was assumed upright"] if pose is not None else []
        for stream, name in pelvis_streams(recording, match, self._profile)[:1]:
            self.pelvis.renew(stream, name)
        return []

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

    def frames_of(self, source: Store, segment: ChunkRef) -> Iterator[Frames]:
        """Yield the frames that a segment completes."""
        self.decoder.take(source, segment)
        self.decoder.note(self.log)
        if self.pelvis is not None:
            self.pelvis.add_segment(source, segment)
        block = self.decoder.flush_whole()
        if block is not None:
            self._waiting.append(block)
        yield from self._release()

    def remaining_frames(self) -> Iterator[Frames]:
        """Yield the waiting frames at the end of the source."""
        block = self.decoder.flush(last=True)
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

    def renew(self, stream: Stream, name: str) -> None:
        """Go on with a frame of the pelvis in a stream with further frames or parents."""
        self._poses, self._stream, self._name = FrameTree(stream, (name,)), stream, name
        decoder = block_decoder(stream, self._poses.wanted, ReadLog())
        decoder.go_on(self._decoder)
        self._decoder = decoder

    def add_segment(self, source: Store, segment: ChunkRef) -> None:
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


def with_gaps(block: Block, names: Sequence[str]) -> Block:
    """Return a block with gaps for the names that it lacks: its samples are from before they appeared."""
    absent = tuple(name for name in names if name not in block.names)
    if not absent:
        return block
    gaps = np.full((len(block.time), len(absent), *block.values.shape[2:]), np.nan)
    parents = (*block.parents, *("",) * len(absent)) if block.parents else ()
    return Block(block.time, (*block.names, *absent), np.concatenate([block.values, gaps], axis=1), parents)
