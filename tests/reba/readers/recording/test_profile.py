"""Profiles: every sign by single movements, strict files, and forward kinematics of the URDF as a second opinion."""

from __future__ import annotations

import re
import sysconfig
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from reba.errors import ProfileError
from reba.posture.columns import COLUMNS, INDEX
from reba.readers.mapping import block_angles, mapper_for, measurable_columns
from reba.readers.recording.profile import Profile, find_profile, load_profile, parse_profile, profiles
from reba.readers.recording.stream import Block, Stream
from tests.support.says import says
from tests.support.synthetic_bodies import joints_stream, quaternion, rotation, stream_of

HANGING = {"jRightShoulder_rotx": 90.0, "jLeftShoulder_rotx": -90.0}

# profile -> [(joints [deg], columns that change by [deg])]; joints not named are 0, for human_gazebo the arms hang.
MOVES: dict[str, list[tuple[dict[str, float], dict[str, float]]]] = {
    "human_description": [
        ({"middle_lumbar_Z": 20}, {"trunk_flexion": 20}),
        ({"middle_lumbar_X": 20}, {"trunk_side_bend": 20}),
        ({"middle_thoracic_Z": 20}, {"trunk_flexion": 20}),
        ({"middle_thoracic_X": 20}, {"trunk_side_bend": 20}),
        ({"middle_thoracic_Y": 20}, {"trunk_twist": 20}),
        ({"middle_lumbar_Z": 30, "middle_thoracic_Z": 40}, {"trunk_flexion": 70}),
        ({"middle_cervical_Z": 20}, {"neck_flexion": 20}),
        ({"middle_cervical_X": 20}, {"neck_side_bend": 20}),
        ({"middle_cervical_Y": 20}, {"neck_twist": 20}),
        ({"left_shoulder_Z": 70}, {"upper_arm_flexion_left": 70}),
        ({"right_shoulder_Z": -30}, {"upper_arm_flexion_right": -30}),
        ({"left_shoulder_X": 40}, {"upper_arm_abduction_left": 40}),
        ({"right_shoulder_X": 40}, {"upper_arm_abduction_right": 40}),
        ({"right_shoulder_Y": 40}, {}),
        # A raised girdle takes the arm along; who shrugs lowers the arm in the shoulder.
        ({"left_clavicle_joint_X": 15, "left_shoulder_X": -15}, {"shoulder_elevation_left": 15}),
        ({"right_clavicle_joint_X": 15}, {"shoulder_elevation_right": 15, "upper_arm_abduction_right": 15}),
        ({"left_elbow_Z": 90}, {"lower_arm_flexion_left": 90}),
        ({"left_elbow_Y": 30}, {"wrist_twist_left": 30}),
        ({"right_wrist_Z": 25}, {"wrist_flexion_right": 25}),
        ({"right_wrist_X": 25}, {"wrist_deviation_right": -25}),
        ({"left_knee_Z": 60}, {"knee_flexion_left": 60}),
        ({"left_hip_Z": 60}, {}),
    ],
    "ros4hri": [
        ({"waist": 20}, {"trunk_flexion": 20}),
        ({"r_head": 20}, {"neck_side_bend": 20}),
        ({"y_head": 20}, {"neck_twist": 20}),
        ({"p_head": 20}, {"neck_flexion": -20}),
        ({"l_p_shoulder": 30}, {"upper_arm_abduction_left": 30}),
        ({"r_p_shoulder": 30}, {"upper_arm_abduction_right": 30}),
        ({"l_p_shoulder": 70, "l_y_shoulder": 90}, {"upper_arm_flexion_left": 70}),
        ({"r_p_shoulder": 70, "r_y_shoulder": 90}, {"upper_arm_flexion_right": 70}),
        ({"l_elbow": 45}, {"lower_arm_flexion_left": 45}),
        ({"r_knee": -45}, {"knee_flexion_right": 45}),
    ],
    "xsens_joints": [
        ({"l5_s1_y": 20}, {"trunk_flexion": 20}),
        ({"t9_t8_x": 20}, {"trunk_side_bend": 20}),
        ({"t9_t8_z": 20}, {"trunk_twist": 20}),
        ({"c1_head_y": 20}, {"neck_flexion": 20}),
        ({"t1_c7_x": 20}, {"neck_side_bend": 20}),
        ({"c1_head_z": 20}, {"neck_twist": 20}),
        ({"right_shoulder_y": -50}, {"upper_arm_flexion_right": 50}),
        ({"left_shoulder_y": -50}, {"upper_arm_flexion_left": 50}),
        ({"right_shoulder_x": -30}, {"upper_arm_abduction_right": 30}),
        ({"left_shoulder_x": 30}, {"upper_arm_abduction_left": 30}),
        ({"right_c7_shoulder_x": -10, "right_shoulder_x": 10}, {"shoulder_elevation_right": 10}),
        ({"left_elbow_y": -80}, {"lower_arm_flexion_left": 80}),
        ({"right_elbow_z": 20}, {"wrist_twist_right": 20}),
        ({"left_elbow_z": -20}, {"wrist_twist_left": 20}),
        ({"right_wrist_y": -20}, {"wrist_flexion_right": 20}),
        ({"left_wrist_x": 20}, {"wrist_deviation_left": -20}),
        ({"right_wrist_x": 20}, {"wrist_deviation_right": 20}),
        ({"left_knee_y": 60}, {"knee_flexion_left": 60}),
    ],
    "mvnx_joints": [
        ({"jL4L3_z": 20}, {"trunk_flexion": 20}),
        ({"jL1T12_x": 20}, {"trunk_side_bend": 20}),
        ({"jT9T8_y": 20}, {"trunk_twist": 20}),
        ({"jT1C7_z": 20}, {"neck_flexion": 20}),
        ({"jRightShoulder_z": 50}, {"upper_arm_flexion_right": 50}),
        ({"jLeftShoulder_x": 30}, {"upper_arm_abduction_left": 30}),
        ({"jLeftT4Shoulder_x": 10, "jLeftShoulder_x": -10}, {"shoulder_elevation_left": 10}),
        ({"jLeftElbow_z": 80}, {"lower_arm_flexion_left": 80}),
        ({"jRightElbow_y": 20}, {"wrist_twist_right": 20}),
        ({"jRightWrist_z": 20}, {"wrist_flexion_right": 20}),
        ({"jRightWrist_x": 20}, {"wrist_deviation_right": -20}),
        ({"jLeftWrist_x": 20}, {"wrist_deviation_left": -20}),
        ({"jRightKnee_z": 60}, {"knee_flexion_right": 60}),
    ],
    "human_gazebo": [
        ({"jL5S1_roty": 20}, {"trunk_flexion": 20}),
        ({"jT9T8_rotx": 20}, {"trunk_side_bend": 20}),
        ({"jT9T8_rotz": 20}, {"trunk_twist": 20}),
        ({"jC1Head_roty": 20}, {"neck_flexion": 20}),
        ({"jT1C7_rotx": 20}, {"neck_side_bend": 20}),
        ({"jRightShoulder_rotx": 60}, {"upper_arm_abduction_right": 30}),
        ({"jLeftShoulder_rotx": -60}, {"upper_arm_abduction_left": 30}),
        ({"jRightC7Shoulder_rotx": -10, "jRightShoulder_rotx": 100}, {"shoulder_elevation_right": 10}),
        ({"jLeftC7Shoulder_rotx": 10, "jLeftShoulder_rotx": -100}, {"shoulder_elevation_left": 10}),
        ({"jRightElbow_rotz": 80}, {"lower_arm_flexion_right": 80}),
        ({"jLeftElbow_rotz": -80}, {"lower_arm_flexion_left": 80}),
        ({"jRightWrist_rotx": 20}, {"wrist_flexion_right": 20}),
        ({"jLeftWrist_rotz": 20}, {"wrist_deviation_left": 20}),
        ({"jLeftKnee_roty": 60}, {"knee_flexion_left": 60}),
    ],
    "opensim": [
        ({"pelvis_tilt": -20}, {"trunk_flexion": 20}),
        ({"lumbar_extension": -20}, {"trunk_flexion": 20}),
        ({"pelvis_tilt": -20, "lumbar_extension": -30, "pelvis_rotation": 0}, {"trunk_flexion": 50}),
        ({"pelvis_list": 20}, {"trunk_side_bend": 20}),
        ({"lumbar_bending": 20}, {"trunk_side_bend": 20}),
        ({"lumbar_rotation": 20}, {"trunk_twist": 20}),
        ({"pelvis_rotation": 120, "lumbar_extension": -30}, {"trunk_flexion": 30}),
        ({"arm_flex_r": 50}, {"upper_arm_flexion_right": 50}),
        ({"arm_flex_l": 50}, {"upper_arm_flexion_left": 50}),
        ({"arm_add_r": -30}, {"upper_arm_abduction_right": 30}),
        ({"arm_add_l": -30}, {"upper_arm_abduction_left": 30}),
        ({"elbow_flex_l": 80}, {"lower_arm_flexion_left": 80}),
        ({"pro_sup_r": 20}, {"wrist_twist_right": 20}),
        ({"wrist_flex_r": 20}, {"wrist_flexion_right": 20}),
        ({"wrist_dev_l": 20}, {"wrist_deviation_left": 20}),
        ({"knee_angle_r": 60}, {"knee_flexion_right": 60}),
    ],
    "opensim_pose2sim": [
        ({"L5_S1_Flex_Ext": -20}, {"trunk_flexion": 20}),
        ({"L1_T12_Lat_Bending": 20}, {"trunk_side_bend": 20}),
        ({"L2_L3_axial_rotation": 20}, {"trunk_twist": 20}),
        # About the axis to the right, like the lumbar joints: positive is backwards, whatever its name.
        ({"neck_flexion": 20}, {"neck_flexion": -20}),
        ({"neck_bending": 20}, {"neck_side_bend": 20}),
        ({"neck_rotation": 20}, {"neck_twist": 20}),
        ({"arm_flex_r": 50}, {"upper_arm_flexion_right": 50}),
        ({"arm_flex_l": 50}, {"upper_arm_flexion_left": 50}),
        ({"arm_add_r": -30}, {"upper_arm_abduction_right": 30}),
        ({"arm_add_l": -30}, {"upper_arm_abduction_left": 30}),
        ({"sh_elev_r": 40}, {"upper_arm_abduction_right": 40}),
        ({"sh_elev_l": 40}, {"upper_arm_abduction_left": 40}),
        ({"sh_elev_r": 40, "sh_plane_elev_r": 90}, {"upper_arm_flexion_right": 40}),
        ({"sh_elev_l": 40, "sh_plane_elev_l": 90}, {"upper_arm_flexion_left": 40}),
    ],
}  # fmt: skip


