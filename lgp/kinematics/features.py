"""Kinematic features that constraints are made of, as values and Jacobians for a batch of slices.

Each feature takes placements (`FramePlacement` of a frame, `Pose` of an object: rotation, position and Jacobian in
world axes) and returns a `Feature`. The curvature of positions and directions follows from the Jacobian: joint a turns
the velocity of every later joint b of the chain, so the second derivative of a point is omega_a x v_b (Siciliano et al.
2009, Robotics, section 3.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lgp.errors import WorldError
from reba.arrays import Array


class Placement(Protocol):
    """A pose with rotation (n, 3, 3), position (n, 3) [m] and Jacobian (n, 6, columns)."""

    @property
    def rotation(self) -> Array: ...

    @property
    def position(self) -> Array: ...

    @property
    def jacobian(self) -> Array: ...


@dataclass(frozen=True)
class FullPose:
    """A pose whose Jacobian (n, 6, nq + nz) is by the configuration and all variables of a sequence."""

    rotation: Array
    position: Array
    jacobian: Array


@dataclass(frozen=True)
class Feature:
    """A feature of m values (n, m) and its Jacobian (n, m, columns).

    It can be shifted and scaled by numbers, (m,) or one for all, and its values chosen: `feature[[0, 1]] - 0.1`.
    """

    value: Array
    jacobian: Array

    def __add__(self, shift: Array | float) -> Feature:
        return Feature(self.value + shift, self.jacobian)

    def __sub__(self, shift: Array | float) -> Feature:
        return Feature(self.value - shift, self.jacobian)

    def __mul__(self, factor: Array | float) -> Feature:
        factors = np.broadcast_to(np.asarray(factor, dtype=float), self.value.shape[1:])
        return Feature(self.value * factors, self.jacobian * factors[:, None])

    def __neg__(self) -> Feature:
        return self * -1.0

    def __getitem__(self, which: list[int] | slice) -> Feature:
        return Feature(self.value[:, which], self.jacobian[:, which])


def stack(*features: Feature) -> Feature:
    """Return the values of several features as one."""
    values, jacobians = ([getattr(one, name) for one in features] for name in ("value", "jacobian"))
    return Feature(np.concatenate(values, axis=1), np.concatenate(jacobians, axis=1))


def offset(place: Placement, by: Sequence[float], turn: Array | None = None) -> FullPose:
    """Return the placement of a point fixed to a frame: (3,) [m] in its axes, turned by a rotation (3, 3).

    Raises:
        WorldError: `by` or `turn` has another shape.
    """
    for name, given, shape in (("by", by, (3,)), ("turn", np.eye(3) if turn is None else turn, (3, 3))):
        if np.shape(given) != shape:
            raise WorldError(f"offset: {name} has shape {np.shape(given)}, expected {shape}, of a point or a rotation")
    arm = place.rotation @ np.asarray(by, dtype=float)
    jacobian = place.jacobian.copy()
    jacobian[:, :3] += cross(place.jacobian[:, 3:], arm)
    return FullPose(place.rotation if turn is None else place.rotation @ turn, place.position + arm, jacobian)


def relative_position(first: Placement, second: Placement) -> Feature:
    """Return the position [m] of the second frame in the axes of the first, (n, 3)."""
    away, back = second.position - first.position, np.swapaxes(first.rotation, 1, 2)
    moved = second.jacobian[:, :3] - first.jacobian[:, :3] - cross(first.jacobian[:, 3:], away)
    return Feature((back @ away[:, :, None])[:, :, 0], back @ moved)


def difference(first: Placement, second: Placement) -> Feature:
    """Return the position of the first frame minus that of the second [m], in the axes of the world, (n, 3)."""
    return Feature(first.position - second.position, first.jacobian[:, :3] - second.jacobian[:, :3])


def distance(first: Placement, second: Placement) -> Feature:
    """Return the distance of two frames [m], (n, 1); at one point as `nearness`."""
    return -nearness(first, second, 0.0)


def outside_cone(eye: Placement, target: Placement, half_angle: float, number: int = 2) -> Feature:
    """Return cos(half angle) - cos(angle from axis `number` of an eye to a target), (n, 1): <= 0 where it is in view.

    Args:
        half_angle: of the cone [deg].
        number: axis 0, 1 or 2 of the eye along which it looks.
    """
    away = target.position - eye.position
    length = np.maximum(np.linalg.norm(away, axis=1), SMALL)[:, None]
    direction, looks = away / length, axis(eye, number)
    moved = target.jacobian[:, :3] - eye.jacobian[:, :3]
    cosine = np.einsum("ni,ni->n", direction, looks.value)
    across = (looks.value - cosine[:, None] * direction) / length
    slope = np.einsum("ni,nij->nj", direction, looks.jacobian) + np.einsum("ni,nij->nj", across, moved)
    return Feature(np.cos(np.radians(half_angle)) - cosine[:, None], -slope[:, None])


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


def nearness(first: Placement, second: Placement, least: float) -> Feature:
    """Return how much nearer [m] than `least` two frames are, (n, 1), <= 0 where they are apart, by q.

    At one point they part along the y axis of the first frame.
    """
    away = second.position - first.position
    distance = np.linalg.norm(away, axis=1)
    together = distance < SMALL
    direction = np.where(together[:, None], first.rotation[:, :, 1], away / np.maximum(distance, SMALL)[:, None])
    moved = second.jacobian[:, :3] - first.jacobian[:, :3]
    return Feature((least - distance)[:, None], -np.einsum("ni,nij->nj", direction, moved)[:, None])


def tilt(place: Placement, limit: float) -> Feature:
    """Return cos(limit) - cos(angle between z of a hand and down), (n, 1): <= 0 where tilted at most by limit [deg]."""
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
    """Return the first pose relative to the second, (n, 6): displacement [m], then a rotation vector [rad].

    Both Jacobians must have the same columns. The rotation vector is not differentiable at half a turn.
    """
    turn = logarithm(np.swapaxes(second.rotation, 1, 2) @ first.rotation)
    relative = first.jacobian[:, 3:] - second.jacobian[:, 3:]
    slopes = inverse_right_jacobian(turn) @ np.swapaxes(first.rotation, 1, 2) @ relative
    return Feature(
        np.concatenate([first.position - second.position, turn], axis=1),
        np.concatenate([first.jacobian[:, :3] - second.jacobian[:, :3], slopes], axis=1),
    )


def position_curvature(jacobian: Array, weights: Array) -> Array:
    """Return sum_i weights_i d2 position_i (n, columns, columns) for weights (n, 3).

    The columns of the Jacobian (n, 6, columns) are in the order of the chain (as pinocchio numbers joints).
    """
    turned = -cross(jacobian[:, 3:], weights)
    return _symmetric(np.swapaxes(turned, 1, 2) @ jacobian[:, :3])


def axis_curvature(jacobian: Array, direction: Array, weights: Array) -> Array:
    """Return sum_i weights_i d2 direction_i (n, columns, columns) of an (n, 3) direction that moves with a frame."""
    moved = cross(jacobian[:, 3:], direction)
    turned = -cross(jacobian[:, 3:], weights)
    return _symmetric(np.swapaxes(turned, 1, 2) @ moved)


def _symmetric(product: Array) -> Array:
    """Mirror the upper triangle: the derivative by joints (a, b) is that of a, the earlier one, acting on b."""
    upper = np.triu(product)
    return upper + np.swapaxes(np.triu(product, 1), 1, 2)


IDENTITY = np.eye(3)
SMALL = 1e-4
"""[rad] Below this angle the Taylor series are exact to rounding."""


def skew(vectors: Array) -> Array:
    """Return (..., 3, 3) matrices S with S b = a x b for (..., 3) vectors a."""
    out = np.zeros((*vectors.shape, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -vectors[..., 2], vectors[..., 1], -vectors[..., 0]
    out[..., 1, 0], out[..., 2, 0], out[..., 2, 1] = vectors[..., 2], -vectors[..., 1], vectors[..., 0]
    return out


def cross(turns: Array, arms: Array) -> Array:
    """Return turns x arms: (n, 3, k) columns each crossed with the (n, 3) vector of its row (faster than np.cross)."""
    out = np.empty_like(turns)
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(turns[:, j], arms[:, k, None], out=out[:, i])
        out[:, i] -= turns[:, k] * arms[:, j, None]
    return out


def exponential(vectors: Array) -> Array:
    """Return (..., 3, 3) rotations about (..., 3) vectors by their lengths [rad].

    >>> exponential(np.array([0.0, 0.0, np.pi / 2])).round(9)[:, 0].tolist()
    [0.0, 1.0, 0.0]
    """
    return exponential_with_slope(vectors)[0]


def exponential_with_slope(vectors: Array) -> tuple[Array, Array]:
    """Return the rotations as `exponential` does, and the left Jacobians.

    The left Jacobian (..., 3, 3) maps a change of the rotation vector to the rotation it causes, in outer axes.
    """
    squared = np.einsum("...i,...i->...", vectors, vectors)[..., None, None]
    angle = np.sqrt(squared)
    safe = np.maximum(angle, SMALL)
    small, sine = angle < SMALL, np.sin(safe)
    first = np.where(small, 1.0 - squared / 6.0, sine / safe)
    second = np.where(small, 0.5 - squared / 24.0, (1.0 - np.cos(safe)) / safe**2)
    third = np.where(small, 1.0 / 6.0 - squared / 120.0, (safe - sine) / safe**3)
    cross = skew(vectors)
    twice = cross @ cross
    return IDENTITY + first * cross + second * twice, IDENTITY + second * cross + third * twice


def rotation_about_z(angle: float) -> Array:
    """Return the rotation (3, 3) about z by an angle [rad]."""
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])


def logarithm(rotations: Array) -> Array:
    """Return (..., 3) rotation vectors, of length at most pi; at pi their sense is arbitrary."""
    sine = np.stack(
        [
            rotations[..., 2, 1] - rotations[..., 1, 2],
            rotations[..., 0, 2] - rotations[..., 2, 0],
            rotations[..., 1, 0] - rotations[..., 0, 1],
        ],
        axis=-1,
    )
    trace = np.trace(rotations, axis1=-2, axis2=-1)
    twice = np.linalg.norm(sine, axis=-1)
    angle = np.arctan2(twice, trace - 1.0)
    factor = np.where(twice < 2.0 * SMALL, 0.5 + angle**2 / 12.0, angle / np.maximum(twice, 2.0 * SMALL))
    out = factor[..., None] * sine
    turned = (twice < 2.0 * SMALL) & (trace < 0.0)
    if np.any(turned):
        # At half a turn R + 1 = 2 a a', so its longest column gives the axis a.
        both = rotations[turned] + IDENTITY
        longest = np.argmax(np.linalg.norm(both, axis=-2), axis=-1)
        axis = np.take_along_axis(both, longest[:, None, None], axis=-1)[..., 0]
        axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
        sense = np.where(np.sum(axis * sine[turned], axis=-1) < 0.0, -1.0, 1.0)
        out[turned] = axis * (sense * angle[turned])[:, None]
    return out


def inverse_right_jacobian(vectors: Array) -> Array:
    """Return (..., 3, 3) matrices from a rotation in inner axes to the change of the (..., 3) rotation vectors."""
    angle = np.linalg.norm(vectors, axis=-1)[..., None, None]
    safe = np.maximum(angle, SMALL)
    half = safe / 2.0
    second = np.where(angle < SMALL, 1.0 / 12.0 + angle**2 / 720.0, (1.0 - half / np.tan(half)) / safe**2)
    cross = skew(vectors)
    return IDENTITY + 0.5 * cross + second * (cross @ cross)
