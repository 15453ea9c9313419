"""Writes JointState and TFMessage to an MCAP file laid out as `ros2 bag record` lays it out (zstd chunks, CDR)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType

from mcap.writer import CompressionType, Writer
from numpy.typing import ArrayLike
from ros2_messages import (
    JOINT_STATE_NAME,
    JOINT_STATE_TEXT,
    TF_MESSAGE_NAME,
    TF_MESSAGE_TEXT,
    Transform,
    joint_state,
    tf_message,
)

TEXTS = {JOINT_STATE_NAME: JOINT_STATE_TEXT, TF_MESSAGE_NAME: TF_MESSAGE_TEXT}


class Ros2Bag:
    """An MCAP file under construction; messages get their stamp as log and publish time.

    Args:
        path: file to write.
        library: what the MCAP header names as the writer.

    Example:
        >>> with Ros2Bag(Path("walk.mcap"), "example") as bag:          # doctest: +SKIP
        ...     bag.joints("/joint_states", 0, ["left_knee_Z"], [0.5])
    """

    def __init__(self, path: Path, library: str) -> None:
        self._stream = path.open("wb")
        self._writer = Writer(self._stream, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library=library)
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[int, int] = {}

    def __enter__(self) -> Ros2Bag:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._writer.finish()
        self._stream.close()

    def joints(
        self, topic: str, stamp: int, names: Sequence[str], position: ArrayLike, velocity: ArrayLike = ()
    ) -> None:
        """Add a JointState: stamp [ns], positions [rad], velocities [rad/s]."""
        self._add(topic, JOINT_STATE_NAME, stamp, joint_state(stamp, names, position, velocity))

    def transforms(self, topic: str, stamp: int, transforms: Sequence[Transform]) -> None:
        """Add a TFMessage: stamp [ns], poses in metres with the quaternion x y z w."""
        self._add(topic, TF_MESSAGE_NAME, stamp, tf_message(stamp, transforms))

    def note(self, name: str, entries: Mapping[str, str]) -> None:
        """Add an MCAP Metadata record."""
        self._writer.add_metadata(name, dict(entries))

    def _add(self, topic: str, kind: str, stamp: int, data: bytes) -> None:
        channel = self._channel(topic, kind)
        number = self._counts.get(channel, 0)
        self._counts[channel] = number + 1
        self._writer.add_message(channel, stamp, data, stamp, number)

    def _channel(self, topic: str, kind: str) -> int:
        if topic not in self._channels:
            if kind not in self._schemas:
                self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", TEXTS[kind].encode())
            self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[kind])
        return self._channels[topic]
