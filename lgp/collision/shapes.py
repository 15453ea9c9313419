"""One collision shape: a convex body on a frame of an agent, on an object or in the world."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import coal
import numpy as np

from reba.arrays import Array


@dataclass(frozen=True)
class JawPlacement:
    """Where a shape of a finger stands in the frame of the joint that carries its hand.

    Attributes:
        hand: full name of the hand.
        closed, opened: rotation (3, 3) and position (3,) [m].
        width: how far the jaws are apart when they are open [m].
    """

    hand: str
    closed: tuple[Array, Array]
    opened: tuple[Array, Array]
    width: float


@dataclass(frozen=True)
class CollisionShape:
    """One convex shape.

    Attributes:
        name: for messages.
        owner: agent, "table", or the name of an object or of a table that a robot carries.
        kind: "link", "base", "table", "object", "point" of a link or an object: a corner or an end, or "grip": a ball
            around the grip point of a hand, as large as half the distance that two grip points keep.
        frame: frame it is fixed to, "" for the world.
        branch: limb of a person; shapes of one limb are never checked against each other. "" for other shapes.
        reaches: whether it can touch other limbs of its agent.
        rotation, position: (3, 3) and centre (3,) [m] in the frame.
        radius: of the bounding sphere [m].
        half, rim: all points within `rim` [m] of a box of half sides `half` (3,) [m]; a segment for a capsule.
        shape: coal geometry, capsules along z.
        hands: hands that it belongs to; these may touch what they take, have and let go.
        jaw: of a finger, None for other shapes.
        leg: "left thigh", "right shank" ... of a leg whose joints are solved in closed form, "" for other shapes.
        table: that the link is, "" for other shapes: what rests on it touches the link.
    """

    name: str
    owner: str
    kind: str
    frame: str
    branch: str
    reaches: bool
    rotation: Array
    position: Array
    radius: float
    half: Array
    rim: float
    shape: Any = field(repr=False, compare=False)
    hands: frozenset[str] = frozenset()
    jaw: JawPlacement | None = None
    leg: str = ""
    table: str = ""


def box(
    name: str, owner: str, kind: str, rotation: Array, position: Array, size: tuple[float, float, float]
) -> CollisionShape:
    """Return a box of a table or an object, in the world or in the frame of the object."""
    radius = float(np.linalg.norm(size)) / 2.0
    half = np.array(size) / 2.0
    return CollisionShape(name, owner, kind, "", name, False, rotation, position, radius, half, 0.0, coal.Box(*size))


def points(shape: CollisionShape) -> list[CollisionShape]:
    """Return the corners of a box, or the ends of a capsule, as shapes.

    Where a shape is parallel to another one, the nearest point jumps between these as it turns; the distance of each
    of them has no such edge.
    """
    places = [np.array(signs) * shape.half for signs in product((-1.0, 1.0), repeat=3)]
    if not shape.half[:2].any():
        places = [np.array([0.0, 0.0, side]) for side in (-shape.half[2], shape.half[2])]
    return [
        replace(
            shape,
            kind="point",
            position=shape.position + shape.rotation @ place,
            radius=shape.rim,
            half=np.zeros(3),
            shape=coal.Sphere(shape.rim),
        )
        for place in places
    ]


def capsule(
    name: str, owner: str, kind: str, frame: str, branch: str, ends: tuple[Array, Array], radius: float
) -> CollisionShape:
    """Return a capsule between two ends (3,) [m] in a frame."""
    start, end = ends
    length = float(np.linalg.norm(end - start))
    return CollisionShape(
        name=name,
        owner=owner,
        kind=kind,
        frame=frame,
        branch=branch,
        reaches=False,
        rotation=along((end - start)[None])[0],
        position=(start + end) / 2.0,
        radius=length / 2.0 + radius,
        half=np.array([0.0, 0.0, length / 2.0]),
        rim=radius,
        shape=coal.Capsule(radius, length),
    )


def along(direction: Array) -> Array:
    """Return rotations (n, 3, 3) whose z is along directions (n, 3)."""
    z = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    aside = np.eye(3)[np.argmin(np.abs(z), axis=1)]
    y = np.cross(z, aside)
    y /= np.linalg.norm(y, axis=1, keepdims=True)
    return np.stack([np.cross(y, z), y, z], axis=2)
