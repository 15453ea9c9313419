"""The page about profiles: it describes every key, no other, and its examples read what they say."""

from __future__ import annotations

import re
import tomllib
from dataclasses import fields

import numpy as np
import pytest
from numpy.typing import NDArray

from reba.errors import ProfileError
from reba.posture.columns import SIDES
from reba.posture.table import PostureTable
from reba.readers.build_table import build_table
from reba.readers.recognise import choose
from reba.readers.recording import profile as profile_module
from reba.readers.recording.profile import GROUPS, MIDDLE, POINTS_MIDDLE, POINTS_SIDED, SIDED, Profile, parse_profile
from reba.readers.recording.stream import Recording, Stream
from tests.support.paths import ROOT
from tests.support.says import says
from tests.support.synthetic_bodies import joints_stream, quaternion, recording_of, rotation, stream_of

PAGE = (ROOT / "docs" / "profiles.md").read_text(encoding="utf-8")
EXAMPLES = {
    example["name"]: example for example in map(tomllib.loads, re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL))
}
KEYS = set(profile_module._FIELDS)
WAVE = np.linspace(0.0, 1.0, 100)


def _profile(name: str) -> Profile:
    return parse_profile(EXAMPLES[name], "docs/profiles.md")


def _read(name: str, *streams: Stream, neutral: str = "none") -> PostureTable:
    recording = recording_of(*streams)
    return build_table(recording, choose(recording, (_profile(name),), named=True), neutral=neutral)


def test_every_key_is_described_and_no_other() -> None:
    rows = re.findall(r"^\| (`.+?`) \| ", PAGE, flags=re.MULTILINE)
    described = [key for row in rows for key in re.findall(r"`(\w+)`", row)]
    assert sorted(described) == sorted(KEYS)
    assert {field.name for field in fields(Profile)} == KEYS


def test_every_key_is_in_an_example() -> None:
    assert {key for example in EXAMPLES.values() for key in example} == KEYS
    assert {example["kind"] for example in EXAMPLES.values()} == set(profile_module.KINDS)


def test_segments_points_and_groups_are_named() -> None:
    for word in (*MIDDLE, *SIDED, *POINTS_MIDDLE, *POINTS_SIDED, *GROUPS):
        assert f"`{word}`" in PAGE, word


def _joints(**change: NDArray[np.float64] | float) -> Stream:
    names = {
        "back_bend": 20.0 * WAVE,
        "back_twist": 5.0 * WAVE,
        "left_arm_raise": 40.0 * WAVE,
        "left_knee": -60.0 * WAVE,
    }
    names |= {
        "right_arm_raise": 10.0 * WAVE,
        "right_knee": -30.0 * WAVE,
        "left_elbow": 90.0,
        "right_elbow": 30.0 + WAVE,
    }
    return joints_stream({**names, **change}, unit="deg")


def test_the_joints_example() -> None:
    table = _read("mylab", _joints())
    last = table.data.iloc[-1]
    for column, value in {
        "trunk_flexion": 20.0,
        "trunk_twist": 5.0,
        "upper_arm_flexion_left": 40.0,
        "upper_arm_abduction_left": 10.0,
        "upper_arm_abduction_right": 10.0,
        "lower_arm_flexion_right": 26.0,
        "knee_flexion_left": 60.0,
        "knee_flexion_right": 30.0,
    }.items():
        assert last[column] == pytest.approx(value, abs=1e-6), column
    assert table.why_unmeasured["lower_arm_flexion_left"] == "left_elbow constant 90"
    assert table.why_unmeasured["neck_flexion"] == "no sensor on the head"
    says(" ".join(table.assumed), "the back is one joint", "sign inverted", "pelvis assumed upright")


def test_the_joints_example_with_the_pose_of_the_pelvis() -> None:
    lean = np.array([[0.0, 0.0, 1.0, *quaternion(rotation("y", 15.0))]] * 100)[:, None]
    table = _read("mylab", _joints(), stream_of("/tf", "frames", ("base",), lean, parents=("map",)))
    assert table.data["trunk_flexion"].iloc[0] == pytest.approx(15.0)


def test_one_side_is_sufficient_for_the_joints_example() -> None:
    one = {"back_bend": 20.0 * WAVE, "right_arm_raise": 10.0 * WAVE}
    table = _read("mylab", joints_stream(one, unit="deg"))
    assert {"upper_arm_flexion_left", "knee_flexion_right"} <= set(table.unmeasured)
    assert table.data["upper_arm_flexion_right"].iloc[-1] == pytest.approx(10.0)
    with pytest.raises(ProfileError) as caught:
        _read("mylab", joints_stream({"back_bend": 20.0 * WAVE}, unit="deg"))
    says(caught, "mylab does not fit", "lacks")


