"""Recording: streams of named signals over time, before a profile states their meaning.

A reader turns a file into streams. A stream is one source of named signals of one kind; it is read block by block, so
that memory does not grow with the duration. `profile` states the meaning of the names, `mapping` turns each block into
posture angles.

    bytes -> reader -> Stream -> blocks -> mapping(profile) -> posture table
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.readers.recording.row_times import row_times

if TYPE_CHECKING:
    import pandas as pd


Kind = Literal["joints", "frames", "points", "angles"]
"""joints: one number per name (joint coordinate, in `Stream.unit`).
frames: a pose per name: x y z [m] and the quaternion qx qy qz qw, relative to the parent named beside it.
points: x y z [m] per name, in one world frame.
angles: columns of the posture table [deg], and factor columns."""
MOST_WARNINGS = 100
"""Largest number of warnings of one recording; a damaged file may cause one for each of its fields."""


class BlockDecoder(Protocol):
    """Decodes a recording that is still being written to blocks, segment by segment of its file.

    `container` and `segment` have types of the reader that made the decoder.

    Attributes:
        newest_log: log time [ns] of the newest message with a wanted signal.
        origins: time [s] and first wanted signal, by its name in the file, of what was decoded; None: not noted.
    """

    newest_log: int
    origins: list[tuple[float, str]] | None

    @property
    def seams(self) -> list[float]:
        """Times [s] of the first message after each restart of the clock so far."""

    @property
    def full(self) -> bool:
        """Whether enough messages are decoded for a block."""

    def take(self, container: Any, segment: Any) -> None:
        """Decode the messages of a segment."""

    def flush(self, *, last: bool = False) -> Block | None:
        """Return the decoded messages as a block, without the newest row unless it is the `last`."""

    def flush_whole(self) -> Block | None:
        """Return the decoded messages as a block, with the newest row only if it has every signal."""

    def go_on(self, before: Any) -> None:
        """Go on where the decoder `before` is: with its time 0, its columns, and what it has not yet returned."""

    def note(self, log: ReadLog) -> None:
        """Count the messages so far in the log of a recording that is being written."""

    def rows(self, container: Any, segment: Any) -> list[dict[str, Any]]:
        """Return the rows of posture tables in a segment, text columns included."""


@dataclass(frozen=True)
class Block:
    """Consecutive samples of a stream.

    Attributes:
        time: (n,) seconds since `Stream.epoch`; normally increasing.
        names: the k signal names of `values`; later blocks may have more.
        values: joints and angles (n, k); points (n, k, 3); frames (n, k, 7). NaN = no value at that time.
        parents: frames only: the parent frame of each name, "" for a pose that is already in the world.
    """

    time: Array
    names: tuple[str, ...]
    values: Array
    parents: tuple[str, ...] = ()


MESSAGES = ("mcap", "bag", "db3")
"""Formats of recordings of messages, whose streams have a common start."""
LOST_HINT = "copy the recording again, or read it without strict to use the rest"


@dataclass
class ReadLog:
    """Counts and notes of a reading; filled by readers, shown by `reba info` and in every report.

    Attributes:
        messages: samples or messages of the stream, usable or not.
        skipped: of these, those that could not be decoded or had no usable value.
        first_skipped: place and reason of the first one ("byte 676: string length 12 exceeds the message").
        lost: None, or what the recording states to have and does not; also a warning.
        ended_abnormally: None, or where the recording is truncated ("inside a chunk at byte 81920 of 81920").
        time_source: "header.stamp", "log_time", "file", "frame rate" ...
        time_why: why another time than the first choice is used, "" if that is.
        unused: reason -> decoded messages that were not used, see `UNUSED`.
        times: gets the times [s] of the messages with a signal that is read, where a list is given; else None.
    """

    messages: int = 0
    skipped: int = 0
    first_skipped: str | None = None
    lost: str | None = None
    ended_abnormally: str | None = None
    time_source: str = ""
    time_why: str = ""
    warnings: list[str] = field(default_factory=list)
    unused: Counter[str] = field(default_factory=Counter)
    times: list[Array] | None = None

    def account(self) -> dict[str, Any]:
        """Return messages read, used and not used by reason; the last two add up to the first."""
        reasons = {"undecodable": self.skipped, **{reason: self.unused[reason] for reason in UNUSED}}
        unused = {reason: count for reason, count in reasons.items() if count}
        return {"read": self.messages, "used": self.messages - sum(unused.values()), "not_used": unused}

    def skip(self, count: int, where: str) -> None:
        """Count messages without usable value and store the place of the first one."""
        if count > 0 and self.first_skipped is None:
            self.first_skipped = where
        self.skipped += count

    def lose(self, text: str) -> None:
        """Note data that the recording states to have and does not; a strict reading refuses it."""
        self.lost = self.lost or text
        self.warn(text)

    def warn(self, text: str) -> None:
        """Note a warning once; of more than `MOST_WARNINGS` the rest is left out."""
        if len(self.warnings) < MOST_WARNINGS and text not in self.warnings:
            self.warnings.append(text if len(self.warnings) < MOST_WARNINGS - 1 else "further warnings are left out")


UNUSED = {
    "repeated_time": "repeat the time of another",
    "no_time": "have no time",
    "first_frame": "are a first frame that is an outlier",
    "other_body": "are of another body",
    "other_signals": "have no signal of the profile",
    "outside_interval": "are outside the interval asked for",
}
"""Reason -> why decoded messages are not used, to complete a sentence."""
ASKED_FOR = "outside_interval"
"""Reason that the caller gave."""
LOST = ("undecodable", "repeated_time", "no_time")
"""Reasons that lose what was recorded; the others leave out what is not of the person."""
JOINED = " + "
"""Between the names of streams that were joined to one."""
LogTimes = Callable[[Array, frozenset[str]], tuple[NDArray[np.int64], NDArray[np.int64]]]
BlockReader = Callable[[ReadLog, Sequence[str] | None], Iterator[Block]]


@dataclass(frozen=True)
class Stream:
    """One source of named signals in a recording.

    Attributes:
        name: topic, or the file's stem.
        kind: what a value is, see `Kind`.
        format: what was decoded, for messages: "ROS 2 sensor_msgs/JointState (CDR)", "BVH", "OpenSim .mot".
        names: signal names in the first messages (a block may add later ones).
        unit: unit of joints: "rad", "deg" or "" where the file does not state it (then the range decides).
        parents: frames only, as in `Block`.
        epoch: Unix time [s] of time 0, or 0.0 where the file does not state it.
        count: number of samples if known without reading, else None.
        total: messages of all its signals; 0 where `count` has them.
        up: "x", "y", "z", "-y" ... if the format defines the vertical axis, else "" (the mapping determines it).
        rest: frames only: (k, 7) pose of each frame in its parent when all rotations are zero (BVH offsets), else None.
        read: `read(log, names)` iterates over blocks; `names` limits the signals (None: all).
        seams: times [s] of the first sample after each restart of the clock; no interval reaches across them.
        present: name -> intervals [s since the start of the recording] in which it is there; empty: always.
        messages: name -> messages that have it; empty: all have.
        join: `join(other -> name, streams)` makes the stream of this and other streams of the recording, in which
            signals have the names of others, never there at once.
        reader: what made it, for `join`.
        follow: makes the decoder of a recording that is still being written (MCAP), see `reba.live`.
        logged: log and publish times [ns] of the messages that rows come from, by their (n,) increasing times [s] and
            the signals that they were made of.
        static: topic of transforms that hold until the next one -> its reading.
        table: angles only: the complete table, `time` in seconds since `epoch`, text and bool factor columns included.
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
    total: int = 0
    up: str = ""
    rest: Array | None = None
    table: Callable[[], pd.DataFrame] | None = None
    follow: Callable[[ReadLog, Sequence[str] | None], BlockDecoder] | None = None
    seams: tuple[float, ...] = ()
    present: Mapping[str, Sequence[tuple[float, float]]] = field(default_factory=dict)
    messages: Mapping[str, int] = field(default_factory=dict)
    join: Callable[[Mapping[str, str], Sequence[Stream]], Stream] | None = None
    reader: Any = None
    logged: LogTimes | None = None
    static: Mapping[str, ReadLog] = field(default_factory=dict)

    @property
    def topics(self) -> list[str]:
        """Names of the streams that it was joined of, or its own."""
        return self.name.split(JOINED)

    def blocks(self, log: ReadLog | None = None, names: Sequence[str] | None = None) -> Iterator[Block]:
        """Iterate over the samples in time order, block by block."""
        return self.read(log if log is not None else ReadLog(), names)


