"""Poses with column names: the same numbers in whatever order the columns stand, through every way in."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dreba
import reba
from reba.posture.columns import COLUMNS
from tests.support.says import says

SOME = ("wrist_flexion_left", "trunk_flexion", "knee_flexion_right", "neck_flexion")


@cache
def poses() -> dreba.Poses:
    return dreba.sample(200, rng=np.random.default_rng(20250101))


def table() -> pd.DataFrame:
    return pd.DataFrame(poses().angles, columns=list(COLUMNS))


def other_order() -> pd.DataFrame:
    return table()[sorted(COLUMNS, reverse=True)]


NAMED: dict[str, Callable[[], Any]] = {
    "frame": table,
    "other order": other_order,
    "more columns": lambda: other_order().assign(time=0.0, reba=1),
    "mapping": lambda: dict(other_order()),
    "rows": lambda: other_order().to_dict("records"),
    "posture table": lambda: reba.PostureTable(other_order().assign(time=np.arange(200.0))),
    "poses": poses,
}


@pytest.mark.parametrize("kind", NAMED)
@pytest.mark.parametrize("name", ["quadratic", "convex", "soft"])
def test_models_read_poses_by_name(name: str, kind: str) -> None:
    model = dreba.load(name)
    expected = model.value(poses().angles)
    np.testing.assert_array_equal(model.value(NAMED[kind]()), expected)
    np.testing.assert_array_equal(model.predict(NAMED[kind]()), expected)
    np.testing.assert_array_equal(model.gradient(NAMED[kind]()), model.gradient(poses().angles))
    value, gradient = model.value_and_gradient(NAMED[kind]())
    np.testing.assert_array_equal(value, expected)
    assert gradient.shape == (200, 22)


@pytest.mark.parametrize("kind", NAMED)
@pytest.mark.parametrize("joints", [COLUMNS, SOME])
def test_fits_read_poses_by_name(joints: tuple[str, ...], kind: str) -> None:
    places = [COLUMNS.index(joint) for joint in joints]
    expected = dreba.QuadraticModel(joints=joints).fit(poses().angles[:, places], poses().reba)
    model = dreba.QuadraticModel(joints=joints).fit(NAMED[kind](), poses().reba)
    assert model.joints_ == joints
    pose = poses().angles[0, places]
    assert model.value(pose) == pytest.approx(expected.value(pose), abs=1e-12)
    np.testing.assert_array_equal(model.predict(NAMED[kind]()), model.value(NAMED[kind]()))


@pytest.mark.parametrize("kind", ["mapping", "rows", "poses"])
def test_named_data_without_joints_are_fitted_on_their_columns(kind: str) -> None:
    model = dreba.QuadraticModel().fit(NAMED[kind](), poses().reba)
    assert sorted(model.joints_) == sorted(COLUMNS)
    expected = dreba.QuadraticModel().fit(poses().angles, poses().reba)
    assert model.value(table()) == pytest.approx(expected.value(table()), abs=1e-6)


def test_one_named_pose_is_one_value() -> None:
    model = dreba.load("quadratic")
    expected = model.value(poses().angles[3])
    row: Any = {str(name): angle for name, angle in other_order().iloc[3].items()}
    assert model.value(other_order().iloc[3]) == expected
    assert model.value(row) == expected
    assert model.gradient(other_order().iloc[3]).shape == (22,)
    assert model.hessian(other_order().iloc[3]).shape == (22, 22)


def test_a_column_that_is_not_there_is_named() -> None:
    model = dreba.load("quadratic")
    for ask in (model.value, model.gradient, model.predict):
        with pytest.raises(dreba.ModelError) as caught:
            ask(other_order().drop(columns="neck_twist"))
        says(caught, "neck_twist")
        with pytest.raises(dreba.ModelError) as caught:
            ask(other_order().rename(columns={"neck_twist": "neck_twst"}))
        says(caught, "'neck_twst'", "did you mean 'neck_twist'")


def test_the_warning_is_one_class() -> None:
    assert dreba.RadiansWarning is reba.RadiansWarning