def _suit(mark: str = "suit/base_station") -> Stream:
    poses = {"hip_sensor": np.eye(3), "back_sensor": rotation("y", 25.0)}
    for side, out in zip(SIDES, (1.0, -1.0), strict=True):
        # Arms hang from the trunk; the sensor of the upper arm is turned by a quarter about the arm, the elbow bent.
        poses[f"{side}_upper_arm_sensor"] = rotation("y", 25.0) @ rotation("z", -90.0 * -out)
        poses[f"{side}_forearm_sensor"] = rotation("y", 25.0) @ rotation("y", -70.0)
    values = np.array([[0.0, 0.0, 0.0, *quaternion(pose)] for pose in poses.values()])
    names = (*(f"suit/{name}" for name in poses), mark)
    moving = np.tile(np.vstack([values, values[:1]]), (100, 1, 1))
    moving[:, :, 3:] += 1e-5 * np.random.default_rng(0).normal(size=moving[:, :, 3:].shape)
    return stream_of("/tf", "frames", names, moving, parents=("",) * len(names))


def test_the_frames_example() -> None:
    table = _read("suit", _suit())
    last = table.data.iloc[-1]
    assert last["trunk_flexion"] == pytest.approx(25.0, abs=0.1)
    for side in SIDES:
        assert last[f"upper_arm_flexion_{side}"] == pytest.approx(0.0, abs=0.1)
        assert last[f"lower_arm_flexion_{side}"] == pytest.approx(70.0, abs=0.1)
        assert last[f"wrist_twist_{side}"] == pytest.approx(0.0, abs=0.1)
    assert {"neck_flexion", "knee_flexion_left"} <= set(table.unmeasured)


def test_the_mark_of_the_frames_example_has_to_be_there() -> None:
    with pytest.raises(ProfileError) as caught:
        _read("suit", _suit(mark="suit/another_station"))
    says(caught, "suit does not fit")


def _markers(shoulder: str) -> Stream:
    noise = np.random.default_rng(0)
    places = {"C7": (-0.05, 0.0, 1.5), "TOP": (0.05, 0.0, 1.75)}
    for side, out in (("L", 1.0), ("R", -1.0)):
        places |= {f"{side}HIP": (0.0, 0.1 * out, 0.95), f"{side}{shoulder}": (0.0, 0.18 * out, 1.45)}
        places |= {f"{side}ELL": (0.0, 0.21 * out, 1.15), f"{side}ELM": (0.0, 0.15 * out, 1.15)}
        places |= {f"{side}WRI": (0.25, 0.18 * out, 1.15)}
    values = np.tile(np.array(list(places.values())), (100, 1, 1))
    return stream_of("s", "points", tuple(places), values + 1e-5 * noise.normal(size=values.shape))


@pytest.mark.parametrize("shoulder", ["SHO", "ACR"])
def test_the_points_example(shoulder: str) -> None:
    table = _read("markers", _markers(shoulder))
    for column in ("shoulder_elevation_left", "neck_flexion", "neck_side_bend"):
        says(table.why_unmeasured[column], "no zero", "--neutral first:3s")
    assert table.data["lower_arm_flexion_left"].iloc[-1] == pytest.approx(90.0, abs=0.1)
    calibrated = _read("markers", _markers(shoulder), neutral="first:1s")
    assert calibrated.data["neck_flexion"].abs().max() < 0.1
    assert "shoulder_elevation_right" not in calibrated.unmeasured


def test_points_without_the_key_have_no_zero_for_the_girdle_and_say_what_is_not_calibrated() -> None:
    content = {key: value for key, value in EXAMPLES["markers"].items() if key != "needs_neutral"}
    recording = recording_of(_markers("SHO"))
    table = build_table(recording, choose(recording, (parse_profile(content, "mine.toml"),), named=True))
    says(table.why_unmeasured["shoulder_elevation_left"], "no zero", "--neutral")
    says(" ".join(table.quality.warnings), "not calibrated", "neck_flexion", "--neutral first:3s")
    assert table.data["neck_flexion"].iloc[0] == pytest.approx(21.8, abs=0.1)


def test_a_profile_of_points_may_say_that_it_needs_no_neutral_posture() -> None:
    recording: Recording = recording_of(_markers("SHO"))
    none = parse_profile({**EXAMPLES["markers"], "needs_neutral": []}, "mine.toml")
    table = build_table(recording, choose(recording, (none,), named=True))
    assert not {"shoulder_elevation_left", "neck_flexion"} & set(table.unmeasured)
    assert not [text for text in table.quality.warnings if "calibrated" in text]
