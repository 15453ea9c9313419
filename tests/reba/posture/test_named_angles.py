"""Angles by name or position: every kind of data, every order of columns, and what is refused."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest

import reba
from reba.arrays import Array
from reba.posture.columns import COLUMNS, INDEX
from reba.posture.named_angles import check_angles
from tests.support import posture_samples as samples
from tests.support.says import says

N = 12


def angles() -> Array:
    return samples.random_angles(np.random.default_rng(20250101), N)


def frame() -> pd.DataFrame:
    return pd.DataFrame(angles(), columns=list(COLUMNS))


def shuffled() -> list[str]:
    return [str(name) for name in np.random.default_rng(1).permutation(COLUMNS)]


class Poses:
    """What `dreba.Poses` looks like from here."""

    angles = angles()


NAMED: dict[str, Callable[[], Any]] = {
    "frame": frame,
    "frame in another order": lambda: frame()[shuffled()],
    "frame with other columns": lambda: frame()[shuffled()].assign(time=1.0, load=3.0, comment="x"),
    "frame of objects": lambda: frame()[shuffled()].astype(object),
    "frame of nullable floats": lambda: frame()[shuffled()].astype("Float64"),
    "frame in single precision and back": lambda: frame()[shuffled()].convert_dtypes(),
    "mapping": lambda: {name: frame()[name].to_numpy() for name in shuffled()},
    "mapping of lists": lambda: {name: frame()[name].tolist() for name in shuffled()},
    "list of rows": lambda: frame()[shuffled()].to_dict("records"),
    "posture table": lambda: reba.PostureTable(frame()[shuffled()].assign(time=np.arange(N))),
    "scores": lambda: reba.score(frame()[shuffled()]),
    "poses": Poses,
    "array": angles,
    "list of lists": lambda: angles().tolist(),
    "column-major array": lambda: np.asfortranarray(angles()),
}


@pytest.mark.parametrize("kind", NAMED)
def test_every_kind_of_data_gives_the_same_angles(kind: str) -> None:
    np.testing.assert_array_equal(reba.angle_table(NAMED[kind]()), angles())
    some = ("wrist_twist_right", "trunk_flexion")
    if "array" not in kind and "lists" not in kind.removeprefix("mapping of"):
        table = reba.angle_table(NAMED[kind](), some, absent="refuse")
        np.testing.assert_array_equal(table, angles()[:, [INDEX[name] for name in some]])


@pytest.mark.parametrize("kind", [kind for kind in NAMED if kind not in ("poses", "array")])
def test_scores_do_not_depend_on_the_kind_of_data(kind: str) -> None:
    expected = reba.score_array(angles())
    scores = reba.score_array(NAMED[kind]())
    assert all((scores[name] == expected[name]).all() for name in ("trunk", "wrist_left", "reba"))


def test_one_pose() -> None:
    pose = angles()[0]
    for data in (pose, pose.tolist(), frame().iloc[0], frame()[shuffled()].iloc[0], frame().iloc[0].to_dict()):
        np.testing.assert_array_equal(reba.angle_table(data), pose[None])


def test_right_arrays_are_not_copied() -> None:
    table = angles()
    assert reba.angle_table(table) is table
    assert np.shares_memory(reba.angle_table(table[0]), table)


def test_a_name_without_a_side_stands_for_both() -> None:
    table = reba.angle_table({"knee_flexion": [30.0, 60.0], "knee_flexion_right": [5.0, 6.0]})
    assert table[:, INDEX["knee_flexion_left"]].tolist() == [30.0, 60.0]
    assert table[:, INDEX["knee_flexion_right"]].tolist() == [5.0, 6.0]
    legs = reba.score(pd.DataFrame({"trunk_flexion": [0.0, 0.0], "knee_flexion": [10.0, 45.0]}), missing="neutral")
    assert legs.data["legs"].tolist() == [1, 2]


def test_raised_shoulders_stand_in_for_their_elevation() -> None:
    table = reba.angle_table({"shoulder_raised_left": [True, False], "shoulder_elevation_left": [np.nan, 7.0]})
    assert table[:, INDEX["shoulder_elevation_left"]].tolist() == [180.0, 7.0]


def test_absent_columns() -> None:
    part = frame()[["neck_flexion", "trunk_flexion"]]
    table = reba.angle_table(part)
    assert np.isfinite(table).sum(axis=0).nonzero()[0].tolist() == [INDEX["trunk_flexion"], INDEX["neck_flexion"]]
    with pytest.raises(reba.PostureError) as caught:
        reba.angle_table(part, absent="refuse")
    says(caught, "no column 'trunk_side_bend'", "expected trunk_flexion, trunk_side_bend")
    with pytest.raises(KeyError):
        reba.angle_table(frame().assign(trunk_flexion=np.nan), absent="refuse", error=_Own)


class _Own(KeyError, ValueError):
    """An error of a caller's own."""


