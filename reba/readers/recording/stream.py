"""What a recording holds before any profile gives it meaning: named signals over time, in blocks.

A reader turns a file into streams. A stream is one source of named signals of one kind; it hands out its samples in
blocks so that an hour of recording never stands in memory as a whole. The profile (`profile.py`) says what the names
mean and the mapping (`mapping.py`) turns each block into posture angles.

    bytes -> reader -> Stream -> blocks -> mapping(profile) -> posture table
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

    from reba.readers.mcap.streams import Intake

Kind = Literal["joints", "frames", "points", "angles"]
"""joints: one number per name (joint coordinate, in `Stream.unit`).
frames: a pose per name: x y z [m] and the quaternion qx qy qz qw, relative to the parent named beside it.
points: x y z [m] per name, in one world frame.
angles: columns of the posture table, already in degrees and by their contract names (and factor columns)."""


MOST_WARNINGS = 100
"""Warnings of one recording that are kept; a damaged file can give one for each of its fields."""


@dataclass(frozen=True)
class Block:
    """Consecutive samples of a stream.

    Attributes:
        time: (n,) seconds since `Stream.epoch`; normally increasing, never NaN.
        names: the k signal names of `values`; may grow during a recording when a late joint appears.
        values: joints and angles (n, k); points (n, k, 3); frames (n, k, 7). NaN = no value at that time.
        parents: frames only: the parent frame of each name, "" for a pose that is already in the world.
    """

    time: NDArray[np.float64]
    names: tuple[str, ...]
    values: NDArray[np.float64]
    parents: tuple[str, ...] = ()


@dataclass
class ReadLog:
    """What happened while a recording was read; filled by readers, shown by `reba info` and in every report.

    Attributes:
        messages: samples or messages seen for the stream (good or not).
        skipped: of these, how many could not be decoded or held no usable value.
        first_skipped: where and why the first one was skipped ("byte 676: string length 12 exceeds the message").
        ended_abnormally: None, or how the recording ends ("cut inside a chunk at byte 81920 of 81920").
        time_source: "header.stamp", "log_time", "file", "frame rate" ...
        warnings: other things a user must know, one sentence each.
    """

    messages: int = 0
    skipped: int = 0
    first_skipped: str | None = None
    ended_abnormally: str | None = None
    time_source: str = ""
    warnings: list[str] = field(default_factory=list)

    def skip(self, count: int, where: str) -> None:
        """Count messages that gave nothing and remember where the first one stood."""
        if count > 0 and self.first_skipped is None:
            self.first_skipped = where
        self.skipped += count

    def warn(self, text: str) -> None:
        """Note a warning once, and no more of them than anybody reads."""
        if len(self.warnings) < MOST_WARNINGS and text not in self.warnings:
            self.warnings.append(text if len(self.warnings) < MOST_WARNINGS - 1 else "further warnings are left out")


BlockReader = Callable[[ReadLog, Sequence[str] | None], Iterator[Block]]


@dataclass(frozen=True)
class Stream:
    """One source of named signals in a recording.

    Attributes:
        name: topic, or the file's stem.
        kind: what a value is, see `Kind`.
        format: what was decoded, for people: "ROS 2 sensor_msgs/JointState (CDR)", "BVH", "OpenSim .mot".
        names: signal names known without reading everything (a block may add late ones).
        unit: unit of joints: "rad", "deg" or "" where the file does not say (the mapping then decides from the data).
        parents: frames only, as in `Block`.
        epoch: Unix time [s] of time 0, or 0.0 where the file does not say.
        count: number of samples if known without reading, else None.
        up: "x", "y", "z", "-y" ... if the format fixes the vertical axis, else "" (found from the body).
        rest: frames only: (k, 7) pose of each frame in its parent when all rotations are zero (BVH offsets), else None.
        read: `read(log, names)` iterates over blocks; `names` limits the signals (None: all).
        follow: takes the segments of a recording one by one as they are written (MCAP), see `reba.live`.
        table: angles only: the whole table, `time` in seconds since `epoch`, text and bool factor columns included.
    """

    name: str
    kind: Kind
    format: str
    names: tuple[str, ...]
    read: BlockReader
    unit: Literal["rad", "deg", ""] = ""
    parents: tuple[str, ...] = ()
    epoch: float = 0.0
    count: int | None = None
    up: str = ""
    rest: NDArray[np.float64] | None = None
    table: Callable[[], pd.DataFrame] | None = None
    follow: Callable[[ReadLog, Sequence[str] | None], Intake] | None = None

    def blocks(self, log: ReadLog | None = None, names: Sequence[str] | None = None) -> Iterator[Block]:
        """Iterate over the samples in time order, block by block."""
        return self.read(log if log is not None else ReadLog(), names)


@dataclass(frozen=True)
class Topic:
    """One line of `reba info`: a topic or signal group of a file, usable or not, and why.

    Attributes:
        name: topic or group name.
        type: message type or format.
        count: messages or samples, None if unknown.
        usable: whether a stream was made of it.
        why: what it was taken for, or why it was left out.
    """

    name: str
    type: str
    count: int | None
    usable: bool
    why: str


@dataclass(frozen=True)
class Recording:
    """An opened file: its streams and everything else it holds.

    Attributes:
        path: the file or folder given.
        format: "mcap", "bvh", "csv" ... (the name of the reader).
        streams: candidates for scoring, in file order.
        topics: every topic or signal group, for `reba info`.
        log: what was noticed on opening (abnormal end, missing summary ...).
    """

    path: str
    format: str
    streams: tuple[Stream, ...]
    topics: tuple[Topic, ...] = ()
    log: ReadLog = field(default_factory=ReadLog)
