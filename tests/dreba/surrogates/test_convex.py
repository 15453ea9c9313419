"""The convex model: error, weights, parameters."""

from __future__ import annotations

import pytest

import dreba
from tests.support.says import says


def test_convex_hinges_are_near_their_known_error() -> None:
    poses, held_out = dreba.sample(10_000, rng=43), dreba.sample(5000, rng=44)
    model = dreba.ConvexModel().fit(poses.angles, poses.reba)
    assert dreba.evaluate(model, held_out).rmse < 1.4
    assert (model.weights_ >= 0.0).all()
    with pytest.raises(dreba.ModelError) as error:
        dreba.ConvexModel(knots=0).fit(poses.angles, poses.reba)
    says(error, "knots", "0", "whole number from 1")
