"""Collision shapes of robots: the <collision> geometry of their URDF, meshes as convex bodies, fingers as jaws.

Every link has the shapes that its URDF gives it; a mesh is replaced by its hull, or the hulls of its slabs. Locked
joints beyond the joint that carries a hand are its jaws: their links stand open, or closed to the width of what the
hand has.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from functools import cache
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from lgp.collision.convex_parts import convex_body, convex_parts, hull_corners
from lgp.collision.shapes import CollisionShape, JawPlacement, capsule
from lgp.kinematics.mesh_file import MissingMeshError, mesh_path, read_mesh
from lgp.kinematics.robot import urdf_of
from lgp.kinematics.urdf import read_urdf
from lgp.kinematics.world import World
from lgp.scene.model import Robot
from reba.arrays import Array
from reba.errors import warn_user

SHORTEST = 0.03
"""[m] Shorter links of a robot without <collision> get no capsule: those of their neighbours cover them."""
FINGERS = 0.10
"""[m] The last capsule of a robot without <collision> ends this far before the grasping point."""
RADIUS = 0.06
"""[m] Capsule radius of the links of a robot without <collision> (a choice)."""


class MissingMeshWarning(UserWarning):
    """A mesh of a robot is not there: its link has no body, and plans may pass through it."""


@dataclass(frozen=True)
class LinkGeometry:
    """One <collision> of a link: its coal shape, half sides of the box around it and rim [m], and pose in the link."""

    link: str
    shape: Any
    half: Array
    rim: float
    placement: pin.SE3


def robot_shapes(world: World, robot: Robot) -> list[CollisionShape]:
    """Return the collision shapes of a robot of a world.

    Warns with `MissingMeshWarning` of each mesh file that does not exist.

    Raises:
        WorldError: a mesh is damaged or outside of the robot's folder.
    """
    path = urdf_of(robot.model, robot.packages)
    geometry = _geometry(path, robot.packages)
    if not geometry:
        return _link_capsules(world, robot)
    jaws = _jaws(world, robot, path, geometry)
    shapes = []
    numbers: dict[str, int] = {}
    for part in geometry:
        frame = world.model.frames[world.model.getFrameId(f"{robot.name}.{part.link}", pin.FrameType.BODY)]
        name = f"{robot.name}.{part.link}"
        numbers[name] = numbers.get(name, 0) + 1
        if numbers[name] > 1:
            name = f"{name}/{numbers[name]}"
        at = frame.placement * part.placement
        shapes.append(_shape(world, robot, name, frame.parentJoint, at, part))
        if part.link in jaws:
            stands = [stand * part.placement for stand in jaws[part.link].stands]
            closed, opened = ((stand.rotation.copy(), stand.translation.copy()) for stand in stands)
            shapes[-1] = replace(shapes[-1], jaw=JawPlacement(jaws[part.link].hand, closed, opened, 0.0))
    return _with_widths(shapes)


def _with_widths(shapes: list[CollisionShape]) -> list[CollisionShape]:
    """Return the shapes with the widths of their jaws: how far the two fingers that move most go apart."""
    moves: dict[str, dict[str, float]] = {}
    for shape in shapes:
        if shape.jaw is not None:
            link = shape.name.partition("/")[0]
            moved = float(np.linalg.norm(shape.jaw.opened[1] - shape.jaw.closed[1]))
            of_hand = moves.setdefault(shape.jaw.hand, {})
            of_hand[link] = max(of_hand.get(link, 0.0), moved)
    widths = {hand: sum(sorted(by_link.values())[-2:]) for hand, by_link in moves.items()}
    return [
        shape if shape.jaw is None else replace(shape, jaw=replace(shape.jaw, width=widths[shape.jaw.hand]))
        for shape in shapes
    ]


def _shape(world: World, robot: Robot, name: str, joint: int, at: pin.SE3, part: LinkGeometry) -> CollisionShape:
    model = world.model
    chain = list(model.supports[joint])[1:]
    hands = {
        hand.full for hand in robot.hands if chain and model.frames[world.frame_id(hand.full)].parentJoint in chain
    }
    return CollisionShape(
        name=name,
        owner=robot.name,
        kind="link" if chain else "base",
        frame=str(model.names[joint]) if chain else "",
        branch="",
        reaches=True,
        rotation=at.rotation.copy(),
        position=at.translation.copy(),
        radius=float(np.linalg.norm(part.half)) + part.rim,
        half=part.half,
        rim=part.rim,
        shape=part.shape,
        hands=frozenset(hands),
    )


@cache
def _geometry(path: Path, packages: tuple[str, ...]) -> tuple[LinkGeometry, ...]:
    """Return the <collision> geometry of a URDF (read once)."""
    root, _ = read_urdf(path)
    parts: list[LinkGeometry] = []
    for link in root.findall("link"):
        for element in link.findall("collision"):
            parts += _parts(link.get("name", ""), element, path, packages)
    return tuple(parts)


def _parts(link: str, element: ET.Element, path: Path, packages: tuple[str, ...]) -> Iterator[LinkGeometry]:
    shape, origin = element.find("geometry/*"), element.find("origin")
    if shape is None:
        return
    xyz, rpy = (
        np.array([float(word) for word in ("0 0 0" if origin is None else origin.get(key, "0 0 0")).split()])
        for key in ("xyz", "rpy")
    )
    at = pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz)
    if shape.tag == "mesh":
        yield from _mesh(link, shape, at, path, packages)
        return
    size = {key: [float(word) for word in shape.get(key, "0").split()] for key in ("size", "radius", "length")}
    radius, length = size["radius"][0], size["length"][0]
    half = np.array([0.0, 0.0, length / 2.0])
    if shape.tag == "box":
        yield LinkGeometry(link, coal.Box(*size["size"]), np.array(size["size"]) / 2.0, 0.0, at)
    elif shape.tag == "sphere":
        yield LinkGeometry(link, coal.Sphere(radius), np.zeros(3), radius, at)
    elif shape.tag == "capsule":
        yield LinkGeometry(link, coal.Capsule(radius, length), half, radius, at)
    else:
        yield LinkGeometry(link, *_prism(radius, length), at)


SIDES_OF_PRISM = 16


def _prism(radius: float, length: float) -> tuple[Any, Array, float]:
    """Return the prism around a cylinder, 2 % wider: nearest points of flat bodies are exact, of cylinders not."""
    angle = 2.0 * np.pi * np.arange(SIDES_OF_PRISM) / SIDES_OF_PRISM
    wide = radius / np.cos(np.pi / SIDES_OF_PRISM)
    ring = wide * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    end = np.array([0.0, 0.0, length / 2.0])
    return convex_body(np.concatenate([ring - end, ring + end])), np.array([wide, wide, length / 2.0]), 0.0


def _mesh(link: str, mesh: ET.Element, at: pin.SE3, path: Path, packages: tuple[str, ...]) -> Iterator[LinkGeometry]:
    """Yield the convex bodies around a mesh, none with a warning where its file does not exist."""
    name = str(mesh.get("filename"))
    try:
        file = mesh_path(name, path, packages)
    except MissingMeshError as error:
        warn_user(f"{error}; link {link!r} has no body", MissingMeshWarning)
        return
    scale = np.array([float(word) for word in mesh.get("scale", "1 1 1").split()])
    parts = [(vertices * scale, np.asarray(triangles)) for vertices, triangles, *_ in read_mesh(file)]
    first = np.cumsum([0, *(len(vertices) for vertices, _ in parts)])
    vertices = np.concatenate([vertices for vertices, _ in parts])
    triangles = np.concatenate([of + begin for (_, of), begin in zip(parts, first, strict=False)])
    for corners in convex_parts(vertices, triangles):
        middle = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
        moved = at * pin.SE3(np.eye(3), middle)
        yield LinkGeometry(link, convex_body(hull_corners(corners) - middle), np.ptp(corners, axis=0) / 2.0, 0.0, moved)


@dataclass(frozen=True)
class _Jaw:
    """A link of a finger: its hand, and its pose closed and open in the frame of the joint that carries the hand."""

    hand: str
    stands: tuple[pin.SE3, pin.SE3]


def _jaws(world: World, robot: Robot, path: Path, geometry: tuple[LinkGeometry, ...]) -> dict[str, _Jaw]:
    """Return the links of the fingers of a robot: those that locked joints beyond a hand's carrier move."""
    model = pin.buildModelFromXML(read_urdf(path)[1])
    jaws: dict[str, _Jaw] = {}
    for hand in robot.hands:
        at = world.model.frames[world.frame_id(hand.full)]
        carrier = str(world.model.names[at.parentJoint]).removeprefix(f"{robot.name}.")
        if not model.existJointName(carrier):
            continue
        root = model.getJointId(carrier)
        beyond = [joint for joint in list(model.subtrees[root])[1:] if model.joints[joint].nq == 1]
        fingers = [joint for joint in beyond if any(fnmatch(model.names[joint], name) for name in robot.locked)]
        low, high = (
            _stands(model, root, fingers, limits) for limits in (model.lowerPositionLimit, model.upperPositionLimit)
        )
        for link in low:
            parts = [part for part in geometry if part.link == link]
            if parts:
                # Open is where the finger is farther from the line along which the hand approaches.
                ends = sorted((low[link], high[link]), key=lambda stand: _from_axis(at.placement, stand, parts))
                jaws[link] = _Jaw(hand.full, (ends[0], ends[1]))
    return jaws


