"""What the vectorised core takes and refuses: lengths, layouts, kinds of numbers."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
import pytest

import reba
from reba.method.scoring import CHUNK, SCORE_COLUMNS, score_angles
from tests.support import posture_samples as samples
from tests.support.posture_samples import MEASURED, one, posture
from tests.support.says import says


@pytest.mark.parametrize("n", [0, 1, 8191, 8192, 8193, CHUNK - 1, CHUNK, CHUNK + 1, 2 * CHUNK + 3])
def test_chunk_borders(n: int) -> None:
    rng = np.random.default_rng(n)
    few, factors = samples.random_angles(rng, 50), samples.random_factors(rng, 50)
    few[rng.random(few.shape) < 0.02] = np.nan
    expected = reba.score_array(few, factors)
    places = np.arange(n) % 50
    arrays = reba.score_array(few[places], {name: values[places] for name, values in factors.items()})
    for name in SCORE_COLUMNS:
        assert arrays[name].shape == (n,)
        assert arrays[name].dtype == np.uint8
        np.testing.assert_array_equal(arrays[name], expected[name][places], err_msg=name)


@pytest.mark.parametrize(
    "change",
    [
        np.asfortranarray,
        lambda a: a.tolist(),
        lambda a: np.repeat(a, 2, axis=0)[::2],
        lambda a: a.astype(object),
        lambda a: a.astype(">f8"),
    ],
)
def test_layouts(change: Callable[[np.ndarray], object]) -> None:
    angles = samples.random_angles(np.random.default_rng(1), 64)
    before = angles.copy()
    np.testing.assert_array_equal(reba.score_array(change(angles)).reba, reba.score_array(before).reba)
    np.testing.assert_array_equal(angles, before)


def test_narrow_floats_and_integers() -> None:
    angles = np.round(samples.random_angles(np.random.default_rng(2), 64))
    for kind in (np.float32, np.int16):
        np.testing.assert_array_equal(reba.score_array(angles.astype(kind)).reba, reba.score_array(angles).reba)


def test_input_is_never_changed() -> None:
    for rules in (MEASURED, MEASURED.replace(upper_arm_reference="gravity")):
        angles = samples.random_angles(np.random.default_rng(3), 10)
        angles[0, :5] = np.nan
        before = angles.copy()
        reba.score_array(angles, None, rules)
        np.testing.assert_array_equal(angles, before)


@pytest.mark.parametrize(
    ("angles", "message"),
    [
        (np.zeros(21), "shape (21,); expected (n, 22)"),
        (np.zeros((3, 21)), "shape (3, 21); expected (n, 22)"),
        (np.zeros((2, 3, 22)), "expected"),
        ([["flexed"] * 22], "not a number"),
        ([[0.0] * 22, [0.0] * 21], "not a number"),
        (None, "expected"),
        (posture(trunk_twist=np.inf), "trunk_twist is infinite at frame 0"),
        (posture(trunk_twist=np.inf, neck_twist=-np.inf), "infinite"),
        (posture(trunk_flexion=-360.1), "trunk_flexion is -360.1 at frame 0; expected degrees from -360 to 360"),
        (posture(trunk_flexion=1.7e308, trunk_twist=1.7e308), "trunk_flexion is 1.7e+308 at frame 0"),
    ],
)
def test_bad_angles_are_refused(angles: object, message: str) -> None:
    with pytest.raises(reba.PostureError) as caught:
        reba.score_array(angles)
    says(caught, *message.split("; "))


def test_the_largest_angles_are_scored() -> None:
    assert one(posture(trunk_flexion=360.0, trunk_twist=-360.0))["trunk"] == 5
    huge = np.full((1, 22), 1.7e308)  # angles of recordings, whose readers warn of them
    assert score_angles(huge).reba.tolist() == reba.score_array(np.full((1, 22), 360.0)).reba.tolist()


def test_one_posture_without_a_row() -> None:
    assert reba.score_array(posture(trunk_flexion=70.0)[0]).trunk.tolist() == [4]


def test_unknown_choices_are_refused() -> None:
    with pytest.raises(reba.PostureError) as caught:
        reba.score_array(posture(), missing="guess")
    says(caught, "missing is 'guess'")
    with pytest.raises(reba.RulesError) as caught:
        reba.score_array(posture(), rules="strict")
    says(caught, "rules 'strict' are unknown")
    with pytest.raises(KeyError):
        reba.score_array(posture())["knees"]


def test_misuse_of_the_interface_is_told_in_one_line() -> None:
    table = pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [1.0, 70.0]})
    scores = reba.score(table)
    twice = pd.DataFrame([[0, 1, 2]], columns=["time", "trunk_flexion", "trunk_flexion"])
    calls: list[Callable[[], object]] = [
        *(lambda wrong=wrong: reba.score(wrong) for wrong in (None, [1], "x.csv", np.zeros((2, 22)), twice)),
        lambda: reba.score(table, load=10**400),
        lambda: reba.score(table.assign(trunk_flexion=1j)),
        lambda: reba.score_array(np.zeros((1, 22), complex)),
        *(lambda wrong=wrong: reba.score_array(np.zeros((1, 22)), wrong) for wrong in ([1], "load")),
        *(lambda wrong=wrong: scores.explain(wrong) for wrong in ("a", None, float("nan"))),
        *(lambda wrong=wrong: reba.read(wrong) for wrong in (None, 5, b"x")),
        lambda: reba.read("x.csv", profile=None),
        lambda: reba.read("x.csv", topic=3),
    ]
    for call in calls:
        with pytest.raises(reba.RebaError) as caught:
            call()
        assert "\n" not in str(caught.value)
