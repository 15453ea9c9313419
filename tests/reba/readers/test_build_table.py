"""Posture tables of streams: units, constant joints, vertical, signs, neutral posture, and their notes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from reba.errors import ProfileError, ReadError, RebaError
from reba.posture.columns import COLUMNS
from reba.posture.table import PostureTable
from reba.readers.build_table import build_table
from reba.readers.mapping.segments import AXES
from reba.readers.recognise import choose
from reba.readers.recording.profile import find_profile, profiles
from reba.readers.recording.stream import Recording, Stream
from tests.support.says import says
from tests.support.synthetic_bodies import (
    joints_stream,
    quaternion,
    recording_of,
    rotation,
    stream_of,
)

Array = NDArray[np.float64]
N = 150
WAVE = np.linspace(0.0, 1.0, N)


def _read(*streams: Stream, topic: str | None = None, neutral: str = "none") -> PostureTable:
    recording = recording_of(*streams)
    return build_table(recording, choose(recording, profiles(), topic), neutral=neutral)


def _human(unit: str = "rad", scale: float = np.pi / 180.0, **moves: Array | float) -> Stream:
    """Return a stream of human.urdf joints [deg], all of them moving a little unless given."""
    values = dict.fromkeys(find_profile("human_description").names, 1.0 + WAVE)
    return joints_stream(
        {name: np.asarray(value) * scale for name, value in {**values, **moves}.items()}, n=N, unit=unit
    )


def test_an_exact_edge_survives_radians() -> None:
    table = _read(_human(left_elbow_Z=np.where(WAVE < 0.5, 60.0, 100.0), left_knee_Z=30.0 + 30.0 * (WAVE > 0.5)))
    assert set(table.data["lower_arm_flexion_left"]) == {60.0, 100.0}
    assert set(table.data["knee_flexion_left"]) == {30.0, 60.0}
    assert table.unmeasured == ()
    assert "pelvis assumed upright" in table.assumed[0]
    assert list(table.data.columns) == ["time", *COLUMNS]


def test_degrees_in_a_field_of_radians_are_found_and_told() -> None:
    moves = {"left_elbow_Z": 90.0 * WAVE, "right_elbow_Z": 80.0 * WAVE, "middle_lumbar_Z": 40.0 * WAVE}
    table = _read(_human(scale=1.0, **moves))
    assert table.data["lower_arm_flexion_left"].max() == pytest.approx(90.0)
    assert any("read as degrees" in text for text in table.quality.warnings)


def test_one_damaged_value_does_not_change_the_unit() -> None:
    bent = 60.0 * WAVE
    bent[75] = 1e6
    table = _read(_human(left_elbow_Z=bent))
    assert np.isnan(table.data["lower_arm_flexion_left"][75])
    assert table.data["lower_arm_flexion_left"].max() == pytest.approx(60.0)
    assert any("left out as damaged" in text for text in table.quality.warnings)


def test_unit_not_stated_is_taken_from_the_range() -> None:
    table = _read(_human(unit="", scale=1.0, left_elbow_Z=30.0 + 60.0 * WAVE, right_knee_Z=30.0 + 40.0 * WAVE))
    assert table.data["lower_arm_flexion_left"].max() == pytest.approx(90.0)


def test_joints_constantly_zero_are_not_measured() -> None:
    values = {f"{name}_b1": 0.1 + 0.2 * WAVE for name in find_profile("ros4hri").names}
    dummies = dict.fromkeys(("waist_b1", "r_head_b1", "y_head_b1", "p_head_b1"), 0.0)
    table = _read(joints_stream({**values, **dummies}, n=N, unit="rad"))
    for column in ("trunk_flexion", "neck_flexion", "neck_side_bend", "neck_twist"):
        assert column in table.unmeasured
    assert table.why_unmeasured["trunk_flexion"] == "waist_b1 constant 0"
    assert table.why_unmeasured["trunk_twist"] == "the waist has one joint"
    assert "14/14 joints of profile ros4hri of body b1" in table.recognised
    assert "waist_b1 constant 0 -> trunk_flexion not measured" in table.recognised


def test_joints_of_another_convention_are_told() -> None:
    # The XME mode of the Xsens driver: raw triples under the same names, flexion about z and not -y.
    values = {f"skeleton_{name}": 0.1 + 0.1 * WAVE for name in find_profile("xsens_joints").names}
    elbows = {f"skeleton_{side}_elbow_y": np.radians(80.0 + 10.0 * WAVE) for side in ("left", "right")}
    table = _read(joints_stream({**values, **elbows}, n=N, unit="rad"))
    (warning,) = [text for text in table.quality.warnings if "impossible" in text]
    says(warning, "lower_arm_flexion_left and lower_arm_flexion_right", "another convention than xsens_joints")


def test_known_place_holders_count_even_when_nothing_moves() -> None:
    values = {f"{name}_b1": 0.3 for name in find_profile("ros4hri").names}
    table = _read(joints_stream({**values, "waist_b1": 0.0}, n=N, unit="rad"))
    assert table.why_unmeasured["trunk_flexion"] == "waist_b1 constant 0"
    assert "neck_flexion" not in table.unmeasured


def test_zero_is_believed_in_a_short_or_motionless_recording() -> None:
    names = find_profile("human_description").names
    still = joints_stream({**dict.fromkeys(names, 0.0), "middle_lumbar_Z": np.radians(30.0)}, n=N, unit="rad")
    table = _read(still)
    assert set(table.data["trunk_flexion"]) == {30.0}
    assert table.unmeasured == ()
    short = joints_stream({**dict.fromkeys(names, 0.0), "middle_lumbar_Z": WAVE[:20]}, n=20, unit="rad")
    assert _read(short).unmeasured == ()


def test_a_recording_of_zeros_only_is_an_error() -> None:
    zeros = joints_stream(dict.fromkeys(find_profile("human_description").names, 0.0), n=N, unit="rad")
    with pytest.raises(ProfileError) as caught:
        _read(zeros)
    says(caught, "no angle was measured", "constant 0")


def test_negative_knees_are_turned_round() -> None:
    values = dict.fromkeys(find_profile("opensim").names, 5.0 + WAVE)
    knees = {"knee_angle_l": -10.0 - 80.0 * WAVE, "knee_angle_r": -5.0 - 60.0 * WAVE}
    table = _read(joints_stream({**values, **knees}, n=N, unit="deg"))
    assert table.data["knee_flexion_left"].max() == pytest.approx(90.0)
    assert table.data["knee_flexion_right"].max() == pytest.approx(65.0)
    assert any("flexion is negative" in text for text in table.assumed)
    straight = {"knee_angle_l": -2.0 + WAVE, "knee_angle_r": -3.0 + WAVE}
    assert _read(joints_stream({**values, **straight}, n=N, unit="deg")).data["knee_flexion_left"].min() == -2.0


@pytest.mark.parametrize(
    ("root", "axes", "id"), [("body_b1", "ros", "ros4hri"), ("middle_pelvis", "isb", "human_description")]
)
def test_the_root_frame_gives_the_trunk_its_vertical(root: str, axes: str, id: str) -> None:
    suffix = "_b1" if id == "ros4hri" else ""
    values = {f"{name}{suffix}": 0.1 + 0.1 * WAVE for name in find_profile(id).names}
    bend = "waist_b1" if id == "ros4hri" else "middle_lumbar_Z"
    others = {name: 0.0 for name in values if name.startswith(("middle_lumbar", "middle_thoracic"))}
    joints = joints_stream({**values, **others, bend: np.radians(10.0 + WAVE)}, n=N, unit="rad")
    pelvis = AXES["ros"] @ rotation("y", 50.0) @ rotation("z", -30.0) @ AXES[axes].T
    poses = np.tile([1.0, 2.0, 0.9, *quaternion(pelvis)], (N, 1, 1))
    tf = stream_of("/tf", "frames", (root,), poses, parents=("map",))
    table = _read(joints, tf)
    np.testing.assert_allclose(table.data["trunk_flexion"], 40.0 + WAVE, atol=1e-6)
    assert any(f"from frame {root} of /tf, vertical z of map" in text for text in table.assumed)


def test_neutral_posture_is_subtracted_but_not_from_hinges() -> None:
    moves = {"middle_cervical_Z": np.where(WAVE < 0.3, 21.0, 41.0), "left_elbow_Z": np.where(WAVE < 0.3, 10.0, 60.0)}
    table = _read(_human(**moves), neutral="first:0.5s")
    assert set(table.data["neck_flexion"].round(6)) == {0.0, 20.0}
    assert set(table.data["lower_arm_flexion_left"]) == {10.0, 60.0}
    assert any("neutral posture from" in text for text in table.assumed)
    at_end = _read(_human(**moves), neutral="at:2.5")
    assert at_end.data["neck_flexion"].min() == pytest.approx(-20.0)


def test_neutral_beyond_the_recording_is_refused() -> None:
    with pytest.raises(RebaError) as caught:
        _read(_human(), neutral="at:99")
    says(caught, "at:99", "0.00 to 2.98 s")


def test_abnormal_ends_are_kept_and_refused_when_strict() -> None:
    stream = _human()
    recording = Recording(__file__, "test", (stream,))
    recording.log.ended_abnormally = "truncated at byte 9"
    match = choose(recording, profiles())
    assert build_table(recording, match).quality.ended_abnormally == "truncated at byte 9"
    with pytest.raises(ReadError) as caught:
        build_table(recording, match, strict=True)
    says(caught, "truncated at byte 9", "without strict")
