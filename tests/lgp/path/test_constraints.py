"""Leg reach: one smooth constraint for both legs, its gradient and curvature."""

from __future__ import annotations

import numpy as np
import pytest

from lgp.kinematics.posture import PostureMap
from lgp.path.constraints import BLEND, LegReachConstraint
from tests.support.lgp_worlds import human_world


@pytest.fixture(scope="module")
def standing() -> tuple[np.ndarray, LegReachConstraint]:
    world = human_world("solved")
    assert world.scene.human is not None
    legs, rng = LegReachConstraint(world, world.scene.human), np.random.default_rng(0)
    q = np.tile(world.initial_configuration, (40, 1))
    q[:, legs.columns] += 0.02 * rng.normal(size=(40, len(legs.columns)))
    q[:5, legs.columns] = world.initial_configuration[legs.columns]
    return q, legs


def test_one_constraint_bounds_the_reach_of_both_legs(standing: tuple[np.ndarray, LegReachConstraint]) -> None:
    q, legs = standing
    both = PostureMap(human_world("solved")).leg_shortfall(q)[0]
    value, _ = legs.evaluate(q)
    assert (value >= both.max(axis=1)).all()
    assert (value <= both.max(axis=1) + BLEND * np.log(2.0) + 1e-12).all()


def test_leg_reach_has_its_stated_gradient_and_convex_curvature(
    standing: tuple[np.ndarray, LegReachConstraint],
) -> None:
    q, legs = standing
    _, slope = legs.evaluate(q)
    for at, column in enumerate(legs.columns):
        step = np.zeros(q.shape[1])
        step[column] = 1e-7
        difference = (legs.evaluate(q + step)[0] - legs.evaluate(q - step)[0]) / 2e-7
        assert slope[:, at] == pytest.approx(difference, abs=1e-5)
    assert np.linalg.eigvalsh(legs.curvature(q)).min() > -1e-9
