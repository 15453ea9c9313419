"""Standard definitions of well-known ROS types, for recordings that have none.

rosbag2 wrote no definitions into its databases up to Humble, and writes an empty one into MCAP where it does not find
the package of a type. Source: https://github.com/ros2/common_interfaces, https://github.com/ros/common_msgs.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

_HEADER: Final = {
    False: "builtin_interfaces/Time stamp\nstring frame_id",
    True: "uint32 seq\ntime stamp\nstring frame_id",
}
"""Header of ROS 2 and (True) of ROS 1."""
_PARTS: Final[Mapping[str, str]] = {
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"
    ),
    "std_msgs/ColorRGBA": "float32 r\nfloat32 g\nfloat32 b\nfloat32 a",
    "sensor_msgs/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data",
    "visualization_msgs/UVCoordinate": "float32 u\nfloat32 v",
    "visualization_msgs/MeshFile": "string filename\nuint8[] data",
}
_DURATION: Final = {False: "builtin_interfaces/Duration", True: "duration"}
_MARKER: Final = (
    "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n"
    "geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\n{duration} lifetime\nbool frame_locked\n"
    "geometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\n{texture}string text\nstring mesh_resource\n"
    "{mesh}bool mesh_use_embedded_materials"
)
_TEXTURE: Final = (
    "string texture_resource\nsensor_msgs/CompressedImage texture\nvisualization_msgs/UVCoordinate[] uv_coordinates\n"
)
_SINCE_HUMBLE: Final = {"texture": _TEXTURE, "mesh": "visualization_msgs/MeshFile mesh_file\n"}
"""Fields that were added to the Marker."""
_BEFORE: Final = {"texture": "", "mesh": ""}
_TYPES: Final[Mapping[str, str]] = {
    "sensor_msgs/JointState": (
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort"
    ),
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "tf/tfMessage": "geometry_msgs/TransformStamped[] transforms",
    "geometry_msgs/TransformStamped": _PARTS["geometry_msgs/TransformStamped"],
    "sensor_msgs/CompressedImage": _PARTS["sensor_msgs/CompressedImage"],
    "geometry_msgs/PoseArray": "std_msgs/Header header\ngeometry_msgs/Pose[] poses",
    "visualization_msgs/Marker": _MARKER,
    "visualization_msgs/MarkerArray": "visualization_msgs/Marker[] markers",
}


def standard_definitions(name: str, *, ros1: bool) -> list[str]:
    """Return the definitions that a type had, the newest first, each followed by those that it needs.

    Args:
        name: package and type, "sensor_msgs/JointState".
        ros1: whether of ROS 1.

    >>> standard_definitions("sensor_msgs/JointState", ros1=False)[0].splitlines()[:2]
    ['std_msgs/Header header', 'string[] name']
    >>> standard_definitions("my_msgs/Skeleton", ros1=False)
    []
    """
    if name not in _TYPES:
        return []
    changed = not ros1 and name.startswith("visualization_msgs/")
    return [_text(name, fields, ros1) for fields in (_SINCE_HUMBLE, _BEFORE)[0 if changed else 1 :]]


def _text(name: str, added: Mapping[str, str], ros1: bool) -> str:
    marker = _MARKER.format(duration=_DURATION[ros1], **added)
    parts = {"std_msgs/Header": _HEADER[ros1], **_PARTS, "visualization_msgs/Marker": marker}
    first = marker if name == "visualization_msgs/Marker" else _TYPES[name]
    rest = "".join(f"\n{'=' * 80}\nMSG: {part}\n{text}" for part, text in parts.items() if part != name)
    return first + rest