def _angles(profile: Profile, joints: dict[str, float]) -> np.ndarray:
    start = HANGING if profile.name == "human_gazebo" else {}
    names = {slot: words[:1] for slot, words in profile.slots.items()}
    values = {name: np.radians({**start, **joints}.get(name, 0.0)) for (name,) in names.values()}
    stream = joints_stream(values, unit="rad", n=2)
    mapper = mapper_for(profile, names, stream)
    mapper.begin()
    return block_angles(mapper, next(stream.blocks()))[0]


@pytest.mark.parametrize("name", MOVES)
def test_one_joint_moves_the_expected_column_and_no_other(name: str) -> None:
    profile = find_profile(name)
    still = _angles(profile, {})
    for joints, changes in MOVES[name]:
        moved = _angles(profile, joints) - still
        expected = np.array([changes.get(column, 0.0) for column in COLUMNS])
        expected[np.isnan(still)] = np.nan
        np.testing.assert_allclose(moved, expected, atol=1e-8, err_msg=f"{name}: {joints}")


def test_every_joints_profile_has_its_signs_tested() -> None:
    assert set(MOVES) == {profile.name for profile in profiles() if profile.kind == "joints"}


def test_mid_position_of_the_forearm_is_zero() -> None:
    assert _angles(find_profile("human_description"), {"left_elbow_Y": 90})[INDEX["wrist_twist_left"]] == 0.0
    assert _angles(find_profile("opensim"), {"pro_sup_l": 90})[INDEX["wrist_twist_left"]] == 0.0


