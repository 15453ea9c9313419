"""The messages of an MCAP recording in other containers, written by the library `rosbags`."""

from __future__ import annotations

import dataclasses
import sqlite3
import sys
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import make_reader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.support.paths import DATASETS

sys.path.insert(0, str(DATASETS))
from palletising import JOINTS
from ros2_bag import Ros2Bag
from ros2_messages import Transform

RATE, EPOCH_NS, SECOND = 50, 1_700_000_000 * 10**9, 10**9
ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
Message = tuple[str, str, int, bytes]
"""Topic, type, log time [ns] and CDR."""


def positions(frames: int) -> np.ndarray:
    """Return (frames, 36) positions [rad] of a person that moves every joint a little and one arm a lot."""
    time = np.arange(frames)[:, None] / RATE
    values = 0.2 * np.sin(2 * np.pi * (0.1 + 0.01 * np.arange(len(JOINTS))) * time)
    values[:, JOINTS.index("right_elbow_Z")] += 0.8
    return values


def write_motion(path: Path, frames: int = 200, passes: int = 1) -> Path:
    """Write the recording that is copied: joint states of human.urdf and the pose of its root.

    Its clock starts again with every further pass, whose elbow is bent less.
    """
    rows = [(index, row - 0.3 * number) for number in range(passes) for index, row in enumerate(positions(frames))]
    with Ros2Bag(path, "tests.support.bag_copies") as bag:
        for index, row in rows:
            stamp = EPOCH_NS + index * SECOND // RATE
            bag.joints("/joint_states", stamp, JOINTS, row)
            root = np.array([0.01 * index, 0, 0.95, 0.7071067811865476, 0, 0, 0.7071067811865476])
            bag.transforms("/tf", stamp, [Transform("map", "middle_pelvis", root)])
    return path


def messages(path: Path) -> Iterator[Message]:
    """Yield the messages of an MCAP file, read by the official reader."""
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages(log_time_order=False):
            assert schema is not None
            yield channel.topic, schema.name, message.log_time, message.data


def as_ros1(message: Any) -> Any:
    """Return a message of ROS 2 as one of ROS 1, whose headers are numbered."""
    if isinstance(message, list):
        return [as_ros1(each) for each in message]
    if not dataclasses.is_dataclass(message):
        return message
    name: str = message.__msgtype__  # type: ignore[attr-defined]
    values = {field.name: as_ros1(getattr(message, field.name)) for field in dataclasses.fields(message)}
    return ROS1.types[name](**({"seq": 7} if name == "std_msgs/msg/Header" else {}), **values)


def to_bag(source: Path | Sequence[Message], path: Path, compression: str = "") -> Path:
    """Copy a recording, or messages, into a ROS 1 bag ("BZ2" or "LZ4" for packed chunks), in several chunks."""
    writer = Writer1(path)
    writer.chunk_threshold = 1 << 16
    if compression:
        writer.set_compression(Writer1.CompressionFormat[compression])
    with writer:
        connections = {}
        for topic, name, time, data in messages(source) if isinstance(source, Path) else source:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, name, typestore=ROS1)
            message = as_ros1(ROS2.deserialize_cdr(data, name))
            writer.write(connections[topic], time, ROS1.serialize_ros1(message, name))
    return path


def to_rosbag2(source: Path | Sequence[Message], folder: Path, plugin: str = "SQLITE3", mode: str = "") -> Path:
    """Copy a recording, or messages, into a rosbag2 folder ("FILE" or "MESSAGE" for packed ones), in their order."""
    writer = Writer2(folder, version=9, storage_plugin=StoragePlugin[plugin])
    if mode:
        writer.set_compression(CompressionMode[mode], CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, name, time, data in messages(source) if isinstance(source, Path) else source:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, name, typestore=ROS2)
            writer.write(connections[topic], time, data)
    return folder


def as_humble(folder: Path) -> Path:
    """Take the definitions from the database of a folder: up to Humble there were none. Return the database."""
    (file,) = folder.glob("*.db3")
    with sqlite3.connect(file) as database:
        database.executescript("DROP TABLE message_definitions; UPDATE schema SET schema_version = 3;")
    database.close()
    return file


COPIES: dict[str, Callable[[Path | Sequence[Message], Path], Path]] = {
    "bag": lambda source, folder: to_bag(source, folder / "a.bag"),
    "bag_bz2": lambda source, folder: to_bag(source, folder / "a.bag", "BZ2"),
    "bag_lz4": lambda source, folder: to_bag(source, folder / "a.bag", "LZ4"),
    "db3_folder": lambda source, folder: to_rosbag2(source, folder / "a"),
    "db3": lambda source, folder: next(to_rosbag2(source, folder / "a").glob("*.db3")),
    "db3_humble": lambda source, folder: as_humble(to_rosbag2(source, folder / "a")),
    "db3_packed_files": lambda source, folder: to_rosbag2(source, folder / "a", mode="FILE"),
    "db3_packed_messages": lambda source, folder: to_rosbag2(source, folder / "a", mode="MESSAGE"),
    "mcap_packed_files": lambda source, folder: to_rosbag2(source, folder / "a", "MCAP", "FILE"),
    "mcap_packed_messages": lambda source, folder: to_rosbag2(source, folder / "a", "MCAP", "MESSAGE"),
}
"""Name -> writer(source, folder) -> the copy."""
