"""URDF files, checked element by element: https://wiki.ros.org/urdf/XML. The parsers of libraries get no other."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Final

import numpy as np

from lgp.errors import WorldError
from lgp.kinematics.planar_joints import add_planar_base, split_planar_joints
from lgp.kinematics.xml_file import LARGEST, numbers, parse_xml
from lgp.scene.model import PlanarBase
from reba.open_file import read_regular

URDF_BYTES: Final = 1 << 24
"""[bytes] Largest file; a choice."""
MOST_LINKS: Final = 1000
"""A choice: the libraries descend from link to link, and some thousands in a chain overflow their stack."""
SIZES: Final = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "capsule": {"radius": 1, "length": 1},
}
"""Shapes and how many numbers each of their attributes has."""
_JOINTS: Final = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_INERTIA: Final = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_NO_LIMIT: Final = 1e30
"""Limits of joints may be as large as this to mean none."""
_AXIS_ERROR: Final = 0.01
"""Departure of the length of an axis from 1 that rounded digits explain."""


def read_urdf(path: Path, base: PlanarBase | None = None) -> tuple[ET.Element, str]:
    """Return the root element of a URDF file, all of whose links and joints are checked, and a text for Pinocchio.

    In the text no link has a shape, and every joint has one coordinate of its own: endless ones have limits, and none
    follows another. Planar joints, which have three coordinates, are split into three joints, see
    `lgp.kinematics.planar_joints`.

    Args:
        base: of a robot that moves over the floor.

    Raises:
        WorldError: it cannot be read, or an element is damaged; with the element.
    """
    try:
        data = read_regular(path, limit_bytes=URDF_BYTES)
    except OSError as error:
        raise WorldError(f"{path}: cannot be read ({error.strerror or error}); give a .urdf file") from error
    root = parse_xml(data, path, "robot")
    names = [_name(element, path) for element in root.findall("link")]
    _once(names, "link", path)
    if not names:
        raise WorldError(f"{path}: has no <link>, expected one or more; export the robot again")
    if len(names) > MOST_LINKS:
        raise WorldError(f"{path}: has {len(names)} links, expected at most {MOST_LINKS}; merge those that are fixed")
    for element in root.findall("material"):
        _material(element, f"{path}: material {str(element.get('name'))!r}")
    for element in root.findall("link"):
        _link(element, f"{path}: link {element.get('name')!r}", path)
    _tree(root, set(names), path)
    if base is not None:
        add_planar_base(root, base, path)
    split_planar_joints(root)
    return root, _plain(root)


def _plain(root: ET.Element) -> str:
    """Return a URDF as text in which no joint is endless, none follows another, and no link has a shape."""
    plain = ET.fromstring(ET.tostring(root))
    for link in plain.findall("link"):
        for part in (*link.findall("visual"), *link.findall("collision")):
            link.remove(part)  # Pinocchio makes no use of them, and complains of a capsule
    for joint in plain.findall("joint"):
        for mimic in joint.findall("mimic"):
            joint.remove(mimic)
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")
            limit = joint.find("limit")
            limit = ET.SubElement(joint, "limit", effort="0", velocity="0") if limit is None else limit
            limit.attrib |= {"lower": "-1", "upper": "1"}  # the model sets its own
    return ET.tostring(plain, encoding="unicode")


def _name(element: ET.Element, path: Path) -> str:
    name = element.get("name", "")
    if not name or not name.isprintable():
        raise WorldError(f"{path}: a <{element.tag}> has the name {name[:40]!r}, expected a text; export it again")
    return name


def _once(names: list[str], tag: str, path: Path) -> None:
    twice = next((name for name, after in pairwise(sorted(names)) if name == after), None)
    if twice is not None:
        raise WorldError(f"{path}: {tag} {twice!r} is there twice, expected once; rename one of them")


def _child(element: ET.Element, tag: str, where: str) -> ET.Element:
    child = element.find(tag)
    if child is None:
        raise WorldError(f"{where} has no <{tag}>; export the robot again")
    return child


def _numbers(
    element: ET.Element,
    key: str,
    count: int,
    where: str,
    default: str | None = None,
    low: float = -LARGEST,
    high: float = LARGEST,
) -> list[float]:
    """Return the numbers of an attribute; without a default it is required."""
    text = element.get(key, default)
    if text is None:
        raise WorldError(f"{where}: <{element.tag}> has no {key}; export the robot again")
    return numbers(text, count, f"{where}: {key} of <{element.tag}>", low, high)


def _origin(element: ET.Element, where: str) -> None:
    origin = element.find("origin")
    if origin is not None:
        _numbers(origin, "xyz", 3, where, "0 0 0")
        _numbers(origin, "rpy", 3, where, "0 0 0")


def _material(element: ET.Element, where: str) -> None:
    colour = element.find("color")
    if colour is not None:
        _numbers(colour, "rgba", 4, where, low=0.0)


def _link(element: ET.Element, where: str, path: Path) -> None:
    inertial = element.find("inertial")
    if inertial is not None:
        _origin(inertial, where)
        _numbers(_child(inertial, "mass", where), "value", 1, where, low=0.0)
        inertia = _child(inertial, "inertia", where)
        for key in _INERTIA:
            _numbers(inertia, key, 1, where)
    for tag in ("visual", "collision"):
        for part in element.findall(tag):
            place = f"{where}: <{tag}>"
            _origin(part, place)
            _shape(_child(part, "geometry", place), place)
            if (material := part.find("material")) is not None:
                _material(material, place)


def _shape(geometry: ET.Element, where: str) -> None:
    shape = next(iter(geometry), None)
    known = ", ".join((*SIZES, "mesh"))
    if shape is None or (shape.tag != "mesh" and shape.tag not in SIZES):
        what = "nothing" if shape is None else f"<{str(shape.tag)[:40]}>"
        raise WorldError(f"{where}: <geometry> has {what}, expected one of {known}; export the robot again")
    if shape.tag == "mesh":
        if not shape.get("filename"):
            raise WorldError(f"{where}: <mesh> has no filename; export the robot again")
        _numbers(shape, "scale", 3, where, "1 1 1")
        return
    for key, count in SIZES[shape.tag].items():
        if min(_numbers(shape, key, count, where, low=0.0)) <= 0.0:
            raise WorldError(f"{where}: {key} of <{shape.tag}> is {shape.get(key)!r}, expected above 0")


def _tree(root: ET.Element, links: set[str], path: Path) -> None:
    """Check the joints: numbers, names, and that they connect all links to one tree."""
    parents: dict[str, str] = {}
    joints = root.findall("joint")
    names = [_name(joint, path) for joint in joints]
    _once(names, "joint", path)
    for joint in joints:
        where = f"{path}: joint {joint.get('name')!r}"
        ends = [_child(joint, tag, where).get("link", "") for tag in ("parent", "child")]
        for end in ends:
            if end not in links:
                raise WorldError(f"{where} names link {end[:40]!r}, which is not there; export the robot again")
        if ends[1] in parents:
            raise WorldError(f"{where}: link {ends[1]!r} is the child of two joints, expected one")
        parents[ends[1]] = ends[0]
        _joint(joint, where)
    _mimics(joints, path)
    first = [name for name in links if name not in parents]
    if len(first) != 1:
        raise WorldError(f"{path}: {len(first)} links have no parent, expected one; its joints make no tree")
    reached = set(first)
    for name in links:
        chain: list[str] = []
        while name not in reached and len(chain) <= len(links):
            chain.append(name)
            name = parents[name]
        if len(chain) > len(links):
            raise WorldError(f"{path}: link {name!r} is connected to itself by its joints, which make no tree")
        reached.update(chain)


def _mimics(joints: list[ET.Element], path: Path) -> None:
    """Refuse joints that follow each other in a circle."""
    follows = {str(joint.get("name")): mimic.get("joint", "") for joint in joints
               if (mimic := joint.find("mimic")) is not None}  # fmt: skip
    for name, leader in follows.items():
        where = f"{path}: joint {name!r} follows {leader[:40]!r}"
        seen = {name}
        while leader in follows and leader not in seen:
            seen.add(leader)
            leader = follows[leader]
        if leader in seen:
            raise WorldError(f"{where}, which follows it in turn; let one of them move on its own")


def _joint(joint: ET.Element, where: str) -> None:
    kind = joint.get("type", "")
    if kind not in _JOINTS:
        raise WorldError(f"{where}: type is {kind[:40]!r}, expected one of {', '.join(_JOINTS)}")
    _origin(joint, where)
    get = partial(_numbers, where=where)
    axis = joint.find("axis")
    if axis is not None and kind not in ("fixed", "floating"):
        length = float(np.linalg.norm(get(axis, "xyz", 3, default="1 0 0")))
        if abs(length - 1.0) > _AXIS_ERROR:
            raise WorldError(f"{where}: axis is {axis.get('xyz')!r}, expected a direction of length 1")
    limit = joint.find("limit")
    if limit is None and kind in ("revolute", "prismatic"):
        raise WorldError(f"{where}: a {kind} joint has no <limit>, expected lower and upper; export the robot again")
    if limit is not None:
        lower, upper = (
            get(limit, key, 1, default="0", low=-_NO_LIMIT, high=_NO_LIMIT)[0] for key in ("lower", "upper")
        )
        if lower > upper:
            raise WorldError(f"{where}: lower is {lower:g} and upper {upper:g}, expected lower below upper")
        for key in ("effort", "velocity"):
            if key not in limit.attrib:
                raise WorldError(f"{where}: <limit> has no {key}, which URDF requires; add it, in SI units")
            get(limit, key, 1, default="0", low=0.0, high=_NO_LIMIT)
    for tag, keys in (("mimic", ("multiplier", "offset")), ("dynamics", ("damping", "friction"))):
        if (element := joint.find(tag)) is not None:
            for key in keys:
                get(element, key, 1, default="1")