def stream_called(streams: Sequence[Stream], name: str) -> Stream | None:
    """Return the stream of a name, joined where it is the name of several; None without it."""
    by_name = {stream.name: stream for stream in streams}
    several = [by_name.get(part) for part in name.split(JOINED)]
    first, *others = several if name not in by_name else [by_name[name]]
    if not others or first is None or first.join is None:
        return first
    there = [stream for stream in others if stream is not None and stream.kind == first.kind]
    return first.join({}, there) if len(there) == len(others) else None


@dataclass(frozen=True)
class Topic:
    """One line of `reba info`: a topic or signal group with its `count` of messages or samples, None if unknown.

    `usable`: a stream was made of it. `why` says what it contains, or why it is not used.
    """

    name: str
    type: str
    count: int | None
    usable: bool
    why: str


@dataclass(frozen=True)
class Recording:
    """An opened file or folder with its streams.

    Attributes:
        format: name of the reader: "mcap", "bag", "db3", "bvh", "csv" ...
        streams: candidates for scoring, in file order.
        topics: every topic or signal group, for `reba info`.
        log: notes made on opening (truncated, no summary ...).
        hint: what to do where no profile fits, "" for the usual.
        files: paths of a recording that was given as a list of files, else empty.
        scored: what a file of scores was written with, None for others.
    """

    path: str
    format: str
    streams: tuple[Stream, ...]
    topics: tuple[Topic, ...] = ()
    log: ReadLog = field(default_factory=ReadLog)
    hint: str = ""
    files: tuple[str, ...] = ()
    scored: Mapping[str, Any] | None = None


