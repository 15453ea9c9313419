"""ROS 2 messages that a run is logged in: their definitions, and values of them as plain data.

Definitions: sensor_msgs, trajectory_msgs, tf2_msgs, geometry_msgs and std_msgs of ROS 2 (Apache-2.0), comments left
out; concatenated as https://mcap.dev/spec/registry#ros2msg asks for.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, Final

import numpy as np

from lgp.execution.trajectory import JointTrajectory
from reba.arrays import Array, Indices
from reba.readers.mcap.ros import Number, RosArray, Struct, Text, Type, parse

_LINE = "\n" + "=" * 80 + "\n"
_HEADER = "MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n"
_TIME = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
_DURATION = "MSG: builtin_interfaces/Duration\nint32 sec\nuint32 nanosec\n"
_VECTOR = "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
_QUATERNION = "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
_TRANSFORM = "MSG: geometry_msgs/Transform\ngeometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"
_STAMPED = (
    "MSG: geometry_msgs/TransformStamped\nstd_msgs/Header header\nstring child_frame_id\n"
    "geometry_msgs/Transform transform\n"
)
_POINT = (
    "MSG: trajectory_msgs/JointTrajectoryPoint\nfloat64[] positions\nfloat64[] velocities\nfloat64[] accelerations\n"
    "float64[] effort\nbuiltin_interfaces/Duration time_from_start\n"
)
JOINT_STATE: Final = "sensor_msgs/msg/JointState"
TRAJECTORY: Final = "trajectory_msgs/msg/JointTrajectory"
TRANSFORMS: Final = "tf2_msgs/msg/TFMessage"
DEFINITIONS: Final[dict[str, str]] = {
    JOINT_STATE: _LINE.join(
        (
            "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
            _HEADER,
            _TIME,
        )
    ),
    TRAJECTORY: _LINE.join(
        (
            "std_msgs/Header header\nstring[] joint_names\ntrajectory_msgs/JointTrajectoryPoint[] points\n",
            _HEADER,
            _TIME,
            _POINT,
            _DURATION,
        )
    ),
    TRANSFORMS: _LINE.join(
        (
            "geometry_msgs/TransformStamped[] transforms\n",
            _STAMPED,
            _HEADER,
            _TIME,
            _TRANSFORM,
            _VECTOR,
            _QUATERNION,
        )
    ),
}
"""Type -> definition."""
STEP = 0.05
"""[s] Between points of a trajectory."""


def joint_state(stamp: int, names: Sequence[str], position: Array) -> dict[str, Any]:
    """Return a joint state; `stamp` in nanoseconds since 1970."""
    return {
        "header": _header(stamp, ""),
        "name": list(names),
        "position": np.asarray(position).tolist(),
        "velocity": [],
        "effort": [],
    }


def transforms(stamp: int, poses: Mapping[str, tuple[Array, Array]]) -> dict[str, Any]:
    """Return poses (rotation (3, 3), position (3,)) of frames in the world."""
    return {
        "transforms": [
            {
                "header": _header(stamp, "world"),
                "child_frame_id": name,
                "transform": {
                    "translation": dict(zip("xyz", position.tolist(), strict=True)),
                    "rotation": dict(zip("xyzw", quaternion(rotation).tolist(), strict=True)),
                },
            }
            for name, (rotation, position) in poses.items()
        ]
    }


def trajectory(stamp: int, names: Sequence[str], segment: JointTrajectory, columns: Indices) -> dict[str, Any]:
    """Return the motion of some joints, from rest to rest, with velocities and accelerations."""
    count = max(int(np.ceil(segment.duration / STEP)), 1)
    times = np.linspace(0.0, segment.duration, count + 1)
    return {
        "header": _header(stamp, ""),
        "joint_names": list(names),
        "points": [
            {
                "positions": segment.at(t)[columns].tolist(),
                "velocities": segment.velocity(t)[columns].tolist(),
                "accelerations": segment.acceleration(t)[columns].tolist(),
                "effort": [],
                "time_from_start": _seconds(round(t * 1e9)),
            }
            for t in times
        ],
    }


def quaternion(rotation: Array) -> Array:
    """Return x, y, z, w of a rotation (3, 3)."""
    import pinocchio as pin

    return np.asarray(pin.Quaternion(np.ascontiguousarray(rotation)).coeffs())


def _header(stamp: int, frame: str) -> dict[str, Any]:
    return {"stamp": _seconds(stamp), "frame_id": frame}


def _seconds(nanoseconds: int) -> dict[str, int]:
    return {"sec": nanoseconds // 1_000_000_000, "nanosec": nanoseconds % 1_000_000_000}


HEADER: Final = b"\x00\x01\x00\x00"
_CODES: Final = {
    "u1": "B", "i1": "b", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "i8": "q", "u8": "Q", "f4": "f", "f8": "d",
}  # fmt: skip


def encode(kind: str, value: dict[str, Any]) -> bytes:
    """Return a message of a type in `messages.DEFINITIONS`.

    Raises:
        KeyError: the type is not there, or a field is missing.

    >>> encode("tf2_msgs/msg/TFMessage", {"transforms": []})
    b'\\x00\\x01\\x00\\x00\\x00\\x00\\x00\\x00'
    """
    body = bytearray()
    _write(_layout(kind), value, body)
    return HEADER + bytes(body)


@cache
def _layout(kind: str) -> Struct:
    return parse(DEFINITIONS[kind], kind)


def _write(kind: Type, value: Any, body: bytearray) -> None:
    if isinstance(kind, Struct):
        for name, inner in kind.fields:
            _write(inner, value[name], body)
    elif isinstance(kind, Number):
        _numbers(kind.code, [value], body)
    elif isinstance(kind, Text):
        text = value.encode() + b"\0"
        _numbers("u4", [len(text)], body)
        body += text
    else:
        _sequence(kind, value, body)


def _sequence(kind: RosArray, value: list[Any], body: bytearray) -> None:
    if kind.length is None:
        _numbers("u4", [len(value)], body)
    if isinstance(kind.element, Number):
        _numbers(kind.element.code, value, body)
    else:
        for item in value:
            _write(kind.element, item, body)


def _numbers(code: str, values: list[Any], body: bytearray) -> None:
    """Write numbers one after the other, the first at a multiple of their size; none need no gap."""
    if values:
        size = int(code[1])
        body += bytes(-len(body) % size)
        body += struct.pack(f"<{len(values)}{_CODES[code]}", *values)
