"""Convex bodies around meshes."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from lgp.collision.convex_parts import convex_parts
from reba.arrays import Array, Indices


def boxes(*sizes_and_places: tuple[tuple[float, float, float], tuple[float, float, float]]) -> tuple[Array, Indices]:
    """Return the triangles of boxes, each of a size, with its lowest corner at a place."""
    vertices, triangles = [], []
    for size, place in sizes_and_places:
        corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * np.array(size) + place
        triangles.append(ConvexHull(corners).simplices + sum(map(len, vertices)))
        vertices.append(corners)
    return np.concatenate(vertices), np.concatenate(triangles)


def test_a_box_is_one_body_and_a_flat_mesh_too() -> None:
    vertices, triangles = boxes(((0.2, 0.3, 0.5), (0.0, 0.0, 0.0)))
    assert [len(part) for part in convex_parts(vertices, triangles)] == [8]
    flat = vertices * (1.0, 1.0, 0.0)
    (corners,) = convex_parts(flat, triangles)
    assert np.ptp(corners, axis=0).tolist() == [0.2, 0.3, 0.0]


def test_a_hollow_mesh_is_cut_into_slabs_that_enclose_it_and_leave_its_rooms() -> None:
    vertices, triangles = boxes(((0.9, 0.1, 0.1), (0.0, 0.0, 0.0)), ((0.1, 0.8, 0.1), (0.0, 0.1, 0.0)))
    parts = convex_parts(vertices, triangles)
    assert len(parts) > 1
    hulls = [ConvexHull(part) for part in parts]

    def depth(point: Array) -> float:
        return max(-float((hull.equations[:, :3] @ point + hull.equations[:, 3]).max()) for hull in hulls)

    assert all(depth(vertex) > -1e-9 for vertex in vertices)
    assert depth(np.array([0.45, 0.45, 0.05])) < -0.1
    assert depth(np.array([0.5, 0.05, 0.05])) > 0.01
