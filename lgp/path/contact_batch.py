"""Pose continuity of objects in all contacts of a sequence at once, for B points of its problem: values, Jacobians and
curvature on stacked arrays, K contacts with two sides each.

A contact is a switch in which an object gets a new hand or table; its sides are the attachments after and before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from lgp.kinematics import features
from lgp.kinematics.attachments import Attachment
from lgp.kinematics.features import cross, exponential_with_slope, inverse_right_jacobian, logarithm, skew
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import Kinematics, World
from reba.arrays import Array, Indices

STEP: Final = 1e-6
"""[m, rad] Of the forward differences that give the second derivatives by a grip."""


@dataclass(frozen=True)
class ContactValues:
    """Rows of K contacts at B points, with what their curvature needs.

    Attributes:
        value: (B, K, 6) displacement [m] and rotation vector [rad] of the pose after relative to the one before.
        jacobian: (B, K, 6, nq + nz), by the configuration of the switch and all variables.
        rotation: (B, 2K, 3, 3) of the objects, all sides after and then all before.
        by_point: (B, 2K, 6, nq + nz) Jacobians of their poses.
        hands: (B, 2K, 3, 3) rotations of what they are attached to.
        variables: (B, nz).
    """

    value: Array
    jacobian: Array
    rotation: Array
    by_point: Array
    hands: Array
    variables: Array


class ContactBatch:
    """The contacts of some switches of a sequence.

    Args:
        contacts: numbers of the switches that are contacts.
        order: numbers of all switches whose kinematics are given to `evaluate`.
    """

    def __init__(self, world: World, modes: ModeSequence, contacts: Sequence[int], order: Sequence[int]) -> None:
        self.nq, self.nz, self.count = world.nq, modes.size, len(contacts)
        sides = [side for part in (0, 1) for side in (_sides(modes, number)[part] for number in contacts)]
        places = [order.index(number) for number in contacts] * 2
        in_hand = [side.base is None for side in sides]
        self._hands = np.flatnonzero(in_hand)
        self.frames = tuple(dict.fromkeys(sides[number].parent for number in self._hands))
        self._place = np.array(places, np.intp)[self._hands]
        self._frame = [sides[number].parent for number in self._hands]
        self._support = np.array([world.support(name) for name in self._frame]).reshape(-1, 1, self.nq)
        self._rotation, self._position = np.zeros((len(sides), 3, 3)), np.zeros((len(sides), 3))
        for number, side in enumerate(sides):
            if side.base is not None:
                self._rotation[number], self._position[number] = side.base
        self._facing = np.array([side.facing for side in sides]).reshape(-1, 3, 3)
        self._offset, self._arm = (
            np.array([getattr(side, name) for side in sides]).reshape(-1, 3) for name in ("offset", "arm")
        )
        self._turns, self._offset_by, self._arm_by = (np.zeros((len(sides), 3, self.nz)) for _ in range(3))
        for number, side in enumerate(sides):
            self._turns[number, :, side.variables] = side.turns
            self._offset_by[number, :, side.variables] = side.offset_by
            self._arm_by[number, :, side.variables] = side.arm_by
        self._variables = [
            np.arange(self.nz)[sides[number].variables] if sides[number].grip else np.zeros(0, np.intp)
            for number in self._hands
        ]

    def evaluate(self, kinematics: Kinematics, z: Array) -> ContactValues:
        """Return the rows at B points.

        Args:
            kinematics: of B times the switches in `order`, point after point, with `frames`.
            z: (B, nz).
        """
        count, nq, hands = len(z), self.nq, self._hands
        sides = 2 * self.count
        rotation = np.broadcast_to(self._rotation, (count, sides, 3, 3)).copy()
        position = np.broadcast_to(self._position, (count, sides, 3)).copy()
        frames = np.array([kinematics.index[name] for name in self._frame], np.intp)
        spatial = kinematics.spatial.reshape(count, -1, 6, nq)
        rotation[:, hands] = kinematics.rotation.reshape(count, -1, *kinematics.rotation.shape[1:])[
            :, self._place, frames
        ]
        position[:, hands] = kinematics.position.reshape(count, -1, *kinematics.position.shape[1:])[
            :, self._place, frames
        ]
        turned, away, by_point = self._attached(rotation, z)
        position += away
        moved = np.ascontiguousarray(spatial[:, self._place] * self._support)  # indexing may leave axes transposed
        flat = moved.reshape(-1, 6, nq)
        flat[:, :3] += cross(flat[:, 3:], position[:, hands].reshape(-1, 3))
        by_point[:, hands, :, :nq] = moved
        k = self.count
        turn = logarithm(np.swapaxes(turned[:, k:], 2, 3) @ turned[:, :k])
        jacobian = by_point[:, :k] - by_point[:, k:]
        jacobian[:, :, 3:] = inverse_right_jacobian(turn) @ np.swapaxes(turned[:, :k], 2, 3) @ jacobian[:, :, 3:]
        value = np.concatenate([position[:, :k] - position[:, k:], turn], axis=2)
        return ContactValues(value, jacobian, turned, by_point, rotation, z)

    def _attached(self, rotation: Array, z: Array) -> tuple[Array, Array, Array]:
        """Return rotations (B, 2K, 3, 3) and offsets (B, 2K, 3) of the objects on their parents, and the Jacobians of
        their poses (B, 2K, 6, nq + nz) by the variables alone."""
        turn, slope = exponential_with_slope(self._linear(self._turns, z))
        turned = rotation @ (turn @ self._facing)
        arm = (turned @ (self._arm + self._linear(self._arm_by, z))[..., None])[..., 0]
        away = (rotation @ (self._offset + self._linear(self._offset_by, z))[..., None])[..., 0] - arm
        by_point = np.zeros((*rotation.shape[:2], 6, self.nq + self.nz))
        by_turn = rotation @ (slope @ self._turns)
        by_point[:, :, 3:, self.nq :] = by_turn
        by_point[:, :, :3, self.nq :] = rotation @ self._offset_by - turned @ self._arm_by
        crossed = cross(by_turn.reshape(arm.size // 3, 3, self.nz), arm.reshape(-1, 3))
        by_point[:, :, :3, self.nq :] -= crossed.reshape(by_turn.shape)
        return turned, away, by_point

    def _linear(self, matrices: Array, z: Array) -> Array:
        """Return matrices (2K, 3, nz) times variables (B, nz): (B, 2K, 3)."""
        sides = len(matrices)  # no -1: a sequence of fixed grips has no variables
        return (z @ matrices.reshape(3 * sides, self.nz).T).reshape(len(z), sides, 3)

    def curvature(self, values: ContactValues, y: Array, joints: Indices) -> Array:
        """Return sum_i y_i d2 row_i (B, K, m, m) by some joints and then all variables, for weights y (B, K, 6)."""
        k, nq, hands = self.count, self.nq, self._hands
        columns = np.concatenate([joints, nq + np.arange(self.nz)])
        weights = np.concatenate([y[..., :3], (values.rotation[:, :k] @ y[..., 3:, None])[..., 0]], axis=2)
        by_point = values.by_point[..., columns]
        hessian = np.zeros((len(y), 2 * k, len(columns), len(columns)))
        own = by_point[:, hands].reshape(-1, 6, len(columns))
        signs = np.where(hands < k, 1.0, -1.0)[:, None]
        weight = (signs * weights[:, hands % k]).reshape(-1, 6)
        part = features.position_curvature(own, weight[:, :3])
        twist = np.triu(np.swapaxes(skew(weight[:, 3:]) @ own[:, 3:], 1, 2) @ own[:, 3:], 1)
        part += 0.5 * (twist + np.swapaxes(twist, 1, 2))
        part = part.reshape(len(y), len(hands), *part.shape[1:])
        self._put_grips(part, values, weight.reshape(len(y), len(hands), 6), len(joints))
        hessian[:, hands] = part
        total = hessian[:, :k] + hessian[:, k:]
        mixed = -0.5 * np.swapaxes(skew(weights[..., 3:]) @ by_point[:, k:, 3:], 2, 3) @ by_point[:, :k, 3:]
        return np.asarray(total + mixed + np.swapaxes(mixed, 2, 3))

    def _put_grips(self, part: Array, values: ContactValues, weights: Array, first: int) -> None:
        """Write the second derivatives by the variables of grips: components of a rotation vector are no consecutive
        rotations, as the columns of a chain are."""
        longest = max((len(own) for own in self._variables), default=0)
        if not longest:
            return
        # One step moves one variable of every grip, as no two sides share an attachment and a hand.
        slopes = []
        for at in range(longest):
            z = values.variables.copy()
            moved = np.unique([own[at] for own in self._variables if len(own) > at])
            z[:, moved] += STEP
            slopes.append(self._attached(values.hands, z)[2][:, self._hands, :, self.nq :])
        change = (np.stack(slopes) - values.by_point[:, self._hands, :, self.nq :]) / STEP
        weighted = np.einsum("bhr,sbhrv->bhsv", weights, change)
        for number, own in enumerate(self._variables):
            if len(own):
                by_grip = weighted[:, number, : len(own)][:, :, own]
                places = first + own
                part[:, number, places[:, None], places] = 0.5 * (by_grip + np.swapaxes(by_grip, 1, 2))


def _sides(modes: ModeSequence, number: int) -> tuple[Attachment, ...]:
    return modes.contact(number) or ()