def test_large_turns_are_composed_and_not_added() -> None:
    read = _angles(find_profile("human_description"), {"middle_lumbar_X": 40, "middle_thoracic_Z": 60})
    trunk = rotation("x", 40) @ rotation("z", -60) @ np.array([0.0, 1.0, 0.0])
    assert read[0] == pytest.approx(np.degrees(np.arctan2(trunk[0], trunk[1])))
    assert read[1] == pytest.approx(np.degrees(np.arcsin(trunk[2])))


def _urdf() -> Path:
    path = Path(sysconfig.get_paths()["purelib"]) / "cmeel.prefix/share/example-robot-data/robots"
    path = path / "human_description/robots/human.urdf"
    if not path.is_file():
        pytest.skip("example-robot-data with human.urdf is not installed")
    return path


def _link_rotations(urdf: Path, angles: dict[str, float]) -> dict[str, np.ndarray]:
    """Return link -> (3, 3) orientation in the pelvis, by the axes in the file (all joint origins are unturned)."""
    found = {"middle_pelvis": np.eye(3)}
    for joint in ElementTree.parse(urdf).getroot().iter("joint"):
        ends = joint.find("parent"), joint.find("child"), joint.find("axis")
        if any(end is None for end in ends):
            continue
        parent, child, axis = (dict(end.attrib) for end in ends if end is not None)
        direction = [float(word) for word in axis["xyz"].split()]
        letter = "xyz"[int(np.argmax(np.abs(direction)))]
        turn = rotation(letter, sum(direction) * angles[joint.attrib["name"]])
        found[child["link"]] = found[parent["link"]] @ turn
    return found


