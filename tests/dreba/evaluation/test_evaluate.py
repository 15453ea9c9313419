"""Evaluation of a model on poses."""

from __future__ import annotations

import numpy as np
import pytest

import dreba


@pytest.fixture(scope="module")
def model() -> dreba.QuadraticModel:
    fitted = dreba.QuadraticModel()
    dreba.fit_to(fitted, dreba.sample(1000, rng=1), dreba.sample(1000, rng=2), command="dreba fit")
    return fitted


def test_radians_are_warned_about(model: dreba.QuadraticModel) -> None:
    poses = dreba.sample(50, rng=3)
    with pytest.warns(dreba.RadiansWarning, match="degrees") as caught:
        dreba.evaluate(model, dreba.Poses(np.radians(poses.angles), poses.reba))
    assert len(caught) == 1
