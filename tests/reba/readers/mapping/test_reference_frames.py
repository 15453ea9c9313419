"""Reference frames: pose of the pelvis between its samples."""

from __future__ import annotations

import numpy as np

from reba.readers.mapping.reference_frames import PelvisPose
from tests.support.synthetic_bodies import quaternion, rotation


def test_the_pelvis_is_interpolated_but_not_over_gaps() -> None:
    poses = np.array([quaternion(rotation("z", angle)) for angle in (0.0, 20.0, 30.0)])
    pose = PelvisPose(np.array([0.0, 0.1, 9.0]), poses, np.eye(3), np.array([0.0, 1.0, 0.0]), "")
    read_back = pose.at(np.array([-0.5, -0.1, 0.0, 0.05, 0.1, 4.0, 9.1, 9.3]))
    angles = np.degrees(np.arctan2(read_back[:, 1, 0], read_back[:, 0, 0]))
    np.testing.assert_allclose(angles, [np.nan, 0.0, 0.0, 10.0, 20.0, np.nan, 30.0, np.nan], atol=1e-9)
