"""The agents of an audit: the person from the table of the human body, robots from their URDF."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from lgp.audit.joint_tree import BASE, Frame, TreeJoint, about, chain_of, turned
from lgp.audit.robot_file import RobotFile, robot_file
from lgp.audit.shapes import PERSON, ROBOT, Body, capsule
from lgp.errors import WorldError
from lgp.kinematics import human
from lgp.kinematics.human_speeds import speed_limit
from lgp.kinematics.leg_ik import rest_posture
from lgp.kinematics.robot import urdf_of
from lgp.scene.joint_units import unit_of
from lgp.scene.model import Agent, Hand, Human, Robot
from reba.arrays import Array
from reba.posture.columns import SIDES


@dataclass(frozen=True, eq=False)
class AgentModel:
    """The kinematics and bodies of an agent.

    Attributes:
        rotation, position: (3, 3) and (3,) [m] of its base.
        fixed: joint -> value [rad, m] where the plan does not move it.
        hands: full name -> frame of its grip point.
        parts: bodies, each with its frame.
        legs: bodies that follow the pelvis, for legs solved in closed form: body -> "left thigh".
        soles: frames that must stay where they stand, for planted legs.
        notes: what has no body.
        file: the URDF of a robot.
        frames: of a person by name: joints, hands and soles.
    """

    agent: Agent
    joints: tuple[TreeJoint, ...]
    rotation: Array
    position: Array
    fixed: Mapping[str, float]
    hands: Mapping[str, Frame]
    parts: tuple[tuple[Body, Frame], ...]
    legs: Mapping[str, str] = field(default_factory=dict)
    soles: Mapping[str, Frame] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    file: RobotFile | None = None
    frames: Mapping[str, Frame] = field(default_factory=dict)

    def ground(self, frames: tuple[Array, Array]) -> tuple[Array, Array] | None:
        """Return where a person who may step stands, of all frames (n + 1, T, ...) of joints; None for others."""
        if not isinstance(self.agent, Human) or self.agent.step is None:
            return None
        at = 1 + [joint.name for joint in self.joints].index(self.agent.ground)
        return frames[0][at], frames[1][at]

    def chain(self, number: int) -> list[int]:
        """Return the frames from one to the base, both included."""
        return chain_of(self.joints, number)


def person_model(person: Human) -> AgentModel:
    """Return the person: joints and capsules of the table of the human body."""
    tree: list[TreeJoint] = []
    number = {"": BASE}
    for joint in human.joints(person.stature, person.sex, person.step):
        axes = human.ISB if joint.parent == human.PELVIS else np.eye(3)  # the pelvis moves in the axes of the world
        at = Frame(number[joint.parent], axes, axes @ joint.position)
        speed = speed_limit(joint.name, person)
        name = f"{person.name}.{joint.name}"
        tree.append(TreeJoint(name, at, joint.axis, joint.prismatic, joint.lower, joint.upper, speed))
        number[joint.name] = len(tree)
    frames = {
        name: Frame(number[parent], rotation, position)
        for name, parent, position, rotation in human.frames(person.stature, person.sex)
    }
    parts, legs = [], {}
    for part in human.capsules(person.stature, person.sex):
        side, _, segment = part.name.partition("_")
        hand = f"{person.name}.{side}_hand"
        acts = segment == "palm" and hand in {one.full for one in person.hands}
        name = f"{person.name}.{part.name}"
        length = float(np.linalg.norm(part.end))
        body = Body(name, PERSON, person.name, number[part.parent], capsule(part.radius, length),
                    frozenset([hand] if acts else []), part.limb)  # fmt: skip
        parts.append((body, Frame(number[part.parent], _towards(part.end), part.end / 2.0)))
        if part.limb.endswith("leg") and person.legs == "solved":
            legs[name] = f"{side} {segment}"
    slides = {joint.name for joint in tree if joint.slides}
    fixed = {f"{person.name}.{name}": value for name, value in rest_posture(person.stature, person.sex).items()}
    soles = {f"{side}_sole": frames[f"{side}_sole"] for side in ("left", "right")}
    return AgentModel(
        agent=person,
        joints=tuple(tree),
        rotation=_upright(person.yaw),
        position=np.array(person.position),
        fixed=fixed | _stated(person, slides),
        # Both, also where one of them acts on nothing.
        hands={f"{person.name}.{side}_hand": frames[f"{side}_hand"] for side in SIDES},
        parts=tuple(parts),
        legs=legs,
        soles=soles if person.legs == "planted" else {},
        frames={name: Frame(at, np.eye(3), np.zeros(3)) for name, at in number.items() if name} | frames,
    )


def _upright(yaw: float) -> Array:
    return np.asarray(about(np.array([0.0, 0.0, 1.0]), np.radians([yaw]))[0])


def _towards(direction: Array) -> Array:
    """Return a rotation (3, 3) whose z is along a direction (3,)."""
    z = direction / np.linalg.norm(direction)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(z)))], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def _stated(agent: Agent, slides: set[str]) -> dict[str, float]:
    """Return the joints that the scene states, `agent.joint` -> [rad, m]."""
    full = {f"{agent.name}.{name}": value for name, value in agent.joints.items()}
    return {name: unit_of(name in slides).to_si(value) for name, value in full.items()}


def _grip(frame: Frame, hand: Hand) -> Frame:
    turn = turned(hand.rotation)
    return frame.then(turn, hand.reach * turn[:, 2])


def robot_model(robot: Robot) -> AgentModel:
    """Return a robot as its URDF describes it.

    Raises:
        WorldError: the URDF or a mesh is damaged, or a frame of a hand is not there.
    """
    path = urdf_of(robot.model, robot.packages)
    file = robot_file(path, robot.base, robot.packages)
    tree = tuple(
        TreeJoint(f"{robot.name}.{joint.name}", joint.at, joint.axis, joint.slides, joint.lower, joint.upper,
                  joint.speed, _full(robot.name, joint.follows))
        for joint in file.joints
    )  # fmt: skip
    hands = {}
    for hand in robot.hands:
        if hand.frame not in file.frames:
            raise WorldError(f"{path}: has no link or joint {hand.frame!r}; correct the frame of {hand.full}")
        hands[hand.full] = _grip(file.frames[hand.frame], hand)
    parts = tuple(
        (Body(f"{robot.name}.{link}", ROBOT, robot.name, frame.on, shape), frame) for link, frame, shape in file.parts
    )
    notes = tuple(f"{robot.name}: {note}" for note in file.notes)
    return AgentModel(
        agent=robot,
        joints=tree,
        rotation=_upright(robot.yaw),
        position=np.array(robot.position),
        fixed=_stated(robot, {joint.name for joint in tree if joint.slides}),
        hands=hands,
        parts=parts,
        notes=notes if parts or notes else (f"{robot.name}: its URDF has no <collision>, so it has no body",),
        file=file,
    )


def _full(robot: str, follows: tuple[str, float, float] | None) -> tuple[str, float, float] | None:
    return None if follows is None else (f"{robot}.{follows[0]}", *follows[1:])
