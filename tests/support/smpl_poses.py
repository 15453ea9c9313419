"""Known postures as poses of SMPL, SMPL-H and SMPL-X: rotations of joints in their parents, zero in a T-pose."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.support.t_pose_bodies import t_pose_bodies

Array = NDArray[np.float64]

ORDER = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle"),
    *("spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder"),
    *("right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist"),
)
"""Joints of a body pose, as in the documentation of the models."""
ABOVE = {
    "left_hip": "pelvis", "right_hip": "pelvis", "spine1": "pelvis", "spine2": "spine1", "spine3": "spine2",
    "neck": "spine3", "head": "neck",
    **{
        f"{side}_{joint}": parent if parent == "spine3" else f"{side}_{parent}"
        for side in ("left", "right")
        for joint, parent in (
            ("knee", "hip"), ("ankle", "knee"), ("foot", "ankle"), ("collar", "spine3"), ("shoulder", "collar"),
            ("elbow", "shoulder"), ("wrist", "elbow"),
        )
    },
}  # fmt: skip
SEGMENTS = {
    "pelvis": "pelvis", "spine3": "thorax", "head": "head",
    **{
        f"{side}_{joint}": f"{segment}_{side}"
        for side in ("left", "right")
        for joint, segment in (
            ("hip", "thigh"), ("knee", "shank"), ("ankle", "foot"), ("foot", "toe"), ("collar", "clavicle"),
            ("shoulder", "upper_arm"), ("elbow", "forearm"), ("wrist", "hand"),
        )
    },
}  # fmt: skip
"""Joint -> the bone of `t_pose_bodies` that it turns."""
SPINE = ("spine1", "spine2", "spine3")


def smpl_pose(postures: Sequence[Mapping[str, float]], world: Array | None = None, heading: float = 0.0) -> Array:
    """Return the (n, 66) body pose [rad] of postures; the spine is turned in equal parts by its three joints.

    Args:
        world: (3, 3) the axes x left, y up, z forward in the world of the recording.
    """
    bodies = t_pose_bodies(postures, heading)
    axes = np.eye(3) if world is None else world
    turned = {joint: axes @ bodies[bone][0] for joint, bone in SEGMENTS.items()}
    bend = Rotation.from_matrix(np.swapaxes(turned["pelvis"], 1, 2) @ turned["spine3"]).as_rotvec()
    for share, joint in enumerate(SPINE[:2], start=1):
        turned[joint] = turned["pelvis"] @ Rotation.from_rotvec(bend * share / 3).as_matrix()
    turned["neck"] = turned["spine3"]
    local = [
        np.swapaxes(turned[ABOVE[joint]], 1, 2) @ turned[joint] if joint in ABOVE else turned[joint] for joint in ORDER
    ]
    return np.concatenate([Rotation.from_matrix(turn).as_rotvec() for turn in local], axis=1)


Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""The world of AMASS: what is y up for the body model is z up."""
CAMERA = np.diag([1.0, -1.0, -1.0])
"""The world of a camera: x right, y down, z away from it."""
