"""Collision shapes: capsules along the limbs of human and robots, boxes for tables and objects."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import coal
import numpy as np

from lgp.kinematics import human
from lgp.kinematics.features import rotation_about_z
from lgp.kinematics.world import World
from lgp.scene.model import Robot
from lgp.scene.scene_file import known_robots
from reba.arrays import Array

SHORTEST = 0.03
"""[m] Shorter links get no capsule: those of their neighbours cover them."""
FINGERS = 0.10
"""[m] The last capsule of a robot arm ends this far before the grasping point, which fingers may surround."""
SHOULDER = 2
"""Number of first joints of an arm whose links stay inside or beside the base: no collision check against it."""
RADIUS = 0.06
"""[m] Capsule radius of the links of robots that are not in robots.toml."""


@dataclass(frozen=True)
class CollisionShape:
    """One convex shape.

    Attributes:
        name: for messages.
        owner: agent, "table", or the object's name.
        kind: "link", "base", "table" or "object".
        frame: frame it is fixed to, "" for the world.
        branch: limb; shapes of one limb are never checked against each other.
        reaches: whether it can touch other limbs of its agent.
        rotation, position: (3, 3) and centre (3,) [m] in the frame.
        radius: of the bounding sphere [m].
        half, rim: all points within `rim` [m] of a box of half sides `half` (3,) [m]; a segment for a capsule.
        shape: coal geometry, capsules along z.
    """

    name: str
    owner: str
    kind: str
    frame: str
    branch: str
    reaches: bool
    rotation: Array
    position: Array
    radius: float
    half: Array
    rim: float
    shape: Any = field(repr=False, compare=False)


def collision_shapes(world: World) -> tuple[CollisionShape, ...]:
    """Return every collision shape of a world: human, robots, tables, objects."""
    shapes: list[CollisionShape] = []
    for agent in world.scene.agents:
        shapes += _robot(world, agent) if isinstance(agent, Robot) else _human(world)
    for name, table in world.scene.tables.items():
        rotation = rotation_about_z(np.radians(table.yaw))
        centre = np.array([*table.position, table.height - table.thickness / 2.0])
        shapes.append(_box(name, "table", "table", rotation, centre, (*table.size, table.thickness)))
    for name, item in world.scene.objects.items():
        shapes.append(_box(name, name, "object", np.eye(3), np.zeros(3), item.size))
    return tuple(shapes)


def _box(
    name: str, owner: str, kind: str, rotation: Array, position: Array, size: tuple[float, float, float]
) -> CollisionShape:
    radius = float(np.linalg.norm(size)) / 2.0
    half = np.array(size) / 2.0
    return CollisionShape(name, owner, kind, "", name, False, rotation, position, radius, half, 0.0, coal.Box(*size))


def _capsule(
    name: str, owner: str, kind: str, frame: str, branch: str, reaches: bool, ends: tuple[Array, Array], radius: float
) -> CollisionShape:
    start, end = ends
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    aside = np.eye(3)[int(np.argmin(np.abs(along)))]
    across = np.cross(along, aside)
    across /= np.linalg.norm(across)
    rotation = np.stack([np.cross(across, along), across, along], axis=1)
    return CollisionShape(
        name,
        owner,
        kind,
        frame,
        branch,
        reaches,
        rotation,
        (start + end) / 2.0,
        length / 2.0 + radius,
        np.array([0.0, 0.0, length / 2.0]),
        radius,
        coal.Capsule(radius, length),
    )


def _human(world: World) -> list[CollisionShape]:
    person = world.scene.human
    if person is None:
        return []
    shapes = []
    for name, joint, end, radius, limb, reaches in human.capsules(person.stature, person.sex):
        # Solved and locked legs have no joints of their own to attach a capsule to; the trunk covers their space.
        if limb.endswith("leg") and person.legs != "planted":
            continue
        frame = f"human.{joint}"
        shapes.append(_capsule(f"human.{name}", "human", "link", frame, limb, reaches, (np.zeros(3), end), radius))
    return shapes


def _robot(world: World, robot: Robot) -> list[CollisionShape]:
    known = known_robots().get(robot.model, {})
    radius = known.get("radius", RADIUS)
    shapes = []
    base = rotation_about_z(np.radians(robot.yaw))
    for number, body in enumerate(known.get("bodies", [])):
        ends = tuple(np.array(robot.position) + base @ np.array(body[end], dtype=float) for end in ("from", "to"))
        name = f"{robot.name}.body_{number}"
        shapes.append(_capsule(name, robot.name, "base", "", name, False, (ends[0], ends[1]), body["radius"]))
    for joint, end in _links(world, robot):
        if np.linalg.norm(end) > SHORTEST:
            name = world.model.names[joint]
            chain = list(world.model.supports[joint])[1:]
            branch = world.model.names[chain[0]]
            reaches = len(chain) > SHOULDER
            shapes.append(_capsule(name, robot.name, "link", name, branch, reaches, (np.zeros(3), end), radius))
    return shapes


def _links(world: World, robot: Robot) -> list[tuple[int, Array]]:
    """Return (joint, far end (3,) in its frame [m]) of each link of a robot."""
    model = world.model
    links = []
    for joint in range(1, model.njoints):
        if not model.names[joint].startswith(f"{robot.name}."):
            continue
        links += [(joint, model.jointPlacements[child].translation) for child in model.children[joint]]
        for hand in robot.hands:
            frame = model.frames[world.frame_id(hand.full)]
            if frame.parentJoint == joint:
                tip = frame.placement
                links.append((joint, tip.translation - FINGERS * tip.rotation[:, 2]))
    return links
