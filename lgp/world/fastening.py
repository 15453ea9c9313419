"""The geometry of a screw: two objects stand as their joint says, and a hand has its tool on the screw, aligned."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lgp.world import features
from lgp.world.features import Feature, pose_difference
from lgp.world.holders import Holder, Pose, Spread
from lgp.world.model import Kinematics
from lgp.world.rotations import cross, exponential
from lgp.world.scene import Hand, Joint

Array = NDArray[np.float64]

UPRIGHT = (0, 1, 5)
"""Rows of a pose difference that matter where both objects stand on tables of one height: x, y and yaw."""

SMALL = 1e-3
"""Sine below which its series stands for an angle."""

LEVEL = 1e-9
"""[m, rad] Differences below this count as standing alike."""


@dataclass(frozen=True)
class Fastening:
    """A screw between two objects.

    Attributes:
        joint: how they are joined.
        hand: that has the tool.
        first, second: what holds the parts of the joint, in their order.
        size: number of all variables of the sequence.
    """

    joint: Joint
    hand: Hand
    first: Holder
    second: Holder
    size: int

    @property
    def tool_axis(self) -> int:
        """Axis of the hand along which its tool points: the fingers (x) of a human, the approach (z) of others."""
        return 0 if self.hand.agent == "human" else 2

    @property
    def variables(self) -> NDArray[np.intp]:
        """Which variables of the sequence the parts stand by."""
        own = [np.arange(holder.variables.start, holder.variables.stop) for holder in (self.first, self.second)]
        return np.unique(np.concatenate(own)).astype(np.intp)

    def apart(self, kinematics: Kinematics, z: Array) -> Feature:
        """Return how far the second part is from where it is joined, (n, 6) [m, rad], by (q, z)."""
        first, second = (holder.pose(kinematics, z[holder.variables]) for holder in (self.first, self.second))
        base = first.spread(self.size)
        rotation = base.rotation @ exponential(np.array([0.0, 0.0, np.radians(self.joint.yaw)]))
        position, jacobian = _point(base, np.array(self.joint.position))
        wanted = Spread(rotation, position, np.concatenate([jacobian, base.jacobian[:, 3:]], axis=1))
        return pose_difference(second.spread(self.size), wanted)

    def rows(self, kinematics: Kinematics) -> tuple[int, ...]:
        """Return which rows of `apart` to keep: those of `UPRIGHT` where the others are 0 anyway."""
        apart = self.apart(kinematics, np.zeros(self.size))
        others = [row for row in range(6) if row not in UPRIGHT]
        level = not apart.jacobian[:, others].any() and np.abs(apart.value[:, others]).max() < LEVEL
        return UPRIGHT if level else tuple(range(6))

    def reach(self, kinematics: Kinematics, z: Array) -> Feature:
        """Return how far the hand is from its place behind the screw [m] and from its axis [rad], (n, 5), by (q, z).

        The last two values are the rotation vector from the tool to the screw, about the axes across the tool.
        """
        part = self.first.pose(kinematics, z[self.first.variables]).spread(self.size)
        place = kinematics.place(self.hand.full)
        nothing = np.zeros((len(kinematics), 6, 0))
        hand = Pose(place.rotation, place.position, place.jacobian, nothing, slice(0, 0)).spread(self.size)
        along, by_along = _direction(part, np.array(self.joint.along))
        behind, by_behind = _point(part, np.array(self.joint.screw) - self.joint.tool * np.array(self.joint.along))
        slant, by_slant = _slant(*_seen(hand, along, by_along), self.tool_axis)
        return Feature(
            np.concatenate([hand.position - behind, slant], axis=1),
            np.concatenate([hand.jacobian[:, :3] - by_behind, by_slant], axis=1),
        )

    def curvature(self, kinematics: Kinematics, z: Array, y: Array) -> Array:
        """Return sum_i y_i d2 reach_i by the configuration near an aligned tool, (n, nq, nq), for (5,) weights."""
        hand = kinematics.place(self.hand.full)
        part = self.first.pose(kinematics, z[self.first.variables]).spread(self.size)
        along, _ = _direction(part, np.array(self.joint.along))
        bend = features.position_curvature(hand.jacobian, np.broadcast_to(y[:3], (len(kinematics), 3)))
        for weight, axis in zip(y[3:], _across(self.tool_axis), strict=True):
            bend = bend + features.axis_curvature(hand.jacobian, hand.axis(axis), weight * along)
        return bend


def _across(axis: int) -> tuple[int, ...]:
    return tuple(other for other in range(3) if other != axis)


def _seen(hand: Spread, along: Array, by_along: Array) -> tuple[Array, Array]:
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


def _point(base: Spread, point: Array) -> tuple[Array, Array]:
    """Return the place (n, 3) of a point of an object and its Jacobian (n, 3, columns)."""
    arm = base.rotation @ point
    return base.position + arm, base.jacobian[:, :3] + cross(base.jacobian[:, 3:], arm)


def _direction(base: Spread, vector: Array) -> tuple[Array, Array]:
    """Return a direction (n, 3) that turns with an object and its Jacobian (n, 3, columns)."""
    turned = base.rotation @ vector
    return turned, cross(base.jacobian[:, 3:], turned)
