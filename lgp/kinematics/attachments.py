"""What can hold an object - a table at a known place, a table anywhere on its top, a hand - and the pose it gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lgp.kinematics import features
from lgp.kinematics.features import (
    Feature,
    cross,
    exponential,
    exponential_with_slope,
    logarithm,
    pose_difference,
    skew,
)
from lgp.kinematics.world import Kinematics
from lgp.scene.model import Assembly, Hand, SceneObject, Table
from reba.arrays import Array, Indices

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

    def with_all_variables(self, size: int) -> FullPose:
        """Return the same with one Jacobian (n, 6, nq + size) by the configuration and all variables."""
        n, rows, nq = self.by_q.shape
        jacobian = np.zeros((n, rows, nq + size))
        jacobian[:, :, :nq] = self.by_q
        jacobian[:, :, nq + self.variables.start : nq + self.variables.stop] = self.by_variables
        return FullPose(self.rotation, self.position, jacobian)


@dataclass(frozen=True)
class FullPose:
    """A pose whose Jacobian is by the configuration and all variables of a sequence."""

    rotation: Array
    position: Array
    jacobian: Array


@dataclass(frozen=True)
class Attachment:
    """What holds an object over a stretch of phases.

    Attributes:
        parent: full name of the hand or table.
        names: of its variables.
        lower, upper: their bounds [m, rad].
        variables: where they are in z.
        pose: (kinematics of n slices, (m,) variables) -> Pose.
        fit: (kinematics, (3, 3) rotation, (3,) position, slice) -> (m,) variables nearest to that pose.
        slopes: (kinematics of one slice, (k, m) variables) -> (k, 6, m) Jacobians by the variables; None where these do
            not change.
    """

    parent: str
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


def resting(table: Table, thing: SceneObject, x: float, y: float, yaw: float, up: str = "z") -> tuple[Array, Array]:
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


def fixed_on(table: Table, thing: SceneObject) -> Attachment:
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

    return Attachment(table.full, (), np.zeros(0), np.zeros(0), slice(0, 0), pose, fit)


def fixed_in(hand: Hand, thing: SceneObject) -> Attachment:
    """Return the hand an object is in at first; nothing is variable."""
    turn = exponential(np.radians(np.array(thing.in_hand[3:])))
    offset = np.array(thing.in_hand[:3])

    def pose(kinematics: Kinematics, _: Array) -> Pose:
        place = kinematics.placement(hand.full)
        arm = place.rotation @ offset
        by_q = place.jacobian.copy()
        by_q[:, :3] -= skew(arm) @ place.jacobian[:, 3:]
        by_variables = np.zeros((len(kinematics), 6, 0))
        return Pose(place.rotation @ turn, place.position + arm, by_q, by_variables, slice(0, 0))

    def fit(*_: object) -> Array:
        return np.zeros(0)

    return Attachment(hand.full, (), np.zeros(0), np.zeros(0), slice(0, 0), pose, fit)


def placed(table: Table, thing: SceneObject, start: int) -> Attachment:
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

    return Attachment(table.full, ("x", "y", "yaw"), lower, upper, variables, pose, fit)


def held(hand: Hand, thing: SceneObject, start: int) -> Attachment:
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
        place = kinematics.placement(hand.full)
        rotation, arm, by_variables = moved(place.rotation, z)
        by_q = place.jacobian.copy()
        by_q[:, :3] -= skew(arm) @ place.jacobian[:, 3:]
        return Pose(rotation, place.position + arm, by_q, by_variables, variables)

    def slopes(kinematics: Kinematics, z: Array) -> Array:
        return moved(kinematics.placement(hand.full).rotation, z)[2]

    def fit(kinematics: Kinematics, rotation: Array, position: Array, slice_: int) -> Array:
        place = kinematics.placement(hand.full)
        vector = logarithm(place.rotation[slice_].T @ rotation @ facing.T)
        point = rotation.T @ (place.position[slice_] - position) - at
        return np.clip([*vector[turns], *([float(point @ side)] if slides else [])], -upper, upper)

    return Attachment(hand.full, names, -upper, upper, variables, pose, fit, slopes)


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


FASTENING_UPRIGHT = (0, 1, 5)
"""Rows of a pose difference that matter where both objects stand on tables of one height: x, y and yaw."""
SMALL = 1e-3
"""Sine below which its series stands for an angle."""
LEVEL = 1e-9
"""[m, rad] Differences below this count as standing alike."""


@dataclass(frozen=True)
class ScrewConstraint:
    """A screw between two objects.

    Attributes:
        assembly: how they are joined.
        hand: that has the tool.
        first, second: what holds the parts of the joint, in their order.
        size: number of all variables of the sequence.
    """

    assembly: Assembly
    hand: Hand
    first: Attachment
    second: Attachment
    size: int

    @property
    def tool_axis(self) -> int:
        """Axis of the hand along which its tool points: the fingers (x) of a human, the approach (z) of others."""
        return 0 if self.hand.agent == "human" else 2

    @property
    def variables(self) -> Indices:
        """Which variables of the sequence the parts stand by."""
        own = [np.arange(holder.variables.start, holder.variables.stop) for holder in (self.first, self.second)]
        return np.unique(np.concatenate(own)).astype(np.intp)

    def assembly_error(self, kinematics: Kinematics, z: Array) -> Feature:
        """Return how far the second part is from where it is joined, (n, 6) [m, rad], by (q, z)."""
        first, second = (holder.pose(kinematics, z[holder.variables]) for holder in (self.first, self.second))
        base = first.with_all_variables(self.size)
        rotation = base.rotation @ exponential(np.array([0.0, 0.0, np.radians(self.assembly.yaw)]))
        position, jacobian = _point(base, np.array(self.assembly.position))
        wanted = FullPose(rotation, position, np.concatenate([jacobian, base.jacobian[:, 3:]], axis=1))
        return pose_difference(second.with_all_variables(self.size), wanted)

    def rows(self, kinematics: Kinematics) -> tuple[int, ...]:
        """Return which rows of `assembly_error` to keep: those of `UPRIGHT` where the others are 0 anyway."""
        apart = self.assembly_error(kinematics, np.zeros(self.size))
        others = [row for row in range(6) if row not in FASTENING_UPRIGHT]
        level = not apart.jacobian[:, others].any() and np.abs(apart.value[:, others]).max() < LEVEL
        return FASTENING_UPRIGHT if level else tuple(range(6))

    def tool_error(self, kinematics: Kinematics, z: Array) -> Feature:
        """Return how far the hand is from its place behind the screw [m] and from its axis [rad], (n, 5), by (q, z).

        The last two values are the rotation vector from the tool to the screw, about the axes across the tool.
        """
        part = self.first.pose(kinematics, z[self.first.variables]).with_all_variables(self.size)
        place = kinematics.placement(self.hand.full)
        nothing = np.zeros((len(kinematics), 6, 0))
        hand = Pose(place.rotation, place.position, place.jacobian, nothing, slice(0, 0)).with_all_variables(self.size)
        along, by_along = _direction(part, np.array(self.assembly.along))
        behind, by_behind = _point(
            part, np.array(self.assembly.screw) - self.assembly.tool * np.array(self.assembly.along)
        )
        slant, by_slant = _slant(*_seen(hand, along, by_along), self.tool_axis)
        return Feature(
            np.concatenate([hand.position - behind, slant], axis=1),
            np.concatenate([hand.jacobian[:, :3] - by_behind, by_slant], axis=1),
        )

    def curvature(self, kinematics: Kinematics, z: Array, y: Array) -> Array:
        """Return sum_i y_i d2 reach_i by the configuration near an aligned tool, (n, nq, nq), for (5,) weights."""
        hand = kinematics.placement(self.hand.full)
        part = self.first.pose(kinematics, z[self.first.variables]).with_all_variables(self.size)
        along, _ = _direction(part, np.array(self.assembly.along))
        bend = features.position_curvature(hand.jacobian, np.broadcast_to(y[:3], (len(kinematics), 3)))
        for weight, axis in zip(y[3:], _across(self.tool_axis), strict=True):
            bend = bend + features.axis_curvature(hand.jacobian, hand.axis(axis), weight * along)
        return bend


def _across(axis: int) -> tuple[int, ...]:
    return tuple(other for other in range(3) if other != axis)


def _seen(hand: FullPose, along: Array, by_along: Array) -> tuple[Array, Array]:
    """Return a direction (n, 3) in the frame of a hand, and its Jacobian (n, 3, columns)."""
    inverse = np.swapaxes(hand.rotation, 1, 2)
    # d(R'a) = R'(da - omega x a)
    return np.einsum("nij,nj->ni", inverse, along), inverse @ (by_along - cross(hand.jacobian[:, 3:], along))


def _slant(seen: Array, by_seen: Array, axis: int) -> tuple[Array, Array]:
    """Return the angle between an axis and a unit direction as two parts (n, 2) [rad], and its Jacobian.

    The parts are those of the direction across the axis, scaled from the sine to the angle: 0 where both agree only.
    """
    sides = list(_across(axis))
    across, by_across = seen[:, sides], by_seen[:, sides]
    cosine, by_cosine = seen[:, axis], by_seen[:, axis]
    sine = np.linalg.norm(across, axis=1)
    half_square = np.einsum("ni,nij->nj", across, by_across)
    small = (sine < SMALL) & (cosine > 0.0)
    safe = np.where(small, 1.0, np.maximum(sine, 1e-9))
    angle = np.arctan2(sine, cosine)
    scale = np.where(small, 1.0 + sine**2 / 6.0, angle / safe)
    by_sine = half_square / safe[:, None]
    by_scale = (cosine[:, None] * by_sine - sine[:, None] * by_cosine) / safe[:, None] - (angle / safe**2)[
        :, None
    ] * by_sine
    by_scale = np.where(small[:, None], half_square / 3.0, by_scale)
    return scale[:, None] * across, scale[:, None, None] * by_across + across[:, :, None] * by_scale[:, None, :]


def _point(base: FullPose, point: Array) -> tuple[Array, Array]:
    """Return the place (n, 3) of a point of an object and its Jacobian (n, 3, columns)."""
    arm = base.rotation @ point
    return base.position + arm, base.jacobian[:, :3] + cross(base.jacobian[:, 3:], arm)


def _direction(base: FullPose, vector: Array) -> tuple[Array, Array]:
    """Return a direction (n, 3) that turns with an object and its Jacobian (n, 3, columns)."""
    turned = base.rotation @ vector
    return turned, cross(base.jacobian[:, 3:], turned)
