"""Convex bodies around a mesh: its hull, or the hulls of slabs where it is hollow.

The hull of a torso with shoulders, or of a pedestal with feet, fills rooms that arms move through. Cut into slabs
across its longest side, such a mesh has hulls that fill less; together they enclose it as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Final

import coal
import numpy as np
from scipy.spatial import ConvexHull, QhullError

from reba.arrays import Array, Indices

NEIGHBOURS: Final = 250
"""Neighbours of a corner of a convex hull; coal counts them in a byte."""
THIN: Final = 0.0005
"""[m] Half the thickness of a flat part; a choice."""
SLABS = 6
HOLLOW = 0.9
"""Volume of the hulls of the slabs, relative to the hull of all, below which slabs are used (a choice)."""


def convex_parts(vertices: Array, triangles: Indices) -> list[Array]:
    """Return the corners (k, 3) of each convex body around a mesh of vertices (n, 3) and triangles (m, 3).

    A flat mesh has the eight corners of the box around it.

    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> [len(part) for part in convex_parts(corners, np.array([[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]))]
    [4]
    """
    whole, volume = _hull(vertices)
    if volume == 0.0:
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        return [np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])]
    slabs = [_hull(slab) for slab in _slabs(vertices, triangles) if len(slab)]
    full = all(volume > 0.0 for _, volume in slabs)
    return [slab for slab, _ in slabs] if full and sum(each for _, each in slabs) < HOLLOW * volume else [whole]


def _hull(points: Array) -> tuple[Array, float]:
    """Return the corners of the convex hull of points, and its volume [m3], 0 where they are flat."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):
        return points, 0.0
    return points[hull.vertices], float(hull.volume)


def _slabs(vertices: Array, triangles: Indices) -> Sequence[Array]:
    """Return the points of a mesh in each slab across its longest side, those where its edges cross the cuts too."""
    height = vertices[:, int(np.ptp(vertices, axis=0).argmax())]
    cuts = np.linspace(height.min(), height.max(), SLABS + 1)
    edges = np.unique(
        np.sort(np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])), axis=0
    )
    start, end = edges.T
    crossings = []
    for cut in cuts:
        crosses = (height[start] - cut) * (height[end] - cut) < 0.0
        first, second = start[crosses], end[crosses]
        share = (cut - height[first]) / (height[second] - height[first])
        crossings.append(vertices[first] + share[:, None] * (vertices[second] - vertices[first]))
    return [
        np.concatenate([vertices[(height >= low) & (height <= high)], crossings[number], crossings[number + 1]])
        for number, (low, high) in enumerate(pairwise(cuts))
    ]


def hull_corners(points: Array) -> Array:
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


def convex_body(corners: Array) -> Any:
    """Return the coal body with some corners (n, 3)."""
    vertices = coal.StdVec_Vec3s()
    vertices.extend(list(corners))
    return coal.Convex.convexHull(vertices, True, "Qt")
