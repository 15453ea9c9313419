"""Geometry: postures made of known angles are read back; left is right in a mirror; edges are exact."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reba.posture.angles import (
    CONE,
    SegmentFrames,
    angle_between,
    arm_angles,
    frame_from_y_z,
    posture_angles,
    rotated_about,
)
from reba.posture.columns import COLUMNS, INDEX
from tests.support.synthetic_bodies import body_of, rotation, segment_frames

RANGES: dict[str, tuple[float, float]] = {
    "trunk_flexion": (-40, 120),
    "trunk_side_bend": (-50, 50),
    "trunk_twist": (-70, 70),
    "neck_flexion": (-60, 70),
    "neck_side_bend": (-50, 50),
    "neck_twist": (-80, 80),
    "knee_flexion": (0, 150),
    "upper_arm_flexion": (-60, 180),
    "upper_arm_abduction": (-40, 90 - CONE - 1),
    "shoulder_elevation": (-20, 60),
    "lower_arm_flexion": (0, 150),
    "wrist_flexion": (-80, 80),
    "wrist_deviation": (-40, 40),
    "wrist_twist": (-90, 90),
}


def _range(column: str) -> tuple[float, float]:
    return RANGES[column.removesuffix("_left").removesuffix("_right")]


postures = st.fixed_dictionaries({column: st.floats(*_range(column)) for column in COLUMNS})


@settings(max_examples=150, deadline=None)
@given(posture=postures, heading=st.floats(-180, 180), hip=st.floats(-20, 110))
def test_every_angle_of_a_posture_is_read_back(posture: dict[str, float], heading: float, hip: float) -> None:
    body = body_of({**posture, "hip_flexion_left": hip, "hip_flexion_right": hip}, heading)
    read = posture_angles(body, 1)[0]
    np.testing.assert_allclose(read, [posture[column] for column in COLUMNS], atol=1e-8)


@settings(max_examples=50, deadline=None)
@given(posture=postures)
def test_left_is_right_in_a_mirror(posture: dict[str, float]) -> None:
    frames = segment_frames(posture)
    mirror = np.diag([1.0, 1.0, -1.0])
    swap = {"left": "right", "right": "left"}
    mirrored = {}
    for name, frame in frames.items():
        part, _, side = name.rpartition("_")
        mirrored[f"{part}_{swap[side]}" if side in swap else name] = (mirror @ frame @ mirror)[None]
    read = posture_angles(SegmentFrames(mirrored, up=np.array([0.0, 1.0, 0.0])), 1)[0]
    plain = posture_angles(body_of(posture), 1)[0]
    for column, index in INDEX.items():
        part, _, side = column.rpartition("_")
        other = INDEX[f"{part}_{swap[side]}"] if side in swap else index
        sign = -1.0 if column.endswith(("side_bend", "trunk_twist", "neck_twist")) else 1.0
        assert read[index] == pytest.approx(sign * plain[other], abs=1e-8), column


def test_neutral_is_zero_everywhere() -> None:
    assert np.all(np.round(posture_angles(body_of({}), 1), 9) == 0.0)


@pytest.mark.parametrize("degrees", [20.0, 45.0, 60.0, 90.0, 100.0])
def test_class_edges_are_exact_after_rounding(degrees: float) -> None:
    posture = {"trunk_flexion": degrees, "upper_arm_flexion_left": degrees, "lower_arm_flexion_right": degrees}
    read = np.round(posture_angles(body_of(posture), 1)[0], 9)
    assert [read[INDEX[column]] for column in posture] == [degrees] * 3


def test_trunk_keeps_its_sign_when_the_pelvis_tips_over() -> None:
    frames = segment_frames({"trunk_flexion": 0.0}, 30.0)
    tipped = rotation("y", 30.0) @ rotation("z", -100.0)
    body = SegmentFrames({"pelvis": tipped[None], "thorax": tipped[None]}, up=np.array([0.0, 1.0, 0.0]))
    read = posture_angles(body, 1)[0]
    assert read[0] == pytest.approx(100.0)
    assert read[1:3] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert frames["pelvis"].shape == (3, 3)


def test_without_a_vertical_the_pelvis_is_the_reference() -> None:
    body = body_of({"trunk_flexion": 30.0, "trunk_twist": 10.0}, heading=70.0)
    body.up = None
    tilt = rotation("x", 40.0)
    body.frames = {name: tilt @ frame for name, frame in body.frames.items()}
    assert posture_angles(body, 1)[0, :3] == pytest.approx([30.0, 0.0, 10.0])


def test_arm_flexion_is_elevation_near_the_sideways_direction_and_never_jumps_overhead() -> None:
    def arm(flexion: float, abduction: float) -> np.ndarray:
        direction = rotation("z", flexion) @ rotation("x", -abduction) @ np.array([0.0, -1.0, 0.0])
        return np.array(arm_angles(direction[None]))[:, 0]

    assert arm(0.0, 90.0) == pytest.approx([90.0, 90.0])
    assert arm(-3.0, 85.0) == pytest.approx([85.0, 85.0], abs=0.2)
    assert arm(0.0, 59.0) == pytest.approx([0.0, 59.0], abs=1e-9)
    assert arm(185.0, 5.0) == pytest.approx([185.0, 5.0])
    assert arm(-60.0, 0.0) == pytest.approx([-60.0, 0.0])


def test_what_is_missing_is_nan_and_nothing_else() -> None:
    body = body_of({"trunk_flexion": 10.0})
    del body.frames["head"], body.frames["hand_left"], body.frames["shank_right"]
    missing = {column for column in COLUMNS if np.isnan(posture_angles(body, 1)[0, INDEX[column]])}
    expected = {"neck_flexion", "neck_side_bend", "neck_twist", "wrist_flexion_left", "wrist_deviation_left"}
    assert missing == expected | {"knee_flexion_right"}


def test_directions_are_enough_for_elbow_knee_and_arm() -> None:
    down, forward = np.array([[0.0, 2.0, 0.0]]), np.array([[-3.0, 0.0, 0.0]])
    frames = {"thorax": np.eye(3)[None], "pelvis": np.eye(3)[None]}
    axes = {"upper_arm_left": down, "forearm_left": forward, "thigh_left": down, "shank_left": down}
    read = posture_angles(SegmentFrames(frames, axes), 1)[0]
    assert read[INDEX["lower_arm_flexion_left"]] == pytest.approx(90.0)
    assert read[INDEX["upper_arm_flexion_left"]] == pytest.approx(0.0)
    assert read[INDEX["knee_flexion_left"]] == 0.0


def test_helpers_refuse_degenerate_directions_with_nan() -> None:
    assert np.isnan(frame_from_y_z(np.array([[0.0, 1.0, 0.0]]), np.array([[0.0, 2.0, 0.0]]))).any()
    assert np.isnan(angle_between(np.zeros((1, 3)), np.array([[1.0, 0, 0]]))[0])
    assert angle_between(np.array([[1.0, 0, 0]]), np.array([[-1.0, 0, 0]]))[0] == 180.0
    np.testing.assert_allclose(rotated_about(np.eye(3), 0, np.radians([30.0]))[0], rotation("x", 30.0), atol=1e-15)
