"""The worksheet of a frame: its points add up to the part scores, and its rules say what happened."""

from __future__ import annotations

import io
import re

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reba
from reba.analysis.worksheet import contributions
from reba.console import show_worksheet
from reba.method.classes import AngleClasses, angle_classes
from reba.posture.columns import BEST, INDEX
from reba.terminal import Console
from tests.support import posture_samples as samples
from tests.support.says import says

rule_sets = st.builds(
    reba.Rules,
    trunk_upright=st.sampled_from([0.0, 5.0]),
    neck_upright=st.sampled_from([0.0, 5.0]),
    abduction=st.sampled_from([0.0, 30.0]),
    edges=st.sampled_from(["lower", "upper"]),
    twist_and_bend=st.sampled_from(["one", "two"]),
    seated_knees=st.booleans(),
    coupling_without_load=st.booleans(),
    walking_legs=st.sampled_from([1, 2]),
    upper_arm_reference=st.sampled_from(["trunk", "gravity"]),
)
seeds = st.integers(0, 2**32 - 1)
SUMS = (
    "trunk", "neck", "legs", "load_force", "upper_arm_left", "upper_arm_right", "lower_arm_left", "lower_arm_right",
    "wrist_left", "wrist_right", "coupling_left", "coupling_right", "activity",
)  # fmt: skip


def frame_of(angles: np.ndarray) -> pd.DataFrame:
    return pd.DataFrame({"time": np.arange(len(angles), dtype=float)} | dict(zip(reba.COLUMNS, angles.T, strict=True)))


def scored(seed: int, rules: reba.Rules, n: int = 6, unmeasured: float = 0.0) -> reba.Scores:
    rng = np.random.default_rng(seed)
    angles = samples.random_angles(rng, n)
    angles[rng.random(angles.shape) < unmeasured] = np.nan
    return reba.score(frame_of(angles), rules=rules, activity="none", **samples.random_factors(rng, n))


@settings(max_examples=40, deadline=None)
@given(seed=seeds, rules=rule_sets)
def test_points_add_up_to_the_part_scores(seed: int, rules: reba.Rules) -> None:
    scores = scored(seed, rules)
    for time in scores.time:
        sheet = scores.explain(time)
        row = scores.data.iloc[int(time)]
        for part in SUMS:
            assert sum(line.points for line in sheet.of(part)) == row[part], (part, sheet.of(part))
        assert sheet.scores["reba"] == row["reba"]
        assert (sheet.risk, sheet.action) == reba.ACTION_LEVELS[int(row["action_level"])]
        assert sheet.rules == rules.name


@settings(max_examples=40, deadline=None)
@given(seed=seeds, rules=rule_sets, share=st.sampled_from([0.1, 0.5, 1.0]))
def test_unmeasured_angles_have_no_points(seed: int, rules: reba.Rules, share: float) -> None:
    scores = scored(seed, rules.replace(upper_arm_reference="trunk"), n=3, unmeasured=share)
    for time in scores.time:
        sheet = scores.explain(time)
        unknown = [line for line in sheet.lines if line.points is None]
        empty = int(np.isnan(scores.angles[int(time)]).sum())
        knees = scores.angles[int(time), INDEX["knee_flexion_left"] :][:2]
        one_knee = int(np.isnan(knees).sum() == 1)
        one_open = int(any("other not measured" in line.value for line in unknown))
        assert one_open <= one_knee
        assert len(unknown) == empty - int(np.isnan(knees).all()) - one_knee + one_open
        assert all(line.value.endswith("not measured") for line in unknown)
        for part in SUMS:
            lines = sheet.of(part)
            if all(line.points is not None for line in lines):
                assert sum(line.points for line in lines) == sheet.scores[part]
        if sheet.scores["action_level"] is None:
            assert (sheet.risk, sheet.action) == ("", "")


@settings(max_examples=60, deadline=None)
@given(rules=rule_sets, seed=seeds)
def test_classes_agree_with_the_core(rules: reba.Rules, seed: int) -> None:
    """Every class of every quantity, on and one float beside each of its ends, gives the points of the core."""
    rules = rules.replace(upper_arm_reference="trunk", seated_knees=False)
    rng = np.random.default_rng(seed)
    for quantity in angle_classes(rules):
        ends = [end for c in quantity.classes for end in (c.low, c.high) if np.isfinite(end)]
        values = np.array(
            [v for e in ends for v in (e, np.nextafter(e, 1e9), np.nextafter(e, -1e9), e + 1e-9, e - 1e-9)]
        )
        values = np.concatenate([values, rng.uniform(-180, 180, 20)])
        angles = np.zeros((len(values), len(reba.COLUMNS)))
        for side in ("left", "right"):
            angles[:, INDEX[f"lower_arm_flexion_{side}"]] = 80.0
        angles[:, [INDEX[column] for column in quantity.columns]] = values[:, None]
        base = _base(quantity)
        found = [quantity.class_of(value).points + base for value in values]
        assert reba.score_array(angles, None, rules)[quantity.part].tolist() == found, quantity.name


