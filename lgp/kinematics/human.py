"""The human as a Pinocchio model: joints, limits and frames from the table of body measures.

Joint names and senses are those of human.urdf (`human_36dof_ISB_model`), which recordings use as well. Five joints come
first: position (x, y, z), yaw and tilt of the pelvis relative to the standing position.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lgp.scene.body_measures import lengths, table
from lgp.scene.joint_units import TURN
from lgp.scene.model import PlanarBase
from reba.arrays import Array
from reba.posture.columns import SIDES

if TYPE_CHECKING:
    import pinocchio as pin

ISB = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Rotation from ISB axes (x forward, y up, z right) to world axes (x forward, y left, z up)."""
HAND = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Axes of a hand frame in the ISB axes of the hand: x along the fingers, z out of the palm."""
AXES = {"hand": HAND, "world": ISB.T}
LEGS = ("hip_Z", "hip_X", "hip_Y", "knee_Z", "ankle_Z", "ankle_X")
"""Joints of a leg, from the hip down."""


@dataclass(frozen=True)
class BodyJoint:
    """One joint of the human.

    Attributes:
        parent: name of the joint before it, "" for the floor.
        position: (3,) in the frame of that joint [m].
        axis: (3,) unit vector in ISB axes; in world axes for the pelvis.
        lower, upper: limits [rad], [m] for a prismatic joint.
    """

    name: str
    parent: str
    position: Array
    prismatic: bool
    axis: Array
    lower: float
    upper: float


def joints(stature: float, sex: str, step: PlanarBase | None = None) -> tuple[BodyJoint, ...]:
    """Return the joints of a human, parents first: pelvis, spine, left and right arm, left and right leg.

    Of one who may step, three come before them: where the soles stand, `base_x`, `base_y` and `base_yaw`.
    """
    measures = lengths(stature, sex)
    places = () if step is None else _standing_place(step)
    body: list[BodyJoint] = []
    standing = np.array([0.0, 0.0, measures["ankle_height"] + measures["shank"] + measures["thigh"]])
    for limb in _limbs():
        is_sided = "{side}" in limb[0]["name"]
        for side in SIDES if is_sided else ("right",):
            previous = places[-1].name if places and not body else ""
            for entry in limb:
                parent = sided(entry.get("after", previous), side)
                position = offset(entry, measures, side) if body else standing
                body.append(_joint(entry, parent, position, side))
                previous = body[-1].name
    return (*places, *body)


def _standing_place(step: PlanarBase) -> tuple[BodyJoint, ...]:
    """Return the joints from the place in the scene to that where a person stands."""
    x, y, z = np.eye(3)
    turns = (TURN.to_si(step.yaw[0]), TURN.to_si(step.yaw[1]))
    return (
        BodyJoint("base_x", "", np.zeros(3), True, x, *step.x),
        BodyJoint("base_y", "base_x", np.zeros(3), True, y, *step.y),
        BodyJoint("base_yaw", "base_y", np.zeros(3), False, z, *turns),
    )


def _limbs() -> list[list[dict[str, Any]]]:
    """Return the joints of the table as chains; an entry with `after` starts a new chain."""
    chains: list[list[dict[str, Any]]] = [[]]
    for entry in table()["joints"]:
        if "after" in entry:
            chains.append([])
        chains[-1].append(entry)
    return chains


def _joint(entry: dict[str, Any], parent: str, position: Array, side: str) -> BodyJoint:
    axis = np.zeros(3)
    direction = entry["axis"].removeprefix("slide ")
    axis["xyz".index(direction[1])] = -1.0 if direction[0] == "-" else 1.0
    prismatic = entry["axis"].startswith("slide")
    lower, upper = entry["limits"] if prismatic else np.radians(entry["limits"])
    if side == "left":
        axis = axis * (-1.0, -1.0, 1.0)
    parent = PELVIS if parent == "pelvis" else parent
    return BodyJoint(sided(entry["name"], side), parent, position, prismatic, axis, float(lower), float(upper))


PELVIS = "pelvis_tilt"
"""The last joint of the pelvis, parent of spine and legs."""


def sided(name: str, side: str) -> str:
    """Return a name of the table for one side: `{side}_knee_Z` for "left" is `left_knee_Z`."""
    return name.replace("{side}", side)


def offset(entry: dict[str, Any], measures: dict[str, float], side: str, key: str = "at") -> Array:
    """Return (3,) [m] from three sums of named body measures such as "xiphoid - lumbar", mirrored on the left."""
    position = np.array([_length(text, measures) for text in entry.get(key, ("0", "0", "0"))])
    return position * (1.0, 1.0, -1.0) if side == "left" else position


def _length(text: str, measures: dict[str, float]) -> float:
    total, sign = 0.0, 1.0
    for word in text.split():
        if word in "+-":
            sign = -1.0 if word == "-" else 1.0
        else:
            total, sign = total + sign * (measures[word] if word in measures else float(word)), 1.0
    return total


def human_model(stature: float, sex: str, step: PlanarBase | None = None) -> pin.Model:
    """Return the kinematic model (no inertia): 41 joints, frames `left_hand` ... `left_sole` ... `head`.

    Of a person who may step, three more come first.

    It stands at the origin and faces x; segments have ISB axes (x forward, y up, z right).
    """
    import pinocchio as pin

    model = pin.Model()
    model.name = "human"
    index = {"": 0}
    for joint in joints(stature, sex, step):
        kind = pin.JointModelPrismaticUnaligned if joint.prismatic else pin.JointModelRevoluteUnaligned
        # The pelvis moves in world axes; its children have ISB axes.
        axes = ISB if joint.parent == PELVIS else np.eye(3)
        placement = pin.SE3(axes, axes @ joint.position)
        number = model.addJoint(index[joint.parent], kind(joint.axis), placement, joint.name)
        index[joint.name] = number
        model.lowerPositionLimit[model.joints[number].idx_q] = joint.lower
        model.upperPositionLimit[model.joints[number].idx_q] = joint.upper
        model.addJointFrame(number)
    for name, parent, position, rotation in frames(stature, sex):
        placement = pin.SE3(rotation, position)
        model.addFrame(pin.Frame(name, index[parent], model.getFrameId(parent), placement, pin.FrameType.OP_FRAME))
    return model


def frames(stature: float, sex: str) -> list[tuple[str, str, Array, Array]]:
    """Return the named frames: name, parent joint, position (3,) [m] and axes (3, 3) in the frame of that joint."""
    measures = lengths(stature, sex)
    return [
        (sided(entry["name"], side), sided(entry["after"], side), offset(entry, measures, side), AXES[entry["axes"]])
        for entry in table()["frames"]
        for side in (SIDES if "{side}" in entry["name"] else ("right",))
    ]


class Capsule(NamedTuple):
    """A capsule for collisions, from a joint to `end` (3,) [m] in its frame; `reaches`: it can touch other limbs."""

    name: str
    parent: str
    end: Array
    radius: float
    limb: str
    reaches: bool


def capsules(stature: float, sex: str) -> list[Capsule]:
    """Return the collision capsules of a human."""
    measures = lengths(stature, sex)
    return [
        Capsule(
            sided(name, side),
            sided(entry["after"], side),
            offset(entry, measures, side, "to"),
            entry["radius"] * stature / 1.75,
            sided(entry["limb"], side),
            entry.get("reaches", False),
        )
        for name, entry in table()["capsules"].items()
        for side in (SIDES if "{side}" in name else ("right",))
    ]


@cache
def joint_names() -> tuple[str, ...]:
    """Return the names of the 41 joints in the order of the model."""
    return tuple(joint.name for joint in joints(1.75, "male"))
