"""Collision shapes of what is in the way: boxes, cylinders, and the convex hull of each part of a mesh."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import coal
import numpy as np

from lgp.collision.shapes import CollisionShape
from lgp.kinematics.features import exponential
from lgp.kinematics.mesh_file import read_mesh
from lgp.scene.model import Obstacle, Scene
from lgp.scene.surroundings import fixed_bodies
from reba.arrays import Array


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
        cylinder = coal.Cylinder(body.size[0] / 2.0, body.size[2])
        return [_shape(body, rotation, position, np.array(body.size) / 2.0, cylinder)]
    hulls = []
    for vertices, *_ in read_mesh(Path(body.file)):
        scaled = vertices * np.array(body.size)
        middle = (scaled.min(axis=0) + scaled.max(axis=0)) / 2.0
        points = coal.StdVec_Vec3s()
        points.extend(list(scaled - middle))
        hull = coal.ConvexBase.convexHull(points, True, "Qt")
        hulls.append(_shape(body, rotation, position + rotation @ middle, np.ptp(scaled, axis=0) / 2.0, hull))
    return hulls


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
