"""Types of messages with postures -> what they contain, and the function that extracts it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from reba.posture.columns import COLUMNS
from reba.readers.mcap.extract import (
    TEXTS,
    Extractor,
    extract_angles,
    extract_joints,
    extract_links,
    extract_transforms,
)
from reba.readers.mcap.extract_points import MARKER_FIELDS, SCENE_FIELDS, extract_markers, extract_poses, extract_scene
from reba.readers.recording.stream import Kind


@dataclass(frozen=True)
class Meaning:
    """What messages of a type contain.

    Attributes:
        fixed: fields whose value determines what the numbers mean, so that it belongs to the layout of a message.
    """

    kind: Kind
    extract: Extractor
    fixed: frozenset[str] = TEXTS


_JOINTS: Final = Meaning("joints", extract_joints)
_FRAMES: Final = Meaning("frames", extract_transforms)
_LINKS: Final = Meaning("frames", extract_links)
_MARKERS: Final = Meaning("points", extract_markers, MARKER_FIELDS)
_POSES: Final = Meaning("points", extract_poses)
_SCENE: Final = Meaning("points", extract_scene, SCENE_FIELDS)
_ANGLES: Final = Meaning("angles", extract_angles)
MEANINGS: Final[Mapping[str, Meaning]] = {
    "sensor_msgs/JointState": _JOINTS,
    "foxglove/JointState": _JOINTS,
    "foxglove/JointStates": _JOINTS,
    "foxglove_msgs/JointState": _JOINTS,
    "foxglove_msgs/JointStates": _JOINTS,
    "tf2_msgs/TFMessage": _FRAMES,
    "tf/tfMessage": _FRAMES,
    "geometry_msgs/TransformStamped": _FRAMES,
    "foxglove/FrameTransform": _FRAMES,
    "foxglove/FrameTransforms": _FRAMES,
    "foxglove_msgs/FrameTransform": _FRAMES,
    "foxglove_msgs/FrameTransforms": _FRAMES,
    "xsens_mvn_msgs/LinkStateArray": _LINKS,
    "xsens_mvn_ros2_msgs/LinkStateArray": _LINKS,
    "xsens_mvn_ros_msgs/LinkStateArray": _LINKS,
    "xsens_awinda_ros/LinkStateArray": _LINKS,
    "visualization_msgs/Marker": _MARKERS,
    "visualization_msgs/MarkerArray": _MARKERS,
    "geometry_msgs/PoseArray": _POSES,
    "foxglove/PosesInFrame": _POSES,
    "foxglove_msgs/PosesInFrame": _POSES,
    "foxglove/SceneUpdate": _SCENE,
    "foxglove_msgs/SceneUpdate": _SCENE,
    "reba/Posture": _ANGLES,
    "reba_msgs/Scores": _ANGLES,
}
"""Type by `type_key` -> meaning. LinkStateArray: https://github.com/hrii-iit/xsens_mvn_ros."""


def type_key(name: str) -> str:
    """Return the package and name of a type, however ROS, DDS, IDL or protobuf write it.

    >>> type_key("sensor_msgs/msg/JointState"), type_key("sensor_msgs::msg::dds_::JointState_")
    ('sensor_msgs/JointState', 'sensor_msgs/JointState')
    >>> type_key("foxglove.JointStates"), type_key("foxglove::JointStates")
    ('foxglove/JointStates', 'foxglove/JointStates')
    """
    parts = re.split(r"/|::|\.", name)
    if "dds_" in parts:
        parts[-1] = parts[-1].removesuffix("_")
    return "/".join(part for part in parts if part not in ("msg", "dds_"))


def meaning_of(name: str) -> Meaning | None:
    """Return what messages of a type contain, None for types without postures."""
    return MEANINGS.get(type_key(name))


def meaning_of_json(tree: Any) -> Meaning | None:
    """Return the meaning of a JSON message of unknown type by its fields, None without posture."""
    if isinstance(tree, list):
        return _JOINTS if tree and isinstance(tree[0], dict) and "position" in tree[0] else None
    if not isinstance(tree, dict):
        return None
    if "transforms" in tree or "child_frame_id" in tree:
        return _FRAMES
    if "joints" in tree or ("name" in tree and "position" in tree):
        return _JOINTS
    return _ANGLES if any(column in tree for column in COLUMNS) else None
