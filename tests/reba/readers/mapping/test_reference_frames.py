"""Reference frames: pose of the pelvis between its samples."""

from __future__ import annotations

import numpy as np

from reba.readers.mapping.reference_frames import PelvisPose, VerticalAxis
from tests.support.synthetic_bodies import quaternion, rotation


def test_the_pelvis_is_interpolated_but_not_over_gaps() -> None:
    poses = np.array([quaternion(rotation("z", angle)) for angle in (0.0, 20.0, 30.0)])
    pose = PelvisPose(np.array([0.0, 0.1, 9.0]), poses, np.eye(3), np.array([0.0, 1.0, 0.0]), "")
    read_back = pose.at(np.array([-0.5, -0.1, 0.0, 0.05, 0.1, 4.0, 9.1, 9.3]))
    angles = np.degrees(np.arctan2(read_back[:, 1, 0], read_back[:, 0, 0]))
    np.testing.assert_allclose(angles, [np.nan, 0.0, 0.0, 10.0, 20.0, np.nan, 30.0, np.nan], atol=1e-9)


def test_a_changed_vertical_does_not_exchange_the_sides() -> None:
    # A body with z up that faces y, its toes raised: for y as the vertical they point backwards for the hips.
    vertical = VerticalAxis("", "y")
    up, right, forward = (np.array([vector]) for vector in ([0.0, 0.1, 1.0], [1.0, 0.0, 0.0], [0.0, 0.9, 0.44]))
    consistent = False
    for _ in range(3):
        vertical.begin()
        vertical.add_directions(up, right, forward, right)
        consistent = vertical.is_consistent()
    assert consistent
    assert (vertical.name, vertical.swapped) == ("z", False)
    assert not any("exchanged" in warning for warning in vertical.warnings)