def test_joints_and_link_frames_of_the_urdf_give_the_same_posture() -> None:
    urdf = _urdf()
    names = re.findall(r'<joint name="([^"]+)" type="revolute"', urdf.read_text())
    assert len(names) == 36
    random = np.random.default_rng(7)
    frames = find_profile("human_frames")
    for _ in range(20):
        angles = {name: float(random.uniform(-35, 35)) for name in names}
        angles |= {name: abs(angle) * 3 for name, angle in angles.items() if "elbow_Z" in name or "knee" in name}
        links = _link_rotations(urdf, angles)
        present = tuple(name for group in frames.segments.values() for name in group if name in links)
        poses = np.array([[[0.0, 0.0, 0.0, *quaternion(links[name])] for name in present]])
        stream = stream_of("/tf", "frames", present, poses, parents=("middle_pelvis",) * len(present), up="y")
        found = {slot: (group[0],) for slot, group in frames.segments.items() if group[0] in present}
        mapper = mapper_for(frames, found, stream)
        mapper.begin()
        by_frames = block_angles(mapper, Block(np.zeros(1), present, poses, stream.parents))[0]
        by_joints = _angles(find_profile("human_description"), angles)
        np.testing.assert_allclose(by_frames, by_joints, atol=1e-6)


def test_shipped_profiles_say_what_they_are() -> None:
    assert len(profiles()) >= 19
    assert len({profile.name for profile in profiles()}) == len(profiles())
    for profile in profiles():
        assert profile.title
        assert profile.source
        assert len(measurable_columns(profile)) >= 8, profile.name
        assert not set(measurable_columns(profile)) & set(profile.cannot)


GOOD = {"name": "a", "title": "b", "source": "c", "kind": "joints", "columns": {"knee_flexion": ["+{side}_knee"]}}


