"""Live signals that jump, pause, change their names or their file, on a clock that advances when it is waited for."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from reba.live.follow import Follower
from reba.live.frames import ReadingOptions
from reba.live.notices import Notice
from reba.live.session import Alert, LiveScorer
from reba.live.sources import GrowingStore, open_growing
from tests.support import mcap_builder as make

START = 1_700_000_000 * 10**9
HZ = 50
NAMES = (
    "left_knee_Z", "middle_lumbar_Z", "middle_cervical_Z", "left_shoulder_Z", "left_elbow_Z", "left_wrist_Z",
    "right_shoulder_Z", "right_elbow_Z", "right_wrist_Z", "right_knee_Z",
)  # fmt: skip
ROBOT = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
TF = "tf2_msgs/msg/TFMessage"


def angles(time: float) -> list[float]:
    """Return the joint angles of `NAMES` [rad] at a time [s]: slow swings that begin at once."""
    return [math.radians(30 + 28 * math.sin(1.3 * time + at)) for at in range(len(NAMES))]


@dataclass(frozen=True)
class Message:
    """A message: log time and time in it [s after the start], content."""

    log: float
    stamp: float
    topic: str
    payload: bytes
    at: float | None = None

    @property
    def written(self) -> float:
        """Seconds after the start at which it is written: the log time, unless `at` says another."""
        return self.log if self.at is None else self.at


def joints(
    log: float, stamp: float | None = None, prefix: str = "", names: Sequence[str] = NAMES, epoch: int = START
) -> Message:
    """Return a joint state of a body with a prefix; its stamp is the log time unless given, after `epoch` [ns]."""
    stamp = log if stamp is None else stamp
    full = dict(zip(NAMES, angles(log), strict=True))
    values = np.array([full.get(name, 0.5) for name in names])
    text = make.joint_state(epoch + round(stamp * 1e9), [prefix + name for name in names], values)
    return Message(log, stamp, "/joint_states", text)


def transform(
    log: float, parent: str, child: str, degrees: float, topic: str = "/tf", stamp: float | None = None
) -> Message:
    """Return a transform that turns about z, behind a quarter turn about x for the pelvis."""
    of = make.TYPES.types
    half = math.radians(degrees) / 2
    root = math.sqrt(0.5)
    x, y, z, w = (0.0, 0.0, math.sin(half), math.cos(half))
    if child.endswith("pelvis"):
        x, y, z, w = root * w, -root * z, root * z, root * w
    placed = of["geometry_msgs/msg/Transform"](
        of["geometry_msgs/msg/Vector3"](0.0, 0.0, 1.0), of["geometry_msgs/msg/Quaternion"](x, y, z, w)
    )
    nanos = START + round((log if stamp is None else stamp) * 1e9)
    one = of["geometry_msgs/msg/TransformStamped"](make.header(nanos, parent), child, placed)
    return Message(log, log, topic, bytes(make.TYPES.serialize_cdr(of[TF]([one]), TF)))


def ticks(first: float, last: float) -> list[float]:
    """Return the times of frames [s] from the first until before the last."""
    return [at / HZ for at in range(round(first * HZ), round(last * HZ))]


class Recorder:
    """Writes messages to a file, one record after the other."""

    def __init__(self, path: Path, *, chunked: bool = False) -> None:
        self._file = path.open("wb")
        self._writer = Writer(self._file, use_chunking=chunked, compression=CompressionType.NONE, chunk_size=20_000)
        self._writer.start(profile="ros2", library="tests")
        self._file.flush()
        self._channels: dict[str, int] = {}

    def write(self, message: Message) -> None:
        """Write a message."""
        if message.topic not in self._channels:
            name = TF if message.topic.startswith("/tf") else make.JOINT_STATE
            schema = self._writer.register_schema(name, "ros2msg", make.definition(name))
            self._channels[message.topic] = self._writer.register_channel(message.topic, "cdr", schema)
        log = START + round(message.log * 1e9)
        self._writer.add_message(self._channels[message.topic], log, message.payload, log)
        self._file.flush()

    def finish(self) -> None:
        """End the file."""
        if not self._file.closed:
            self._writer.finish()
            self._file.close()


Act = Callable[[], Any]
STEP = 0.01
"""[s] By which the clock advances at least."""


@dataclass
class LiveRun:
    """What came out of a run: lines as of the command, without those of the summary, and warnings."""

    lines: list[dict[str, Any]] = field(default_factory=list)
    at: list[float] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    summary: dict[str, Any] = field(default_factory=dict)
    follower: Any = None

    @property
    def scores(self) -> list[dict[str, Any]]:
        """Lines of frames."""
        return [line for line in self.lines if "notice" not in line]

    @property
    def kinds(self) -> list[str]:
        """Kinds of the notices."""
        return [line["notice"]["kind"] for line in self.lines if "notice" in line]

    def notices(self, kind: str) -> list[dict[str, Any]]:
        """Notices of a kind, `at` the monotonic time [s] at which each came."""
        pairs = zip(self.lines, self.at, strict=True)
        return [{"at": at, **line} for line, at in pairs if line.get("notice", {}).get("kind") == kind]


def run(
    path: Path,
    messages: Sequence[Message],
    monkeypatch: pytest.MonkeyPatch,
    *,
    silent_end: float = 0.0,
    chunked: bool = False,
) -> LiveRun:
    """Follow a file to which each message is written at its log time; it ends some time [s] after the last one."""
    recorder = Recorder(path, chunked=chunked)
    acts: list[tuple[float, Act]] = [(message.written, partial(recorder.write, message)) for message in messages]
    acts.append((max(message.written for message in messages) + silent_end, recorder.finish))
    try:
        return follow(open_growing(path, 0.0), acts, monkeypatch)
    finally:
        recorder.finish()


def follow(
    source: GrowingStore, acts: Sequence[tuple[float, Act]], monkeypatch: pytest.MonkeyPatch, until_idle: float = 600.0
) -> LiveRun:
    """Follow a source while something happens at times [s] of a clock that advances when it is waited for."""
    now = 0.0
    plan = sorted(acts, key=lambda pair: pair[0])

    def wait(_: object, seconds: float) -> None:
        nonlocal now
        now += max(seconds, STEP)
        while plan and plan[0][0] <= now + 1e-9:
            plan.pop(0)[1]()

    monkeypatch.setattr(type(source), "wait", wait)
    result = LiveRun()
    scorer = LiveScorer("measured", 10.0, Alert(4, 0.5))
    result.follower = follower = Follower(source, ReadingOptions(), {}, {}, result.warnings.append, lambda: now)
    for item in follower.follow(until_idle):
        lines = [scorer.notice(item)] if isinstance(item, Notice) else scorer.add(item)[0]
        result.lines += lines
        result.at += [now] * len(lines)
    result.summary = scorer.summary(follower.missing)
    return result


def messages_of(path: Path, first: float, last: float) -> list[Message]:
    """Return the messages of a recording that are logged between two times [s] after its start."""
    result: list[Message] = []
    start = 0
    with path.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages():
            start = message.log_time if not result else start
            result.append(Message((message.log_time - start) / 1e9, 0.0, channel.topic, message.data))
    return [message for message in result if first <= message.log < last]


def written(path: Path, messages: Sequence[Message]) -> Path:
    """Write the same messages to a file at once."""
    recorder = Recorder(path)
    for message in sorted(messages, key=lambda message: message.written):
        recorder.write(message)
    recorder.finish()
    return path
