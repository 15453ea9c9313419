"""Codes for missing values: zeros of points and numbers such as -9999, in every kind of stream."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import reba
from reba.readers.mapping.gap_codes import GapCodes
from reba.readers.recording.stream import Block, Kind, ReadLog
from tests.support.says import says


def cleaned(kind: Kind, values: np.ndarray, parts: int = 1) -> tuple[np.ndarray, str]:
    """Return the values without codes, read in some blocks until the decision holds, and the warning."""
    names = tuple(f"p{at}" for at in range(values.shape[1]))
    gaps = GapCodes(kind)
    for _ in range(2):
        gaps.begin()
        result = np.concatenate(
            [gaps.without(Block(np.arange(len(part)), names, part)).values for part in np.array_split(values, parts)]
        )
        if gaps.is_consistent():
            break
    log = ReadLog()
    gaps.note(log)
    return result, "".join(log.warnings)


def body(frames: int = 20) -> np.ndarray:
    """Return points [m] around an origin at the first one."""
    points = np.random.default_rng(0).normal(size=(frames, 6, 3))
    points[:, 0] = 0.0
    return points


@pytest.mark.parametrize("parts", [1, 4])
def test_points_at_zero_are_gaps_but_not_the_origin_of_a_body(parts: int) -> None:
    points = body()
    points[3:9, 4] = 0.0
    values, warning = cleaned("points", points, parts)
    assert not np.isnan(values[:, 0]).any()
    np.testing.assert_array_equal(np.isnan(values[:, 4]).all(axis=1), np.isin(np.arange(20), range(3, 9)))
    says(warning, "(0, 0, 0)", "'p4' 6", "of 20 samples")


def test_a_point_that_is_never_there_is_no_origin() -> None:
    points = body() + 5.0
    points[:, 0] = 0.0
    assert np.isnan(cleaned("points", points)[0][:, 0]).all()


def test_a_point_that_leaves_zero_late_was_a_gap() -> None:
    points = body(40)
    points[30:, 0] = 0.5
    values, _ = cleaned("points", points, 4)
    np.testing.assert_array_equal(np.isnan(values[:, 0]).all(axis=1), np.arange(40) < 30)


@pytest.mark.parametrize("code", [-1.0, -999.0, -9999.0, 9999.0, 99999.0])
@pytest.mark.parametrize("scale", [1.0, 0.001])
def test_codes_of_points_in_any_unit(code: float, scale: float) -> None:
    points = body()
    points[5, 2] = code * scale
    points[6, 2] = [code * scale, 0.1, 0.2]
    values, _ = cleaned("points", points)
    assert np.isnan(values[5, 2]).all()
    alone = abs(code * scale) > 3.0  # a nearer one may be the place of the point
    assert np.isnan(values[6, 2]).all() == alone
    assert alone or (values[6, 2] == points[6, 2]).all()


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("away", [0.0, 9.5, 4.5e5])
def test_codes_in_one_coordinate_are_those_far_from_the_body(axis: int, away: float) -> None:
    """A laboratory may have its origin far away, and a body may stand where a code of another unit is."""
    points = body()
    points[:, 0] = 0.5
    points[..., axis] += away
    points[5, 2, axis] = -9999.0
    points[7, 3, axis] = away + 2e6
    points[9, 1:, axis] = 99999.0
    points[3, 1, axis] = 9.99
    values, warning = cleaned("points", points)
    gaps = np.zeros(points.shape[:2], bool)
    gaps[5, 2] = gaps[7, 3] = gaps[9, 1:] = True
    gaps[3, 1] = abs(away - 9.99) > 3.0
    np.testing.assert_array_equal(np.isnan(values).all(axis=-1), gaps)
    says(warning, "'p2' 2")


def test_codes_of_joints_and_angles_but_never_zero() -> None:
    joints = np.zeros((10, 2))
    joints[4, 1] = -999.0
    values, warning = cleaned("joints", joints)
    assert np.isnan(values).sum() == 1
    says(warning, "-999", "'p1' 1")


@pytest.mark.parametrize("code", [1e6, -1e30, 3.4028234663852886e38])
def test_points_farther_away_than_any_body_are_gaps(code: float) -> None:
    points = body()
    points[5, 2] = code
    points[6, 2] = [code, 0.1, 0.2]
    values, warning = cleaned("points", points)
    assert np.isnan(values[5:7, 2]).all()
    says(warning, "'p2' 2")


def test_an_angle_that_no_joint_has_is_damaged_and_said(tmp_path: Path) -> None:
    table = pd.DataFrame({"time": np.arange(50) / 10, "trunk_flexion": 30.0, "neck_flexion": np.linspace(0, 20, 50)})
    table.loc[10:14, "trunk_flexion"] = 1e6
    table.loc[15, "trunk_flexion"] = -999
    table.to_csv(tmp_path / "damaged.csv", index=False)
    read = reba.read(tmp_path / "damaged.csv")
    assert read.data["trunk_flexion"].isna().sum() == 6
    says(" | ".join(read.quality.warnings), "beyond 360 deg", "damaged", "'trunk_flexion' 5", "'trunk_flexion' 1")


@pytest.mark.parametrize("code", [-999, 9999])
def test_codes_in_a_posture_table_are_not_scored(tmp_path: Path, code: int) -> None:
    table = pd.DataFrame({"time": np.arange(50) / 10, "trunk_flexion": 30.0, "neck_flexion": np.linspace(0, 20, 50)})
    table.loc[10:14, "trunk_flexion"] = code
    table.to_csv(tmp_path / "coded.csv", index=False)
    read = reba.read(tmp_path / "coded.csv")
    assert read.data["trunk_flexion"].isna().sum() == 5
    assert any("'trunk_flexion' 5" in text for text in read.quality.warnings)
