"""A robot as its URDF describes it: https://wiki.ros.org/urdf/XML. Joints that move, frames, and <collision> bodies."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from lgp.audit.joint_tree import BASE, Frame, TreeJoint, about, chain_of
from lgp.audit.shapes import Shape, ball, box, capsule, cylinder, mesh_of
from lgp.kinematics.mesh_file import MissingMeshError, mesh_path, read_mesh
from lgp.kinematics.urdf import read_urdf
from lgp.scene.model import PlanarBase
from reba.arrays import Array


@dataclass(frozen=True, eq=False)
class RobotFile:
    """A URDF: moving joints, frames of links and joints, (link, frame, shape) of each body, links without one."""

    joints: tuple[TreeJoint, ...]
    frames: Mapping[str, Frame]
    parts: tuple[tuple[str, Frame, Shape], ...]
    notes: tuple[str, ...]

    def chain(self, number: int) -> list[int]:
        """Return the frames from one to the base, both included."""
        return chain_of(self.joints, number)


MOVES: Final = ("revolute", "continuous", "prismatic")


@cache
def robot_file(path: Path, base: PlanarBase | None = None, packages: tuple[str, ...] = ()) -> RobotFile:
    """Return a URDF file, on a mobile base if it has one (read once); `packages` as for `mesh_path`."""
    root, _ = read_urdf(path, base)
    by_parent: dict[str, list[ET.Element]] = {}
    for element in root.findall("joint"):
        by_parent.setdefault(_link(element, "parent"), []).append(element)
    children = {_link(element, "child") for element in root.findall("joint")}
    first = next(link.get("name", "") for link in root.findall("link") if link.get("name") not in children)
    frames, joints, waiting = {first: Frame(BASE, np.eye(3), np.zeros(3))}, [], [first]
    while waiting:
        parent = waiting.pop()
        for element in by_parent.get(parent, []):
            at, child = frames[parent].then(*_origin(element)), _link(element, "child")
            if element.get("type") in MOVES:
                joints.append(_joint(element, at))
                at = Frame(len(joints), np.eye(3), np.zeros(3))
            frames[child] = at
            frames.setdefault(element.get("name", ""), at)
            waiting.append(child)
    known = {element.get("name") for element in root.findall("joint")}
    parts, notes = (
        [],
        [
            f"joint {joint.name!r} follows {joint.follows[0]!r}, which is not there, and stays where it is"
            for joint in joints
            if joint.follows is not None and joint.follows[0] not in known
        ],
    )
    for link in root.findall("link"):
        for element in link.findall("collision"):
            try:
                shape, middle = _shape(element, path, packages)
            except MissingMeshError:
                named = [str(shape.get("filename"))[:120] for shape in element.findall("geometry/mesh")]
                notes.append(f"link {link.get('name')!r} has no body, because its mesh {named[0]!r} is not there")
                continue
            rotation, position = _origin(element)
            frame = frames[link.get("name", "")].then(rotation, position)
            parts.append((link.get("name", ""), frame.then(np.eye(3), middle), shape))
    return RobotFile(tuple(joints), frames, tuple(parts), tuple(notes))


def _link(joint: ET.Element, tag: str) -> str:
    element = joint.find(tag)
    return "" if element is None else element.get("link", "")


def _numbers(element: ET.Element | None, key: str, default: str) -> Array:
    return np.array([float(word) for word in (default if element is None else element.get(key, default)).split()])


def _origin(element: ET.Element) -> tuple[Array, Array]:
    """Return rotation (3, 3) and position (3,) of <origin>: roll, pitch, yaw about fixed axes."""
    origin = element.find("origin")
    turn = np.eye(3)
    for axis, angle in zip(np.eye(3), _numbers(origin, "rpy", "0 0 0"), strict=True):
        turn = about(axis, np.array([angle]))[0] @ turn
    return turn, _numbers(origin, "xyz", "0 0 0")


def _joint(element: ET.Element, at: Frame) -> TreeJoint:
    axis, limit, mimic = _numbers(element.find("axis"), "xyz", "1 0 0"), element.find("limit"), element.find("mimic")
    lower, upper, speed = (float(_numbers(limit, key, "0")[0]) for key in ("lower", "upper", "velocity"))
    endless = element.get("type") == "continuous"
    follows = None
    if mimic is not None:
        factor, offset = (float(_numbers(mimic, key, text)[0]) for key, text in (("multiplier", "1"), ("offset", "0")))
        follows = (mimic.get("joint", ""), factor, offset)
    return TreeJoint(
        name=element.get("name", ""),
        at=at,
        axis=axis / np.linalg.norm(axis),
        slides=element.get("type") == "prismatic",
        lower=-np.inf if endless else lower,
        upper=np.inf if endless else upper,
        speed=speed if speed > 0.0 else np.inf,
        follows=follows,
    )


def _shape(element: ET.Element, path: Path, packages: tuple[str, ...]) -> tuple[Shape, Array]:
    """Return the shape of a <collision> and where its middle is (3,) [m]."""
    shape: Any = element.find("geometry/*")
    if shape.tag == "mesh":
        parts = read_mesh(mesh_path(str(shape.get("filename")), path, packages))
        return mesh_of(parts, _numbers(shape, "scale", "1 1 1"))
    if shape.tag == "box":
        return box(_numbers(shape, "size", "")), np.zeros(3)
    radius = float(shape.get("radius", "0"))
    if shape.tag == "sphere":
        return ball(radius), np.zeros(3)
    return (capsule if shape.tag == "capsule" else cylinder)(radius, float(shape.get("length", "0"))), np.zeros(3)
