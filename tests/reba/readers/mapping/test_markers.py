"""Markers and keypoints: the same movement from joint centres, in any world and with exchanged sides."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from reba.readers.mapping.segments import AXES
from reba.readers.recording.stream import Stream
from tests.support.says import says
from tests.support.synthetic_bodies import (
    check_movement,
    moving_postures,
    read_stream,
    rotation,
    segment_poses,
    stream_of,
)

Array = NDArray[np.float64]


def _points(world: Array, swap: bool = False) -> Stream:
    segments, poses = segment_poses(moving_postures(), AXES["ros"], world=world)
    at = {name: poses[:, index, :3] for index, name in enumerate(segments)}
    points = {"Neck": (at["upper_arm_left"] + at["upper_arm_right"]) / 2.0}
    points["Neck"] = points["Neck"] + 0.1 * points["Neck"]
    points["Head"] = points["Neck"] + (at["head"] - points["Neck"]) * 0.5
    for side in ("left", "right"):
        letter = {"left": "L", "right": "R"}[side if not swap else ("left" if side == "right" else "right")]
        for name, joint in (("Shoulder", "upper_arm"), ("Elbow", "forearm"), ("Wrist", "hand"), ("Hip", "thigh")):
            points[letter + name] = at[f"{joint}_{side}"]
        points[letter + "Knee"], points[letter + "Ankle"] = at[f"shank_{side}"], at[f"foot_{side}"]
        points[letter + "Heel"] = at[f"foot_{side}"] - 0.05 * world[:, 0]
        points[letter + "BigToe"] = at[f"foot_{side}"] + 0.15 * world[:, 0]
    return stream_of("keypoints", "points", tuple(points), np.stack(list(points.values()), axis=1))


@pytest.mark.parametrize("world", [np.eye(3), AXES["ros"], rotation("x", 180.0), rotation("z", 90.0)])
def test_keypoints_find_their_vertical_in_the_body(world: Array) -> None:
    table = read_stream(_points(world))
    check_movement(table, leave=("neck_flexion", "neck_side_bend", "neck_twist"))
    says(" ".join(table.quality.warnings), "not calibrated", "neck_flexion", "20 deg", "--neutral first:3s")
    says(table.why_unmeasured["shoulder_elevation_left"], "no zero", "--neutral first:3s")


def test_exchanged_sides_are_reported_and_corrected() -> None:
    table = read_stream(_points(AXES["ros"], swap=True))
    assert any("exchanged" in text for text in table.quality.warnings)
    check_movement(table, leave=("neck_flexion", "neck_side_bend", "neck_twist"))


def test_the_girdle_of_keypoints_has_a_zero_only_by_a_neutral_posture() -> None:
    measured = read_stream(_points(np.eye(3)), neutral="first:0.1s")
    assert "shoulder_elevation_left" not in measured.unmeasured
    assert not [text for text in measured.quality.warnings if "calibrated" in text]


def test_a_neck_computed_from_the_shoulders_shows_no_raised_girdle() -> None:
    stream = _points(np.eye(3))
    block = next(stream.blocks())
    at = {name: block.values[:, index] for index, name in enumerate(block.names)}
    at["Neck"] = (at["LShoulder"] + at["RShoulder"]) / 2.0
    measured = read_stream(stream_of("s", "points", tuple(at), np.stack(list(at.values()), axis=1)), neutral="at:0")
    says(measured.why_unmeasured["shoulder_elevation_right"], "middle of the shoulders")
