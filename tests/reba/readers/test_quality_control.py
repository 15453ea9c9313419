"""Quality control: gaps, frozen frames, neutral posture."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import reba
from reba.errors import RebaError
from reba.posture.columns import COLUMNS, INDEX
from reba.readers.column_statistics import ColumnStatistics
from reba.readers.quality_control import (
    apply_neutral,
    constant_columns,
    equal_frames,
    find_gaps,
    frozen_warning,
    parse_neutral,
)
from tests.support.says import says
from tests.support.synthetic_bodies import RATE


@pytest.mark.parametrize("spec", ["", "first", "first:0s", "first:-1s", "at:x", "last:3s", "none "])
def test_bad_neutral_is_refused(spec: str) -> None:
    with pytest.raises(RebaError) as caught:
        parse_neutral(spec)
    says(caught, repr(spec), "none, first:3s", "at:12.5")


@pytest.mark.parametrize("spec", ["first:3s", "at:0.4"])
def test_a_neutral_posture_is_not_all_of_the_recording(spec: str) -> None:
    data = pd.DataFrame({"time": np.arange(5) / 5, "trunk_flexion": [30.0, 40, 50, 40, 30]})
    angles = data.reindex(columns=list(COLUMNS)).to_numpy()
    with pytest.raises(RebaError) as caught:
        apply_neutral(data["time"].to_numpy(), angles, spec)
    says(caught, repr(spec), "0.00 to 0.80 s", "first:1s")
    np.testing.assert_array_equal(angles[:, INDEX["trunk_flexion"]], data["trunk_flexion"])
    says(apply_neutral(data["time"].to_numpy(), angles, "first:0.2s"), "2 frames")


def test_gaps_and_frozen_stretches() -> None:
    time = np.concatenate([np.arange(50) / RATE, 5.0 + np.arange(50) / RATE])
    assert find_gaps(time) == ((0.98, 5.0),)
    assert find_gaps(np.arange(5) * 10.0) == ()
    angles = np.random.default_rng(1).normal(size=(100, 22))
    assert frozen_warning(np.arange(100) / RATE, equal_frames(angles)) is None
    angles[20:80] = angles[20]
    says(frozen_warning(np.arange(100) / RATE, equal_frames(angles)) or "", "equal frames", "0.40 s")


@pytest.mark.parametrize(("straight", "warned"), [(180.0, True), (0.0, False)])
def test_hinges_that_count_from_180_are_told(tmp_path: Path, straight: float, warned: bool) -> None:
    bend = 10 + 50 * np.abs(np.sin(np.arange(200) / 20))
    table = pd.DataFrame({"time": np.arange(200) / 20, "trunk_flexion": bend, "knee_flexion": np.abs(straight - bend)})
    table["lower_arm_flexion"] = np.abs(straight - bend[::-1] - 15)
    table.to_csv(tmp_path / "hinges.csv", index=False)
    texts = [text for text in reba.read(tmp_path / "hinges.csv").quality.warnings if "180 is straight" in text]
    assert len(texts) == warned
    assert all("knee_flexion_left" in text and "lower_arm_flexion_right" in text for text in texts)


@pytest.mark.parametrize(
    ("kind", "moving", "measured"),
    [
        ("frames", "wrist_flexion_left", True),  # the hand bends in one direction only
        ("frames", "wrist_twist_left", False),  # the forearm turns, and the hand of the rig has no joint
        ("joints", "wrist_flexion_left", False),  # joints are recorded one by one
    ],
)
def test_a_hand_that_bends_is_measured_in_both_directions(kind: str, moving: str, measured: bool) -> None:
    angles = np.zeros((50, len(COLUMNS)))
    angles[:, INDEX[moving]] = np.linspace(0, 40, 50)
    constant = constant_columns(ColumnStatistics().add(angles), 5.0, kind, {})
    assert ("wrist_deviation_left" not in constant) == measured
    assert "wrist_deviation_right" in constant


def test_equal_frames_are_those_in_which_every_column_is_equal() -> None:
    rng = np.random.default_rng(1)
    angles = np.repeat(rng.choice([0.0, 1.0, np.nan], (60, len(COLUMNS)), p=(0.94, 0.02, 0.04)), 2, axis=0)
    plain = ((angles[1:] == angles[:-1]) | np.isnan(angles[1:])).all(axis=1)
    assert 0 < plain.sum() < len(plain)
    assert (equal_frames(angles) == plain).all()
    assert [len(equal_frames(angles[:count])) for count in range(3)] == [0, 0, 1]


def test_frames_without_a_value_are_gaps_and_not_frozen(tmp_path: Path) -> None:
    time = np.arange(300) / 10
    frame = pd.DataFrame({"time": time, "trunk_flexion": 20 + time, "neck_flexion": 5 + time})
    frame.loc[100:150, ["trunk_flexion", "neck_flexion"]] = np.nan
    frame.to_csv(tmp_path / "gap.csv", index=False)
    texts = " ".join(reba.read(tmp_path / "gap.csv").quality.warnings)
    assert "no value in 17 %" in texts
    assert "frozen" not in texts
    assert "repeat" not in texts
