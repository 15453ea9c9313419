"""Known postures as skeletons whose bones are not turned in a T-pose: x left, y up, z forward.

OptiTrack Motive and the SMPL body models write poses so. Written out from the posture, without the code under test.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from tests.support.synthetic_bodies import Posture, rotation, segment_frames

Array = NDArray[np.float64]

ISB = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
"""Columns: x forward, y up, z right in a frame with x left, y up, z forward."""
SIDED = ("clavicle", "upper_arm", "forearm", "hand", "thigh", "shank", "foot", "toe")
BONES = ("pelvis", "thorax", "head", *(f"{part}_{side}" for part in SIDED for side in ("left", "right")))
PARENTS: dict[str, str] = {
    "thorax": "pelvis",
    "head": "thorax",
    **{
        f"{part}_{side}": parent if parent in ("pelvis", "thorax") else f"{parent}_{side}"
        for side in ("left", "right")
        for part, parent in (
            ("clavicle", "thorax"),
            ("upper_arm", "clavicle"),
            ("forearm", "upper_arm"),
            ("hand", "forearm"),
            ("thigh", "pelvis"),
            ("shank", "thigh"),
            ("foot", "shank"),
            ("toe", "foot"),
        )
    },
}
OFFSETS: dict[str, Array] = {
    "thorax": np.zeros(3),
    "head": np.array([0.0, 0.65, 0.02]),
    **{
        f"{part}_{side}": np.array(offset) * [1.0 if side == "left" else -1.0, 1.0, 1.0]
        for side in ("left", "right")
        for part, offset in (
            ("clavicle", [0.18, 0.5, 0.0]),
            ("upper_arm", [0.0, 0.0, 0.0]),
            ("forearm", [0.3, 0.0, 0.0]),
            ("hand", [0.25, 0.0, 0.0]),
            ("thigh", [0.09, 0.0, 0.0]),
            ("shank", [0.0, -0.42, 0.0]),
            ("foot", [0.0, -0.42, 0.0]),
            ("toe", [0.0, -0.06, 0.14]),
        )
    },
}
"""Place of each bone in its parent [m]: the trunk bends at the hips and girdles turn about the shoulders, so that the
line from the hips to the shoulders is the long axis of the chest."""


def t_pose_body(posture: Posture, heading: float = 0.0) -> dict[str, tuple[Array, Array]]:
    """Return bone -> its orientation (3, 3) and place (3,) in the world, x left, y up, z forward."""
    mirror = np.diag([1.0, 1.0, -1.0])
    frames = segment_frames(posture, heading)
    turned = {}
    for bone in BONES:
        kind, _, side = bone.rpartition("_")
        frame = frames[f"shank_{side}" if kind in ("foot", "toe") else bone]
        raised = rotation("x", -90.0) if kind in ("upper_arm", "forearm", "hand") else np.eye(3)
        raised = raised if side == "right" else mirror @ raised @ mirror
        turned[bone] = ISB @ frame @ raised.T @ ISB.T
    places = {"pelvis": np.array([0.0, 0.95, 0.0])}
    for bone, parent in PARENTS.items():
        places[bone] = places[parent] + turned[parent] @ OFFSETS[bone]
    return {bone: (turned[bone], places[bone]) for bone in BONES}


def t_pose_bodies(postures: Sequence[Mapping[str, float]], heading: float = 0.0) -> dict[str, tuple[Array, Array]]:
    """Return bone -> orientations (n, 3, 3) and places (n, 3)."""
    bodies = [t_pose_body(posture, heading) for posture in postures]
    return {
        bone: (np.stack([body[bone][0] for body in bodies]), np.stack([body[bone][1] for body in bodies]))
        for bone in BONES
    }
