"""What can hold an object - a table at a known place, a table anywhere on its top, a hand - and the pose it gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lgp.world.model import Kinematics
from lgp.world.rotations import exponential, exponential_with_slope, logarithm, skew
from lgp.world.scene import Hand, Table, Thing

Array = NDArray[np.float64]

FREEDOM: dict[str, tuple[int, ...]] = {"free": (0, 1, 2), "axis": (2,), "jaw": (1,), "fixed": ()}
"""Parts of the rotation vector in the hand that are variables."""


@dataclass(frozen=True)
class Pose:
    """Poses of an object in n slices.

    Attributes:
        rotation: (n, 3, 3).
        position: (n, 3).
        by_q: (n, 6, nq), linear then angular, world axes.
        by_variables: (n, 6, m) by the m variables of what holds it.
        variables: where these are in z.
    """

    rotation: Array
    position: Array
    by_q: Array
    by_variables: Array
    variables: slice

    @property
    def jacobian(self) -> Array:
        """The Jacobian by the configuration, as that of a frame."""
        return self.by_q

    def spread(self, size: int) -> Spread:
        """Return the same with one Jacobian (n, 6, nq + size) by the configuration and all variables."""
        n, rows, nq = self.by_q.shape
        jacobian = np.zeros((n, rows, nq + size))
        jacobian[:, :, :nq] = self.by_q
        jacobian[:, :, nq + self.variables.start : nq + self.variables.stop] = self.by_variables
        return Spread(self.rotation, self.position, jacobian)


@dataclass(frozen=True)
class Spread:
    """A pose whose Jacobian is by the configuration and all variables of a sequence."""

    rotation: Array
    position: Array
    jacobian: Array


@dataclass(frozen=True)
class Holder:
    """What holds an object over a stretch of phases.

    Attributes:
        by: full name of the hand or table.
        names: of its variables.
        lower, upper: their bounds [m, rad].
        variables: where they are in z.
        pose: (kinematics of n slices, (m,) variables) -> Pose.
        fit: (kinematics, (3, 3) rotation, (3,) position, slice) -> (m,) variables nearest to that pose.
        slopes: (kinematics of one slice, (k, m) variables) -> (k, 6, m) Jacobians by the variables; None where these do
            not change.
    """

    by: str
    names: tuple[str, ...]
    lower: Array
    upper: Array
    variables: slice
    pose: Callable[[Kinematics, Array], Pose]
    fit: Callable[[Kinematics, Array, Array, int], Array]
    slopes: Callable[[Kinematics, Array], Array] | None = None

    @property
    def size(self) -> int:
        """Number of variables."""
        return len(self.names)


UPRIGHT: dict[str, Array] = {
    "x": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}
"""Rotations of an object that rests with one of its axes upwards."""


def resting(table: Table, thing: Thing, x: float, y: float, yaw: float, up: str = "z") -> tuple[Array, Array]:
    """Return rotation (3, 3) and position (3,) of an object on a table at x, y [m], yaw [rad] of its top.

    Args:
        table: the table.
        thing: the object.
        x, y, yaw: where on the top.
        up: axis of the object that points upwards.
    """
    top = _about_z(np.radians(table.yaw))
    centre = np.array([*table.position, table.height])
    half = thing.size["xyz".index(up)] / 2.0
    return top @ _about_z(yaw) @ UPRIGHT[up], centre + top @ np.array([x, y, half])


def fixed_on(table: Table, thing: Thing) -> Holder:
    """Return the table an object lies on at first; nothing is variable."""
    x, y, yaw = thing.at
    rotation, position = resting(table, thing, x, y, np.radians(yaw), thing.up)

    def pose(kinematics: Kinematics, _: Array) -> Pose:
        n, nq = len(kinematics), kinematics.world.nq
        return Pose(
            np.broadcast_to(rotation, (n, 3, 3)),
            np.broadcast_to(position, (n, 3)),
            np.zeros((n, 6, nq)),
            np.zeros((n, 6, 0)),
            slice(0, 0),
        )

    def fit(*_: object) -> Array:
        return np.zeros(0)

    return Holder(table.full, (), np.zeros(0), np.zeros(0), slice(0, 0), pose, fit)


def fixed_in(hand: Hand, thing: Thing) -> Holder:
    """Return the hand an object is in at first; nothing is variable."""
    turn = exponential(np.radians(np.array(thing.in_hand[3:])))
    offset = np.array(thing.in_hand[:3])

    def pose(kinematics: Kinematics, _: Array) -> Pose:
        place = kinematics.place(hand.full)
        arm = place.rotation @ offset
        by_q = place.jacobian.copy()
        by_q[:, :3] -= skew(arm) @ place.jacobian[:, 3:]
        by_variables = np.zeros((len(kinematics), 6, 0))
        return Pose(place.rotation @ turn, place.position + arm, by_q, by_variables, slice(0, 0))

    def fit(*_: object) -> Array:
        return np.zeros(0)

    return Holder(hand.full, (), np.zeros(0), np.zeros(0), slice(0, 0), pose, fit)


def placed(table: Table, thing: Thing, start: int) -> Holder:
    """Return a table that an object is put on: x, y anywhere on the top, any yaw (twice around: no yaw is a border)."""
    margin = min(thing.size[:2]) / 2.0
    reach = np.maximum(np.array(table.size) / 2.0 - margin, 0.0)
    lower, upper = np.array([*-reach, -2.0 * np.pi]), np.array([*reach, 2.0 * np.pi])
    variables = slice(start, start + 3)
    top = _about_z(np.radians(table.yaw))

    def pose(kinematics: Kinematics, z: Array) -> Pose:
        n, nq = len(kinematics), kinematics.world.nq
        rotation, position = resting(table, thing, *z)
        by_variables = np.zeros((n, 6, 3))
        by_variables[:, :3, :2] = top[:, :2]
        by_variables[:, 5, 2] = 1.0
        return Pose(
            np.broadcast_to(rotation, (n, 3, 3)),
            np.broadcast_to(position, (n, 3)),
            np.zeros((n, 6, nq)),
            by_variables,
            variables,
        )

    def fit(kinematics: Kinematics, rotation: Array, position: Array, _: int) -> Array:
        x, y, _ = top.T @ (position - np.array([*table.position, table.height]))
        forward = top.T @ rotation[:, 0]
        return np.clip([x, y, np.arctan2(forward[1], forward[0])], lower, upper)

    return Holder(table.full, ("x", "y", "yaw"), lower, upper, variables, pose, fit)


def held(hand: Hand, thing: Thing, start: int) -> Holder:
    """Return a hand that holds an object: turned as its freedom allows, slid along the longest side of the object.

    Where and from where it takes the object is the `Grip` of its kind.
    """
    grip = thing.grip(hand.kind)
    turns = list(FREEDOM[hand.freedom])
    slides = grip.slide > 0.0
    side, at, facing = np.eye(3)[int(np.argmax(thing.size))], np.array(grip.at), _facing(np.array(grip.along))
    names = tuple(f"turn_{'xyz'[part]}" for part in turns) + (("slide",) if slides else ())
    upper = np.array([np.pi] * len(turns) + [grip.slide] * slides)
    variables = slice(start, start + len(names))

    def moved(place: Array, z: Array) -> tuple[Array, Array, Array]:
        """Return rotation (n, 3, 3), arm (n, 3), slopes (n, 6, m) of n hands (n, 3, 3), or of one and n grips."""
        vector = np.zeros((*z.shape[:-1], 3))
        vector[..., turns] = z[..., : len(turns)]
        turn, slope = exponential_with_slope(vector)
        rotation = place @ (turn @ facing)
        slid = at + z[..., -1:] * side if slides else at
        arm = -(rotation @ slid[..., None])[..., 0]
        by_variables = np.zeros((len(rotation), 6, len(names)))
        by_turn = (place @ slope)[:, :, turns]
        by_variables[:, 3:, : len(turns)] = by_turn
        by_variables[:, :3, : len(turns)] = -skew(arm) @ by_turn
        if slides:
            by_variables[:, :3, -1] = -(rotation @ side)
        return rotation, arm, by_variables

    def pose(kinematics: Kinematics, z: Array) -> Pose:
        place = kinematics.place(hand.full)
        rotation, arm, by_variables = moved(place.rotation, z)
        by_q = place.jacobian.copy()
        by_q[:, :3] -= skew(arm) @ place.jacobian[:, 3:]
        return Pose(rotation, place.position + arm, by_q, by_variables, variables)

    def slopes(kinematics: Kinematics, z: Array) -> Array:
        return moved(kinematics.place(hand.full).rotation, z)[2]

    def fit(kinematics: Kinematics, rotation: Array, position: Array, slice_: int) -> Array:
        place = kinematics.place(hand.full)
        vector = logarithm(place.rotation[slice_].T @ rotation @ facing.T)
        point = rotation.T @ (place.position[slice_] - position) - at
        return np.clip([*vector[turns], *([float(point @ side)] if slides else [])], -upper, upper)

    return Holder(hand.full, names, -upper, upper, variables, pose, fit, slopes)


def _facing(along: Array) -> Array:
    """Return the rotation (3, 3) of an object in a hand whose variables are 0: its (3,) `along` is the hand's z.

    The hand's x is the object's x as far as that goes, so that a hand from above has diag(1, -1, -1).
    """
    x = np.array([1.0, 0.0, 0.0]) if abs(along[0]) < 0.9 else np.array([0.0, 0.0, 1.0])
    x = x - (x @ along) * along
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(along, x), along])


def _about_z(angle: float) -> Array:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
