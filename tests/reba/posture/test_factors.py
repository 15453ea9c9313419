"""Factors: spellings, lengths, wrong values."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

import reba
from reba.method.factor_points import points
from reba.posture.factors import FACTORS, checked, expand_sides
from tests.support.says import says

N = 4


def test_names() -> None:
    assert FACTORS == (
        "load", "shock", "coupling_left", "coupling_right", "support", "arm_supported_left", "arm_supported_right",
        "static", "repeated", "unstable",
    )  # fmt: skip


def test_defaults_give_no_points_but_the_legs() -> None:
    found = points(reba.Factors(), reba.Rules(), N)
    assert (found.load_force.tolist(), found.legs.tolist(), found.activity.tolist()) == ([0], [1], [0])
    assert not found.coupling.any()
    assert not found.arm_supported.any()


def test_both_sides_at_once() -> None:
    assert expand_sides({"coupling": "poor", "coupling_left": "good"}) == {
        "coupling_left": "good",
        "coupling_right": "poor",
    }
    assert expand_sides({"arm_supported": True}) == {"arm_supported_left": True, "arm_supported_right": True}


def test_scalars_and_columns_mix() -> None:
    given = {"coupling_left": ["good", "fair", "poor", "unacceptable"], "coupling_right": 1, "load": 7}
    found = points(reba.Factors.of(given), reba.Rules(), N)
    assert found.coupling.tolist() == [[0, 1, 2, 3], [1, 1, 1, 1]]
    assert found.rows(1, 3).coupling.tolist() == [[1, 2], [1, 1]]
    assert found.rows(1, 3).load_force.tolist() == [1]


@pytest.mark.parametrize(
    ("yes", "no"),
    [(True, False), (1, 0), (1.0, 0.0), ("true", "false"), (" True ", "FALSE"), (np.True_, np.False_), ("1", "0")],
)
def test_spellings_of_yes_and_no(yes: object, no: object) -> None:
    found = checked(reba.Factors(shock=yes, static=no, unstable=[yes, no, no, yes]), N)
    assert found.shock is True
    assert found.static is False
    assert found.unstable.tolist() == [True, False, False, True]


def test_checked_gives_one_spelling() -> None:
    found = checked(reba.Factors(load="3", coupling_left=2.0, coupling_right=[0, 1, 2, 3], support=" Sitting"), N)
    assert (found.load, found.coupling_left, found.support) == (3.0, "poor", "sitting")
    assert found.coupling_right.tolist() == ["good", "fair", "poor", "unacceptable"]
    assert checked(found, N).support == "sitting"


@pytest.mark.parametrize(
    "values",
    [
        pd.Series([True, False, True, False]),
        pd.Series([True, False, True, False], dtype="boolean"),
        pd.Series([1, 0, 1, 0]),
        np.array([True, False, True, False], object),
    ],
)
def test_columns_of_any_kind(values: object) -> None:
    assert points(reba.Factors(static=values), reba.Rules(), N).activity.tolist() == [1, 0, 1, 0]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"load": -1}, "load is -1.0 at frame 0; expected kilograms"),
        ({"load": [1, 2, float("nan"), 3]}, "load is nan at frame 2"),
        ({"load": float("inf")}, "load is inf"),
        ({"load": [3.0, 9999.0, 3.0, 3.0]}, "load is 9999.0 at frame 1, a code for no value"),
        ({"load": "heavy"}, "load is 'heavy'; expected kilograms"),
        ({"load": None}, "load is"),
        ({"load": [1, 2]}, "load has shape (2,); expected one value or one for each of 4 frames"),
        ({"load": [[1, 2, 3, 4]]}, "load has shape (1, 4)"),
        ({"load": {}}, "load is"),
        ({"shock": "maybe"}, "shock is 'maybe' at frame 0; expected true or false"),
        ({"shock": 2}, "shock is 2"),
        ({"static": [True, None, True, True]}, "static is None at frame 1"),
        ({"static": [0.0, float("nan"), 1.0, 1.0]}, "static is nan at frame 1"),
        ({"unstable": [True, False]}, "unstable has shape (2,)"),
        ({"repeated": [[1, 2], [3]]}, "repeated is; expected one value"),
        ({"coupling": "great"}, "coupling_left is 'great'; expected one of good, fair, poor, unacceptable"),
        ({"coupling": 4}, "coupling_left is '4'"),
        ({"coupling": 1.5}, "coupling_left is '1.5'"),
        ({"coupling_right": ["good", "", "good", "good"]}, "coupling_right is ''"),
        ({"coupling": float("nan")}, "coupling_left is 'nan'"),
        ({"support": "flying"}, "support is 'flying'; expected one of bilateral"),
        ({"support": 1}, "support is '1'"),
        ({"support": ["bilateral", None, "walking", "sitting"]}, "support is 'None'"),
        ({"support": ["bilateral"] * 3}, "support has shape (3,)"),
        ({"supprot": "sitting"}, "factor 'supprot' is unknown; did you mean 'support'"),
        ({"zzz": 1}, "factor 'zzz' is unknown; known: load"),
    ],
)
def test_wrong_values_are_refused(given: dict[str, object], message: str) -> None:
    with pytest.raises(reba.PostureError) as caught:
        reba.score_array(np.zeros((N, 22)), given)
    says(caught, *message.split("; "))
    frame = pd.DataFrame(np.zeros((N, 22)), columns=list(reba.COLUMNS))
    with pytest.raises(reba.PostureError) as caught:
        reba.score(frame, **{name: value for name, value in given.items() if value is not None} or {"load": "none"})
    says(caught, *message.split("; "))
