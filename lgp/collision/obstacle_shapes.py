"""Collision shapes of what is in the way: boxes, prisms around cylinders, the convex hull of each part of a mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import coal
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from lgp.collision.shapes import CollisionShape
from lgp.kinematics.features import exponential
from lgp.kinematics.mesh_file import read_mesh
from lgp.scene.model import Obstacle, Scene
from lgp.scene.surroundings import fixed_bodies
from reba.arrays import Array

NEIGHBOURS: Final = 250
"""Neighbours of a corner of a convex hull; coal counts them in a byte."""
SIDES: Final = 24
"""Sides of the prism of a cylinder."""
THIN: Final = 0.0005
"""[m] Half the thickness of a flat part; a choice."""


def obstacle_shapes(scene: Scene) -> tuple[CollisionShape, ...]:
    """Return the shapes of obstacles, walls of shelves and boards above tables.

    Raises:
        WorldError: a mesh cannot be read.
    """
    return tuple(shape for body in fixed_bodies(scene).values() for shape in _shapes(body))


def _shapes(body: Obstacle) -> list[CollisionShape]:
    rotation, position = exponential(np.radians(np.array(body.rotation))), np.array(body.position)
    if body.shape == "box":
        return [_shape(body, rotation, position, np.array(body.size) / 2.0, coal.Box(*body.size))]
    if body.shape == "cylinder":
        parts = [_prism(body.size[0] / 2.0, body.size[2])]
    else:
        parts = [_corners(vertices * np.array(body.size)) for vertices, *_ in read_mesh(Path(body.file))]
    hulls = []
    for scaled in parts:
        middle = (scaled.min(axis=0) + scaled.max(axis=0)) / 2.0
        points = coal.StdVec_Vec3s()
        points.extend(list(scaled - middle))
        hull = coal.ConvexBase.convexHull(points, True, "Qt")
        hulls.append(_shape(body, rotation, position + rotation @ middle, np.ptp(scaled, axis=0) / 2.0, hull))
    return hulls


def _prism(radius: float, length: float) -> Array:
    """Return the corners (m, 3) of the prism around a cylinder, 1 % wider: distances of flat bodies are exact."""
    angle = 2.0 * np.pi * np.arange(SIDES) / SIDES
    ring = radius / np.cos(np.pi / SIDES) * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    end = np.array([0.0, 0.0, length / 2.0])
    return np.concatenate([ring - end, ring + end])


def _corners(points: Array) -> Array:
    """Return the corners (m, 3) of the convex hull of points (n, 3); flat ones get a thickness.

    Where a corner has more neighbours than coal counts, the hull is that of the farthest points in `NEIGHBOURS`
    directions.
    """
    try:
        hull = ConvexHull(points)
    except QhullError:
        signs = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
        points = (points[:, None] + THIN * signs).reshape(-1, 3)
        hull = ConvexHull(points)
    corners: Array = points[hull.vertices]
    if np.bincount(hull.simplices.ravel()).max() > NEIGHBOURS:
        directions = np.random.default_rng(0).normal(size=(NEIGHBOURS, 3))
        corners = corners[np.unique((corners @ directions.T).argmax(axis=0))]
    return corners


def _shape(body: Obstacle, rotation: Array, position: Array, half: Array, shape: Any) -> CollisionShape:
    return CollisionShape(
        name=body.full,
        owner=body.full,
        kind="obstacle",
        frame="",
        branch=body.full,
        reaches=False,
        rotation=rotation,
        position=position,
        radius=float(np.linalg.norm(half)),
        half=half,
        rim=0.0,
        shape=shape,
    )
