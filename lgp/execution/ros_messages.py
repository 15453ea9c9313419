"""ROS 2 messages of the log of a run: definitions, values as plain data, and their CDR serialisation.

Definitions: sensor_msgs, trajectory_msgs, tf2_msgs, geometry_msgs and std_msgs of ROS 2 (Apache-2.0), comments left
out; concatenated as https://mcap.dev/spec/registry#ros2msg asks for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, Final

import numpy as np

from lgp.execution.trajectory import JointTrajectory
from reba.arrays import Array, Indices
from reba.extras import missing

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
"""[s] Time between points of a trajectory."""


def joint_state_message(stamp: int, names: Sequence[str], position: Array) -> dict[str, Any]:
    """Return a sensor_msgs/JointState; `stamp` in nanoseconds since 1970, positions [rad, m]."""
    return {
        "header": _header(stamp, ""),
        "name": list(names),
        "position": np.asarray(position).tolist(),
        "velocity": [],
        "effort": [],
    }


def transforms_message(stamp: int, poses: Mapping[str, tuple[Array, Array]]) -> dict[str, Any]:
    """Return a tf2_msgs/TFMessage of frames in the world: rotations (3, 3), positions (3,) [m]."""
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


def trajectory_message(
    stamp: int, names: Sequence[str], trajectory: JointTrajectory, columns: Indices
) -> dict[str, Any]:
    """Return a trajectory_msgs/JointTrajectory of some joints, with velocities and accelerations, every `STEP`."""
    count = max(int(np.ceil(trajectory.duration / STEP)), 1)
    times = np.linspace(0.0, trajectory.duration, count + 1)
    return {
        "header": _header(stamp, ""),
        "joint_names": list(names),
        "points": [
            {
                "positions": trajectory.at(t)[columns].tolist(),
                "velocities": trajectory.velocity(t)[columns].tolist(),
                "accelerations": trajectory.acceleration(t)[columns].tolist(),
                "effort": [],
                "time_from_start": _seconds(round(t * 1e9)),
            }
            for t in times
        ],
    }


def quaternion(rotation: Array) -> Array:
    """Return the quaternion x, y, z, w of a rotation (3, 3)."""
    import pinocchio as pin

    return np.asarray(pin.Quaternion(np.ascontiguousarray(rotation)).coeffs())


def _header(stamp: int, frame: str) -> dict[str, Any]:
    return {"stamp": _seconds(stamp), "frame_id": frame}


def _seconds(nanoseconds: int) -> dict[str, int]:
    return {"sec": nanoseconds // 1_000_000_000, "nanosec": nanoseconds % 1_000_000_000}


def encode(kind: str, value: dict[str, Any]) -> bytes:
    """Return a message of a type in `DEFINITIONS` in CDR (little-endian), as ROS 2 serialises it.

    >>> encode("tf2_msgs/msg/TFMessage", {"transforms": []})
    b'\\x00\\x01\\x00\\x00\\x00\\x00\\x00\\x00'
    """
    return encoder(kind)(value)


@cache
def encoder(kind: str) -> Callable[[dict[str, Any]], bytes]:
    """Return the CDR serialiser of a type in `DEFINITIONS`.

    Raises:
        LgpError: mcap-ros2-support is not installed.
    """
    try:
        from mcap_ros2._dynamic import serialize_dynamic  # what `mcap_ros2.writer.Writer` encodes with
    except ImportError as error:
        raise missing("mcap_ros2", "the log of a run") from error
    return serialize_dynamic(kind, DEFINITIONS[kind])[kind]