def _base(quantity: AngleClasses) -> int:
    return 1 if quantity.classes[0].points == 0 else 0


def test_a_worked_frame() -> None:
    angles = np.zeros((1, len(reba.COLUMNS)))
    given_ = {"trunk_flexion": 62.0, "trunk_twist": 15.0, "trunk_side_bend": -12.0, "knee_flexion_left": 45.0}
    given_ |= {"lower_arm_flexion_left": 80.0, "upper_arm_flexion_right": 95.0, "neck_flexion": -20.0}
    for name, value in given_.items():
        angles[0, INDEX[name]] = value
    scores = reba.score(
        frame_of(angles), load=12.0, shock=True, coupling_left="poor", activity="static", arm_supported=True
    )
    sheet = scores.explain(0.0)
    lines = {line.what: (line.points, line.value, line.rule) for line in sheet.lines}
    assert lines["trunk flexion"] == (4, "62.0 deg", "over 60")
    assert lines["trunk twist"] == (1, "15.0 deg", "twisted (over 10)")
    assert lines["trunk side bend"] == (0, "-12.0 deg", "side flexed (over 10); one point together")
    assert lines["neck flexion"] == (2, "-20.0 deg", "over 20 of flexion, or in extension")
    assert lines["knee flexion"] == (1, "45.0 deg", "30 to 60")
    assert lines["load"] == (2, "12 kg", "over 10 kg")
    assert lines["shock"][0] == 1
    assert lines["left arm support"][0] == 0
    assert lines["right arm support"][0] == -1
    assert lines["left coupling"][:2] == (2, "poor")
    assert [lines[kind][0] for kind in ("static", "repeated", "unstable")] == [1, 0, 0]
    assert sheet.to_dict()["lines"][0]["part"] == "trunk"


def test_points_over_the_table_are_cut_off() -> None:
    angles = np.zeros((1, len(reba.COLUMNS)))
    for name in ("trunk_flexion", "trunk_twist", "trunk_side_bend"):
        angles[0, INDEX[name]] = 70.0
    sheet = reba.score(frame_of(angles), rules=reba.Rules(twist_and_bend="two")).explain(0.0)
    assert [line.points for line in sheet.of("trunk")] == [4, 1, 0]
    assert sheet.of("trunk")[-1].rule.endswith("at most 5 for this part")


@pytest.mark.parametrize("spelling", ["sitting", " Sitting ", "SITTING"])
def test_sitting_is_understood_in_any_spelling(spelling: str) -> None:
    angles = np.zeros((1, len(reba.COLUMNS)))
    angles[0, INDEX["knee_flexion_left"]] = 90.0
    sheet = reba.score(frame_of(angles), support=spelling).explain(0.0)
    assert sheet.of("legs")[-1].rule == "over 60; not counted while sitting"
    assert sum(line.points for line in sheet.of("legs")) == sheet.scores["legs"] == 1


def test_drivers_name_the_worse_side_only() -> None:
    angles = np.zeros((1, len(reba.COLUMNS)))
    angles[0, INDEX["trunk_flexion"]] = 70.0
    angles[0, INDEX["upper_arm_flexion_right"]] = 100.0
    angles[0, INDEX["wrist_flexion_left"]] = 40.0
    scores = reba.score(frame_of(angles))
    found = contributions(scores, 0)
    assert found[0] == "trunk flexion 70.0 deg (over 60): +3"
    assert any(text.startswith("right upper arm flexion 100.0 deg (over 90): +3") for text in found)
    assert not any("left" in text for text in found)


def test_time_outside_the_recording() -> None:
    scores = scored(1, reba.Rules())
    with pytest.raises(reba.PostureError) as caught:
        scores.explain(99.0)
    says(caught, "time 99 s lies outside the recording (0 to 5 s)")
    assert scores.explain(2.4).time == 2.0


