"""Joints with two slides and a turn, as three joints with one coordinate each: planar joints of a URDF, mobile bases.

`NAME_x` and `NAME_y` [m] move in the plane, `NAME_yaw` turns about its normal.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from lgp.errors import WorldError
from lgp.scene.joint_units import TURN
from lgp.scene.model import PlanarBase
from reba.arrays import Array

BASE: Final = "base"
"""Name of the joint of a mobile base."""
FARTHEST: Final = 5.0
"""[m] How far a planar joint without <limit> goes each way; a choice."""


@dataclass(frozen=True)
class _Limits:
    """Lower, upper and speed of one coordinate [m, rad, /s]; infinite ones of a turn without end."""

    lower: float
    upper: float
    speed: float


def add_planar_base(root: ET.Element, base: PlanarBase, path: Path) -> None:
    """Let a robot move over the floor: three joints before its first link, which the URDF has fixed.

    Raises:
        WorldError: the URDF has joints or links of these names.
    """
    children = {_link(joint, "child") for joint in root.findall("joint")}
    first = next(str(link.get("name")) for link in root.findall("link") if link.get("name") not in children)
    floor = f"{BASE}_floor"
    ET.SubElement(root, "link", name=floor)
    turn = _Limits(TURN.to_si(base.yaw[0]), TURN.to_si(base.yaw[1]), TURN.to_si(base.turn))
    limits = [_Limits(*base.x, base.speed), _Limits(*base.y, base.speed), turn]
    _three_joints(root, BASE, (floor, first), np.array([0.0, 0.0, 1.0]), limits)
    for tag in ("link", "joint"):
        names = [element.get("name") for element in root.findall(tag)]
        twice = next((name for name in names if names.count(name) > 1 and str(name).startswith(BASE)), None)
        if twice is not None:
            raise WorldError(f"{path}: {tag} {twice!r} is that of a mobile base; rename it, or leave out `base`")


def split_planar_joints(root: ET.Element) -> None:
    """Replace every planar joint by three joints; the limits of the file are those of its slides."""
    for joint in [joint for joint in root.findall("joint") if joint.get("type") == "planar"]:
        axis, limit = joint.find("axis"), joint.find("limit")
        normal = np.array(_numbers(axis, "xyz", "1 0 0"))
        lower, upper, speed = (_numbers(limit, key, "0")[0] for key in ("lower", "upper", "velocity"))
        if lower >= upper:
            lower, upper = -FARTHEST, FARTHEST
        slide = _Limits(lower, upper, speed)
        ends = _link(joint, "parent"), _link(joint, "child")
        origin = joint.find("origin")
        root.remove(joint)
        _three_joints(
            root, str(joint.get("name")), ends, normal, [slide, slide, _Limits(-np.inf, np.inf, speed)], origin
        )


def _three_joints(
    root: ET.Element,
    name: str,
    ends: tuple[str, str],
    normal: Array,
    limits: list[_Limits],
    origin: ET.Element | None = None,
) -> None:
    """Add the joints between two links."""
    normal = normal / np.linalg.norm(normal)
    along = np.eye(3)[0] if abs(normal[0]) < 0.9 else np.eye(3)[1]
    along = along - (along @ normal) * normal
    along /= np.linalg.norm(along)
    between = [ends[0], f"{name}_at_x", f"{name}_at_y", ends[1]]
    for link in between[1:-1]:
        ET.SubElement(root, "link", name=link)
    for number, (part, axis) in enumerate(
        zip(("x", "y", "yaw"), (along, np.cross(normal, along), normal), strict=True)
    ):
        limit = limits[number]
        kind = "prismatic" if number < 2 else "revolute" if np.isfinite(limit.upper) else "continuous"
        joint = ET.SubElement(root, "joint", name=f"{name}_{part}", type=kind)
        if number == 0 and origin is not None:
            joint.append(origin)
        ET.SubElement(joint, "parent", link=between[number])
        ET.SubElement(joint, "child", link=between[number + 1])
        ET.SubElement(joint, "axis", xyz=" ".join(map(repr, map(float, axis))))
        ET.SubElement(
            joint, "limit", lower=repr(limit.lower), upper=repr(limit.upper), velocity=repr(limit.speed), effort="0"
        )


def _link(joint: ET.Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def _numbers(element: ET.Element | None, key: str, default: str) -> list[float]:
    return [float(word) for word in (default if element is None else element.get(key, default)).split()]
