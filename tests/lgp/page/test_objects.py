"""The meshes of robots."""

from __future__ import annotations

import numpy as np
import pytest

from lgp.scene.scene_file import load_scene
from tests.support.lgp_worlds import needs_robots
from tests.support.page_packages import needs_page

pytestmark = pytest.mark.slow


@needs_page
@needs_robots
def test_a_robot_is_seen_as_its_urdf_says_in_few_triangles() -> None:
    from lgp.page.objects import FACES, robot_meshes

    robot = load_scene("screwdriver_panda").robots["panda"]
    visuals = robot_meshes(robot)
    links = [part.link for part in visuals]
    assert set(links) == {f"panda_link{number}" for number in range(8)} | {
        "panda_hand", "panda_leftfinger", "panda_rightfinger",
    }  # fmt: skip
    assert all(len(part.mesh.faces) <= 1.2 * FACES for part in visuals)
    arm = np.ptp(visuals[links.index("panda_link5")].mesh.vertices, axis=0)
    np.testing.assert_allclose(arm, [0.11, 0.18, 0.31], atol=0.02)
    assert len(np.unique(visuals[links.index("panda_hand")].mesh.colours, axis=0)) >= 2
    # One mesh for both fingers, turned.
    left, right = visuals[links.index("panda_leftfinger")], visuals[links.index("panda_rightfinger")]
    assert left.key == right.key
    np.testing.assert_allclose(np.abs(np.diag(right.place)[:2]), 1.0)
