"""Recognition: what is chosen, why, and when it is refused."""

from __future__ import annotations

import numpy as np
import pytest

from reba.errors import ProfileError
from reba.posture.columns import COLUMNS
from reba.readers import signal_names
from reba.readers.recognise import choose, matches
from reba.readers.recording.profile import find_profile, profiles
from reba.readers.recording.stream import Recording, Stream, Topic
from reba.readers.signal_names import bodies
from tests.support.says import says
from tests.support.synthetic_bodies import joints_stream, recording_of, stream_of


def _joints(profile: str, pattern: str = "{name}", leave: tuple[str, ...] = (), name: str = "/joint_states") -> Stream:
    names = [word for word in find_profile(profile).names if word not in leave]
    return joints_stream({pattern.replace("{name}", word): 0.1 for word in names}, name)


@pytest.mark.parametrize(
    ("profile", "pattern", "body"),
    [
        ("human_description", "{name}", ""),
        ("ros4hri", "{name}_b1", "b1"),
        ("ros4hri", "{name}_a3f_2", "a3f_2"),
        ("xsens_joints", "skeleton_{name}", "skeleton"),
        ("mvnx_joints", "{name}", ""),
        ("human_gazebo", "{name}", ""),
        ("opensim", "{name}", ""),
        ("opensim_pose2sim", "{name}", ""),
        ("opensim", "/jointset/hip/{name}/value", ""),
        ("human_description", "/joint_states/{name}/position", "joint_states"),
        ("human_description", "{name}/position", ""),
        ("human_description", "human1.{name}.position", "human1"),
    ],
)
def test_every_joints_profile_recognises_its_own_names(profile: str, pattern: str, body: str) -> None:
    match = choose(recording_of(_joints(profile, pattern)), profiles())
    assert match.profile is not None
    assert (match.profile.name, match.body) == (profile, body)
    total = len(match.profile.slots)
    assert f"{total}/{total} joints of profile {profile}" in match.why


@pytest.mark.parametrize("profile", [profile.name for profile in profiles() if profile.kind != "joints"])
def test_every_other_profile_recognises_its_own_names(profile: str) -> None:
    known = find_profile(profile)
    names = tuple(dict.fromkeys([*known.names, *known.marks]))
    size = 7 if known.kind == "frames" else 3
    stream = stream_of("s", known.kind, names, np.zeros((2, len(names), size)), parents=("",) * len(names))
    match = choose(recording_of(stream), profiles())
    assert match.profile is known
    assert match.missing == ()


def test_missing_joints_are_named_and_not_measured() -> None:
    legs = ("left_knee_Z", "right_knee_Z")
    match = choose(recording_of(_joints("human_description", leave=legs)), profiles())
    assert match.missing == legs
    assert not [column for column in match.columns if column.startswith("knee")]
    assert "24/26" in match.why


def test_a_posture_table_comes_first_unless_a_profile_is_named() -> None:
    table = stream_of("/posture", "angles", COLUMNS, np.zeros((2, 22)))
    recording = recording_of(_joints("human_description"), table)
    assert choose(recording, profiles()).profile is None
    assert choose(recording, (find_profile("human_description"),), named=True).profile is not None
    assert choose(recording, profiles(), topic="/joint_states").profile is not None


def test_frames_in_the_world_come_before_joints_of_as_many_columns() -> None:
    frames = find_profile("xsens_frames")
    names = tuple(f"skeleton_{name}" for name in frames.names)
    tf = stream_of("/tf", "frames", names, np.zeros((2, len(names), 7)), parents=("",) * len(names))
    joints = _joints("xsens_joints", "skeleton_{name}")
    assert choose(recording_of(joints, tf), profiles()).profile is frames
    assert [
        match.profile.name for match in matches(recording_of(joints, tf), profiles()) if match.fits and match.profile
    ] == [
        "xsens_frames",
        "xsens_joints",
    ]


def test_several_bodies_are_refused_and_can_be_chosen() -> None:
    both = {f"{name}_{body}": 0.1 for body in ("b1", "b2") for name in find_profile("ros4hri").names}
    recording = recording_of(joints_stream(both))
    with pytest.raises(ProfileError) as caught:
        choose(recording, profiles())
    says(caught, "2 bodies or streams", "ros4hri", "b1, b2", "--topic b1")
    assert choose(recording, profiles(), topic="b2").body == "b2"
    assert choose(recording, profiles(), topic="/joint_states#b1").body == "b1"
    with pytest.raises(ProfileError) as caught:
        choose(recording, profiles(), topic="b22")
    says(caught, "'b22'", "did you mean 'b2'")


