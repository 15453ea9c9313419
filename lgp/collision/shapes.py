"""Bodies for collisions: capsules along the limbs of human and robots, boxes for tables and objects."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import coal
import numpy as np

from lgp.kinematics import human
from lgp.kinematics.world import World
from lgp.scene.model import Robot
from lgp.scene.scene_file import known_robots
from reba.arrays import Array

SHORTEST = 0.03
"""[m] Shorter links get no capsule of their own; those of their neighbours cover them."""
FINGERS = 0.10
"""[m] The last capsule of a robot's arm ends this far before the grasping point."""
SHOULDER = 2
"""Joints of an arm whose links stay beside the body of their robot."""
RADIUS = 0.06
"""[m] Of the links of a robot that is not in the table of robots."""


@dataclass(frozen=True)
class CollisionShape:
    """One convex body.

    Attributes:
        name: for messages.
        owner: agent, or "table", or the object's own name.
        kind: "link", "base", "table" or "object".
        frame: frame it moves with ("" for one that stands still).
        branch: limb it belongs to (bodies of one limb never meet).
        reaches: whether it may meet other limbs of its own agent.
        rotation: (3, 3) in the frame, or in the world.
        position: (3,) of its centre in the frame, or in the world.
        radius: of a sphere around it [m].
        half, rim: it is every point within `rim` [m] of a box of half sides (3,) [m]; a capsule's box is a segment.
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


def bodies_of(world: World) -> tuple[CollisionShape, ...]:
    """Return every body of a world: human, robots, tables, objects."""
    found: list[CollisionShape] = []
    for agent in world.scene.agents:
        found += _robot(world, agent) if isinstance(agent, Robot) else _human(world)
    for name, table in world.scene.tables.items():
        yaw = np.radians(table.yaw)
        turn = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
        centre = np.array([*table.position, table.height - table.thickness / 2.0])
        found.append(_box(name, "table", "table", turn, centre, (*table.size, table.thickness)))
    for name, thing in world.scene.objects.items():
        found.append(_box(name, name, "object", np.eye(3), np.zeros(3), thing.size))
    return tuple(found)


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
    found = []
    for name, joint, end, radius, limb, reaches in human.capsules(person.stature, person.sex):
        # Solved legs have no joints, so nothing here knows where they are; the trunk stands for them.
        if limb.endswith("leg") and person.legs != "planted":
            continue
        frame = f"human.{joint}"
        found.append(_capsule(f"human.{name}", "human", "link", frame, limb, reaches, (np.zeros(3), end), radius))
    return found


def _robot(world: World, robot: Robot) -> list[CollisionShape]:
    known = known_robots().get(robot.model, {})
    radius = known.get("radius", RADIUS)
    found = []
    yaw = np.radians(robot.yaw)
    base = np.array([[np.cos(yaw), -np.sin(yaw), 0.0], [np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    for number, body in enumerate(known.get("bodies", [])):
        ends = tuple(np.array(robot.position) + base @ np.array(body[end], dtype=float) for end in ("from", "to"))
        name = f"{robot.name}.body_{number}"
        found.append(_capsule(name, robot.name, "base", "", name, False, (ends[0], ends[1]), body["radius"]))
    for joint, end in _links(world, robot):
        if np.linalg.norm(end) > SHORTEST:
            name = world.model.names[joint]
            chain = list(world.model.supports[joint])[1:]
            branch = world.model.names[chain[0]]
            # The first joints turn inside the shoulder, next to the body.
            reaches = len(chain) > SHOULDER
            found.append(_capsule(name, robot.name, "link", name, branch, reaches, (np.zeros(3), end), radius))
    return found


def _links(world: World, robot: Robot) -> list[tuple[int, Array]]:
    """Return (joint, far end in the joint's frame) of each link of a robot."""
    model = world.model
    found = []
    for joint in range(1, model.njoints):
        if not model.names[joint].startswith(f"{robot.name}."):
            continue
        found += [(joint, model.jointPlacements[child].translation) for child in model.children[joint]]
        for hand in robot.hands:
            frame = model.frames[world.frame_id(hand.full)]
            if frame.parentJoint == joint:
                tip = frame.placement
                found.append((joint, tip.translation - FINGERS * tip.rotation[:, 2]))
    return found
