"""The distribution of REBA under measurement error, against enumeration of classes, and its limits."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from numpy.typing import NDArray

import reba
from reba.method.classes import angle_classes
from reba.method.distribution import BLOCK
from reba.method.normal import MIDDLE, PER_SD, normal_cdf
from reba.method.tables import ACTION_LEVEL_FROM, UNKNOWN
from reba.posture.columns import COLUMNS_OF, INDEX
from tests.support import posture_samples as samples
from tests.support.says import says

EVERY = dict.fromkeys(COLUMNS_OF, 6.0)
"""An error of 6 deg of every angle."""
RULES = {
    "measured": reba.Rules(),
    "paper": reba.PRESETS["paper"],
    "two points": reba.Rules(twist_and_bend="two", edges="upper", seated_knees=True, walking_legs=2),
    "left": reba.Rules(two_sides="left", coupling_without_load=False),
    "right": reba.Rules(two_sides="right", trunk_upright=12.0, neck_upright=30.0, abduction=45.0),
}
FACTORS = {
    "none": {},
    "all": {
        "load": 7.0, "shock": True, "coupling_left": "poor", "coupling_right": "fair", "support": "unilateral",
        "arm_supported_left": True, "static": True, "repeated": True,
    },
    "sitting": {"support": "sitting", "arm_supported": True, "load": 12.0},
    "walking": {"support": "walking", "coupling": "unacceptable"},
}  # fmt: skip


def upright(n: int = 1) -> NDArray[np.float64]:
    angles = np.zeros((n, len(reba.COLUMNS)))
    angles[:, [INDEX["lower_arm_flexion_left"], INDEX["lower_arm_flexion_right"]]] = 80.0
    return angles


def tail(z: float) -> float:
    return 0.5 * math.erfc(-z / math.sqrt(2.0))


def enumerated(
    posture: NDArray[np.float64], sd: dict[str, float], rules: reba.Rules, factors: dict[str, object]
) -> NDArray[np.float64]:
    """P(REBA = 1..15) of one posture by scoring every combination of the classes of the columns with an error."""
    cases: list[list[tuple[float, float]]] = []  # for each column (an angle inside a class, its probability)
    for column, spread in sd.items():
        classes = next(group.classes for group in angle_classes(rules) if column in group.columns)
        angle = posture[INDEX[column]]
        edges = sorted({edge for one in classes for edge in (one.low, one.high) if abs(edge) < 1e3})
        ends = [-1e4, *edges, 1e4]
        cases.append(
            [
                ((low + high) / 2.0, tail((high - angle) / spread) - tail((low - angle) / spread))
                for low, high in itertools.pairwise(ends)
                if high - low > 1e-6
            ]
        )
    rows, weights = [], []
    for combination in itertools.product(*cases):
        row = posture.copy()
        for column, (angle, _) in zip(sd, combination, strict=True):
            row[INDEX[column]] = np.clip(angle, -300.0, 300.0)
        rows.append(row)
        weights.append(math.prod(weight for _, weight in combination))
    scores = reba.score_array(np.array(rows), factors, rules).reba
    return np.bincount(scores, weights, minlength=16)[1:]


GROUPS = {
    "trunk and knees": ("trunk_flexion", "trunk_side_bend", "trunk_twist", "knee_flexion_left", "knee_flexion_right"),
    "neck and arms": (
        "neck_flexion", "neck_twist", "neck_side_bend", "upper_arm_flexion_left", "upper_arm_flexion_right",
    ),
    "shoulders": (
        "upper_arm_abduction_left", "shoulder_elevation_left", "upper_arm_abduction_right", "upper_arm_flexion_left",
        "lower_arm_flexion_right", "trunk_flexion",
    ),
    "hands": (
        "wrist_flexion_left", "wrist_deviation_left", "wrist_twist_left", "wrist_flexion_right",
        "lower_arm_flexion_left", "lower_arm_flexion_right",
    ),
}  # fmt: skip
"""Columns with an error: few enough to enumerate their classes."""


@pytest.mark.parametrize("group", GROUPS)
@pytest.mark.parametrize("rules", RULES)
@pytest.mark.parametrize("factors", FACTORS)
def test_equals_the_enumeration_of_all_classes(group: str, rules: str, factors: str) -> None:
    rng = np.random.default_rng([len(group), len(rules), len(factors)])
    sd = {column: float(rng.uniform(2.0, 25.0)) for column in GROUPS[group]}
    postures = samples.random_angles(rng, 3)
    found = reba.score_probabilities(postures, FACTORS[factors], RULES[rules], error=sd)
    np.testing.assert_allclose(found.sum(axis=1), 1.0, atol=1e-9)
    for posture, chances in zip(postures, found, strict=True):
        expected = enumerated(posture, sd, RULES[rules], FACTORS[factors])
        np.testing.assert_allclose(chances, expected, atol=1e-7)


def test_factors_of_each_frame() -> None:
    rng = np.random.default_rng(3)
    angles, factors = samples.random_angles(rng, 400), samples.random_factors(rng, 400)
    together = reba.score_probabilities(angles, factors, error=EVERY)
    for frame in range(0, 400, 7):
        alone = reba.score_probabilities(angles[frame], samples.frame_factors(factors, frame), error=EVERY)
        np.testing.assert_allclose(together[frame], alone[0], atol=1e-12)


def test_no_error_gives_the_score_itself_on_edges_too() -> None:
    rng = np.random.default_rng(4)
    angles, factors = samples.random_angles(rng, 5000), samples.random_factors(rng, 5000)
    for rules in RULES.values():
        scores = reba.score_array(angles, factors, rules, error=dict.fromkeys(COLUMNS_OF, 0.0))
        assert scores.distribution is not None
        for name in ("reba_likely", "reba_95_low", "reba_95_high"):
            np.testing.assert_array_equal(getattr(scores.distribution, name), scores.reba, err_msg=name)
        for level, chance in enumerate(scores.distribution.level_low, start=1):
            np.testing.assert_array_equal(chance, scores.reba >= ACTION_LEVEL_FROM[level])
        np.testing.assert_array_equal(scores.distribution.mean_low, scores.reba)


def test_a_tiny_error_gives_the_score_itself_away_from_edges() -> None:
    rng = np.random.default_rng(5)
    angles = rng.uniform(-180.0, 180.0, (20_000, len(reba.COLUMNS)))
    nearest = np.min([np.abs(np.abs(angles) - edge) for edge in samples.EDGES], axis=0)
    angles = angles[(nearest > 1e-3).all(axis=1)]
    assert len(angles) > 10_000
    for sd in (1e-4, 1e-6, 1e-9):
        chances = reba.score_probabilities(angles, error=dict.fromkeys(COLUMNS_OF, sd))
        np.testing.assert_array_equal(chances.argmax(axis=1) + 1, reba.score_array(angles).reba)
        assert (chances.max(axis=1) == 1.0).all()


def test_an_angle_on_an_edge_is_on_either_side_with_equal_probability() -> None:
    posture = upright()
    posture[0, INDEX["trunk_flexion"]] = 60.0
    scores = reba.score_array(posture, error={"trunk_flexion": 4.0})
    chances = reba.score_probabilities(posture, error={"trunk_flexion": 4.0})[0]
    beside = np.vstack([posture, posture])
    beside[:, INDEX["trunk_flexion"]] += [-1.0, 1.0]
    low, high = reba.score_array(beside).reba.tolist()
    assert (low, high) == (1, 2)
    assert chances[:2] == pytest.approx([0.5, 0.5], abs=1e-8)
    assert scores.distribution is not None
    assert scores.distribution.reba_likely.tolist() == [1]  # an edge belongs to the lower class
    assert (scores.distribution.reba_95_low[0], scores.distribution.reba_95_high[0]) == (1, 2)
    assert scores.reba.tolist() == [1]


def test_bias_is_removed() -> None:
    posture = upright(3)
    posture[:, INDEX["trunk_flexion"]] = [10.0, 25.0, 65.0]
    biased = reba.score_probabilities(posture, error={"trunk_flexion": {"sd": 3.0, "bias": 7.0}})
    shifted = posture.copy()
    shifted[:, INDEX["trunk_flexion"]] -= 7.0
    np.testing.assert_allclose(biased, reba.score_probabilities(shifted, error={"trunk_flexion": 3.0}), atol=1e-12)


def test_unmeasured_angles_bound_the_distribution() -> None:
    rng = np.random.default_rng(6)
    angles = samples.random_angles(rng, 600)
    holes = np.where(rng.random(angles.shape) < 0.15, np.nan, angles)
    scores = reba.score_array(holes, error=EVERY)
    filled = reba.score_array(angles, error=dict.fromkeys(EVERY, 6.0))
    found, whole = scores.distribution, filled.distribution
    assert found is not None
    assert whole is not None
    assert (found.level_low <= found.level_high + 1e-9).all()
    # Any exact value of the unmeasured angles gives something between the ends.
    for frame in range(0, 600, 5):
        exact = dict.fromkeys(np.array(reba.COLUMNS)[np.isnan(holes[frame])], 0.0)
        one = reba.score_array(angles[frame], error={**EVERY, **exact}).distribution
        assert one is not None
        assert (found.level_low[:, frame] <= one.level_low[:, 0] + 1e-9).all()
        assert (one.level_low[:, 0] <= found.level_high[:, frame] + 1e-9).all()
        assert found.reba_95_low[frame] <= one.reba_95_low[0] <= one.reba_95_high[0] <= found.reba_95_high[frame]
        assert found.mean_low[frame] - 1e-9 <= one.mean_low[0] <= found.mean_high[frame] + 1e-9
    open_ = found.reba_likely == UNKNOWN
    assert 0 < open_.sum() < len(open_)
    ends = [reba.score_array(holes, missing=end, error=EVERY).distribution for end in ("neutral", "worst")]
    assert all(end is not None for end in ends)
    low, high = (end.reba_likely for end in ends if end is not None)
    np.testing.assert_array_equal(open_, low != high)
    np.testing.assert_array_equal(low[~open_], found.reba_likely[~open_])


def test_the_figures_follow_from_the_probabilities() -> None:
    rng = np.random.default_rng(7)
    angles, factors = samples.random_angles(rng, 4000), samples.random_factors(rng, 4000)  # more than one block
    found = reba.score_array(angles, factors, error=EVERY).distribution
    chances = reba.score_probabilities(angles, factors, error=EVERY)
    assert found is not None
    assert found.exact
    likely = found.reba_likely.astype(int) - 1
    np.testing.assert_allclose(chances[np.arange(4000), likely], chances.max(axis=1), atol=3e-7)
    for level, chance in enumerate(found.level_low, start=1):
        np.testing.assert_allclose(chance, chances[:, ACTION_LEVEL_FROM[level] - 1 :].sum(axis=1), atol=1e-12)
    np.testing.assert_allclose(found.mean_low, chances @ np.arange(1, 16), atol=1e-12)
    up_to = chances.cumsum(axis=1)
    low, high = found.reba_95_low.astype(int), found.reba_95_high.astype(int)
    frames = np.arange(4000)
    assert (up_to[frames, low - 1] >= 0.025 - 3e-8).all()
    assert (np.where(low > 1, up_to[frames, low - 2], 0.0) < 0.025).all()
    assert (up_to[frames, high - 1] >= 0.975 - 3e-8).all()
    np.testing.assert_array_equal(found.level_low, found.level_high)
    assert list(found.columns()) == [
        "reba_likely", "reba_95_low", "reba_95_high",
        "p_level_2_low", "p_level_2_high", "p_level_3_low", "p_level_3_high",
    ]  # fmt: skip


def test_scores_stay_as_they_are() -> None:
    angles = samples.random_angles(np.random.default_rng(8), 500)
    angles[::7, 3] = np.nan
    plain, with_error = reba.score_array(angles), reba.score_array(angles, error="inertial")
    assert plain.distribution is None
    for name in reba.SCORE_COLUMNS:
        np.testing.assert_array_equal(plain[name], with_error[name], err_msg=name)


def test_a_raised_shoulder_given_as_a_flag_has_no_error_in_degrees() -> None:
    bent = {"trunk_flexion": [70.0], "upper_arm_flexion": [70.0], "lower_arm_flexion": [20.0], "wrist_flexion": [30.0]}
    rows = {**bent, "shoulder_raised_left": [False], "shoulder_raised_right": [False]}
    assert reba.score_probabilities(rows, error={"shoulder_elevation": 30.0}).max() == 1.0
    angles = {**bent, "shoulder_elevation": [0.0]}
    assert reba.score_probabilities(angles, error={"shoulder_elevation": 30.0}).max() < 1.0


@pytest.mark.parametrize("n", [0, 1, BLOCK - 1, BLOCK, BLOCK + 1])
def test_any_number_of_frames(n: int) -> None:
    found = reba.score_array(upright(n), error=EVERY).distribution
    assert found is not None
    assert found.reba_likely.shape == (n,)
    assert found.level_low.shape == (4, n)
    assert reba.score_probabilities(upright(n), error=EVERY).shape == (n, 15)


def test_normal_distribution_function() -> None:
    x = np.linspace(-12.0, 12.0, 100_001)
    exact = np.array([tail(one) for one in x.tolist()])
    found = normal_cdf((PER_SD * x + MIDDLE).reshape(1, -1))[0]
    assert np.abs(found - exact).max() < 5e-9
    assert (found[x < -9.1] == 0.0).all()
    assert (found[x > 9.1] == 1.0).all()


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ("laser", "error 'laser' is unknown; use one of optical, inertial"),
        (3.0, "error 3.0 is unknown"),
        ({"trunk_flexoin": 3.0}, "unknown column 'trunk_flexoin'; did you mean 'trunk_flexion'?"),
        ({"trunk_flexion": -1.0}, "trunk_flexion is -1, expected 0 to 180"),
        ({"trunk_flexion": {"bias": 3.0}}, "sd is missing"),
        ({"trunk_flexion": {"sd": 3.0, "mean": 1.0}}, "unknown key 'mean'"),
        ({"trunk_flexion": "much"}, "expected a finite number"),
        ({"base": "laser"}, "expected one of optical"),
    ],
)
def test_wrong_errors(wrong: object, message: str) -> None:
    with pytest.raises(reba.PostureError) as caught:
        reba.score_array(upright(), error=wrong)  # type: ignore[arg-type]
    says(caught, message)
