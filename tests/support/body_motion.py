"""A recorded movement as world poses of the 23 Xsens segments, read from an Xsens BVH file.

This is a second, independent reading of the file: nothing of the package is used, so that its readers can be
compared with it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

SEGMENTS: dict[str, str] = {
    "Hips": "pelvis",
    "Chest": "l5",
    "Chest2": "l3",
    "Chest3": "t12",
    "Chest4": "t8",
    "Neck": "neck",
    "Head": "head",
    "RightCollar": "right_shoulder",
    "RightShoulder": "right_upper_arm",
    "RightElbow": "right_forearm",
    "RightWrist": "right_hand",
    "LeftCollar": "left_shoulder",
    "LeftShoulder": "left_upper_arm",
    "LeftElbow": "left_forearm",
    "LeftWrist": "left_hand",
    "RightHip": "right_upper_leg",
    "RightKnee": "right_lower_leg",
    "RightAnkle": "right_foot",
    "RightToe": "right_toe",
    "LeftHip": "left_upper_leg",
    "LeftKnee": "left_lower_leg",
    "LeftAnkle": "left_foot",
    "LeftToe": "left_toe",
}
"""BVH joint (named after its proximal end) -> segment, as the Xsens ROS 2 driver names it."""
PARENTS: dict[str, str] = {
    "l5": "pelvis",
    "l3": "l5",
    "t12": "l3",
    "t8": "t12",
    "neck": "t8",
    "head": "neck",
    **{
        f"{side}_{child}": parent if parent in ("pelvis", "t8") else f"{side}_{parent}"
        for side in ("left", "right")
        for child, parent in (
            ("shoulder", "t8"),
            ("upper_arm", "shoulder"),
            ("forearm", "upper_arm"),
            ("hand", "forearm"),
            ("upper_leg", "pelvis"),
            ("lower_leg", "upper_leg"),
            ("foot", "lower_leg"),
            ("toe", "foot"),
        )
    },
}
"""Segment -> kinematic parent; the pelvis has none."""

# BVH of Xsens: x left, y up, z forward. Here: x forward, y left, z up (REP 103).
_AXES = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
# The file's arms are straight to the side when every angle is zero; here they hang.
_HANG = {"left": 90.0, "right": -90.0}


@dataclass(frozen=True)
class BodyMotion:
    """World poses of the segments; x forward, y left, z up; all segments aligned when standing with hanging arms.

    Attributes:
        time: (n,) [s].
        names: the 23 segments.
        rotation: (n, 23, 3, 3) world from segment.
        position: (n, 23, 3) proximal joint centre [m].
    """

    time: Array
    names: tuple[str, ...]
    rotation: Array
    position: Array

    def of(self, segment: str) -> Array:
        """Return the rotations (n, 3, 3) of one segment."""
        return self.rotation[:, self.names.index(segment)]

    def at(self, segment: str) -> Array:
        """Return the positions (n, 3) [m] of one segment."""
        return self.position[:, self.names.index(segment)]

    def relative(self, segment: str, parent: str) -> tuple[Array, Array]:
        """Return rotation (n, 3, 3) and position (n, 3) of a segment in another one."""
        back = np.swapaxes(self.of(parent), 1, 2)
        offset = np.einsum("nij,nj->ni", back, self.at(segment) - self.at(parent))
        return back @ self.of(segment), offset


def read_xsens_bvh(path: Path, skip: int = 1, centimetre: float = 0.01) -> BodyMotion:
    """Read an Xsens BVH file.

    Args:
        path: the file.
        skip: frames to leave out at the start (the first one is a T-pose).
        centimetre: metres per unit of length of the file.
    """
    words = path.read_text().split()
    start = words.index("MOTION")
    joints, parents, offsets = _hierarchy(words[:start])
    step = float(words[start + 5])
    data = np.array(words[start + 6 :], dtype=float).reshape(int(words[start + 2]), -1)
    angles = data[:, 3:].reshape(-1, 3)
    local = Rotation.from_euler("YXZ", angles, degrees=True).as_matrix().reshape(len(data), len(joints), 3, 3)
    rotation, position = local.copy(), np.empty((len(data), len(joints), 3))
    position[:, 0] = data[:, :3]
    for index, parent in enumerate(parents[1:], start=1):
        rotation[:, index] = rotation[:, parent] @ local[:, index]
        position[:, index] = position[:, parent] + rotation[:, parent] @ offsets[index]
    rotation, position = _AXES @ rotation @ _AXES.T, position @ _AXES.T * centimetre
    names = tuple(SEGMENTS[joint] for joint in joints)
    for index, name in enumerate(names):
        side, _, part = name.partition("_")
        if part in ("upper_arm", "forearm", "hand"):
            rotation[:, index] = rotation[:, index] @ Rotation.from_euler("x", _HANG[side], degrees=True).as_matrix()
    time = np.arange(len(data)) * step
    return BodyMotion(time[skip:], names, rotation[skip:], position[skip:])


def _hierarchy(words: list[str]) -> tuple[list[str], list[int], list[Array]]:
    """Return joint names, index of each one's parent (-1 for the root) and offsets (3,)."""
    joints: list[str] = []
    parents: list[int] = []
    offsets: list[Array] = []
    open_joints: list[int] = []
    for index, word in enumerate(words):
        if word in ("ROOT", "JOINT"):
            parents.append(open_joints[-1] if open_joints else -1)
            joints.append(words[index + 1])
        elif word == "{":
            open_joints.append(-1 if words[index - 2] == "End" else len(joints) - 1)
        elif word == "}":
            open_joints.pop()
        elif word == "OFFSET" and open_joints[-1] >= 0:
            offsets.append(np.array(words[index + 1 : index + 4], dtype=float))
    return joints, parents, offsets
