"""Reading frames and points: the same movement from segments, transforms, rest poses and keypoints."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from reba.posture.columns import COLUMNS
from reba.posture.table import PostureTable
from reba.readers.build_table import build_table
from reba.readers.mapping.segments import AXES
from reba.readers.quality_control import first_frame_is_outlier
from reba.readers.recognise import choose
from reba.readers.recording.profile import find_profile, profiles
from reba.readers.recording.stream import Recording, Stream
from tests.support.says import says
from tests.support.synthetic_bodies import quaternion, rotation, segment_frames, stream_of

Array = NDArray[np.float64]


def _read(stream: Stream, neutral: str = "none", format: str = "test") -> PostureTable:
    recording = Recording(__file__, format, (stream,))
    return build_table(recording, choose(recording, profiles()), neutral=neutral)


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
    assert f"vertical {world} determined from the body (head above feet)" in table.assumed


def test_a_t_pose_in_the_first_frame_is_left_out() -> None:
    postures = _moving()
    postures[0] = {"upper_arm_abduction_left": 90.0, "upper_arm_abduction_right": 90.0}
    segments, poses = _poses(postures, AXES["ros"])
    names = _segment_names("mvnx", segments)
    stream = stream_of("mvnx", "frames", names, poses, parents=("",) * len(names), up="z")
    table = _read(stream, format="mvnx")
    assert len(table.data) == len(postures) - 1
    assert any("first frame" in text for text in table.quality.warnings)
    assert not first_frame_is_outlier(np.cumsum(np.full((9, 22), 25.0), axis=0))


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
    says(table.why_unmeasured["shoulder_elevation_left"], "neutral posture", "first:3s")


def test_exchanged_sides_are_told_and_put_right() -> None:
    table = _read(_points(AXES["ros"], swap=True))
    assert any("exchanged" in text for text in table.quality.warnings)
    _check(table, leave=("neck_flexion", "neck_side_bend", "neck_twist"))


def test_the_girdle_of_keypoints_has_a_zero_only_by_a_neutral_posture() -> None:
    measured = _read(_points(np.eye(3)), neutral="first:0.1s")
    assert "shoulder_elevation_left" not in measured.unmeasured
