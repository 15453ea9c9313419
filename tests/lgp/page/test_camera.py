"""Cameras that see all points, from where bodies do not occlude them."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.page.camera import ANGLE, Subject, framed, occluded_share, shots

corners = st.lists(st.tuples(*[st.floats(-2.0, 2.0)] * 3), min_size=2, max_size=20)


@given(corners, st.floats(0.0, 6.3), st.floats(-0.2, 1.2), st.floats(0.3, 3.0))
@settings(max_examples=60, deadline=None)
def test_the_camera_sees_all_points(points: list[Any], around: float, above: float, aspect: float) -> None:
    towards = np.array([np.cos(around) * np.cos(above), np.sin(around) * np.cos(above), np.sin(above)])
    spread = np.array(points) + np.arange(len(points))[:, None] * 1e-3
    eye, target = framed(spread, towards, aspect)
    np.testing.assert_allclose(np.cross(eye - target, towards), 0.0, atol=1e-9)
    right = np.cross([0.0, 0.0, 1.0], towards)
    right /= np.linalg.norm(right)
    depth = (eye - spread) @ towards
    assert (depth > 0).all()
    tall = np.tan(np.radians(ANGLE) / 2.0)
    assert (np.abs((spread - eye) @ np.cross(towards, right)) <= tall * depth * 1.0001).all()
    assert (np.abs((spread - eye) @ right) <= tall * aspect * depth * 1.0001).all()


def test_a_shot_leaves_the_side_where_something_stands_before_it() -> None:
    spots, box = np.zeros((1, 3)), np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    free = shots([Subject(box, spots, np.zeros((0, 3)))], 0.0)[0].towards
    wall = 0.5 * free + 0.2 * np.random.default_rng(0).normal(size=(2000, 3))
    chosen = shots([Subject(box, spots, wall)], 0.0)[0].towards
    assert occluded_share(spots, wall, free) == 1.0
    assert occluded_share(spots, wall, chosen) == 0.0