BAD: dict[str, tuple[Any, tuple[str, ...]]] = {
    "misspelt": ({"trunk_flexoin": [1.0], "neck_flexion": [2.0]}, ("'trunk_flexoin'", "did you mean 'trunk_flexion'")),
    "no angle": (pd.DataFrame({"speed": [1.0]}), ("no angle column", "speed", "trunk_flexion")),
    "empty": ({}, ("no angle column", "none")),
    "text": ({"trunk_flexion": ["bent"]}, ("trunk_flexion", "not a number", "degrees")),
    "dates": (pd.DataFrame({"trunk_flexion": pd.date_range("2025-01-01", periods=2)}), ("dates", "degrees")),
    "complex": (np.zeros((1, 22), complex), ("complex", "degrees")),
    "twice": (pd.DataFrame([[1.0, 2.0]], columns=["trunk_flexion"] * 2), ("trunk_flexion stands 2 times",)),
    "unequal": ({"trunk_flexion": [1.0, 2.0, 3.0], "neck_flexion": [1.0, 2.0]}, ("neck_flexion has 2", "3")),
    "shape": (np.zeros((3, 21)), ("(3, 21)", "(n, 22)", "column names")),
    "infinite": ({"neck_twist": [0.0, -np.inf]}, ("neck_twist is infinite", "frame 1")),
    "large": ({"neck_twist": [0.0, 361.0]}, ("neck_twist is 361", "frame 1", "-360 to 360")),
    "huge integer": ({"neck_twist": [10**400]}, ("neck_twist", "not a number")),
    "nothing": (None, ("shape ()", "(n, 22)")),
    "path": ("walk.csv", ("not a number",)),
}


@pytest.mark.parametrize("kind", BAD)
def test_what_cannot_be_read_is_refused(kind: str) -> None:
    data, facts = BAD[kind]
    with pytest.raises(reba.PostureError) as caught:
        reba.angle_table(data)
    says(caught, *facts)


def test_names_nearly_like_a_column_that_is_there_are_left_alone() -> None:
    assert reba.angle_table(frame().assign(trunk_flexion_raw=1.0)).shape == (N, 22)


def test_columns_that_are_no_posture_may_hold_large_numbers() -> None:
    table = reba.angle_table({"b": [2.0], "a": [1e6]}, ("a", "b"), absent="refuse")
    assert table.tolist() == [[1e6, 2.0]]
    check_angles(table, ("a", "b"), complete=True)


def test_radians_are_warned_about() -> None:
    small = np.radians(angles())
    for call in (
        reba.angle_table,
        reba.score_array,
        lambda data: reba.score(pd.DataFrame(data, columns=list(COLUMNS))),
    ):
        with pytest.warns(reba.RadiansWarning, match="degrees") as caught:
            call(small)
        assert [warning.filename for warning in caught] == [__file__]
    holes = small.copy()
    holes[:, 3] = np.nan
    with pytest.warns(reba.RadiansWarning):
        reba.angle_table(holes)


@pytest.mark.parametrize("poses", [10, 20, 49, 500])
def test_one_outlier_among_any_number_of_poses_does_not_hide_radians(poses: int) -> None:
    small = np.radians(np.resize(angles(), (poses, 22)))
    small[poses // 2, 0] = 90.0
    with pytest.warns(reba.RadiansWarning):
        reba.angle_table(small)


@pytest.mark.parametrize(
    "table",
    [
        np.zeros((20, 22)),
        np.full((20, 22), np.nan),
        np.full((20, 22), 1e-9),
        np.full((9, 22), 1.0),
        np.full((20, 22), 4.0),
    ],
)
def test_poses_at_rest_and_few_poses_are_not_taken_for_radians(table: Array) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        reba.angle_table(table)


def test_flags_of_raised_shoulders_do_not_hide_radians() -> None:
    random = np.random.default_rng(3)
    raised = {"shoulder_raised_left": random.random(50) < 0.5}
    with pytest.warns(reba.RadiansWarning):
        reba.score({"trunk_flexion": random.uniform(0, 1, 50), **raised})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        reba.score({"trunk_flexion": random.uniform(0, 60, 50), **raised})
        reba.score({"trunk_flexion": np.full(50, 20.0), **raised})
