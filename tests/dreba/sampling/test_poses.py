"""Poses from recordings that lack angles: joints named, others held, and never silently."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import dreba
import dreba.cli
import reba
from dreba.domain import Domain
from dreba.sampling.classes import true_scores
from reba.posture.columns import BEST, COLUMNS, INDEX, SIDES, columns_named
from tests.support.paths import RECORDINGS
from tests.support.says import says

REAL = {
    "squat_opencap/squats1_videoAndMocap.mot": 13,
    "running_opensim/subject02_running_arms_ik.mot": 13,
    "cmu_walk/cmu_12_01_walk.bvh": 16,
    "walking_qualisys/Qualisys.c3d": 20,
    "front_box_camera_bvh/ResultFrontBox_Filtered.bvh": 12,
}
"""Recordings, and how many of the 22 angles they measure."""
LACKING = ("shoulder_elevation_left", "shoulder_elevation_right", "neck_twist")


@pytest.fixture
def lifts(tmp_path: Path) -> Path:
    """A table without `LACKING`, with a frame that lacks the trunk."""
    poses = dreba.sample(600, rng=5)
    data = pd.DataFrame(poses.angles, columns=list(COLUMNS)).drop(columns=list(LACKING))
    data.insert(0, "time", np.arange(len(data)) * 0.1)
    data.loc[3, "trunk_flexion"] = np.nan
    path = tmp_path / "lifts.csv"
    data.to_csv(path, index=False)
    return path


def test_lacking_columns_are_named_with_the_options(lifts: Path) -> None:
    with pytest.raises(dreba.SampleError) as error:
        dreba.read_poses(lifts)
    says(error, *LACKING, "joints 'measured'", "hold 'neutral'")


def test_others_than_the_joints_are_held_in_poses_and_scores(lifts: Path) -> None:
    measured = dreba.read_poses(lifts, joints="measured")
    assert len(measured) == 599
    assert measured.provenance["held"] == {column: BEST[column] for column in COLUMNS if column in LACKING}
    assert measured.provenance["left_out"] == 1
    held = dreba.read_poses(lifts, hold="neutral")
    assert np.array_equal(held.angles, measured.angles)
    few = dreba.read_poses(lifts, joints=["trunk_flexion", "knee_flexion"])
    rest = np.tile(list(BEST.values()), (len(few), 1))
    moving = [INDEX[column] for column in ("trunk_flexion", "knee_flexion_left", "knee_flexion_right")]
    rest[:, moving] = few.angles[:, moving]
    assert np.array_equal(few.angles, rest)
    assert np.array_equal(few.reba, reba.score_array(rest).reba)


def test_angles_are_held_where_the_caller_says(lifts: Path) -> None:
    held = dreba.read_poses(lifts, hold={"shoulder_elevation": 25.0, "neck_twist": 0.0})
    assert set(held.angles[:, INDEX["shoulder_elevation_right"]]) == {25.0}
    assert held.reba.mean() > dreba.read_poses(lifts, hold="neutral").reba.mean()
    sides = dreba.read_poses(lifts, hold={"shoulder_elevation_left": 5.0, "shoulder_elevation": 25.0, "neck_twist": 0})
    assert [set(sides.angles[:, INDEX[f"shoulder_elevation_{side}"]]) for side in SIDES] == [{5.0}, {25.0}]
    with pytest.raises(dreba.SampleError) as error:
        dreba.read_poses(lifts, hold={"shoulder_elevation": 25.0})
    says(error, "not measured: neck_twist;")


def test_drawn_poses_can_be_held_too(tmp_path: Path) -> None:
    path = tmp_path / "poses.parquet"
    drawn = dreba.sample(300, domain="paper", rng=1)
    drawn.save(path)
    assert np.array_equal(dreba.read_poses(path).angles, drawn.angles)
    held = dreba.read_poses(path, joints=["trunk_flexion"])
    domain = Domain.from_dict(held.provenance["domain"])
    assert domain.columns == ("trunk_flexion",)
    assert np.array_equal(held.reba, true_scores(domain, held.angles, None))


def test_the_domain_of_a_recording_is_the_range_of_its_angles(lifts: Path) -> None:
    poses = dreba.read_poses(lifts, joints="measured")
    domain = Domain.from_dict(poses.provenance["domain"])
    assert domain.limits["trunk_flexion"] == (poses.angles[:, 0].min(), poses.angles[:, 0].max())
    assert not set(LACKING) & set(domain.columns)


@pytest.mark.parametrize(
    ("options", "fact"),
    [
        ({"joints": "all"}, "'measured' or a list"),
        ({"joints": ["trunk_flexoin"]}, "did you mean 'trunk_flexion'"),
        ({"joints": []}, "no joint is named"),
        ({"hold": "rest"}, "'neutral'"),
        ({"hold": {"wrist": 1.0}}, "unknown"),
        ({"hold": {"wrist_twist": np.nan}}, "held at nan"),
    ],
)
def test_wrong_requests_are_refused(lifts: Path, options: dict, fact: str) -> None:
    with pytest.raises(dreba.SampleError) as error:
        dreba.read_poses(lifts, **options)
    says(error, fact)


def test_what_the_reader_noticed_is_kept_and_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    odd = tmp_path / "odd.csv"
    odd.write_text("time,trunk_flexion,neck_flexoin\n0,1,2\n2,1,2\n1,1,2\n3,1")
    notes = reba.read(odd).quality.notes()
    assert len(notes) >= 3
    assert dreba.read_poses(odd, joints="measured").provenance["warnings"] == notes
    for words in (
        ["evaluate", "quadratic", "--hold", "neutral", "--json"],
        ["compare", "quadratic", "--hold", "neutral", "--tasks", "0"],
        ["fit", "--joints", "measured", "-o", str(tmp_path / "model.json")],
    ):
        monkeypatch.setattr(sys, "argv", ["dreba", *words, "--poses", str(odd)])
        with pytest.raises(SystemExit):
            dreba.cli.main()
        assert capsys.readouterr().err.splitlines()[: len(notes)] == [f"note: {note}" for note in notes]


def test_names_without_a_side_stand_for_both() -> None:
    assert columns_named(["wrist_twist", "neck_twist"]) == ("neck_twist", "wrist_twist_left", "wrist_twist_right")


@pytest.mark.parametrize("name", REAL)
def test_real_recordings_give_models_on_what_they_measure(name: str) -> None:
    path = RECORDINGS / name
    if not path.is_file():
        pytest.skip("recordings are not beside the checkout")
    with pytest.raises(dreba.SampleError) as error:
        dreba.read_poses(path)
    says(error, "not measured: ")
    poses = dreba.read_poses(path, joints="measured")
    joints = tuple(poses.provenance["joints"])
    assert len(joints) == REAL[name]
    assert np.array_equal(poses.reba, reba.score_array(poses.angles).reba)
    train, held_out = poses.split(0.2, np.random.default_rng(0))
    model = dreba.QuadraticModel(joints=joints)
    dreba.fit_to(model, train, held_out, train.balancing_weights())
    assert model.joints_ == joints
    found = dreba.evaluate(model, held_out)
    constant = float(np.sqrt(np.mean([(score - np.mean(list(found.classes))) ** 2 for score in found.classes])))
    assert found.balanced_rmse < constant
    held = dreba.read_poses(path, hold="neutral")
    assert np.array_equal(held.reba, poses.reba)


def test_whole_recordings_need_no_option() -> None:
    path = RECORDINGS / "box_lift_xsens_bvh" / "MotionBox_XSens.bvh"
    if not path.is_file():
        pytest.skip("recordings are not beside the checkout")
    poses = dreba.read_poses(path)
    assert "held" not in poses.provenance
    assert len(poses.counts) == 9


def test_parquet_round_trip_and_posture_table(tmp_path: Path) -> None:
    poses = dreba.sample(150, range(1, 16), rng=6, factors=["load", "coupling", "activity"])
    poses.save(tmp_path / "poses.parquet")
    again = dreba.Poses.load(tmp_path / "poses.parquet")
    assert np.array_equal(again.angles, poses.angles)
    assert np.array_equal(again.reba, poses.reba)
    assert again.provenance == poses.provenance
    assert again.provenance["seed"] == 6
    assert np.array_equal(again.task_factors.load, poses.task_factors.load)
    table = reba.read(tmp_path / "poses.parquet")
    assert np.array_equal(reba.score(table, activity="none").angles, poses.angles)
    (tmp_path / "other.parquet").write_bytes(b"PAR1 nothing")
    with pytest.raises(dreba.SampleError) as error:
        dreba.Poses.load(tmp_path / "other.parquet")
    says(error, "cannot be read")


def test_split_keeps_classes_and_weights_balance() -> None:
    poses = dreba.sample(1000, rng=1)
    train, held = poses.split(0.2, np.random.default_rng(0))
    assert set(held.counts.values()) == {20}
    assert set(train.counts.values()) == {80}
    uneven = poses.rows(np.flatnonzero((poses.reba != 3) | (np.arange(1000) % 2 == 0)))
    weights = uneven.balancing_weights()
    totals = [weights[uneven.reba == score].sum() for score in uneven.counts]
    assert totals == pytest.approx([len(uneven) / 10] * 10)


def test_recordings_become_poses(tmp_path: Path) -> None:
    angles = dreba.sample(30, rng=1).angles
    data = pd.DataFrame(angles, columns=list(COLUMNS))
    data.insert(0, "time", np.arange(30) * 0.1)
    data.loc[4, "neck_twist"] = np.nan
    data.to_csv(tmp_path / "shift.csv", index=False)
    poses = dreba.read_poses(tmp_path / "shift.csv")
    assert len(poses) == 29
    assert poses.provenance["left_out"] == 1
    assert np.array_equal(poses.reba, np.delete(reba.score_array(angles).reba, 4))
    data.drop(columns="wrist_twist_left").to_csv(tmp_path / "part.csv", index=False)
    with pytest.raises(dreba.SampleError) as error:
        dreba.read_poses(tmp_path / "part.csv")
    says(error, "wrist_twist_left", "joints", "hold")
    data.rename(columns={"wrist_twist_left": "wrist_twst_left"}).to_csv(tmp_path / "near.csv", index=False)
    with pytest.raises(dreba.SampleError) as error:
        dreba.read_poses(tmp_path / "near.csv")
    says(error, "'wrist_twst_left'", "did you mean 'wrist_twist_left'")
