"""How deep bodies are in each other in all samples: boxes around them first, then their shapes, then exact meshes.

Where two bodies are some distance from each other, the samples until they have moved as far are passed over.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import coal
import numpy as np
from numpy.typing import NDArray

from lgp.audit.contacts import Allowed
from lgp.audit.shapes import Body, Shape
from reba.arrays import Array, Indices

REQUEST = coal.DistanceRequest()
REQUEST.enable_signed_distance = True


@dataclass(frozen=True)
class Deepest:
    """Where two bodies are deepest in each other, beyond what they may: numbers of bodies, depth [m] and sample."""

    pair: tuple[int, int]
    depth: float
    sample: int


def deepest(
    bodies: Sequence[Body], rotation: Array, position: Array, pairs: Indices, allowed: Allowed
) -> list[Deepest]:
    """Return for each of some pairs where it is deepest, of those that are in each other.

    Args:
        bodies: m bodies.
        rotation, position: of each body (m, T, 3, 3), (m, T, 3) [m].
        pairs: (k, 2) numbers of bodies.
        allowed: what pairs may have.
    """
    near = boxes_meet(bodies, rotation, position, pairs)
    travel = _travel(bodies, rotation, position)
    for number, pair in enumerate(pairs.tolist()):
        if tuple(pair) in allowed:
            near[:, number] &= np.isfinite(allowed[tuple(pair)])
    result = []
    for number in np.flatnonzero(near.any(axis=0)).tolist():
        one, other = pairs[number].tolist()
        most = allowed.get((one, other))
        best: Deepest | None = None
        moved = travel[one] + travel[other]
        begin = 0
        for sample in np.flatnonzero(near[:, number]).tolist():
            if sample < begin:
                continue
            distance = clearance(
                bodies[one].shape, rotation[one, sample], position[one, sample],
                bodies[other].shape, rotation[other, sample], position[other, sample],
            )  # fmt: skip
            if distance > 0.0:
                begin = int(np.searchsorted(moved, moved[sample] + distance - ROUNDING))
            elif -distance > (0.0 if most is None else most[sample]) and (best is None or -distance > best.depth):
                best = Deepest((one, other), -distance, sample)
        if best is not None:
            result.append(best)
    return result


ROUNDING: Final = 1e-5
"""[m] Error of a distance that is allowed for where samples are passed over."""


def _travel(bodies: Sequence[Body], rotation: Array, position: Array) -> Array:
    """Return how far (m, T) [m] no point of a body has moved beyond since the first sample."""
    radius = np.array([np.linalg.norm(body.shape.half) for body in bodies])
    turned = np.linalg.norm(np.diff(rotation, axis=1).reshape(len(bodies), -1, 9), axis=2)
    steps = np.linalg.norm(np.diff(position, axis=1), axis=2) + radius[:, None] * turned
    return np.concatenate([np.zeros((len(bodies), 1)), np.cumsum(steps, axis=1)], axis=1)


def boxes_meet(bodies: Sequence[Body], rotation: Array, position: Array, pairs: Indices) -> NDArray[np.bool_]:
    """Return (T, k) whether the boxes around two bodies may meet: spheres first, then the six axes of both boxes."""
    half = np.array([body.shape.half for body in bodies])
    radius = np.linalg.norm(half, axis=1)
    one, other = pairs.T
    offset = position[other] - position[one]
    reach = (radius[one] + radius[other])[:, None]
    near = np.einsum("ptx,ptx->pt", offset, offset) < reach**2
    where = np.nonzero(near)
    first, second, sample = one[where[0]], other[where[0]], where[1]
    turn_first, turn_second = rotation[first, sample], rotation[second, sample]
    away = offset[where]
    between = np.abs(np.swapaxes(turn_first, 1, 2) @ turn_second)
    along_first = np.abs((away[:, None] @ turn_first)[:, 0]) - half[first] - (between @ half[second][..., None])[..., 0]
    along_second = np.abs((away[:, None] @ turn_second)[:, 0]) - half[second]
    along_second -= (half[first][:, None] @ between)[:, 0]
    near[where] = (along_first.max(axis=1) < 0.0) & (along_second.max(axis=1) < 0.0)
    return near.T


def penetration(one: Shape, turn: Array, place: Array, other: Shape, other_turn: Array, other_place: Array) -> float:
    """Return how deep [m] two shapes are in each other, 0 if they are not."""
    return max(-clearance(one, turn, place, other, other_turn, other_place), 0.0)


def clearance(one: Shape, turn: Array, place: Array, other: Shape, other_turn: Array, other_place: Array) -> float:
    """Return the distance [m] of two shapes, at least; where they are in each other, how deep, below 0.

    Meshes count as their triangles, although their hulls may touch. The depth is that of the hulls where triangles of
    two meshes cross, and where the middle of the other body is inside of the mesh.
    """
    at, other_at = coal.Transform3s(turn, place), coal.Transform3s(other_turn, other_place)
    hulls = float(coal.distance(one.convex, at, other.convex, other_at, REQUEST, coal.DistanceResult()))
    if hulls >= 0.0 or (one.exact is None and other.exact is None):
        return hulls
    if one.exact is not None and other.exact is not None:
        crossing = coal.collide(one.exact, at, other.exact, other_at, coal.CollisionRequest(), coal.CollisionResult())
        inside = one.surrounds(turn.T @ (other_place - place)) or other.surrounds(other_turn.T @ (place - other_place))
        return hulls if crossing or (inside and -hulls > min(one.half.min(), other.half.min())) else 0.0
    solid, smooth = (one, other) if one.exact is not None else (other, one)
    middle = turn.T @ (other_place - place) if solid is one else other_turn.T @ (place - other_place)
    exact = float(coal.distance(one.exact or one.convex, at, other.exact or other.convex, other_at, REQUEST,
                                coal.DistanceResult()))  # fmt: skip
    # Triangles are a surface: of a body whose middle is behind it they are less deep in than it is.
    return hulls if (exact < 0.0 or -hulls > smooth.half.min()) and solid.surrounds(middle) else exact
