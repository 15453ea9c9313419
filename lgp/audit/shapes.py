"""The bodies of an audit: capsules, boxes, cylinders, balls and triangle meshes, with what encloses them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import coal
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from reba.arrays import Array

PERSON: Final = "person"
ROBOT: Final = "robot"
TABLE: Final = "table"
OBJECT: Final = "object"
OBSTACLE: Final = "obstacle"
NEIGHBOURS: Final = 250
"""Neighbours of a corner of a convex hull; coal counts them in a byte."""


@dataclass(frozen=True)
class Shape:
    """A shape around its middle.

    Attributes:
        half: half sides (3,) [m] of the box around it.
        convex: coal geometry; of a mesh its convex hull.
        exact: the triangles of a mesh, None of a convex shape.
        vertices, faces: of that mesh, (n, 3) [m] and (m, 3).
    """

    half: Array
    convex: Any = field(repr=False)
    exact: Any = field(default=None, repr=False)
    vertices: Any = field(default=None, repr=False)
    faces: Any = field(default=None, repr=False)

    def surrounds(self, point: Array) -> bool:
        """Return whether a point (3,) [m] is inside of the mesh, by the solid angle that its triangles take up."""
        a, b, c = (self.vertices[self.faces[:, corner]] - point for corner in range(3))
        la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
        volume = np.einsum("ni,ni->n", a, np.cross(b, c))
        below = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        return bool(abs(np.arctan2(volume, below).sum()) > np.pi)  # a sum of halves: 2 pi inside, 0 outside


def box(size: Any) -> Shape:
    """Return a box with sides (3,) [m]."""
    sides = np.asarray(size, dtype=float)
    return Shape(sides / 2.0, coal.Box(*sides))


def ball(radius: float) -> Shape:
    """Return a ball [m]."""
    return Shape(np.full(3, radius), coal.Sphere(radius))


def capsule(radius: float, length: float) -> Shape:
    """Return a capsule along z, `length` [m] between the middles of its ends."""
    return Shape(np.array([radius, radius, length / 2.0 + radius]), coal.Capsule(radius, length))


def cylinder(radius: float, length: float) -> Shape:
    """Return a cylinder along z."""
    return Shape(np.array([radius, radius, length / 2.0]), coal.Cylinder(radius, length))


def mesh(vertices: Array, faces: Any) -> tuple[Shape, Array]:
    """Return the shape of triangles with vertices (n, 3) [m], and where its middle is (3,)."""
    middle = (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
    moved = vertices - middle
    points = coal.StdVec_Vec3s()
    points.extend(list(moved))
    triangles = coal.StdVec_Triangle()
    triangles.extend([coal.Triangle(*map(int, face)) for face in faces])
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(faces), len(vertices))
    model.addSubModel(points, triangles)
    model.endModel()
    half = np.ptp(vertices, axis=0) / 2.0
    try:
        return Shape(half, _hull(moved), model, moved, faces), middle
    except QhullError:  # flat: there is no hull with a volume
        return Shape(half, model, model, moved, faces), middle


def _hull(vertices: Array) -> Any:
    """Return the convex hull of points (n, 3), coarser where a corner has more neighbours than coal allows.

    The coarse one is that of the points farthest in each of `NEIGHBOURS` directions, up to 3 mm inside of the other for
    a body of half a metre.
    """
    hull = ConvexHull(vertices)
    corners = vertices[hull.vertices]
    if np.bincount(hull.simplices.ravel()).max() > NEIGHBOURS:
        number = np.arange(NEIGHBOURS) + 0.5
        up, turn = 1.0 - 2.0 * number / NEIGHBOURS, np.pi * (1.0 + np.sqrt(5.0)) * number
        around = np.sqrt(1.0 - up**2)
        directions = np.stack([around * np.cos(turn), around * np.sin(turn), up])
        corners = corners[np.unique((corners @ directions).argmax(axis=0))]
    points = coal.StdVec_Vec3s()
    points.extend(list(corners))
    return coal.ConvexBase.convexHull(points, True, "Qt")


def mesh_of(parts: Sequence[tuple[Array, Any, Any]], scale: Array) -> tuple[Shape, Array]:
    """Return the shape of all parts of a mesh file, (vertices, faces, colour) each, and where its middle is (3,)."""
    counts = np.cumsum([0, *(len(vertices) for vertices, *_ in parts)])
    faces = np.concatenate([own + first for (_, own, _), first in zip(parts, counts, strict=False)])
    return mesh(np.concatenate([vertices for vertices, *_ in parts]) * scale, faces)


@dataclass(frozen=True)
class Body:
    """A body of an agent, a table or an object.

    Attributes:
        name: `human.right_palm`, `panda.panda_link3`, `table.left`, or an object; parts of one link share it.
        kind: `PERSON`, `ROBOT`, `TABLE`, `OBJECT` or `OBSTACLE`.
        owner: agent, table or object that it is of.
        joint: number of the frame that carries it in the tree of its agent.
        hands: full names of the hands that it belongs to.
        limb: bodies of one limb never meet, as the table of the human body says; "" for none.
    """

    name: str
    kind: str
    owner: str
    joint: int
    shape: Shape
    hands: frozenset[str] = frozenset()
    limb: str = ""
