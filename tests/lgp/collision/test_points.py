"""Corners of objects and ends of limbs, whose distances to boxes have no edges."""

from __future__ import annotations

import coal
import numpy as np

from lgp.collision.distances import Collisions
from lgp.collision.shapes import box, capsule, points
from tests.support.lgp_worlds import human_world


def test_points_are_the_corners_of_a_box_and_the_ends_of_a_capsule() -> None:
    item = box("a", "a", "object", np.eye(3), np.zeros(3), (0.2, 0.4, 0.6))
    corners = np.array([point.position for point in points(item)])
    assert sorted(map(tuple, np.abs(corners).tolist())) == [(0.1, 0.2, 0.3)] * 8
    ends = points(capsule("b", "human", "link", "f", "arm", (np.zeros(3), np.array([0.3, 0.0, 0.0])), 0.05))
    assert sorted(round(float(end.position[0]), 9) for end in ends) == [0.0, 0.3]
    assert {end.rim for end in ends} == {0.05}


def test_distances_of_points_from_boxes_are_those_of_balls() -> None:
    world = human_world()
    collisions = Collisions(world)
    rng = np.random.default_rng(1)
    q = world.initial_configuration + 0.3 * rng.standard_normal((6, world.nq))
    kinematics, phases, z = world.at(q, collisions.frames), np.zeros(6, np.intp), np.zeros(0)
    slices, pairs = collisions.near_pairs(kinematics, phases, z, within=0.5)
    kinds = [{collisions.shapes[side].kind for side in collisions.pairs[pair]} for pair in pairs]
    rows = np.flatnonzero(["point" in kind for kind in kinds])
    assert len(rows) > 20
    values = collisions.values(kinematics, phases, z, slices[rows], pairs[rows])
    sides = np.array(collisions.pairs)[pairs[rows]].T
    placed = [collisions.placements.poses(kinematics, phases, z, slices[rows], side) for side in sides]
    request = coal.DistanceRequest()
    request.enable_signed_distance = True
    for number, (value, pair) in enumerate(zip(values, pairs[rows], strict=True)):
        shapes = [collisions.shapes[side] for side in collisions.pairs[pair]]
        solids = [coal.Sphere(max(shape.rim, 1e-4)) if shape.kind == "point" else shape.shape for shape in shapes]
        places = [coal.Transform3s(rotation[number], centre[number]) for rotation, centre in placed]
        expected = coal.distance(solids[0], places[0], solids[1], places[1], request, coal.DistanceResult())
        assert abs(value - expected) < 2e-4