BLOCK = 20_000
"""Samples in a block: a few tens of MB for all segments of a body."""
Values = Callable[[slice], Array]


def array_stream(
    name: str,
    kind: Kind,
    format: str,
    names: Sequence[str],
    time: Array,
    values: Array | Values,
    *,
    opened: ReadLog,
    **more: Any,
) -> Stream:
    """Return a stream of k signals at times (n,) [s], as they stand in the rows, in blocks of `BLOCK` samples.

    Rows whose time is damaged or absent are left out, and counted.

    Args:
        values: (n, k) or (n, k, 3) or (n, k, 7) as in `Block`, or a function from a slice of samples to them.
        opened: notes made on opening; every reading starts with them.
        more: further fields of `Stream`.
    """
    signals = tuple(names)
    clock = row_times(time)
    time = clock.time
    timed = np.isfinite(time)
    count = int(np.count_nonzero(timed))
    for note in clock.notes:
        opened.warn(note)
    parents: tuple[str, ...] = more.get("parents", ())

    def read(log: ReadLog, wanted: Sequence[str] | None) -> Iterator[Block]:
        columns = list(range(len(signals)))
        if wanted is not None:
            chosen = set(wanted)
            columns = [index for index, signal in enumerate(signals) if signal in chosen]
        log.messages += len(time) + opened.skipped
        log.skip(opened.skipped, opened.first_skipped or "")
        log.unused["no_time"] += len(time) - count
        log.ended_abnormally = log.ended_abnormally or opened.ended_abnormally
        log.time_source = opened.time_source
        for warning in opened.warnings:
            log.warn(warning)
        for start in range(0, len(time), BLOCK):
            part = slice(start, start + BLOCK)
            all_values = values(part) if callable(values) else values[part]
            known = timed[part]
            if not known.all():
                all_values = all_values[known]
            yield Block(
                time[part][known],
                tuple(signals[index] for index in columns),
                all_values if wanted is None else all_values[:, columns],
                tuple(parents[index] for index in columns) if parents else (),
            )

    if count:
        first, last = float(np.nanmin(time)), float(np.nanmax(time))
        more.setdefault("present", dict.fromkeys(signals, ((first, last),)))
    return Stream(name, kind, format, signals, read, count=count, seams=clock.seams, **more)


def unique_names(names: Sequence[str], log: ReadLog) -> tuple[str, ...]:
    """Return the names with `_2`, `_3` ... appended to repeated ones, and note it.

    >>> unique_names(["hip", "knee", "hip"], ReadLog())
    ('hip', 'knee', 'hip_2')
    """
    taken = set(names)
    seen: dict[str, int] = {}
    result = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        unique = name
        if seen[name] > 1:
            while unique in taken:
                unique = f"{name}_{seen[name]}"
                seen[name] += unique in taken
            taken.add(unique)
            log.warn(f"the name {clip(name)} occurs more than once; the later one is called {clip(unique)}")
        result.append(unique)
    return tuple(result)


def clip(text: str, length: int = 40) -> str:
    """Return the text for a message: quoted, on one line and shortened.

    >>> clip("a" * 50, 8)
    "'aaaaaaaa...'"
    """
    return repr(text if len(text) <= length else text[:length] + "...")
