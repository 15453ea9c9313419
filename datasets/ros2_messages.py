"""The two ROS 2 messages that carry a person, as bytes: sensor_msgs/JointState and tf2_msgs/TFMessage.

The texts are the definitions of ROS 2 common_interfaces and geometry2 (Apache-2.0) without their comments, joined as
rosbag2 joins them ("ros2msg"). The bytes are plain CDR, little endian (OMG DDSI-RTPS 10.5, representation 0x0001):
every number is aligned to its own size, counted from behind the four header bytes, and an empty array of doubles is
its count alone.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

SEPARATOR = "=" * 80
TIME = f"""\
{SEPARATOR}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
HEADER = f"""\
{SEPARATOR}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""
JOINT_STATE_NAME = "sensor_msgs/msg/JointState"
JOINT_STATE_TEXT = f"""\
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{HEADER}{TIME}"""
TF_MESSAGE_NAME = "tf2_msgs/msg/TFMessage"
TF_MESSAGE_TEXT = f"""\
geometry_msgs/TransformStamped[] transforms
{SEPARATOR}
MSG: geometry_msgs/TransformStamped
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
{HEADER}{TIME}{SEPARATOR}
MSG: geometry_msgs/Transform
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
{SEPARATOR}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{SEPARATOR}
MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
"""
NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class Transform:
    """One transform of a TFMessage.

    Attributes:
        parent: frame in which the pose is given.
        child: frame whose pose it is.
        pose: (7,) x y z [m] and the quaternion x y z w.
    """

    parent: str
    child: str
    pose: ArrayLike


class _Cdr:
    """Bytes of one message as they grow."""

    def __init__(self) -> None:
        self._bytes = bytearray()

    def _align(self, size: int) -> None:
        self._bytes.extend(b"\0" * (-len(self._bytes) % size))

    def count(self, value: int) -> None:
        self._align(4)
        self._bytes.extend(struct.pack("<I", value))

    def string(self, text: str) -> None:
        data = text.encode()
        self.count(len(data) + 1)
        self._bytes.extend(data + b"\0")

    def doubles(self, values: ArrayLike) -> None:
        numbers = np.asarray(values, dtype="<f8")
        if numbers.size:
            self._align(8)
            self._bytes.extend(numbers.tobytes())

    def header(self, stamp: int, frame: str) -> None:
        self._align(4)
        self._bytes.extend(struct.pack("<iI", *divmod(stamp, NANOSECONDS)))
        self.string(frame)

    def message(self) -> bytes:
        return b"\x00\x01\x00\x00" + bytes(self._bytes)


def joint_state(
    stamp: int,
    names: Sequence[str],
    position: ArrayLike,
    velocity: ArrayLike = (),
    effort: ArrayLike = (),
    frame: str = "",
) -> bytes:
    """A sensor_msgs/msg/JointState.

    Args:
        stamp: header.stamp [ns since 1970].
        names: the k joint names.
        position: (k,) [rad].
        velocity: (k,) [rad/s] or empty.
        effort: (k,) [N m] or empty.
        frame: header.frame_id.

    >>> len(joint_state(0, ["left_knee_Z"], [0.5]))
    56
    """
    cdr = _Cdr()
    cdr.header(stamp, frame)
    cdr.count(len(names))
    for name in names:
        cdr.string(name)
    for values in (position, velocity, effort):
        cdr.count(np.size(values))
        cdr.doubles(values)
    return cdr.message()


def tf_message(stamp: int, transforms: Sequence[Transform]) -> bytes:
    """A tf2_msgs/msg/TFMessage whose transforms share one stamp [ns since 1970].

    >>> len(tf_message(0, [Transform("map", "pelvis", [0, 0, 1, 0, 0, 0, 1])]))
    100
    """
    cdr = _Cdr()
    cdr.count(len(transforms))
    for transform in transforms:
        cdr.header(stamp, transform.parent)
        cdr.string(transform.child)
        cdr.doubles(transform.pose)
    return cdr.message()
