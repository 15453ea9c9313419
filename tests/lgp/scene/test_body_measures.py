"""Body measures: proportions by sex, ranges."""

from __future__ import annotations

import pytest

from lgp.errors import SceneError
from lgp.scene import body_measures as body_measures_
from tests.support.says import says


def test_sexes_differ_in_proportion() -> None:
    male, female = (body_measures_.lengths(1.7, sex) for sex in ("male", "female"))
    assert female["thigh"] < male["thigh"]
    assert female["cervicale"] > male["cervicale"]


def test_wrong_bodies_are_refused() -> None:
    with pytest.raises(SceneError) as error:
        body_measures_.lengths(1.7, "femal")
    says(error, "expected one of male", "female", "did you mean 'female'")
    with pytest.raises(SceneError) as error:
        body_measures_.lengths(17, "male")
    says(error, "stature is 17 m", "expected 1.4 to 2.1 m")
