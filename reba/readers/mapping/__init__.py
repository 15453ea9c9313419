"""One stream and one profile -> posture angles, block by block."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from reba.arrays import Array
from reba.posture.angles import SegmentFrames, posture_angles
from reba.posture.columns import INDEX
from reba.readers.mapping.frame_table import Frames, MemoryFrames
from reba.readers.mapping.gap_codes import GapCodes
from reba.readers.mapping.joints import JointMapper
from reba.readers.mapping.markers import PointMapper
from reba.readers.mapping.reference_frames import PelvisPose
from reba.readers.mapping.segments import FrameMapper
from reba.readers.recording.profile import Profile
from reba.readers.recording.stream import Block, ReadLog, Stream

Names = Mapping[str, tuple[str, ...]]
"""Joint, segment or point of a profile -> its signals in a stream."""


class Mapper(Protocol):
    """Converts blocks of one kind of stream to segment frames: `joints`, `segments`, `markers`.

    `wanted` are the signals that it reads; `assumed` and `warnings` are sentences for the user.
    """

    wanted: tuple[str, ...]
    assumed: list[str]
    warnings: list[str]

    def begin(self) -> None:
        """Start a pass over the recording."""

    def segment_frames(self, block: Block) -> SegmentFrames:
        """Return the segment frames (n, 3, 3) of a block of n samples."""

    def is_consistent(self) -> bool:
        """Return whether unit, vertical and sides fit all samples; if not, they are changed for another pass."""

    def unmeasured_columns(self, seconds: float) -> dict[str, str]:
        """Return the columns that no signal of the recording measures -> the reason."""


def mapper_for(profile: Profile, names: Names, stream: Stream, root: PelvisPose | None = None) -> Mapper:
    """Return the mapper of a profile's kind for a stream that has `names`."""
    if profile.kind == "points":
        return PointMapper(profile, names, stream)
    single = {slot: signals[0] for slot, signals in names.items()}
    if profile.kind == "frames":
        return FrameMapper(profile, single, stream)
    return JointMapper(profile, single, stream, root)


def extend(mapper: Mapper, names: Names, stream: Stream) -> None:
    """Let a mapper go on with a stream that has further `names`, or known ones in other parents."""
    if isinstance(mapper, PointMapper):
        mapper.extend(names, stream)
    elif isinstance(mapper, JointMapper | FrameMapper):
        mapper.extend({slot: signals[0] for slot, signals in names.items()}, stream)


def block_angles(mapper: Mapper, block: Block) -> Array:
    """Return the (n, 22) angles [deg] of a block, to 1e-9 deg.

    Rounding removes the floating-point error of the conversions: a joint recorded at 20 deg in radians lies exactly on
    the edge of its class.
    """
    with np.errstate(invalid="ignore"):
        return np.round(posture_angles(mapper.segment_frames(block), len(block.time)), 9) + 0.0


def obtainable_columns(profile: Profile, names: Names) -> tuple[str, ...]:
    """Return the columns that a profile gives from some signals, by mapping two random samples."""
    if not names:
        return ()
    signals = tuple(dict.fromkeys(signal for group in names.values() for signal in group))
    random = np.random.default_rng(0)
    shape = {"joints": (), "points": (3,), "frames": (7,)}[profile.kind]
    values = random.uniform(0.1, 0.3, (2, len(signals), *shape))
    stream = Stream("", profile.kind, "", signals, lambda log, wanted: iter(()), up="z")
    mapper = mapper_for(profile, names, stream)
    mapper.begin()
    angles = block_angles(mapper, Block(np.zeros(2), signals, values, ("",) * len(signals)))
    hidden = {*profile.cannot, *mapper.unmeasured_columns(0.0)}
    return tuple(
        column for column, index in INDEX.items() if np.isfinite(angles[:, index]).any() and column not in hidden
    )


def measurable_columns(profile: Profile) -> tuple[str, ...]:
    """Return the columns of the posture table that a profile gives where all its names are recorded."""
    return obtainable_columns(profile, profile.slots)


PASSES = 3
"""Readings of a recording: unit, vertical or sides may differ from what the first frames suggest."""


@dataclass
class Samples:
    """Time [s] and 22 angles [deg] of a recording as a `table` (n, 23), with the `log` of its reader."""

    table: Array
    log: ReadLog

    @property
    def time(self) -> Array:
        """(n,) [s], a view."""
        return self.table[:, 0]

    @property
    def angles(self) -> Array:
        """(n, 22) [deg], a view."""
        return self.table[:, 1:]

    @property
    def seconds(self) -> float:
        """Duration of the recording [s]."""
        return float(self.table[-1, 0] - self.table[0, 0]) if len(self.table) else 0.0


def collect(stream: Stream, mapper: Mapper) -> Samples:
    """Read a stream to its end and return its angles, sorted by time, each time once."""
    frames = MemoryFrames()
    log = collect_into(frames, stream, mapper)
    return Samples(frames.table, log)


def collect_into(frames: Frames, stream: Stream, mapper: Mapper, times: list[Array] | None = None) -> ReadLog:
    """Read a stream to its end into `frames`, and return the log of its reader.

    Args:
        times: gets the times [s] of the messages that were used.
    """
    gaps = GapCodes(stream.kind)
    log = _pass(frames, stream, mapper, gaps, times)
    for _ in range(PASSES - 1):
        if all([gaps.is_consistent(), mapper.is_consistent()]):
            break
        log = _pass(frames, stream, mapper, gaps, times)
    gaps.note(log)
    frames.end(log)
    return log


def _pass(frames: Frames, stream: Stream, mapper: Mapper, gaps: GapCodes, times: list[Array] | None = None) -> ReadLog:
    log = ReadLog(times=times)
    if times is not None:
        times.clear()
    mapper.begin()
    gaps.begin()
    frames.begin(stream.count or 0)
    for block in stream.blocks(log, mapper.wanted):
        frames.append(block.time, block_angles(mapper, gaps.without(block)))
    return log