@pytest.mark.parametrize(
    ("change", "facts"),
    [
        ({"titel": "x"}, ("unknown key 'titel'", "did you mean 'title'?")),
        ({"columns": {"knee_flexoin_left": ["a"]}}, ("columns", "did you mean 'knee_flexion_left'?")),
        ({"chains": {"torax": ["+z a"]}}, ("unknown segment 'torax'", "did you mean 'thorax'?")),
        ({"chains": {"thorax": ["z a"]}}, ("chains", "'z a'", "+z left_elbow")),
        ({"chains": {"thorax": []}}, ("thorax is []", "a list")),
        ({"points": {"hip": ["LHIP", ""]}}, ("points", "hip", "names in quotes")),
        ({"kind": "joint"}, ("kind is 'joint'", "one of joints, frames, points")),
        ({"kind": "frames"}, ("'frames'", "[segments]")),
        ({"unit": "degrees"}, ("unit is 'degrees'", "rad, deg")),
        ({"mirror": "no"}, ("mirror is 'no'", "true or false")),
        ({"required": ["nose"]}, ("required 'nose'",)),
        ({"patterns": ["{id}_x"]}, ("{id}_x", "one {name}")),
        ({"cannot": {"nek": "x"}}, ("unknown column 'nek'", "did you mean 'neck'?")),
        ({"needs_neutral": ["neck_flexoin"]}, ("needs_neutral", "neck_flexion")),
        ({"columns": {"knee_flexion_left": [["a"]]}}, ("['a']", "a number of degrees")),
        ({"columns": {"knee_flexion_left": ["a", float("nan")]}}, ("term nan", "a number of degrees")),
        ({"columns": {"knee_flexion_left": ["a", 10**400]}}, ("term 1000", "a number of degrees")),
        ({"chains": {"thorax": ["+z inf"]}}, ("'+z inf'", "finite degrees")),
        ({"dummies": {"a": "b"}}, ("dummies", "a is 'b'", "number")),
        ({"title": 3}, ("title is 3", "text in quotes")),
    ],
)
def test_profile_files_are_checked(change: dict[str, object], facts: tuple[str, ...]) -> None:
    with pytest.raises(ProfileError) as error:
        parse_profile({**GOOD, **change}, "mine.toml")
    says(error, "profile mine.toml", *facts)


def test_a_chain_of_one_rotation_needs_no_list() -> None:
    assert parse_profile({**GOOD, "chains": {"thorax": "+z a"}}, "mine.toml").chains["thorax"][0].name == "a"


def test_unknown_profiles_and_broken_files(tmp_path: Path) -> None:
    with pytest.raises(ProfileError) as error:
        find_profile("ros4hir")
    says(error, "'ros4hir'", "did you mean 'ros4hri'", "TOML")
    with pytest.raises(ProfileError) as error:
        find_profile(tmp_path / "mine.toml")
    says(error, "mine.toml", "No such file", "give the path")
    broken = tmp_path / "mine.toml"
    broken.write_text("name = ")
    with pytest.raises(ProfileError) as error:
        load_profile(broken)
    says(error, "mine.toml", "not TOML")
    broken.write_text('name = "a"\ntitle = "b"\nsource = "c"\n')
    with pytest.raises(ProfileError) as error:
        load_profile(broken)
    says(error, "kind is missing")


def test_a_profile_of_ones_own_reads_a_stream(tmp_path: Path) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text(
        'name = "lab"\ntitle = "t"\nsource = "s"\nkind = "joints"\nunit = "deg"\n'
        '[columns]\nknee_flexion = ["-{s}knee", 5]\n[chains]\nthorax = ["-z back"]\n'
    )
    profile = find_profile(mine)
    values = {"lknee": -30.0, "rknee": -40.0, "back": 12.0}
    stream: Stream = joints_stream(values, unit="deg", n=2)
    mapper = mapper_for(profile, {name: (name,) for name in profile.names}, stream)
    mapper.begin()
    read = block_angles(mapper, next(stream.blocks()))[0]
    assert read[INDEX["knee_flexion_left"]] == 35.0
    assert read[INDEX["knee_flexion_right"]] == 45.0
    assert read[INDEX["trunk_flexion"]] == 12.0
