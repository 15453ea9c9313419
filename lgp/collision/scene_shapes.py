"""The collision shapes of a scene: capsules along the limbs of persons, robots by their URDF, boxes for the rest."""

from __future__ import annotations

from dataclasses import replace

import coal
import numpy as np

from lgp.collision.robot_shapes import robot_shapes
from lgp.collision.shapes import CollisionShape, box, capsule, points
from lgp.kinematics import human
from lgp.kinematics.features import rotation_about_z
from lgp.kinematics.leg_ik import LegSegments
from lgp.kinematics.world import World
from lgp.scene.model import Human, Robot
from reba.posture.columns import SIDES


def collision_shapes(world: World) -> tuple[CollisionShape, ...]:
    """Return every collision shape of a world: persons, robots, tables, objects.

    Warns with `lgp.collision.robot_shapes.MissingMeshWarning` of each mesh of a robot that does not exist.
    """
    shapes: list[CollisionShape] = []
    for agent in world.scene.agents:
        if isinstance(agent, Human):
            shapes += _human(world, agent)
        elif isinstance(agent, Robot):
            if agent.name not in world.robot_shapes:
                world.robot_shapes[agent.name] = robot_shapes(world, agent)
            shapes += world.robot_shapes[agent.name]
    for name, table in world.scene.tables.items():
        rotation = rotation_about_z(np.radians(table.yaw))
        centre = np.array([*table.position, table.height - table.thickness / 2.0])
        size = (*table.size, table.thickness)
        if not table.frame:
            shapes.append(box(name, "table", "table", rotation, centre, size))
            continue
        top = world.model.frames[world.frame_id(name)]
        joint = str(world.model.names[top.parentJoint]) if top.parentJoint else ""
        at = top.placement.act(np.array([0.0, 0.0, -table.thickness / 2.0]))
        shapes.append(replace(box(name, name, "table", top.placement.rotation.copy(), at, size), frame=joint))
        # What its link draws below the top is the table, too.
        shapes = [
            replace(shape, table=name) if shape.name.partition("/")[0] == table.frame else shape for shape in shapes
        ]
    agent_of = {name: hand.agent for name, hand in world.scene.hands.items()}
    # Both hands of a person, also where one of them acts on nothing.
    agent_of |= {f"{name}.{side}_hand": name for name in world.scene.humans for side in SIDES}
    shapes += [_grip(name, agent, world.scene.hand_clearance / 2.0) for name, agent in agent_of.items()]
    for name, item in world.scene.objects.items():
        shapes.append(box(name, name, "object", np.eye(3), np.zeros(3), item.size))
    flat_or_long = [shape for shape in shapes if shape.kind == "object" or _is_end_of_limb(world, shape)]
    shapes += [point for shape in flat_or_long for point in points(shape)]
    return tuple(shapes)


def _is_end_of_limb(world: World, shape: CollisionShape) -> bool:
    """Return whether a shape is a forearm or palm, whose two ends may be as near to another one as each other."""
    return shape.kind == "link" and shape.owner in world.scene.humans and shape.reaches


def _grip(hand: str, agent: str, radius: float) -> CollisionShape:
    middle = np.zeros(3)
    return CollisionShape(
        name=f"grip point of {hand}",
        owner=agent,
        kind="grip",
        frame=hand,
        branch=hand,
        reaches=True,
        rotation=np.eye(3),
        position=middle,
        radius=radius,
        half=middle,
        rim=radius,
        shape=coal.Sphere(radius),
        hands=frozenset([hand]),
    )


def _human(world: World, person: Human) -> list[CollisionShape]:
    shapes = []
    for part in human.capsules(person.stature, person.sex):
        shape = capsule(
            f"{person.name}.{part.name}",
            person.name,
            "link",
            f"{person.name}.{part.parent}",
            part.limb,
            (np.zeros(3), part.end),
            part.radius,
        )
        side, _, segment = part.name.partition("_")
        if part.limb.endswith("leg") and person.legs != "planted":
            shape = _leg(world, person, shape, f"{side} {segment}")
        hand = f"{person.name}.{side}_hand"
        hands = frozenset([hand] if segment == "palm" and hand in world.scene.hands else [])
        shapes.append(replace(shape, reaches=part.reaches, hands=hands))
    return shapes


def _leg(world: World, person: Human, shape: CollisionShape, leg: str) -> CollisionShape:
    """Return a part of a leg whose joints the model does not have: it follows the pelvis."""
    pelvis = f"{person.name}.{human.PELVIS}"
    if person.legs == "solved":
        return replace(shape, frame=pelvis, leg=leg)
    # Locked legs are rigid: as they stand at first.
    at = world.at(world.initial_configuration[None], [pelvis])
    ends = LegSegments(person).ends(leg, at.rotation[:, 0], at.position[:, 0])
    start, end = ((at.rotation[0, 0].T @ (point[0] - at.position[0, 0])) for point in ends)
    return capsule(shape.name, shape.owner, shape.kind, pelvis, shape.branch, (start, end), shape.rim)
