"""The surface of blended solids."""

from __future__ import annotations

import numpy as np
import pytest

from tests.support.page_packages import needs_page

pytestmark = pytest.mark.slow


@needs_page
def test_colours_meet_without_a_gap_and_face_outwards() -> None:
    from lgp.page.mesh import Solid, painted, surface

    axes = np.eye(3)
    ball = Solid("a", "red", np.zeros(3), np.zeros(3), (0.1, 0.1, 0.1), axes)
    limb = Solid("b", "blue", np.array([0.1, 0.0, 0.0]), np.array([0.4, 0.0, 0.0]), (0.05, 0.04), axes)
    mesh = painted(surface([ball, limb], 0.01, 0.02), [ball, limb], {"red": "#ff0000", "blue": "#0000ff"}, 0.1)
    assert {tuple(row) for row in mesh.colours.tolist()} == {(255, 0, 0), (0, 0, 255)}
    corners = mesh.vertices[mesh.faces]
    # The divergence theorem: faces that look outwards and leave no gap enclose the volume of ball and limb.
    volume = np.einsum("ki,ki->k", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])).sum() / 6.0
    alone = 4 / 3 * np.pi * 0.1**3 + np.pi * 0.3 * (0.05**2 + 0.05 * 0.04 + 0.04**2) / 3
    assert 0.85 * alone < volume < 1.05 * alone
