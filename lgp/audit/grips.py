"""How far a hand is from where it should be: at the grip of an object, at a table, with a tool at a screw."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lgp.audit.faults import LEVEL, TOUCHING
from lgp.audit.joint_tree import about
from lgp.scene.model import Assembly, Hand, SceneObject
from reba.arrays import Array

Pose = tuple[Array, Array]
"""Rotation (3, 3) and position (3,) [m]."""


def grip_error(hand: Hand, item: SceneObject, hand_pose: Pose, pose: Pose) -> float:
    """Return how far [m] a grip point is from the places where its kind of hand may take an object."""
    grip = item.grip(hand.kind)
    beside = pose[0].T @ (hand_pose[1] - pose[1]) - np.array(grip.at)
    longest = int(np.argmax(item.size))
    beside[longest] -= np.clip(beside[longest], -grip.slide, grip.slide)
    return float(np.linalg.norm(beside))


def direction_error(hand: Hand, item: SceneObject, hand_pose: Pose, pose: Pose) -> float:
    """Return how far [deg] a hand is turned from the grip of an object, beyond the freedom that it has.

    At its grip the hand's z is the direction of approach and its x is as near as possible to the object's x.
    """
    z = np.array(item.grip(hand.kind).along)
    x = np.array([1.0, 0.0, 0.0]) if abs(z[0]) < 0.9 else np.array([0.0, 0.0, 1.0])
    x = x - (x @ z) * z
    x /= np.linalg.norm(x)
    wanted = pose[0] @ np.stack([x, np.cross(z, x), z], axis=1)
    compared = {"axis": (2,), "jaw": (1,), "fixed": (1, 2)}.get(hand.freedom, ())
    return max((_angle(hand_pose[0][:, axis], wanted[:, axis]) for axis in compared), default=0.0)


def _angle(one: Array, other: Array) -> float:
    """Return the angle [deg] between two unit vectors (3,)."""
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other)))


def tilt_error(hand: Hand, hand_pose: Pose) -> float:
    """Return how far [deg] a hand at a table is tilted beyond what it may be."""
    return _angle(hand_pose[0][:, 2], np.array([0.0, 0.0, -1.0])) - hand.tilt


def tool_errors(
    assembly: Assembly, hand: Hand, hand_pose: Pose, first: Pose, second: Pose
) -> Iterator[tuple[str, float]]:
    """Yield what is wrong with a screw, and how much [m, deg]: parts not as assembled, the tool beside or askew."""
    turn, place = first
    upright = about(np.array([0.0, 0.0, 1.0]), np.radians([assembly.yaw]))[0]
    beside = float(np.linalg.norm(turn @ np.array(assembly.position) + place - second[1]))
    if beside > TOUCHING:
        yield f"{assembly.parts[1]} is {1000 * beside:.1f} mm from its place beside {assembly.parts[0]}", beside
    wanted = turn @ upright
    turned = max(_angle(second[0][:, axis], wanted[:, axis]) for axis in range(3))
    if turned > LEVEL:
        yield f"{assembly.parts[1]} is turned {turned:.1f} deg from its place beside {assembly.parts[0]}", turned
    along = np.array(assembly.along)
    grip = turn @ (np.array(assembly.screw) - assembly.tool * along) + place
    beside = float(np.linalg.norm(hand_pose[1] - grip))
    if beside > TOUCHING:
        yield f"the tool of {hand.full} is {1000 * beside:.1f} mm from the screw", beside
    askew = _angle(hand_pose[0][:, 0 if hand.human else 2], turn @ along)
    if askew > LEVEL:
        yield f"the tool of {hand.full} is {askew:.1f} deg askew", askew
