"""Features: what constraints are made of, as values and Jacobians for a batch of slices.

Each takes placements (`model.Place` of a frame, `switches.Pose` of an object: rotation, position and Jacobians in world
axes) and returns a `Feature`. Curvature of positions and directions comes from the Jacobian alone: behind joint a every
later motion b of a chain turns with it, so the second derivative of a point is omega_a x v_b (Siciliano et al. 2009,
Robotics, section 3.1).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from lgp.world.rotations import cross, inverse_right_jacobian, logarithm

Array = NDArray[np.float64]


class Placement(Protocol):
    """Something with a pose: rotation (n, 3, 3), position (n, 3), Jacobian (n, 6, columns)."""

    @property
    def rotation(self) -> Array: ...

    @property
    def position(self) -> Array: ...

    @property
    def jacobian(self) -> Array: ...


@dataclass(frozen=True)
class Feature:
    """Values (n, m) and their Jacobian (n, m, columns)."""

    value: Array
    jacobian: Array


def position(place: Placement, target: Array | float = 0.0) -> Feature:
    """Return position - target [m], (n, 3)."""
    return Feature(place.position - target, place.jacobian[:, :3])


def axis(place: Placement, number: int) -> Feature:
    """Return axis 0, 1 or 2 of a frame as a direction in the world, (n, 3)."""
    direction = place.rotation[:, :, number]
    return Feature(direction, cross(place.jacobian[:, 3:], direction))


def along(place: Placement, number: int, direction: Array) -> Feature:
    """Return the cosine between an axis of a frame and a fixed (3,) unit direction, (n, 1)."""
    of = axis(place, number)
    return Feature(of.value @ direction[:, None], np.einsum("i,nij->nj", direction, of.jacobian)[:, None, :])


def tilt(place: Placement, limit: float) -> Feature:
    """Return cos(limit) - cos(angle between z of a hand and straight down), (n, 1): <= 0 where tilted by at most limit.

    Args:
        limit: [deg].
    """
    down = along(place, 2, np.array([0.0, 0.0, -1.0]))
    return Feature(np.cos(np.radians(limit)) - down.value, -down.jacobian)


def pose(place: Placement, rotation: Array, target: Array) -> Feature:
    """Return position - target [m] and the rotation vector [rad] from a fixed (3, 3) rotation, (n, 6)."""
    turn = logarithm(np.swapaxes(np.broadcast_to(rotation, place.rotation.shape), 1, 2) @ place.rotation)
    slopes = inverse_right_jacobian(turn) @ np.swapaxes(place.rotation, 1, 2) @ place.jacobian[:, 3:]
    return Feature(
        np.concatenate([place.position - target, turn], axis=1),
        np.concatenate([place.jacobian[:, :3], slopes], axis=1),
    )


def pose_difference(first: Placement, second: Placement) -> Feature:
    """Return how far the first pose is from the second, (n, 6): metres, then a rotation vector [rad].

    Both Jacobians must have the same columns. The rotation vector has a kink at half a turn.
    """
    turn = logarithm(np.swapaxes(second.rotation, 1, 2) @ first.rotation)
    relative = first.jacobian[:, 3:] - second.jacobian[:, 3:]
    slopes = inverse_right_jacobian(turn) @ np.swapaxes(first.rotation, 1, 2) @ relative
    return Feature(
        np.concatenate([first.position - second.position, turn], axis=1),
        np.concatenate([first.jacobian[:, :3] - second.jacobian[:, :3], slopes], axis=1),
    )


def position_curvature(jacobian: Array, weights: Array) -> Array:
    """Return sum_i weights_i d2 position_i (n, columns, columns).

    Args:
        jacobian: (n, 6, columns), columns in the order of the chain (as pinocchio numbers joints).
        weights: (n, 3).
    """
    turned = -cross(jacobian[:, 3:], weights)
    return _symmetric(np.swapaxes(turned, 1, 2) @ jacobian[:, :3])


def axis_curvature(jacobian: Array, direction: Array, weights: Array) -> Array:
    """Return sum_i weights_i d2 direction_i (n, columns, columns) of an (n, 3) direction that moves with a frame."""
    moved = cross(jacobian[:, 3:], direction)
    turned = -cross(jacobian[:, 3:], weights)
    return _symmetric(np.swapaxes(turned, 1, 2) @ moved)


def _symmetric(product: Array) -> Array:
    """Keep what the earlier joint does to the later one, for both orders."""
    upper = np.triu(product)
    return upper + np.swapaxes(np.triu(product, 1), 1, 2)
