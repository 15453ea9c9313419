"""Errors per class, model files, reports and provenance."""

from __future__ import annotations

import numpy as np
import pytest

import dreba


@pytest.fixture(scope="module")
def model() -> dreba.QuadraticModel:
    found = dreba.QuadraticModel()
    dreba.fit_to(found, dreba.sample(1000, rng=1), dreba.sample(1000, rng=2), command="dreba fit")
    return found


def test_radians_are_warned_about(model: dreba.QuadraticModel) -> None:
    poses = dreba.sample(50, rng=3)
    with pytest.warns(dreba.RadiansWarning, match="degrees"):
        dreba.evaluate(model, dreba.Poses(np.radians(poses.angles), poses.reba))