def test_one_unmeasured_knee_leaves_the_legs_open_unless_the_other_says_all() -> None:
    frames = pd.DataFrame({"time": [0.0, 1.0], "knee_flexion_left": [45.0, 70.0], "trunk_flexion": 0.0})
    scores = reba.score(frames)
    lines = [scores.explain(time).of("legs")[1] for time in (0.0, 1.0)]
    assert [line.points for line in lines] == [None, 2]
    assert (lines[0].value, lines[0].rule) == ("45.0 deg, the other not measured", "1 to 2 possible")
    assert scores.data["legs"].isna().tolist() == [True, False]
    assert [line.points for line in reba.score(frames, support="sitting").explain(0.0).of("legs")] == [1, 0]


def test_the_values_of_the_tables_are_those_of_the_paper() -> None:
    frame = pd.DataFrame({"time": [0.0]} | {name: [BEST[name]] for name in reba.COLUMNS})
    frame["trunk_flexion"], frame["neck_flexion"], frame["upper_arm_flexion_left"] = 70.0, 30.0, 95.0
    sheet = reba.score(frame, load=12.0, coupling="poor", activity="static").explain(0.0)
    # Table A of trunk 4, neck 2, legs 1; Table B of upper arm 4 and 1, lower arm 1, wrist 1.
    assert sheet.tables["table_a"] == reba.TABLE_A[3, 1, 0]
    assert (sheet.tables["table_b_left"], sheet.tables["table_b_right"]) == (
        reba.TABLE_B[3, 0, 0],
        reba.TABLE_B[0, 0, 0],
    )
    score_a, score_b = sheet.scores["score_a"], sheet.scores["score_b_left"]
    assert (score_a, score_b) == (sheet.tables["table_a"] + 2, sheet.tables["table_b_left"] + 2)
    assert sheet.tables["table_c_left"] == reba.TABLE_C[score_a - 1, score_b - 1] == sheet.scores["reba_left"] - 1
    assert sheet.to_dict()["tables"] == sheet.tables
    assert reba.score(frame.drop(columns="trunk_flexion")).explain(0.0).tables["table_a"] is None


def test_an_angle_is_printed_inside_its_class() -> None:
    frames = {"trunk_flexion": [20.004], "trunk_twist": [10.03], "neck_twist": [9.96], "trunk_side_bend": [-10.0]}
    values = {line.what: (line.value, line.rule) for line in reba.score(frames).explain(0.0).lines}
    assert values["trunk flexion"][0] == "20.004 deg"
    assert values["trunk twist"] == ("10.03 deg", "twisted (over 10)")
    assert values["neck twist"] == ("10.0 deg", "within 10")
    assert values["trunk side bend"] == ("-10.0 deg", "within 10")


def test_an_angle_that_rounds_to_nothing_has_no_sign() -> None:
    scores = reba.score(pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [-0.04, 0.0], "neck_flexion": -0.01}))
    assert [line.value for line in scores.explain(0.0).lines if line.what.endswith("k flexion")] == ["0.0 deg"] * 2


@pytest.mark.parametrize("without", ["wrist", "left|neck|shoulder", "."])
def test_what_was_not_measured_has_its_exact_range(without: str) -> None:
    """Every part, table and total spans what the measured angles leave, and no question mark stands."""
    frame = {name: [40.0] for name in reba.COLUMNS if not re.search(without, name)} or {"trunk_flexion": [np.nan]}
    sheet = reba.score(frame, load=7.0, coupling="fair").explain(0.0)
    possible = {}
    for missing in ("neutral", "worst"):
        filled = reba.score(frame, load=7.0, coupling="fair", missing=missing).explain(0.0)
        for name, value in (filled.scores | filled.tables).items():
            possible.setdefault(name, []).append(value)
    assert {name: list(ends) for name, ends in sheet.ranges.items()} == possible | {
        name: [sheet.scores[name]] * 2 for name in ("reba_low", "reba_high")
    }
    for name, value in (sheet.scores | sheet.tables).items():
        low, high = sheet.ranges[name]
        assert value == (low if low == high else None), name
    out = io.StringIO()
    show_worksheet(Console(file=out, width=80), sheet)
    shown = " ".join(out.getvalue().split())
    assert "?" not in shown
    assert "Score B {}-{}".format(*sheet.ranges["score_b_left"]) in shown
    ends = sheet.ranges["reba"]
    total = f"{ends[0]} to {ends[1]} at 0.00 s: not everything" if ends[0] < ends[1] else f"{ends[0]} at 0.00 s: "
    assert shown.startswith(f"REBA {total}")  # the result comes first
