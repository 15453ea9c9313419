"""The human: joints, limits and frames from a table of body measures, as a Pinocchio model.

Joint names and senses are those of human.urdf (`human_36dof_ISB_model`), so that recordings and plans share them; five
joints of the pelvis against the place where the person stands come before them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from lgp.scene.body_measures import lengths, table
from reba.arrays import Array
from reba.posture.columns import SIDES

if TYPE_CHECKING:
    import pinocchio as pin

ISB = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""Axes x forward, y up, z right (ISB) in those of the world: x forward, y left, z up."""
HAND = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Axes of a hand frame in the hand's ISB axes: x along the fingers, z out of the palm."""
AXES = {"hand": HAND, "world": ISB.T}
LEGS = ("hip_Z", "hip_X", "hip_Y", "knee_Z", "ankle_Z", "ankle_X")
"""Joints of a leg, from the hip down."""


@dataclass(frozen=True)
class BodyJoint:
    """One joint of the human.

    Attributes:
        name: joint name.
        after: name of the joint it hangs from, "" for the ground.
        at: (3,) place in the frame of that joint [m].
        slide: whether it slides instead of turning.
        axis: (3,) axis.
        lower: limit [rad] or [m].
        upper: limit [rad] or [m].
    """

    name: str
    after: str
    at: Array
    slide: bool
    axis: Array
    lower: float
    upper: float


def joints(stature: float, sex: str) -> tuple[BodyJoint, ...]:
    """Return the joints of a human, parents first: pelvis, spine, left and right arm, left and right leg."""
    measures = lengths(stature, sex)
    found: list[BodyJoint] = []
    standing = np.array([0.0, 0.0, measures["ankle_height"] + measures["shank"] + measures["thigh"]])
    for limb in _limbs():
        sided = "{side}" in limb[0]["name"]
        for side in SIDES if sided else ("right",):
            previous = ""
            for entry in limb:
                after = _sided(entry.get("after", previous), side)
                at = standing if not found else _place(entry, measures, side)
                found.append(_joint(entry, after, at, side))
                previous = found[-1].name
    return tuple(found)


def _limbs() -> list[list[dict[str, Any]]]:
    """Return the joints of the table in chains; a new chain starts where `after` is given."""
    chains: list[list[dict[str, Any]]] = [[]]
    for entry in table()["joints"]:
        if "after" in entry:
            chains.append([])
        chains[-1].append(entry)
    return chains


def _joint(entry: dict[str, Any], after: str, at: Array, side: str) -> BodyJoint:
    axis = np.zeros(3)
    direction = entry["axis"].removeprefix("slide ")
    axis["xyz".index(direction[1])] = -1.0 if direction[0] == "-" else 1.0
    slide = entry["axis"].startswith("slide")
    lower, upper = entry["limits"] if slide else np.radians(entry["limits"])
    if side == "left":
        axis = axis * (-1.0, -1.0, 1.0)
    return BodyJoint(
        _sided(entry["name"], side), PELVIS if after == "pelvis" else after, at, slide, axis, float(lower), float(upper)
    )


PELVIS = "pelvis_tilt"
"""The last joint of the pelvis: what spine and legs hang from."""


def _sided(name: str, side: str) -> str:
    return name.replace("{side}", side)


def _place(entry: dict[str, Any], measures: dict[str, float], side: str, key: str = "at") -> Array:
    """Return (3,) from three sums of named measures such as "xiphoid - lumbar"."""
    place = np.array([_sum(text, measures) for text in entry.get(key, ("0", "0", "0"))])
    return place * (1.0, 1.0, -1.0) if side == "left" else place


def _sum(text: str, measures: dict[str, float]) -> float:
    total, sign = 0.0, 1.0
    for word in text.split():
        if word in "+-":
            sign = -1.0 if word == "-" else 1.0
        else:
            total, sign = total + sign * (measures[word] if word in measures else float(word)), 1.0
    return total


def human_model(stature: float, sex: str) -> pin.Model:
    """Return the Pinocchio model: 41 joints, frames `left_hand` ... `left_sole` ... `head`; no inertia.

    The model stands at the origin and faces x; all axes of the body are ISB (x forward, y up, z right).
    """
    import pinocchio as pin

    model = pin.Model()
    model.name = "human"
    index = {"": 0}
    for joint in joints(stature, sex):
        kind = pin.JointModelPrismaticUnaligned if joint.slide else pin.JointModelRevoluteUnaligned
        # The pelvis moves in the axes of the world; everything it carries has those of the body.
        turn = ISB if joint.after == PELVIS else np.eye(3)
        at = pin.SE3(turn, turn @ joint.at)
        number = model.addJoint(index[joint.after], kind(joint.axis), at, joint.name)
        index[joint.name] = number
        model.lowerPositionLimit[model.joints[number].idx_q] = joint.lower
        model.upperPositionLimit[model.joints[number].idx_q] = joint.upper
        model.addJointFrame(number)
    for name, after, at, rotation in frames(stature, sex):
        parent = model.getFrameId(after)
        model.addFrame(pin.Frame(name, index[after], parent, pin.SE3(rotation, at), pin.FrameType.OP_FRAME))
    return model


def frames(stature: float, sex: str) -> list[tuple[str, str, Array, Array]]:
    """Return the named frames: name, joint it moves with, (3,) place and (3, 3) axes in that joint's frame."""
    measures = lengths(stature, sex)
    return [
        (_sided(entry["name"], side), _sided(entry["after"], side), _place(entry, measures, side), AXES[entry["axes"]])
        for entry in table()["frames"]
        for side in (SIDES if "{side}" in entry["name"] else ("right",))
    ]


class Capsule(NamedTuple):
    """A body for collisions: from a joint to `end` (3,) [m] in its frame; `reaches`: it may meet the other limbs."""

    name: str
    after: str
    end: Array
    radius: float
    limb: str
    reaches: bool


def capsules(stature: float, sex: str) -> list[Capsule]:
    """Return the bodies for collisions."""
    measures = lengths(stature, sex)
    return [
        Capsule(
            _sided(name, side),
            _sided(entry["after"], side),
            _place(entry, measures, side, "to"),
            entry["radius"] * stature / 1.75,
            _sided(entry["limb"], side),
            entry.get("reaches", False),
        )
        for name, entry in table()["capsules"].items()
        for side in (SIDES if "{side}" in name else ("right",))
    ]


@cache
def joint_names() -> tuple[str, ...]:
    """Return the names of the 41 joints in the order of the model."""
    return tuple(joint.name for joint in joints(1.75, "male"))
