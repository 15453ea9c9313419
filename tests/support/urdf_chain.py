"""Forward kinematics of a URDF file, straight from its XML, to check joint angles against segment poses."""

from __future__ import annotations

import importlib.metadata
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Joint:
    """One revolute joint: name, links, origin (3,) [m], axis (3,) and limits [rad]."""

    name: str
    parent: str
    child: str
    origin: Array
    axis: Array
    lower: float
    upper: float


def human_urdf() -> Path | None:
    """Return human.urdf of the installed package example-robot-data, or None."""
    try:
        files = importlib.metadata.files("example-robot-data") or []
    except importlib.metadata.PackageNotFoundError:
        return None
    paths = [Path(str(file.locate())) for file in files if file.name == "human.urdf"]
    return paths[0] if paths and paths[0].exists() else None


def read_joints(path: Path) -> tuple[Joint, ...]:
    """Read the joints of a URDF whose joint frames are all parallel at zero (rpy = 0), in file order."""
    joints = []
    for element in ElementTree.parse(path).getroot().iter("joint"):
        origin, limit = element.find("origin"), element.find("limit")
        rpy = np.array(origin.get("rpy", "0 0 0").split(), dtype=float)
        if rpy.any():
            raise ValueError(f"{element.get('name')}: a joint frame is turned, which this small reader does not know")
        joints.append(
            Joint(
                name=element.get("name"),
                parent=element.find("parent").get("link"),
                child=element.find("child").get("link"),
                origin=np.array(origin.get("xyz").split(), dtype=float),
                axis=np.array(element.find("axis").get("xyz").split(), dtype=float),
                lower=float(limit.get("lower")),
                upper=float(limit.get("upper")),
            )
        )
    return tuple(joints)


def forward(
    joints: tuple[Joint, ...], angles: Mapping[str, Array], root: str, rotation: Array, position: Array
) -> dict[str, tuple[Array, Array]]:
    """Return link -> (rotation (n, 3, 3), position (n, 3)) in the frame of the root's pose.

    Args:
        joints: of the model.
        angles: joint name -> (n,) [rad].
        root: name of the root link.
        rotation: (n, 3, 3) of the root link.
        position: (n, 3) of the root link.
    """
    poses = {root: (rotation, position)}
    waiting = list(joints)
    while waiting:
        joint = next(joint for joint in waiting if joint.parent in poses)
        waiting.remove(joint)
        turn, place = poses[joint.parent]
        own = Rotation.from_rotvec(np.outer(angles[joint.name], joint.axis)).as_matrix()
        poses[joint.child] = (turn @ own, place + turn @ joint.origin)
    return poses