def _stands(model: pin.Model, root: int, fingers: list[int], limits: Array) -> dict[str, pin.SE3]:
    """Return the pose of each link beyond a joint in its frame, with the fingers at their limits."""
    data, q = model.createData(), pin.neutral(model)
    for joint in fingers:
        q[model.joints[joint].idx_q] = np.clip(limits[model.joints[joint].idx_q], -np.pi, np.pi)
    pin.framesForwardKinematics(model, data, q)
    moved = {below for joint in fingers for below in model.subtrees[joint]}
    return {
        frame.name: data.oMi[root].inverse() * data.oMf[number]
        for number, frame in enumerate(model.frames)
        if frame.type == pin.FrameType.BODY and frame.parentJoint in moved
    }


def _from_axis(hand: pin.SE3, stand: pin.SE3, parts: list[LinkGeometry]) -> float:
    """Return the mean distance [m] of the parts of a link from the line along which the hand approaches."""
    return float(np.mean([np.linalg.norm(hand.actInv((stand * part.placement).translation)[:2]) for part in parts]))


def _link_capsules(world: World, robot: Robot) -> list[CollisionShape]:
    """Return capsules along the links of a robot whose URDF has no <collision>."""
    model, shapes = world.model, []
    for joint in range(1, model.njoints):
        name = str(model.names[joint])
        if not name.startswith(f"{robot.name}."):
            continue
        ends = [model.jointPlacements[child].translation for child in model.children[joint]]
        for hand in robot.hands:
            frame = model.frames[world.frame_id(hand.full)]
            if frame.parentJoint == joint:
                ends.append(frame.placement.translation - FINGERS * frame.placement.rotation[:, 2])
        chain = list(model.supports[joint])[1:]
        hands = {hand.full for hand in robot.hands if model.frames[world.frame_id(hand.full)].parentJoint in chain}
        shapes += [
            replace(
                capsule(name, robot.name, "link", name, "", (np.zeros(3), end), RADIUS),
                reaches=True,
                hands=frozenset(hands),
            )
            for end in ends
            if np.linalg.norm(end) > SHORTEST
        ]
    return shapes
