"""Forward kinematics of one agent for all samples of a motion at once: a tree of joints, parents first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from reba.arrays import Array

BASE: Final = 0
"""Number of the frame that an agent stands in; joint n of a tree has frame n + 1."""


@dataclass(frozen=True)
class Frame:
    """A frame fixed to another one: its number, and rotation (3, 3) and position (3,) [m] in it."""

    on: int
    rotation: Array
    position: Array

    def then(self, rotation: Array, position: Array) -> Frame:
        """Return the frame with a pose (3, 3), (3,) in this one."""
        return Frame(self.on, self.rotation @ rotation, self.rotation @ position + self.position)


@dataclass(frozen=True)
class TreeJoint:
    """A joint with one coordinate.

    Attributes:
        name: `panda.panda_joint1`, as a plan names it.
        at: where it is in a frame before it.
        axis: (3,) unit vector.
        slides: whether it is prismatic.
        lower, upper: limits [rad], [m] of a slide; infinite without.
        speed: limit [rad/s], [m/s] of a slide; infinite without.
        follows: (joint, factor, offset) of a joint that mimics another one.
    """

    name: str
    at: Frame
    axis: Array
    slides: bool
    lower: float
    upper: float
    speed: float
    follows: tuple[str, float, float] | None = None


def chain_of(joints: Sequence[TreeJoint], number: int) -> list[int]:
    """Return the numbers of the frames from one to the base, both included."""
    chain = [number]
    while chain[-1] != BASE:
        chain.append(joints[chain[-1] - 1].at.on)
    return chain


def values_of(joints: Sequence[TreeJoint], moved: Mapping[str, Array], fixed: Mapping[str, float]) -> dict[str, Array]:
    """Return the value of every joint [rad, m]: (T,) as the plan moves it, else of the joint it follows, else fixed."""
    result: dict[str, Array] = {}
    for joint in joints:
        if joint.name in moved:
            result[joint.name] = moved[joint.name]
        elif joint.follows is None or joint.name in fixed:
            result[joint.name] = np.array([fixed.get(joint.name, 0.0)])
    follows = {joint.name: joint.follows for joint in joints if joint.follows is not None}

    def value(name: str) -> Array:
        if name not in result:
            leader, factor, offset = follows[name]
            result[name] = factor * (value(leader) if leader in follows or leader in result else np.zeros(1)) + offset
        return result[name]

    for name in follows:
        value(name)
    return result


def place(
    joints: Sequence[TreeJoint], rotation: Array, position: Array, values: Mapping[str, Array], count: int
) -> tuple[Array, Array]:
    """Return rotations (n + 1, T, 3, 3) and positions (n + 1, T, 3) [m] of the base and of n joints in T samples.

    Args:
        rotation, position: (3, 3) and (3,) [m] of the base.
        values: of each joint, (T,) or (1,) [rad, m].
        count: number T of samples.
    """
    rotations, positions = np.empty((len(joints) + 1, count, 3, 3)), np.empty((len(joints) + 1, count, 3))
    rotations[BASE], positions[BASE] = rotation, position
    for number, joint in enumerate(joints, 1):
        at, value = joint.at, values[joint.name]
        before = rotations[at.on] @ at.rotation
        positions[number] = positions[at.on] + rotations[at.on] @ at.position
        if joint.slides:
            rotations[number] = before
            positions[number] += value[:, None] * (before @ joint.axis)
        else:
            rotations[number] = before @ about(joint.axis, value)
    return rotations, positions


def about(axis: Array, angle: Array) -> Array:
    """Return the rotations (T, 3, 3) by angles (T,) [rad] about an axis (3,).

    >>> about(np.array([0.0, 0.0, 1.0]), np.array([np.pi / 2])).round(6)[0, 1].tolist()
    [1.0, 0.0, 0.0]
    """
    x, y, z = axis
    across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.asarray(np.eye(3) + sine * across + (1.0 - cosine) * (across @ across))


def turned(vector: Sequence[float]) -> Array:
    """Return the rotation (3, 3) by a rotation vector [deg].

    >>> turned((0.0, 0.0, 90.0)).round(6)[0].tolist()
    [0.0, -1.0, 0.0]
    """
    angle = float(np.linalg.norm(vector))
    return about(np.array(vector) / angle, np.radians([angle]))[0] if angle > 0.0 else np.eye(3)


def attached(rotations: Array, positions: Array, frames: Sequence[Frame]) -> tuple[Array, Array]:
    """Return rotations (m, T, 3, 3) and positions (m, T, 3) of m frames on the joints of a tree."""
    on = [frame.on for frame in frames]
    turn, offset = np.array([frame.rotation for frame in frames]), np.array([frame.position for frame in frames])
    return rotations[on] @ turn[:, None], positions[on] + (rotations[on] @ offset[:, None, :, None])[..., 0]


def along(direction: Array) -> Array:
    """Return rotations (T, 3, 3) whose z is along directions (T, 3) of any length; the upright for length 0."""
    length = np.linalg.norm(direction, axis=-1, keepdims=True)
    z = np.where(length > 0.0, direction / np.where(length > 0.0, length, 1.0), np.array([0.0, 0.0, 1.0]))
    least = np.eye(3)[np.argmin(np.abs(z), axis=-1)]
    x = np.cross(least, z)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.cross(z, x), z], axis=-1)
