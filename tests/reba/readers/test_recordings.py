"""Real recordings against the ranges that independent code found in them (their README).

Where the definition differs the expected range is this package's own, and the reason stands beside it.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from reba.errors import ProfileError
from reba.posture.columns import COLUMNS
from reba.posture.table import PostureTable
from reba.readers import read
from tests.support.paths import RECORDINGS
from tests.support.says import says

pytestmark = pytest.mark.skipif(not RECORDINGS.is_dir(), reason="the shared recordings are not beside the checkout")

NEAR = 3.0
"""[deg] Agreement that is asked for where the definition is the same."""

# file -> profile, frames, {column: (lowest, highest) [deg]}
KNOWN: dict[str, tuple[str, int, dict[str, tuple[float, float]]]] = {
    "box_lift_xsens_bvh/MotionBox_XSens.bvh": (
        "bvh_xsens",
        1149,
        {
            "trunk_flexion": (-2, 71),
            "trunk_side_bend": (-6, 6),
            "knee_flexion_left": (0, 80),
            "upper_arm_flexion_right": (-5, 67),
            "lower_arm_flexion_right": (1, 57),
        },
    ),
    "irsst_box_lift/markers_analogs.c3d": (
        "markers_irsst",
        580,
        # Trunk by the line from the hips to the middle of notch and C7: no marker on the left shoulder. Arm and elbow
        # depend on the points taken for shoulder and elbow, so they get 10 deg.
        {"trunk_flexion": (-9, 8)},
    ),
    "squat_opencap/squats1_videoAndMocap.mot": (
        "opensim",
        801,
        {
            "trunk_flexion": (3.5, 87),
            "knee_flexion_left": (0, 88),
            "upper_arm_flexion_right": (-4, 114),
            "lower_arm_flexion_right": (32, 101),
        },
    ),
    "balancing_pose2sim/balancing_LSTM.mot": (
        "opensim_pose2sim",
        100,
        {"knee_flexion_right": (2, 66), "lower_arm_flexion_right": (42, 135)},
    ),
    "running_opensim/subject02_running_arms_ik.mot": (
        "opensim",
        600,
        {"knee_flexion_right": (6, 111), "trunk_flexion": (4, 15), "lower_arm_flexion_right": (51, 128)},
    ),
    "walking_qualisys/Qualisys.c3d": (
        "markers_qualisys",
        340,
        # Hip centres after Harrington, not the trochanters: trunk 3 deg further back, straight knee 10 deg straighter.
        {"lower_arm_flexion_left": (14, 59), "trunk_flexion": (-3, 1.5), "knee_flexion_left": (2, 64)},
    ),
    "cmu_walk/cmu_12_01_walk.bvh": (
        "bvh_cmu",
        523,
        # The README's elbow 128 and knee 88 are not in the joint positions of this file (at most 40 and 77).
        {"lower_arm_flexion_right": (12.7, 40.1), "knee_flexion_right": (0, 77.1), "trunk_flexion": (-12.4, -6.8)},
    ),
}


@cache
def _read(name: str) -> PostureTable:
    path = RECORDINGS / name
    if not path.is_file():
        pytest.skip(f"{name} is not among the shared recordings")
    return read(path)


@pytest.mark.parametrize("name", KNOWN)
def test_ranges_of_real_recordings(name: str) -> None:
    profile, frames, ranges = KNOWN[name]
    table = _read(name)
    assert table.profile == profile
    assert len(table.data) == frames
    for column, (low, high) in ranges.items():
        values = table.data[column].to_numpy()
        assert np.nanmin(values) == pytest.approx(low, abs=NEAR), column
        assert np.nanmax(values) == pytest.approx(high, abs=NEAR), column
    assert len(table.quality.sha256) == 64
    assert np.all(np.diff(table.data["time"]) > 0)


def test_box_lift_percentile_and_first_frame() -> None:
    table = _read("box_lift_xsens_bvh/MotionBox_XSens.bvh")
    assert np.percentile(table.data["trunk_flexion"], 95) == pytest.approx(67.0, abs=2.0)
    assert table.unmeasured == ()
    assert any("first frame" in text for text in table.quality.warnings)
    assert table.quality.rate == pytest.approx(60.0, abs=0.1)


def test_camera_recording_with_y_down() -> None:
    table = _read("front_box_camera_bvh/ResultFrontBox_Filtered.bvh")
    assert table.profile == "bvh_motionbuilder"
    assert "vertical -y determined from the body (head above feet)" in table.assumed
    # The tracker loses the person in a few frames, so ends of the range are percentiles.
    low, high = np.percentile(table.data["trunk_flexion"], [5, 98])
    assert low == pytest.approx(2.0, abs=NEAR)
    assert high == pytest.approx(80.0, abs=NEAR)
    assert table.data["knee_flexion_right"].max() == pytest.approx(126.0, abs=NEAR)
    assert table.data["lower_arm_flexion_left"].max() == pytest.approx(114.0, abs=NEAR)
    # Its head and right hand are turned by more than a person can.
    assert {"neck_flexion", "neck_twist", "wrist_twist_right"} <= set(table.unmeasured)


def test_one_movement_in_three_formats() -> None:
    by_c3d = _read("irsst_box_lift/markers_analogs.c3d")
    by_csv = _read("irsst_box_lift/markers.csv")
    right = [column for column in COLUMNS if column not in by_c3d.unmeasured]
    assert by_c3d.unmeasured == by_csv.unmeasured
    assert "lower_arm_flexion_right" in right
    np.testing.assert_allclose(by_c3d.data[right], by_csv.data[right], atol=0.05)
    elbow = by_c3d.data["lower_arm_flexion_right"]
    assert (elbow.min(), elbow.max()) == (pytest.approx(25, abs=10), pytest.approx(138, abs=10))
    arm = by_c3d.data["upper_arm_flexion_right"]
    assert (arm.min(), arm.max()) == (pytest.approx(-14, abs=10), pytest.approx(98, abs=10))


def test_markers_and_inverse_kinematics_of_one_movement_agree() -> None:
    markers = _read("balancing_pose2sim/S00_P00_T01_BalancingTrial_0-100_filt_butterworth_LSTM.trc").data
    solved = _read("balancing_pose2sim/balancing_LSTM.mot").data
    for column in ("trunk_flexion", "trunk_side_bend", "knee_flexion_left", "lower_arm_flexion_right"):
        assert np.corrcoef(markers[column], solved[column])[0, 1] > 0.9, column
        assert np.median(np.abs(markers[column] - solved[column])) < 15.0, column


def test_constant_columns_are_not_measured() -> None:
    balancing = _read("balancing_pose2sim/balancing_LSTM.mot")
    expected = {"neck_flexion", "neck_side_bend", "neck_twist", "wrist_flexion_left", "wrist_twist_right"}
    assert expected <= set(balancing.unmeasured)
    assert balancing.why_unmeasured["wrist_twist_right"] == "pro_sup_r constant 90"
    running = _read("running_opensim/subject02_running_arms_ik.mot")
    assert any("flexion is negative" in text for text in running.assumed)
    assert "wrist_flexion_left" in running.unmeasured


@pytest.mark.parametrize("name", ["irsst_box_lift/inverse_kin.mot", "bench_static_c3d/sample_static.c3d"])
def test_what_has_no_meaning_for_reba_is_refused_with_a_way_out(name: str) -> None:
    with pytest.raises(ProfileError) as caught:
        _read(name)
    says(caught, "no profile fits", "reba profiles", "TOML")
