"""Attachments of an object: fixed on a table or in a hand, placed on a table, held by a hand; and screws.

An attachment is the parent of an object in the kinematic tree. It gives the pose of the object as a function of the
configuration and of a few variables of its own, with both Jacobians.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lgp.kinematics import features
from lgp.kinematics.features import (
    IDENTITY,
    Feature,
    FullPose,
    cross,
    exponential,
    exponential_with_slope,
    logarithm,
    pose_difference,
    rotation_about_z,
)
from lgp.kinematics.world import Kinematics
from lgp.scene.model import Assembly, Hand, SceneObject, Table
from reba.arrays import Array, Indices

FREEDOM: dict[str, tuple[int, ...]] = {"free": (0, 1, 2), "axis": (2,), "jaw": (1,), "fixed": ()}
"""Components of the rotation vector between hand and object that are variables."""


@dataclass(frozen=True)
class Pose:
    """Poses of an object in n slices: rotation (n, 3, 3) and position (n, 3) [m].

    Attributes:
        by_q: Jacobian (n, 6, nq), linear then angular, world axes.
        by_variables: Jacobian (n, 6, m) by the m variables of its attachment.
        variables: the slice of z with these variables.
    """

    rotation: Array
    position: Array
    by_q: Array
    by_variables: Array
    variables: slice

    @property
    def jacobian(self) -> Array:
        """The Jacobian by the configuration, as for a frame."""
        return self.by_q

    def with_all_variables(self, size: int) -> FullPose:
        """Return the pose with one Jacobian (n, 6, nq + size) by the configuration and all variables z."""
        n, rows, nq = self.by_q.shape
        jacobian = np.zeros((n, rows, nq + size))
        jacobian[:, :, :nq] = self.by_q
        jacobian[:, :, nq + self.variables.start : nq + self.variables.stop] = self.by_variables
        return FullPose(self.rotation, self.position, jacobian)


@dataclass(frozen=True)
class Attachment:
    """The hand or table that an object is attached to during some phases.

    At variables z (m,) the object has, on a parent with rotation R and position p, the rotation
    R exp(turns z) facing and the position p + R (offset + offset_by z) - rotation (arm + arm_by z).

    Attributes:
        parent: full name of the hand or table.
        names: of its m variables; `lower` and `upper` are their bounds [m, rad].
        variables: their slice of z.
        fit: (kinematics, rotation (3, 3), position (3,), slice) -> variables (m,) of the nearest pose.
        base: rotation (3, 3) and position (3,) of a table that stands, None for what moves: a hand, a carried table.
        facing: (3, 3).
        turns, offset_by, arm_by: (3, m); `offset` and `arm` are (3,) [m].
        grip: whether its slopes change with its variables.
    """

    parent: str
    names: tuple[str, ...]
    lower: Array
    upper: Array
    variables: slice
    fit: Callable[[Kinematics, Array, Array, int], Array]
    base: tuple[Array, Array] | None
    facing: Array
    turns: Array
    offset: Array
    offset_by: Array
    arm: Array
    arm_by: Array
    grip: bool = False

    @property
    def size(self) -> int:
        """Number of variables."""
        return len(self.names)

    def pose(self, kinematics: Kinematics, z: Array) -> Pose:
        """Return the poses of the object in n slices, for its variables (m,)."""
        n, nq = len(kinematics), kinematics.world.nq
        if self.base is None:
            place = kinematics.placement(self.parent)
            rotation, position, by_q = place.rotation, place.position, place.jacobian.copy()
        else:
            rotation, position = np.broadcast_to(self.base[0], (n, 3, 3)), np.broadcast_to(self.base[1], (n, 3))
            by_q = np.zeros((n, 6, nq))
        turn, slope = exponential_with_slope(self.turns @ z)
        turned = rotation @ (turn @ self.facing)
        away = rotation @ (self.offset + self.offset_by @ z) - turned @ (self.arm + self.arm_by @ z)
        if self.base is None:
            by_q[:, :3] += cross(by_q[:, 3:], away)
        by_variables = np.zeros((n, 6, self.size))
        by_variables[:, 3:] = rotation @ (slope @ self.turns)
        by_variables[:, :3] = rotation @ self.offset_by - turned @ self.arm_by
        by_variables[:, :3] -= cross(by_variables[:, 3:], turned @ (self.arm + self.arm_by @ z))
        return Pose(turned, position + away, by_q, by_variables, self.variables)


UPRIGHT: dict[str, Array] = {
    "x": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}
"""Rotation of an object that stands with the named axis upwards."""


def resting(
    table: Table, scene_object: SceneObject, x: float, y: float, yaw: float, up: str = "z"
) -> tuple[Array, Array]:
    """Return rotation (3, 3) and position (3,) [m] of an object on a table, its axis `up` upwards.

    x, y [m] and yaw [rad] are relative to the centre of the top.
    """
    top = rotation_about_z(np.radians(table.yaw))
    centre = np.array([*table.position, table.height])
    half = scene_object.size["xyz".index(up)] / 2.0
    return top @ rotation_about_z(yaw) @ UPRIGHT[up], centre + top @ np.array([x, y, half])


def fixed_on(table: Table, scene_object: SceneObject) -> Attachment:
    """Return the attachment to the table that an object is on initially, without variables."""
    x, y, yaw = scene_object.at
    base = resting(table.top if table.frame else table, scene_object, x, y, np.radians(yaw), scene_object.up)
    if table.frame:
        return _without_variables(table.full, None, *base)
    return _without_variables(table.full, base, IDENTITY, np.zeros(3))


def fixed_in(hand: Hand, scene_object: SceneObject) -> Attachment:
    """Return the attachment to the hand that has an object initially, without variables."""
    turn = exponential(np.radians(np.array(scene_object.in_hand[3:])))
    return _without_variables(hand.full, None, turn, np.array(scene_object.in_hand[:3]))


def _without_variables(parent: str, base: tuple[Array, Array] | None, facing: Array, offset: Array) -> Attachment:
    def fit(*_: object) -> Array:
        return np.zeros(0)

    none, by = np.zeros(0), np.zeros((3, 0))
    return Attachment(parent, (), none, none, slice(0, 0), fit, base, facing, by, offset, by, np.zeros(3), by)


def placed(table: Table, scene_object: SceneObject, first_variable: int) -> Attachment:
    """Return the attachment to a table where an object is placed: x, y on the top and yaw are variables.

    Yaw spans two turns each way, so that no yaw is near a bound.
    """
    margin = min(scene_object.size[:2]) / 2.0
    reach = np.maximum(np.array(table.size) / 2.0 - margin, 0.0)
    lower, upper = np.array([*-reach, -2.0 * np.pi]), np.array([*reach, 2.0 * np.pi])
    top, centre = rotation_about_z(np.radians(table.yaw)), np.array([*table.position, table.height])

    def fit(kinematics: Kinematics, rotation: Array, position: Array, slice_: int) -> Array:
        at, middle = top, centre
        if table.frame:
            place = kinematics.placement(table.full)
            at, middle = place.rotation[slice_], place.position[slice_]
        x, y, _ = at.T @ (position - middle)
        forward = at.T @ rotation[:, 0]
        return np.clip([x, y, np.arctan2(forward[1], forward[0])], lower, upper)

    return Attachment(
        parent=table.full,
        names=("x", "y", "yaw"),
        lower=lower,
        upper=upper,
        variables=slice(first_variable, first_variable + 3),
        fit=fit,
        base=None if table.frame else (top, centre),
        facing=IDENTITY,
        turns=np.diag([0.0, 0.0, 1.0]),
        offset=np.array([0.0, 0.0, scene_object.size[2] / 2.0]),
        offset_by=np.diag([1.0, 1.0, 0.0]),
        arm=np.zeros(3),
        arm_by=np.zeros((3, 3)),
    )


def held(hand: Hand, scene_object: SceneObject, first_variable: int) -> Attachment:
    """Return the attachment to a hand: rotation as its freedom allows, offset along the longest side of the object.

    The grip of the hand's kind gives the grasping point and the direction of approach.
    """
    grip = scene_object.grip(hand.kind)
    turns = list(FREEDOM[hand.freedom])
    slides = grip.slide > 0.0
    side, at, facing = np.eye(3)[int(np.argmax(scene_object.size))], np.array(grip.at), _facing(np.array(grip.along))
    names = tuple(f"turn_{'xyz'[part]}" for part in turns) + (("slide",) if slides else ())
    upper = np.array([np.pi] * len(turns) + [grip.slide] * slides)
    nothing = np.zeros((3, len(names)))
    by_turn, by_slide = nothing.copy(), nothing.copy()
    by_turn[turns, range(len(turns))] = 1.0
    if slides:
        by_slide[:, -1] = side

    def fit(kinematics: Kinematics, rotation: Array, position: Array, slice_: int) -> Array:
        place = kinematics.placement(hand.full)
        vector = logarithm(place.rotation[slice_].T @ rotation @ facing.T)
        point = rotation.T @ (place.position[slice_] - position) - at
        return np.clip([*vector[turns], *([float(point @ side)] if slides else [])], -upper, upper)

    return Attachment(
        parent=hand.full,
        names=names,
        lower=-upper,
        upper=upper,
        variables=slice(first_variable, first_variable + len(names)),
        fit=fit,
        base=None,
        facing=facing,
        turns=by_turn,
        offset=np.zeros(3),
        offset_by=nothing,
        arm=at,
        arm_by=by_slide,
        grip=bool(names),
    )


def _facing(along: Array) -> Array:
    """Return the rotation (3, 3) of an object in the hand at zero variables: its direction `along` is the hand's z.

    The hand's x is the projection of the object's x, so that an approach from above has diag(1, -1, -1).
    """
    x = np.array([1.0, 0.0, 0.0]) if abs(along[0]) < 0.9 else np.array([0.0, 0.0, 1.0])
    x = x - (x @ along) * along
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(along, x), along])


PLANAR_ROWS = (0, 1, 5)
"""Rows x, y and yaw of a pose difference: the only ones that vary where both objects stand on tables."""
SMALL = 1e-3
"""Sine below which an angle is computed by its series; the error is of order sine^4."""
LEVEL = 1e-9
"""[m, rad] Rounding of pose differences: smaller ones count as zero."""


@dataclass(frozen=True)
class ScrewConstraint:
    """The constraint of a screw between two objects: both stand as assembled, the tool is on the screw and aligned.

    Attributes:
        hand: the hand with the tool.
        first, second: attachments of the parts, in the order of the assembly.
        size: number of variables nz of the whole sequence.
    """

    assembly: Assembly
    hand: Hand
    first: Attachment
    second: Attachment
    size: int

    @property
    def tool_axis(self) -> int:
        """Axis of the hand along which the tool points: fingers (x) of a human, approach (z) of a robot."""
        return 0 if self.hand.human else 2

    @property
    def variables(self) -> Indices:
        """Indices in z of the variables of both attachments."""
        own = [np.arange(part.variables.start, part.variables.stop) for part in (self.first, self.second)]
        return np.unique(np.concatenate(own)).astype(np.intp)

    def assembly_error(self, kinematics: Kinematics, z: Array) -> Feature:
        """Return the pose of the second part relative to its assembled pose, (n, 6) [m, rad], by (q, z)."""
        first, second = (part.pose(kinematics, z[part.variables]) for part in (self.first, self.second))
        base = first.with_all_variables(self.size)
        rotation = base.rotation @ exponential(np.array([0.0, 0.0, np.radians(self.assembly.yaw)]))
        position, jacobian = _point(base, np.array(self.assembly.position))
        assembled = FullPose(rotation, position, np.concatenate([jacobian, base.jacobian[:, 3:]], axis=1))
        return pose_difference(second.with_all_variables(self.size), assembled)

    def rows(self, kinematics: Kinematics) -> tuple[int, ...]:
        """Return the rows of `assembly_error` to constrain: `PLANAR_ROWS` where the others are always 0, else all."""
        error = self.assembly_error(kinematics, np.zeros(self.size))
        others = [row for row in range(6) if row not in PLANAR_ROWS]
        level = max(np.abs(part[:, others]).max() for part in (error.jacobian, error.value)) < LEVEL
        return PLANAR_ROWS if level else tuple(range(6))

    def tool_error(self, kinematics: Kinematics, z: Array) -> Feature:
        """Return the error of the tool, (n, 5), by (q, z): position behind the screw [m], angle to its axis [rad].

        The angle is a rotation vector from tool to screw, two components across the tool.
        """
        part = self.first.pose(kinematics, z[self.first.variables]).with_all_variables(self.size)
        place = kinematics.placement(self.hand.full)
        no_variables = np.zeros((len(kinematics), 6, 0))
        hand = Pose(place.rotation, place.position, place.jacobian, no_variables, slice(0, 0))
        hand_pose = hand.with_all_variables(self.size)
        along, by_along = _direction(part, np.array(self.assembly.along))
        behind, by_behind = _point(
            part, np.array(self.assembly.screw) - self.assembly.tool * np.array(self.assembly.along)
        )
        misalignment, by_misalignment = _misalignment(*_in_axes_of(hand_pose, along, by_along), self.tool_axis)
        return Feature(
            np.concatenate([hand_pose.position - behind, misalignment], axis=1),
            np.concatenate([hand_pose.jacobian[:, :3] - by_behind, by_misalignment], axis=1),
        )

    def curvature(self, kinematics: Kinematics, z: Array, y: Array) -> Array:
        """Return sum_i y_i d2 tool_error_i by the configuration (n, nq, nq) at an aligned tool, for weights y (5,)."""
        hand = kinematics.placement(self.hand.full)
        part = self.first.pose(kinematics, z[self.first.variables]).with_all_variables(self.size)
        along, _ = _direction(part, np.array(self.assembly.along))
        hessian = features.position_curvature(hand.jacobian, np.broadcast_to(y[:3], (len(kinematics), 3)))
        for weight, axis in zip(y[3:], _across(self.tool_axis), strict=True):
            hessian = hessian + features.axis_curvature(hand.jacobian, hand.axis(axis), weight * along)
        return hessian


def _across(axis: int) -> tuple[int, ...]:
    return tuple(other for other in range(3) if other != axis)


def _in_axes_of(hand: FullPose, along: Array, by_along: Array) -> tuple[Array, Array]:
    """Return a direction (n, 3) in the axes of a hand, and its Jacobian (n, 3, columns)."""
    inverse = np.swapaxes(hand.rotation, 1, 2)
    # d(R'a) = R'(da - omega x a)
    return np.einsum("nij,nj->ni", inverse, along), inverse @ (by_along - cross(hand.jacobian[:, 3:], along))


def _misalignment(direction: Array, by_direction: Array, axis: int) -> tuple[Array, Array]:
    """Return the angle from an axis to a unit direction as two components (n, 2) [rad], and its Jacobian.

    They are the components of the direction across the axis, scaled from sine to angle: 0 where both agree, and at the
    exactly opposite direction, which has no side.
    """
    sides = list(_across(axis))
    across, by_across = direction[:, sides], by_direction[:, sides]
    cosine, by_cosine = direction[:, axis], by_direction[:, axis]
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
    """Return the position (n, 3) of a point fixed to an object and its Jacobian (n, 3, columns)."""
    arm = base.rotation @ point
    return base.position + arm, base.jacobian[:, :3] + cross(base.jacobian[:, 3:], arm)


def _direction(base: FullPose, vector: Array) -> tuple[Array, Array]:
    """Return a direction (n, 3) fixed to an object and its Jacobian (n, 3, columns)."""
    turned = base.rotation @ vector
    return turned, cross(base.jacobian[:, 3:], turned)
