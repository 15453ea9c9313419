"""Segment poses: the same movement from segments, transforms and rest poses."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from reba.posture.columns import COLUMNS
from reba.readers.mapping.segments import AXES
from reba.readers.quality_control import first_frame_is_outlier
from reba.readers.recording.profile import find_profile
from tests.support.synthetic_bodies import (
    check_movement,
    moving_postures,
    quaternion,
    read_stream,
    rotation,
    segment_frames,
    segment_poses,
    stream_of,
)

Array = NDArray[np.float64]


def _segment_names(profile: str, segments: tuple[str, ...], pattern: str = "{name}") -> tuple[str, ...]:
    known = find_profile(profile).segments
    return tuple(pattern.replace("{name}", known[segment][0]) for segment in segments)


def test_link_states_of_the_xsens_driver() -> None:
    segments, poses = segment_poses(moving_postures(), AXES["ros"])
    names = _segment_names("xsens_frames", segments, "skeleton_{name}")
    table = read_stream(stream_of("/link_states", "frames", names, poses, parents=("",) * len(names)))
    assert table.profile == "xsens_frames"
    check_movement(table)
    assert set(table.unmeasured) <= {"shoulder_elevation_right", "wrist_twist_right"} | {
        column for column in COLUMNS if all(posture.get(column, 0.0) == 0.0 for posture in moving_postures())
    }


def test_a_tree_of_transforms_gives_the_same_as_poses_in_the_world() -> None:
    segments, poses = segment_poses(moving_postures(), AXES["ros"])
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
    check_movement(read_stream(tree))


def test_mvnx_segments_have_the_arms_of_the_t_pose() -> None:
    quarter = {"right": rotation("x", 90.0), "left": rotation("x", -90.0)}
    arms = {f"{name}_{side}": quarter[side] for name in ("upper_arm", "forearm", "hand") for side in quarter}
    segments, poses = segment_poses(moving_postures(), AXES["ros"], arms)
    names = _segment_names("mvnx", segments)
    table = read_stream(stream_of("mvnx", "frames", names, poses, parents=("",) * len(names), up="z"))
    assert table.profile == "mvnx"
    check_movement(table)


def _rest(arms: str) -> tuple[dict[str, Array], Array]:
    """Return the turns from a rest pose (arms down or out) to the hanging pose, and its positions by segment."""
    out = {"N": 0.0, "T": 90.0}[arms]
    posture = {f"upper_arm_abduction_{side}": out for side in ("left", "right")}
    frames = segment_frames(posture)
    frames |= {f"foot_{side}": np.eye(3) for side in ("left", "right")}
    segments, poses = segment_poses([posture], np.eye(3), world=np.eye(3))
    return {name: frames[name].T for name in segments}, poses[0]


@pytest.mark.parametrize("arms", ["N", "T"])
@pytest.mark.parametrize("world", ["y", "z", "-y"])
def test_bvh_by_its_rest_pose_and_its_own_vertical(arms: str, world: str) -> None:
    # A BVH's frames are all unturned in the rest pose: frame = segment axes now times those at rest, transposed.
    turn = {"y": np.eye(3), "z": AXES["ros"], "-y": rotation("x", 180.0)}[world]
    back, rest = _rest(arms)
    # Xsens-like: the rest pose faces z, x to the left.
    face = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
    segments, poses = segment_poses(
        moving_postures(), np.eye(3), {name: frame @ face.T for name, frame in back.items()}, world=turn
    )
    rest[:, :3] = rest[:, :3] @ face.T
    rest[:, 3:] = [0.0, 0.0, 0.0, 1.0]
    names = _segment_names("bvh_xsens", segments)
    stream = stream_of("take", "frames", names, poses, parents=("",) * len(names), rest=rest)
    table = read_stream(stream)
    check_movement(table)
    assert f"vertical {world} determined from the body (head above feet)" in table.assumed


@pytest.mark.parametrize("bent", ["legs up", "arms up", "one arm out"])
def test_a_rest_pose_without_a_standing_person_measures_no_hands(bent: str) -> None:
    """Rigs whose bones all lie along one axis at rest tell nothing of how hands and girdles are turned."""
    back, rest = _rest("N")
    segments, poses = segment_poses(moving_postures(), np.eye(3), back, world=np.eye(3))
    at = {name: index for index, name in enumerate(segments)}
    place = rest[:, :3].copy()
    if bent == "legs up":
        for side in ("left", "right"):
            place[at[f"shank_{side}"]] = place[at[f"thigh_{side}"]] + [0.0, 0.4, 0.0]
    else:
        for side, up in (("left", 0.3), ("right", 0.3 if bent == "arms up" else 0.0)):
            place[at[f"forearm_{side}"]] = place[at[f"upper_arm_{side}"]] + [0.0, up or -0.3, 0.0]
    rest[:, :3], rest[:, 3:] = place, [0.0, 0.0, 0.0, 1.0]
    names = _segment_names("bvh_xsens", segments)
    table = read_stream(stream_of("take", "frames", names, poses, parents=("",) * len(names), rest=rest))
    assert {f"wrist_{angle}_left" for angle in ("flexion", "deviation", "twist")} <= set(table.unmeasured)
    assert {"shoulder_elevation_left", "shoulder_elevation_right"} <= set(table.unmeasured)
    assert any("no standing person" in text for text in table.quality.warnings)


def test_a_t_pose_in_the_first_frame_is_left_out() -> None:
    postures = moving_postures()
    postures[0] = {"upper_arm_abduction_left": 90.0, "upper_arm_abduction_right": 90.0}
    segments, poses = segment_poses(postures, AXES["ros"])
    names = _segment_names("mvnx", segments)
    stream = stream_of("mvnx", "frames", names, poses, parents=("",) * len(names), up="z")
    table = read_stream(stream, format="mvnx")
    assert len(table.data) == len(postures) - 1
    assert any("first frame" in text for text in table.quality.warnings)
    assert not first_frame_is_outlier(np.cumsum(np.full((9, 22), 25.0), axis=0))
