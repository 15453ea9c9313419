"""Reading: units, dead joints, vertical, sides, rest poses, gaps, neutral posture, and what the table says about it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from synthetic_bodies import (
    RATE,
    joints_stream,
    quaternion,
    recording_of,
    rotation,
    segment_frames,
    stream_of,
)

from reba.errors import ProfileError, ReadError, RebaError
from reba.posture import COLUMNS, PostureTable
from reba.readers import is_recording, is_recording_folder, read
from reba.readers.checks import find_gaps, first_frame_alien, frozen_warning
from reba.readers.finish import finish
from reba.readers.frames import AXES
from reba.readers.info import inspect
from reba.readers.neutral import parse_neutral
from reba.readers.profile import find_profile, profiles
from reba.readers.recognise import choose
from reba.readers.stream import Recording, Stream

Array = NDArray[np.float64]
N = 150
WAVE = np.linspace(0.0, 1.0, N)


def _read(*streams: Stream, topic: str | None = None, neutral: str = "none") -> PostureTable:
    recording = recording_of(*streams)
    return finish(recording, choose(recording, profiles(), topic), neutral=neutral)


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
    with pytest.raises(ProfileError, match=r"nothing was measured: .*constant 0"):
        _read(zeros)


def test_negative_knees_are_turned_round() -> None:
    values = dict.fromkeys(find_profile("opensim").names, 5.0 + WAVE)
    knees = {"knee_angle_l": -10.0 - 80.0 * WAVE, "knee_angle_r": -5.0 - 60.0 * WAVE}
    table = _read(joints_stream({**values, **knees}, n=N, unit="deg"))
    assert table.data["knee_flexion_left"].max() == pytest.approx(90.0)
    assert any("flexion is negative" in text for text in table.assumed)


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


def _poses(
    postures: list[dict[str, float]], axes: Array, turns: dict[str, Array] | None = None, world: Array | None = None
) -> tuple[tuple[str, ...], Array]:
    """Return segments and their (n, k, 7) poses, positions from plain lengths, in a world turned by `world`."""
    lengths = {
        "upper_arm": ("forearm", 0.3),
        "forearm": ("hand", 0.25),
        "thigh": ("shank", 0.4),
        "shank": ("foot", 0.4),
    }
    rows, names = [], ()
    for posture in postures:
        frames = segment_frames(posture)
        frames |= {f"foot_{side}": frames[f"shank_{side}"] for side in ("left", "right")}
        line = frames["thorax"] @ np.array([0.0, 0.5, 0.0])
        where = {"pelvis": np.zeros(3), "thorax": line * 0.6, "head": line * 1.3}
        for side, out in (("left", -1.0), ("right", 1.0)):
            where[f"clavicle_{side}"] = line
            where[f"upper_arm_{side}"] = line + frames["thorax"] @ np.array([0.0, 0.0, 0.2 * out])
            where[f"thigh_{side}"] = frames["pelvis"] @ np.array([0.0, 0.0, 0.1 * out])
            for near, (far, length) in lengths.items():
                bone = frames[f"{near}_{side}"] @ np.array([0.0, -length, 0.0])
                where[f"{far}_{side}"] = where[f"{near}_{side}"] + bone
        names = tuple(frames)
        base = AXES["ros"] if world is None else world
        rows.append(
            [
                [*(base @ where[name]), *quaternion(base @ frames[name] @ axes.T @ (turns or {}).get(name, np.eye(3)))]
                for name in names
            ]
        )
    return names, np.array(rows)


def _moving() -> list[dict[str, float]]:
    wave = np.linspace(0.0, 1.0, 80)
    return [
        {
            "trunk_flexion": 60 * s,
            "trunk_side_bend": 10 * s,
            "neck_flexion": -20 * s,
            "neck_twist": 15 * s,
            "upper_arm_flexion_left": 80 * s,
            "upper_arm_abduction_right": 40 * s,
            "shoulder_elevation_left": 10 * s,
            "lower_arm_flexion_right": 90 * s,
            "lower_arm_flexion_left": 20 * s,
            "wrist_flexion_right": 30 * s,
            "wrist_deviation_left": -10 * s,
            "wrist_twist_left": 40 * s,
            "knee_flexion_right": 70 * s,
        }
        for s in wave
    ]


def _check(table: PostureTable, leave: tuple[str, ...] = ()) -> None:
    for column in COLUMNS:
        if column in table.unmeasured or column in leave:
            continue
        expected = [posture.get(column, 0.0) for posture in _moving()]
        np.testing.assert_allclose(table.data[column], expected, atol=1e-5, err_msg=column)


def _segment_names(profile: str, segments: tuple[str, ...], pattern: str = "{name}") -> tuple[str, ...]:
    known = find_profile(profile).segments
    return tuple(pattern.replace("{name}", known[segment][0]) for segment in segments)


def test_link_states_of_the_xsens_driver() -> None:
    segments, poses = _poses(_moving(), AXES["ros"])
    names = _segment_names("xsens_frames", segments, "skeleton_{name}")
    table = _read(stream_of("/link_states", "frames", names, poses, parents=("",) * len(names)))
    assert table.profile == "xsens_frames"
    _check(table)
    assert set(table.unmeasured) <= {"shoulder_elevation_right", "wrist_twist_right"} | {
        column for column in COLUMNS if all(posture.get(column, 0.0) == 0.0 for posture in _moving())
    }


def test_a_tree_of_transforms_gives_the_same_as_poses_in_the_world() -> None:
    segments, poses = _poses(_moving(), AXES["ros"])
    names = _segment_names("xsens_frames", segments, "skeleton_{name}")
    turn, shift = rotation("z", 70.0), np.array([3.0, -2.0, 1.0])
    from scipy.spatial.transform import Rotation

    flat = poses.reshape(-1, 7)
    moved = np.concatenate(
        [(flat[:, :3] - shift) @ turn, (Rotation.from_matrix(turn.T) * Rotation.from_quat(flat[:, 3:])).as_quat()], 1
    )
    base = np.tile([*shift, *quaternion(turn)], (len(poses), 1, 1))
    values = np.concatenate([base, moved.reshape(poses.shape)], axis=1)
    tree = stream_of("/tf", "frames", ("station", *names), values, parents=("map", *("station",) * len(names)))
    _check(_read(tree))


def test_mvnx_segments_have_the_arms_of_the_t_pose() -> None:
    quarter = {"right": rotation("x", 90.0), "left": rotation("x", -90.0)}
    arms = {f"{name}_{side}": quarter[side] for name in ("upper_arm", "forearm", "hand") for side in quarter}
    segments, poses = _poses(_moving(), AXES["ros"], arms)
    names = _segment_names("mvnx", segments)
    table = _read(stream_of("mvnx", "frames", names, poses, parents=("",) * len(names), up="z"))
    assert table.profile == "mvnx"
    _check(table)


def _rest(arms: str) -> tuple[dict[str, Array], Array]:
    """Return the turns from a rest pose (arms down or out) to the hanging pose, and its positions by segment."""
    out = {"N": 0.0, "T": 90.0}[arms]
    posture = {f"upper_arm_abduction_{side}": out for side in ("left", "right")}
    frames = segment_frames(posture)
    frames |= {f"foot_{side}": np.eye(3) for side in ("left", "right")}
    segments, poses = _poses([posture], np.eye(3), world=np.eye(3))
    return {name: frames[name].T for name in segments}, poses[0]


@pytest.mark.parametrize("arms", ["N", "T"])
@pytest.mark.parametrize("world", ["y", "z", "-y"])
def test_bvh_by_its_rest_pose_and_its_own_vertical(arms: str, world: str) -> None:
    # A BVH's frames are all unturned in the rest pose: frame = segment axes now times those at rest, transposed.
    turn = {"y": np.eye(3), "z": AXES["ros"], "-y": rotation("x", 180.0)}[world]
    back, rest = _rest(arms)
    # Xsens-like: the rest pose faces z, x to the left.
    face = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    segments, poses = _poses(_moving(), np.eye(3), {name: frame @ face.T for name, frame in back.items()}, world=turn)
    rest[:, :3] = rest[:, :3] @ face.T
    rest[:, 3:] = [0.0, 0.0, 0.0, 1.0]
    names = _segment_names("bvh_xsens", segments)
    stream = stream_of("take", "frames", names, poses, parents=("",) * len(names), rest=rest)
    table = _read(stream)
    _check(table)
    assert f"vertical {world} found from the body (head above feet)" in table.assumed


def test_a_t_pose_in_the_first_frame_is_left_out() -> None:
    postures = _moving()
    postures[0] = {"upper_arm_abduction_left": 90.0, "upper_arm_abduction_right": 90.0}
    segments, poses = _poses(postures, AXES["ros"])
    names = _segment_names("mvnx", segments)
    table = _read(stream_of("mvnx", "frames", names, poses, parents=("",) * len(names), up="z"))
    assert len(table.data) == len(postures) - 1
    assert any("first frame" in text for text in table.quality.warnings)
    assert not first_frame_alien(np.cumsum(np.full((9, 22), 25.0), axis=0))


def _points(world: Array, swap: bool = False) -> Stream:
    segments, poses = _poses(_moving(), AXES["ros"], world=world)
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
    table = _read(_points(world))
    _check(table, leave=("neck_flexion", "neck_side_bend", "neck_twist"))
    assert any("leans about 20 deg" in text for text in table.assumed)
    assert "needs" not in table.why_unmeasured["shoulder_elevation_left"]
    assert "neutral" in table.why_unmeasured["shoulder_elevation_left"]


def test_exchanged_sides_are_told_and_put_right() -> None:
    table = _read(_points(AXES["ros"], swap=True))
    assert any("exchanged" in text for text in table.quality.warnings)
    _check(table, leave=("neck_flexion", "neck_side_bend", "neck_twist"))


def test_neutral_posture_is_subtracted_but_not_from_hinges() -> None:
    moves = {"middle_cervical_Z": np.where(WAVE < 0.3, 21.0, 41.0), "left_elbow_Z": np.where(WAVE < 0.3, 10.0, 60.0)}
    table = _read(_human(**moves), neutral="first:0.5s")
    assert set(table.data["neck_flexion"].round(6)) == {0.0, 20.0}
    assert set(table.data["lower_arm_flexion_left"]) == {10.0, 60.0}
    assert any("neutral posture from" in text for text in table.assumed)
    at_end = _read(_human(**moves), neutral="at:2.5")
    assert at_end.data["neck_flexion"].min() == pytest.approx(-20.0)
    measured = _read(_points(np.eye(3)), neutral="first:0.1s")
    assert "shoulder_elevation_left" not in measured.unmeasured


@pytest.mark.parametrize("spec", ["", "first", "first:0s", "first:-1s", "at:x", "last:3s", "none "])
def test_bad_neutral_is_refused(spec: str) -> None:
    with pytest.raises(RebaError, match=r"expected none, first:3s"):
        parse_neutral(spec)


def test_neutral_beyond_the_recording_is_refused() -> None:
    with pytest.raises(RebaError, match=r"holds no frame; the recording has 0\.00 to 2\.98 s"):
        _read(_human(), neutral="at:99")


def test_gaps_and_frozen_stretches() -> None:
    time = np.concatenate([np.arange(50) / RATE, 5.0 + np.arange(50) / RATE])
    assert find_gaps(time) == ((0.98, 5.0),)
    assert find_gaps(np.arange(5) * 10.0) == ()
    angles = np.random.default_rng(1).normal(size=(100, 22))
    assert frozen_warning(np.arange(100) / RATE, angles) is None
    angles[20:80] = angles[20]
    assert "stand still" in (frozen_warning(np.arange(100) / RATE, angles) or "")


def _csv(path: Path, rows: list[str], header: str = "time,trunk_flexion,neck_flexion,load") -> Path:
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


def test_a_posture_table_is_completed_sorted_and_hashed(tmp_path: Path) -> None:
    file = _csv(tmp_path / "a.csv", ["0.1,20,5,1", "0.0,10,5,1", "0.1,99,5,1", "0.2,30,,2"])
    table = read(file)
    assert table.profile == "table"
    assert list(table.data.columns[:2]) == ["time", "trunk_flexion"]
    assert table.data["trunk_flexion"].tolist() == [10.0, 20.0, 30.0]
    assert table.data["load"].tolist() == [1.0, 1.0, 2.0]
    assert len(table.unmeasured) == 20
    assert len(table.quality.sha256) == 64
    assert any("repeat the time" in text for text in table.quality.warnings)


def test_joint_columns_of_a_csv_by_a_named_profile(tmp_path: Path) -> None:
    names = find_profile("human_description").names
    rows = [",".join([f"{i / 50}", *[f"{0.01 * i + 0.001 * k:.6f}" for k in range(len(names))]]) for i in range(60)]
    file = _csv(tmp_path / "joints.csv", rows, ",".join(["time", *names]))
    assert read(file).profile == "human_description"
    assert read(file, profile="human_description").quality.rate == pytest.approx(50.0)
    with pytest.raises(ProfileError, match="profile ros4hri does not fit"):
        read(file, profile="ros4hri")
    with pytest.raises(ProfileError, match="no stream 'nothing'"):
        read(file, topic="nothing")


def test_unknown_files_are_refused_with_what_is_read(tmp_path: Path) -> None:
    with pytest.raises(ReadError, match="no such file"):
        read(tmp_path / "missing.mcap")
    strange = tmp_path / "film.mp4"
    strange.write_bytes(b"\x00\x00\x00\x18ftypmp42" * 10)
    with pytest.raises(ReadError, match=r"read are MCAP .*BVH .*C3D|read are MCAP .*C3D .*BVH"):
        read(strange)
    assert not is_recording(strange)
    empty = tmp_path / "empty.xyz"
    empty.write_bytes(b"")
    with pytest.raises(ReadError, match="the file is empty"):
        read(empty)


def test_folders_of_splits_are_recordings(tmp_path: Path) -> None:
    for name in ("run_0.mcap", "run_1.mcap"):
        (tmp_path / name).write_bytes(b"")
    assert is_recording_folder(tmp_path)
    (tmp_path / "other.mcap").write_bytes(b"")
    assert not is_recording_folder(tmp_path)
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    assert is_recording_folder(tmp_path)


def test_info_tells_what_was_found_and_stays_calm_when_nothing_was(tmp_path: Path) -> None:
    good = inspect(_csv(tmp_path / "a.csv", ["0.0,10,5,1", "0.1,20,5,1"]))
    assert good.usable
    assert good.ranges["trunk_flexion"] == (10.0, 15.0, 20.0)
    assert "wrist_twist_left" in good.unmeasured
    json.dumps(good.to_dict(), allow_nan=False)
    bad = inspect(_csv(tmp_path / "b.csv", ["0.0,1,2"], "time,foo,bar"))
    assert not bad.usable
    assert "foo, bar" in bad.recognised
    json.dumps(bad.to_dict(), allow_nan=False)


def test_abnormal_ends_are_kept_and_refused_when_strict() -> None:
    stream = _human()
    recording = Recording(__file__, "test", (stream,))
    recording.log.ended_abnormally = "cut at byte 9"
    match = choose(recording, profiles())
    assert finish(recording, match).quality.ended_abnormally == "cut at byte 9"
    with pytest.raises(ReadError, match="cut at byte 9"):
        finish(recording, match, strict=True)