def test_two_streams_with_the_same_names_are_refused() -> None:
    recording = recording_of(_joints("human_description"), _joints("human_description", name="/filtered"))
    with pytest.raises(ProfileError) as caught:
        choose(recording, profiles())
    says(caught, "/joint_states, /filtered", "--topic")
    assert choose(recording, profiles(), topic="/filtered").stream.name == "/filtered"


def test_one_body_in_two_streams_is_no_choice_to_make() -> None:
    names = tuple(f"skeleton_{name}" for name in find_profile("xsens_frames").names)
    streams = [
        stream_of(name, "frames", names, np.zeros((2, len(names), 7)), parents=("",) * len(names))
        for name in ("/link_states", "/tf")
    ]
    assert choose(recording_of(*streams), profiles()).stream.name == "/link_states"
    assert choose(recording_of(*streams), profiles(), topic="/tf").stream.name == "/tf"


def test_a_tie_of_two_profiles_is_refused() -> None:
    first = find_profile("human_description")
    twin = type(first)(**{**{key: getattr(first, key) for key in first.__dataclass_fields__}, "name": "twin"})
    with pytest.raises(ProfileError) as caught:
        choose(recording_of(_joints("human_description")), (first, twin))
    says(caught, "fit equally", "--profile human_description or --profile twin")


def test_nothing_recognised_says_what_was_there_and_what_is_nearest() -> None:
    strange = joints_stream({"left_elbow_Z": 0.1, "gripper": 0.2})
    with pytest.raises(ProfileError) as caught:
        choose(recording_of(strange), profiles())
    says(caught, "left_elbow_Z, gripper", "nearest is human_description (1/26 joints", "reba profiles")
    topic = Topic("/camera", "sensor_msgs/msg/Image", 10, False, "not a posture")
    with pytest.raises(ProfileError) as caught:
        choose(Recording("bag.mcap", "mcap", (), (topic,)), profiles())
    says(caught, "/camera (sensor_msgs/msg/Image): not a posture", "reba info")


def test_a_named_profile_that_does_not_fit_is_named() -> None:
    with pytest.raises(ProfileError) as caught:
        choose(recording_of(_joints("human_description")), (find_profile("opensim"),), named=True)
    says(caught, "profile opensim does not fit", "reba profiles")


def test_a_star_in_a_pattern_is_anything_and_no_body() -> None:
    names = find_profile("opensim").names
    states = joints_stream({f"/jointset/joint{index}/{name}/value": 0.1 for index, name in enumerate(names)})
    assert len(bodies(find_profile("opensim"), states)[""]) == len(names)


@pytest.mark.parametrize(
    ("profile", "pattern"), [(profile.name, pattern) for profile in profiles() for pattern in profile.patterns]
)
def test_every_pattern_of_a_profile_gives_one_body(profile: str, pattern: str) -> None:
    """A word of the source before its names, as of Mixamo, is no id."""
    called = {name: pattern.format(name=name, id="b1").replace("*", "any") for name in find_profile(profile).names}
    found = bodies(find_profile(profile), joints_stream(dict.fromkeys(called.values(), 0.1)))
    assert found == {"b1" if "{id}" in pattern else "": called}


def test_ids_are_taken_from_the_longest_name() -> None:
    stream = joints_stream({"skeleton_left_c7_shoulder_x": 0.1, "my_left_c7_shoulder_y": 0.1})
    signals = bodies(find_profile("xsens_joints"), stream)
    assert signals == {
        "skeleton": {"left_c7_shoulder_x": "skeleton_left_c7_shoulder_x"},
        "my": {"left_c7_shoulder_y": "my_left_c7_shoulder_y"},
    }


def test_only_profiles_of_which_a_name_occurs_are_looked_for_in_detail(monkeypatch: pytest.MonkeyPatch) -> None:
    """Expressions of many names take most of the time of a short recording to compile."""
    asked: set[tuple[str, ...]] = set()
    compiled = signal_names._expression

    def counted(names: tuple[str, ...], pattern: str, loose: bool) -> object:
        asked.add(names)
        return compiled(names, pattern, loose)

    monkeypatch.setattr(signal_names, "_expression", counted)
    match = choose(recording_of(_joints("opensim", "/jointset/hip/{name}/value")), profiles())
    assert match.profile is not None
    assert match.profile.names in asked
    joints = {profile.names for profile in profiles() if profile.kind == "joints"}
    assert len(asked) < len(joints)
