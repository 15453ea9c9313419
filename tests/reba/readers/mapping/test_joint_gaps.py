"""A joint without a value hides the columns of its own chain and no others; outliers decide nothing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import reba
from reba.errors import ReadError
from tests.support.says import says

COLUMNS = {
    "middle_lumbar_Z": {"trunk_flexion", "trunk_side_bend", "trunk_twist"},
    "middle_cervical_Z": {"neck_flexion"},
    "left_shoulder_Z": {"upper_arm_flexion_left", "upper_arm_abduction_left"},
    "left_knee_Z": {"knee_flexion_left"},
}
OTHERS = ("left_elbow_Z", "left_wrist_Z", "right_shoulder_Z", "right_elbow_Z", "right_wrist_Z", "right_knee_Z")
N = 50


def table(folder: Path, name: str, values: dict[str, np.ndarray]) -> Path:
    path = folder / name
    rows = np.column_stack([np.arange(N) / 10, *values.values()])
    np.savetxt(path, rows, delimiter=",", comments="", header=",".join(["time", *values]))
    return path


def joints() -> dict[str, np.ndarray]:
    return {name: np.linspace(0.1, 0.5 + 0.1 * at, N) for at, name in enumerate([*COLUMNS, *OTHERS])}


@pytest.mark.parametrize("joint", COLUMNS)
@pytest.mark.parametrize("code", [np.nan, -9999.0])
def test_a_gap_hides_its_own_columns(tmp_path: Path, joint: str, code: float) -> None:
    whole = reba.read(table(tmp_path, "whole.csv", joints())).data
    values = joints()
    values[joint][10:20] = code
    found = reba.read(table(tmp_path, "gaps.csv", values)).data
    for column in reba.COLUMNS:
        gap = (np.arange(N) >= 10) & (np.arange(N) < 20) & (column in COLUMNS[joint])
        expected = np.where(gap, np.nan, whole[column])
        np.testing.assert_allclose(found[column], expected, atol=1e-9, err_msg=column)


MOTION = (
    *("knee_angle_r", "knee_angle_l", "pelvis_tilt", "pelvis_list", "pelvis_rotation", "lumbar_extension"),
    *("lumbar_bending", "lumbar_rotation", "arm_flex_r", "arm_flex_l", "elbow_flex_r", "elbow_flex_l"),
)


def opensim(folder: Path, factor: float, outlier: float) -> Path:
    path = folder / "motion.mot"
    rows = np.column_stack([np.arange(400) / 100, *(np.linspace(1, 60 + at, 400) for at in range(len(MOTION)))])
    rows[:, 1:] *= factor
    rows[77, 1] = outlier
    body = "\n".join("\t".join(f"{value:.6f}" for value in row) for row in rows)
    path.write_text("\t".join(("inDegrees=yes\nendheader\ntime", *MOTION)) + "\n" + body + "\n")
    return path


def test_an_outlier_does_not_hide_radians_in_joints(tmp_path: Path) -> None:
    path = opensim(tmp_path, np.pi / 180, 300.0)
    with pytest.warns(reba.RadiansWarning):
        reba.read(path)
    with pytest.raises(ReadError) as caught:
        reba.read(path, strict=True)
    says(caught.value, "radians")


def test_an_impossible_joint_in_degrees_is_a_gap(tmp_path: Path) -> None:
    found = reba.read(opensim(tmp_path, 1.0, 1e6))
    assert np.flatnonzero(found.data["knee_flexion_right"].isna()).tolist() == [77]
    says(" ".join(found.quality.warnings), "1 joint values beyond two turns")
