"""How much of an object is on a table: against another way to clip polygons, and its derivatives."""

from __future__ import annotations

import numpy as np
import pytest

from lgp.audit.resting import _share_on
from lgp.scene.footing import shared_area
from tests.support.lgp_worlds import differences

TABLE, HALF = np.array([0.3, 0.2]), np.array([0.2, 0.03])
CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])


def test_areas_are_those_of_clipped_polygons() -> None:
    places = np.random.default_rng(0).uniform([-0.4, -0.3, -7.0], [0.4, 0.3, 7.0], (500, 3))
    area, _ = shared_area(TABLE, HALF, places)
    for (x, y, yaw), own in zip(places, area, strict=True):
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        assert own / (4.0 * HALF.prod()) == pytest.approx(
            _share_on(TABLE, (CORNERS * HALF) @ turn.T + [x, y]), abs=1e-6
        )


def test_derivatives() -> None:
    places = np.random.default_rng(1).uniform([-0.4, -0.3, -7.0], [0.4, 0.3, 7.0], (200, 3))
    slopes = shared_area(TABLE, HALF, places)[1]
    expected = differences(lambda at: shared_area(TABLE, HALF, at)[0][:, None], places)[:, 0]
    np.testing.assert_allclose(slopes, expected, atol=1e-7)


@pytest.mark.parametrize("turns", range(5))
@pytest.mark.parametrize("beside", [-1e-16, 0.0, 1e-16, 5e-10, 2e-9])
def test_sides_that_are_flush_count_once(turns: int, beside: float) -> None:
    quarter = turns * np.pi / 2.0
    reach = HALF[0] if turns % 2 == 0 else HALF[1]
    inside, _ = shared_area(TABLE, HALF, np.array([[TABLE[0] - reach + beside, 0.0, quarter]]))
    assert inside[0] == pytest.approx(4.0 * HALF.prod(), abs=1e-8)
    same, _ = shared_area(HALF, HALF, np.array([[beside, 0.0, turns * np.pi]]))
    assert same[0] == pytest.approx(4.0 * HALF.prod(), abs=1e-8)
