"""The stages of the graduated model."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import dreba
from dreba.surrogates.graduated import GraduatedModel
from dreba.surrogates.soft import SoftModel
from tests.support.says import says

pytestmark = pytest.mark.slow


@cache
def graduated() -> GraduatedModel:
    poses = dreba.sample(10_000, rng=41)
    first = dreba.QuadraticModel().fit(poses.angles, poses.reba)
    return GraduatedModel.of(first, SoftModel(ladder=(8.0, 2.0), updates=300).fit(poses.angles, poses.reba))


def test_stages_of_the_graduated_model() -> None:
    model = graduated()
    assert [stage.name for stage in model.stages_] == ["quadratic", "soft 8 deg", "soft 2 deg"]
    pose = dreba.sample(10, rng=42).angles[0]
    for stage in model.stages_:
        value, slope = stage.objective(load=6.0)(pose)
        assert value == pytest.approx(stage.model.value(pose, load=6.0, temperature=stage.temperature))
        assert slope.shape == (22,)
    with pytest.raises(dreba.ModelError) as error:
        GraduatedModel.of(model.soft_, model.soft_)
    says(error, "'soft'", "quadratic or convex")
    with pytest.raises(dreba.ModelError) as error:
        GraduatedModel(first="net").fit(np.full((5, 22), 30.0), np.ones(5))  # type: ignore[arg-type]
    says(error, "first is", "'net'", "convex")
