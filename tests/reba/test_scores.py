"""From a posture table to the score table: the public front door."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest

import reba
from reba.method.scoring import SCORE_COLUMNS
from reba.posture.columns import INDEX
from tests.support import posture_samples as samples
from tests.support.says import says

TABLE = [
    "time",
    "trunk",
    "neck",
    "legs",
    "load_force",
    "upper_arm_left",
    "upper_arm_right",
    "lower_arm_left",
    "lower_arm_right",
    "wrist_left",
    "wrist_right",
    "coupling_left",
    "coupling_right",
    "activity",
    "score_a",
    "score_b_left",
    "score_b_right",
    "reba_left",
    "reba_right",
    "reba",
    "action_level",
    "reba_low",
    "reba_high",
]


def frame_of(n: int = 4, seed: int = 0) -> pd.DataFrame:
    angles = samples.random_angles(np.random.default_rng(seed), n)
    return pd.DataFrame({"time": np.arange(n) * 0.5} | dict(zip(reba.COLUMNS, angles.T, strict=True)))


def test_angle_columns() -> None:
    sided = "knee_flexion upper_arm_flexion upper_arm_abduction shoulder_elevation lower_arm_flexion wrist_flexion "
    sided += "wrist_deviation wrist_twist"
    whole = [f"{part}_{angle}" for part in ("trunk", "neck") for angle in ("flexion", "side_bend", "twist")]
    assert list(reba.COLUMNS) == whole + [f"{name}_{side}" for name in sided.split() for side in ("left", "right")]


def test_score_table() -> None:
    scores = reba.score(frame_of(), activity="none")
    assert list(scores.data.columns) == TABLE == ["time", *SCORE_COLUMNS]
    assert scores.data["time"].tolist() == [0.0, 0.5, 1.0, 1.5]
    assert {str(kind) for kind in scores.data.dtypes[1:]} == {"Int8"}
    arrays = reba.score_array(frame_of()[list(reba.COLUMNS)].to_numpy())
    for name in SCORE_COLUMNS:
        assert scores.data[name].tolist() == arrays[name].tolist()


def test_column_order_and_extra_columns_do_not_matter() -> None:
    frame = frame_of()
    shuffled = frame[list(frame.columns[::-1])].assign(comment="x")
    pd.testing.assert_frame_equal(reba.score(shuffled).data, reba.score(frame).data)


def test_other_data_with_names_are_scored_as_frames() -> None:
    frame = frame_of()
    expected = reba.score(frame).data
    for data in (dict(frame), frame[list(frame.columns[::-1])].to_dict("list"), frame.to_dict("records")):
        pd.testing.assert_frame_equal(reba.score(data).data, expected)
    pose = frame.iloc[0].to_dict()
    assert reba.score(pose, activity="none").data["reba"].tolist() == [
        reba.score(frame, activity="none").data["reba"][0]
    ]


def test_input_frame_is_not_changed() -> None:
    frame = frame_of()
    before = frame.copy()
    reba.score(frame, load=3.0)
    pd.testing.assert_frame_equal(frame, before)


@pytest.mark.parametrize("kind", ["float32", "Float64", "object", "string"])
def test_column_types(kind: str) -> None:
    frame = frame_of()
    frame[list(reba.COLUMNS)] = frame[list(reba.COLUMNS)].round()
    expected = reba.score(frame).data
    pd.testing.assert_frame_equal(reba.score(frame.astype(dict.fromkeys(reba.COLUMNS, kind))).data, expected)


def test_absent_columns_are_not_measured() -> None:
    scores = reba.score(frame_of()[["time", "trunk_flexion", "neck_flexion"]])
    assert scores.unmeasured == tuple(c for c in reba.COLUMNS if c not in ("trunk_flexion", "neck_flexion"))
    assert scores.data["reba"].isna().all()
    assert (scores.data["reba_low"] < scores.data["reba_high"]).all()


@pytest.mark.parametrize(("missing", "column"), [("neutral", "reba_low"), ("worst", "reba_high")])
def test_missing_fills(missing: str, column: str) -> None:
    scores = reba.score(frame_of()[["time", "trunk_flexion"]], missing=missing)
    assert scores.data["reba"].tolist() == scores.data[column].tolist()
    assert scores.missing == missing


def test_missing_error_and_unknown_choice() -> None:
    with pytest.raises(reba.PostureError) as caught:
        reba.score(frame_of()[["time", "trunk_flexion"]], missing="error")
    says(caught, "is not measured at frame 0")
    with pytest.raises(reba.PostureError) as caught:
        reba.score(frame_of(), missing="drop")
    says(caught, "missing is 'drop'")


def test_factor_columns_and_arguments() -> None:
    frame = frame_of().assign(load=[0.0, 6.0, 12.0, 12.0], coupling_left="poor", shock=[0, 0, 0, 1])
    scores = reba.score(frame)
    assert scores.data["load_force"].tolist() == [0, 1, 2, 3]
    assert scores.data["coupling_left"].tolist() == [2] * 4
    over = reba.score(frame, load=0.0, coupling="fair")
    assert over.data["load_force"].tolist() == [0, 0, 0, 1]
    assert over.data["coupling_left"].tolist() == [1] * 4
    assert "load 0 kg" not in scores.assumed
    assert "coupling good (left)" not in scores.assumed
    assert "coupling good (right)" in scores.assumed


def test_what_is_assumed() -> None:
    assert reba.score(frame_of()).assumed == (
        "load 0 kg", "no shock", "coupling good (left)", "coupling good (right)", "support bilateral",
        "left arm unsupported", "right arm unsupported", "activity from the movement",
    )  # fmt: skip
    given = {"load": 1.0, "shock": False, "coupling": 0, "support": "walking", "arm_supported": False}
    assert reba.score(frame_of(), activity="none", **given).assumed == ()
    assert reba.score(frame_of(), static=False, repeated=False, unstable=True, **given).assumed == ()


def test_raised_shoulders_as_flags() -> None:
    frame = pd.DataFrame({"shoulder_raised_left": [True, False], "upper_arm_flexion_left": 0.0})
    frame["upper_arm_abduction_left"] = 0.0
    scores = reba.score(frame)
    assert scores.data["upper_arm_left"].tolist() == [2, 1]
    assert scores.data["upper_arm_right"].isna().all()
    measured = reba.score(frame.assign(shoulder_elevation_left=[0.0, np.nan]))
    assert measured.data["upper_arm_left"].tolist() == [1, 1]


@pytest.mark.parametrize(
    ("activity", "points"),
    [("none", 0), ("static", 1), ("static,repeated", 2), (" static , repeated, unstable", 3)],
)
def test_activity_by_name(activity: str, points: int) -> None:
    assert reba.score(frame_of(), activity=activity).data["activity"].tolist() == [points] * 4


def test_activity_from_the_movement() -> None:
    n = 900
    frame = pd.DataFrame(np.zeros((n, 22)), columns=list(reba.COLUMNS)).assign(time=np.arange(n) * 0.1)
    scores = reba.score(frame)
    assert scores.data["activity"].tolist() == [1] * n
    assert set(scores.activity_causes["static"]) >= {"trunk", "neck", "legs"}
    assert reba.score(frame, static=False).data["activity"].tolist() == [0] * n
    assert "static" not in reba.score(frame, static=False).activity_causes
    assert scores.summary()["activity"] == scores.activity_causes


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.drop(columns=list(reba.COLUMNS)), "no angle column among: time"),
        (lambda f: pd.DataFrame(), "no angle column among: none"),
        (lambda f: pd.DataFrame({"trunk_flexoin": [1.0]}), "did you mean 'trunk_flexion'"),
        (lambda f: f.assign(trunk_flexion="bent"), "column trunk_flexion holds a value that is not a number"),
        (lambda f: f.assign(time=[0.0, 1.0, 1.0, 2.0]), "time does not increase after frame 1"),
        (lambda f: f.assign(time=[0.0, 2.0, 1.0, 3.0]), "time does not increase after frame 1"),
        (lambda f: f.assign(time=[0.0, np.nan, 1.0, 3.0]), "time is nan at frame 1; expected seconds"),
        (lambda f: f.assign(time=[0.0, 1.0, 2.0, np.inf]), "time is inf at frame 3"),
        (lambda f: f.assign(time=pd.date_range("2024-01-01", periods=4)), "column time ; dates; expected seconds"),
        (lambda f: f.assign(trunk_flexion=np.inf), "trunk_flexion is infinite at frame 0"),
    ],
)
def test_bad_tables_are_refused(change: object, message: str) -> None:
    with pytest.raises(reba.PostureError) as caught:
        reba.score(change(frame_of()))
    says(caught, *message.split("; "))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"activity": "dancing"}, "activity 'dancing' is unknown; use auto, none or some of"),
        ({"lod": 3.0}, "factor 'lod' is unknown; did you mean 'load'"),
        ({"support": ["bilateral"] * 3}, "support has shape (3,)"),
        ({"load": [1.0, 2.0]}, "load has shape (2,)"),
    ],
)
def test_bad_arguments_are_refused(given: dict[str, object], message: str) -> None:
    with pytest.raises(reba.PostureError) as caught:
        reba.score(frame_of(), **given)
    says(caught, *message.split("; "))


def test_misspelt_columns_are_named() -> None:
    scores = reba.score(frame_of().rename(columns={"neck_twist": "neck_twst"}))
    assert scores.postures.quality.warnings == ("column 'neck_twst' is not used; did you mean 'neck_twist'?",)


@pytest.mark.parametrize("n", [0, 1])
def test_short_tables(n: int) -> None:
    scores = reba.score(frame_of(n))
    assert len(scores.data) == n
    assert scores.summary()["frames"] == n


def test_a_posture_table_is_taken_as_it_is() -> None:
    frame = frame_of()
    table = reba.PostureTable(frame, profile="test", assumed=("pelvis assumed upright",), unmeasured=("neck_twist",))
    scores = reba.score(table)
    assert scores.assumed[0] == "pelvis assumed upright"
    assert scores.unmeasured == ("neck_twist",)
    np.testing.assert_array_equal(scores.angles, frame[list(reba.COLUMNS)].to_numpy())
    assert scores.summary()["profile"] == "test"


def test_summary_is_json() -> None:
    for frame in (frame_of(50), frame_of(50)[["trunk_flexion"]]):
        json.dumps(reba.score(frame, load=8.0).summary(), allow_nan=False)


def test_wrong_arm_is_not_mixed_in() -> None:
    frame = frame_of(1)
    frame[list(reba.COLUMNS)] = 0.0
    frame[reba.COLUMNS[INDEX["upper_arm_flexion_right"]]] = 100.0
    row = reba.score(frame).data.iloc[0]
    assert row["reba"] == max(row["reba_left"], row["reba_right"]) == row["reba_right"]


# -- measurement error ---------------------------------------------------------------------------------------------

ADDED = [
    "reba_likely", "reba_95_low", "reba_95_high", "p_level_2_low", "p_level_2_high", "p_level_3_low", "p_level_3_high",
]  # fmt: skip


def test_an_error_adds_columns_and_changes_no_score() -> None:
    frames = frame_of(60)
    frames.loc[20:40, "wrist_twist_left"] = np.nan
    plain, with_error = reba.score(frames, load=7.0), reba.score(frames, load=7.0, error="inertial")
    pd.testing.assert_frame_equal(with_error.data[TABLE], plain.data)
    assert list(with_error.data.columns) == [*TABLE, *ADDED]
    assert [str(kind) for kind in with_error.data.dtypes[ADDED]] == ["Int8"] * 3 + ["float64"] * 4
    assert plain.error is plain.distribution is None
    assert "distribution" not in plain.summary()
    core = reba.score_array(frames, with_error.factors, error="inertial").distribution
    assert core is not None
    np.testing.assert_array_equal(with_error.data["p_level_3_high"], core.columns()["p_level_3_high"])
    np.testing.assert_array_equal(with_error.data["reba_95_low"].to_numpy(np.uint8), core.reba_95_low)


def test_expected_exposure_is_the_weighted_mean_of_the_frames() -> None:
    frames = frame_of(80, seed=3).assign(time=np.cumsum(np.random.default_rng(3).uniform(0.1, 0.2, 80)))
    scores = reba.score(frames, error="one-camera", rules="rater")
    found = scores.summary()["distribution"]
    json.dumps(found)
    chances = reba.score_probabilities(frames, scores.factors, "rater", error="one-camera")
    weights = np.append(np.diff(frames["time"]), np.median(np.diff(frames["time"])))
    shares = weights @ chances / weights.sum()
    assert found["mean_low"] == pytest.approx(shares @ np.arange(1, 16))
    for level, first in (("1", 2), ("2", 4), ("3", 8), ("4", 11)):
        assert found["at_least"][level]["low"] == pytest.approx(shares[first - 1 :].sum())
    assert found["error"]["name"] == "one-camera"
    assert found["error"]["sd"]["trunk_twist"] == 14.0
    assert found["exact"]
    assert not found["without_error"]
    same = weights[scores.data["reba"] == scores.data["reba_likely"]].sum() / weights.sum()
    assert found["likely_is_reba"] == pytest.approx(same)
    unmeasured = reba.score(frames[["time", "trunk_flexion"]], error="optical").summary()["distribution"]
    assert unmeasured["likely_is_reba"] is None


def test_the_worksheet_of_a_frame_has_its_distribution() -> None:
    scores = reba.score(frame_of(), error={"trunk_flexion": 5.0, "wrist_twist": 8.0})
    sheet = scores.explain(0.5)
    row = scores.data.iloc[1]
    assert sheet.error == "own"
    assert sheet.distribution == {name: row[name] for name in ADDED}
    worst = scores.summary()["worst"][0]
    assert worst["distribution"] == scores.explain(worst["time"]).distribution
    json.dumps(worst)
    assert set(sheet.scores) == set(SCORE_COLUMNS)
    assert reba.score(frame_of()).explain(0.5).distribution == {}


def test_columns_without_an_error_and_approximations_are_named() -> None:
    found = reba.score(frame_of(), error={"trunk_flexion": 5.0}).summary()["distribution"]
    assert "trunk_flexion" not in found["without_error"]
    assert len(found["without_error"]) == 21
    gravity = reba.Rules(upper_arm_reference="gravity")
    found = reba.score(frame_of(), rules=gravity, error="optical").summary()["distribution"]
    assert not found["exact"]
    assert "gravity" in found["approximate"]
