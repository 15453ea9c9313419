"""Unmeasured angles: the exact range of every score, by enumeration."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reba
from reba.method.scoring import CHUNK
from reba.method.tables import UNKNOWN
from reba.posture.columns import INDEX
from tests.support import posture_samples as samples
from tests.support import reference_reba as reference
from tests.support.posture_samples import KNOWN, one, posture, restated, rule_sets, seeds
from tests.support.says import says

COLUMNS_OF: dict[str, tuple[str, ...]] = {
    "trunk": ("trunk_flexion", "trunk_side_bend", "trunk_twist"),
    "neck": ("neck_flexion", "neck_side_bend", "neck_twist"),
    "legs": ("knee_flexion_left", "knee_flexion_right"),
    **{
        f"{part}_{side}": tuple(f"{name}_{side}" for name in names)
        for side in ("left", "right")
        for part, names in {
            "upper_arm": ("upper_arm_flexion", "upper_arm_abduction", "shoulder_elevation"),
            "lower_arm": ("lower_arm_flexion",),
            "wrist": ("wrist_flexion", "wrist_deviation", "wrist_twist"),
        }.items()
    },
}
EXTREME = 179.0


def possible(row: np.ndarray, rules: reba.Rules, factors: dict[str, object]) -> dict[str, set[int]]:
    """Return every value that each column can have over all angles of the unmeasured ones, by enumeration."""
    parts: dict[str, set[int]] = {}
    neutral = posture()[0]
    for part, columns in COLUMNS_OF.items():
        spans = [
            (*samples.class_angles(column), EXTREME) if np.isnan(row[INDEX[column]]) else (row[INDEX[column]],)
            for column in columns
        ]
        parts[part] = set()
        for values in itertools.product(*spans):
            tried = neutral.copy()
            tried[[INDEX[column] for column in columns]] = values
            parts[part].add(restated(tried, rules, **factors)[part])
    fixed = restated(neutral, rules, **factors)
    found = {**parts, **{name: {fixed[name]} for name in ("load_force", "coupling_left", "coupling_right", "activity")}}
    for name in KNOWN[KNOWN.index("score_a") :]:
        found[name] = set()
    # The totals see the parts only through Scores A and B: try every reachable combination of these.
    reached: list[dict[int, dict[str, int]]] = []
    for names in (
        ("trunk", "neck", "legs"),
        *(tuple(f"{p}_{s}" for p in ("upper_arm", "lower_arm", "wrist")) for s in reference.SIDES),
    ):
        key = "score_a" if "trunk" in names else f"score_b_{names[0].rsplit('_', 1)[1]}"
        states = [dict(zip(names, values, strict=True)) for values in itertools.product(*(parts[n] for n in names))]
        reached.append({reference.totals({**fixed, **state}, rules)[key]: state for state in states})
    for a, left, right in itertools.product(*(group.values() for group in reached)):
        for name, value in reference.totals({**fixed, **a, **left, **right}, rules).items():
            found[name].add(value)
    return found


@settings(max_examples=80, deadline=None)
@given(seed=seeds, rules=rule_sets, share=st.sampled_from([0.05, 0.2, 0.5, 1.0]))
def test_range_is_exact(seed: int, rules: reba.Rules, share: float) -> None:
    rng = np.random.default_rng(seed)
    angles, factors = samples.random_angles(rng, 3), samples.random_factors(rng, 3)
    angles[rng.random(angles.shape) < share] = np.nan
    results = {choice: reba.score_array(angles, factors, rules, choice) for choice in ("range", "neutral", "worst")}
    for frame in range(len(angles)):
        values = possible(angles[frame], rules, samples.frame_factors(factors, frame))
        for name in KNOWN:
            low, high = min(values[name]), max(values[name])
            assert results["neutral"][name][frame] == low, name
            assert results["worst"][name][frame] == high, name
            assert results["range"][name][frame] == (low if low == high else UNKNOWN), name
        for arrays in results.values():
            assert (arrays.reba_low[frame], arrays.reba_high[frame]) == (min(values["reba"]), max(values["reba"]))


@settings(max_examples=25, deadline=None)
@given(
    seed=seeds, rules=rule_sets, columns=st.lists(st.sampled_from(reba.COLUMNS), min_size=1, max_size=4, unique=True)
)
def test_range_of_whole_postures(seed: int, rules: reba.Rules, columns: list[str]) -> None:
    """The same by scoring every whole posture that the unmeasured angles allow."""
    rng = np.random.default_rng(seed)
    row, factors = samples.random_angles(rng, 1), samples.random_factors(rng, 1)
    fixed = samples.frame_factors(factors, 0)
    places = [INDEX[column] for column in columns]
    spans = [(*samples.class_angles(column), EXTREME) for column in columns]
    tried = np.repeat(row, int(np.prod([len(span) for span in spans])), axis=0)
    tried[:, places] = list(itertools.product(*spans))
    scores = [restated(one_posture, rules, **fixed)["reba"] for one_posture in tried[:400]]
    scores += reba.score_array(tried[400:], fixed, rules).reba.tolist()
    row[:, places] = np.nan
    found = reba.score_array(row, factors, rules)
    assert (found.reba_low[0], found.reba_high[0]) == (min(scores), max(scores))


def test_nothing_measured_is_never_a_score() -> None:
    arrays = reba.score_array(np.full((2, 22), np.nan))
    assert arrays.reba.tolist() == [UNKNOWN, UNKNOWN]
    assert arrays.action_level.tolist() == [UNKNOWN, UNKNOWN]
    # A(5, 3, 3) = 9 and B(6, 2, 3) = 9 give 11; more needs a load, a bad grip or activity.
    assert (arrays.reba_low[0], arrays.reba_high[0]) == (1, 11)
    assert reba.score_array(np.full((1, 22), np.nan), {"load": 12.0}).reba_high[0] == 12
    assert arrays.load_force.tolist() == [0, 0]


def test_seated_knees_need_no_measurement() -> None:
    row = posture(knee_flexion=np.nan)
    assert one(row, support="sitting")["reba"] == 1
    assert one(row, support="bilateral")["legs"] == UNKNOWN


def test_missing_error_names_the_angle_and_the_frame() -> None:
    rows = np.repeat(posture(), CHUNK + 5, axis=0)
    rows[CHUNK + 2, INDEX["wrist_twist_left"]] = np.nan
    with pytest.raises(reba.PostureError) as caught:
        reba.score_array(rows, missing="error")
    says(caught, f"wrist_twist_left is not measured at frame {CHUNK + 2}")
    assert reba.score_array(rows[:CHUNK], missing="error").reba.max() == 1
