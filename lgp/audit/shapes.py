"""The bodies of an audit: capsules, boxes, cylinders, balls and triangle meshes, with what encloses them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Final

import coal
import numpy as np

from reba.arrays import Array

PERSON: Final = "person"
ROBOT: Final = "robot"
TABLE: Final = "table"
OBJECT: Final = "object"


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
    if half.min() <= 0.0:  # flat: there is no hull with a volume
        return Shape(half, model, model, moved, faces), middle
    model.buildConvexHull(True, "Qt")
    return Shape(half, model.convex, model, moved, faces), middle


@dataclass(frozen=True)
class Body:
    """A body of an agent, a table or an object.

    Attributes:
        name: `human.right_palm`, `panda.panda_link3`, `table.left`, or an object; parts of one link share it.
        kind: `PERSON`, `ROBOT`, `TABLE` or `OBJECT`.
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
