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
        """Return how far the hand is from its place behind the screw [m] and from its axis, (n, 5), by (q, z).

        The last two values are the cosines between the axis of the screw and the axes across the tool: 0 if aligned.
        """
        part = self._screwed(kinematics, z)
        hand = self._hand(kinematics)
        along, by_along = _direction(part, np.array(self.joint.along))
        place, by_place = _point(part, np.array(self.joint.screw) - self.joint.tool * np.array(self.joint.along))
        values, jacobians = [hand.position - place], [hand.jacobian[:, :3] - by_place]
        for axis in (axis for axis in range(3) if axis != self.tool_axis):
            value, jacobian = self._cosine(hand, axis, along, by_along)
            values.append(value)
            jacobians.append(jacobian)
        return Feature(np.concatenate(values, axis=1), np.concatenate(jacobians, axis=1))

    def against(self, kinematics: Kinematics, z: Array) -> Feature:
        """Return minus the cosine between tool and screw, (n, 1): <= 0 where the tool points the right way."""
        along, by_along = _direction(self._screwed(kinematics, z), np.array(self.joint.along))
        value, jacobian = self._cosine(self._hand(kinematics), self.tool_axis, along, by_along)
        return Feature(-value, -jacobian)

    def curvature(self, kinematics: Kinematics, z: Array, y: Array) -> Array:
        """Return sum_i y_i d2 reach_i by the configuration, (n, nq, nq), for (5,) weights."""
        hand = kinematics.place(self.hand.full)
        along, _ = _direction(self._screwed(kinematics, z), np.array(self.joint.along))
        bend = features.position_curvature(hand.jacobian, np.broadcast_to(y[:3], (len(kinematics), 3)))
        for weight, axis in zip(y[3:], (axis for axis in range(3) if axis != self.tool_axis), strict=True):
            bend = bend + features.axis_curvature(hand.jacobian, hand.axis(axis), weight * along)
        return bend

    def _screwed(self, kinematics: Kinematics, z: Array) -> Spread:
        return self.first.pose(kinematics, z[self.first.variables]).spread(self.size)

    def _hand(self, kinematics: Kinematics) -> Spread:
        place = kinematics.place(self.hand.full)
        nothing = np.zeros((len(kinematics), 6, 0))
        return Pose(place.rotation, place.position, place.jacobian, nothing, slice(0, 0)).spread(self.size)

    def _cosine(self, hand: Spread, axis: int, along: Array, by_along: Array) -> tuple[Array, Array]:
        own = features.axis(hand, axis)
        value = np.einsum("ni,ni->n", own.value, along)
        jacobian = np.einsum("ni,nij->nj", along, own.jacobian) + np.einsum("ni,nij->nj", own.value, by_along)
        return value[:, None], jacobian[:, None]


def _point(base: Spread, point: Array) -> tuple[Array, Array]:
    """Return the place (n, 3) of a point of an object and its Jacobian (n, 3, columns)."""
    arm = base.rotation @ point
    return base.position + arm, base.jacobian[:, :3] + cross(base.jacobian[:, 3:], arm)


def _direction(base: Spread, vector: Array) -> tuple[Array, Array]:
    """Return a direction (n, 3) that turns with an object and its Jacobian (n, 3, columns)."""
    turned = base.rotation @ vector
    return turned, cross(base.jacobian[:, 3:], turned)
