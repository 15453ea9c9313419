"""The posture mapping: exactly what `reba.read` gives, with the right derivatives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from lgp.errors import WorldError
from lgp.kinematics.human import ISB, joint_names
from lgp.kinematics.leg_ik import solve_legs
from lgp.kinematics.posture import PostureMap
from lgp.kinematics.world import World
from reba.posture.columns import COLUMNS, INDEX
from reba.readers.build_table import build_table
from reba.readers.recognise import choose
from reba.readers.recording.profile import find_profile
from reba.readers.recording.stream import ReadLog, Recording, array_stream
from tests.support.lgp_worlds import anywhere, differences, human_world
from tests.support.says import says


def _as_recorded(path: Path, joints: dict[str, np.ndarray], pelvis: np.ndarray) -> np.ndarray:
    """Return what `reba` reads from a recording of the joints and the pelvis' orientation (n, 3, 3)."""
    path.write_text("a recording in memory")
    n = len(pelvis)
    time = np.arange(n) * 0.05
    poses = np.zeros((n, 1, 7))
    poses[:, 0, 3:] = Rotation.from_matrix(pelvis).as_quat()
    values = np.stack(list(joints.values()), axis=1)
    streams = (
        array_stream("/joint_states", "joints", "test", list(joints), time, values, opened=ReadLog(), unit="rad"),
        array_stream("/tf", "frames", "test", ["middle_pelvis"], time, poses, opened=ReadLog(), parents=("",), up="z"),
    )
    recording = Recording(str(path), "test", streams)
    match = choose(recording, (find_profile("human_description"),), "/joint_states", named=True)
    return build_table(recording, match).data[list(COLUMNS)].to_numpy()


@pytest.mark.parametrize("legs_mode", ["planted", "solved"])
def test_same_angles_as_a_recording_of_the_same_joints(tmp_path: Path, legs_mode: str) -> None:
    world = human_world(legs_mode)
    q = anywhere(world, 40)
    joints = {name: q[:, world.column[f"human.{name}"]] for name in joint_names() if f"human.{name}" in world.column}
    if legs_mode == "solved":
        solved, _ = solve_legs(q[:, world.columns("human")[:5]], 1.75, "male")
        joints |= solved
    pelvis = world.at(q, ["human.pelvis_tilt"]).rotation[:, 0] @ ISB
    recorded = _as_recorded(tmp_path / "plan.bin", joints, pelvis)
    np.testing.assert_allclose(PostureMap(world).angles(q), recorded, atol=1e-7)


@pytest.mark.parametrize("legs_mode", ["planted", "solved", "locked"])
@pytest.mark.parametrize("smooth", [True, False])
def test_jacobian_by_differences(legs_mode: str, smooth: bool) -> None:
    world = human_world(legs_mode)
    posture, q = PostureMap(world), anywhere(world, 30, seed=1)
    _, jacobian = posture.evaluate(q, smooth)
    full = differences(lambda x: posture.evaluate(x, smooth)[0], q)
    np.testing.assert_allclose(jacobian, full[:, :, posture.columns], rtol=1e-4, atol=2e-4)


def test_smooth_flexion_is_the_definition_outside_its_band() -> None:
    world = human_world()
    posture, q = PostureMap(world), anywhere(world, 400, seed=2)
    exact, smooth = posture.angles(q), posture.evaluate(q, smooth=True)[0]
    columns = [INDEX[f"upper_arm_flexion_{side}"] for side in ("left", "right")]
    sideways = np.abs(exact[:, [INDEX[f"upper_arm_abduction_{side}"] for side in ("left", "right")]])
    outside = (sideways < 45.0) | (sideways > 75.0)
    np.testing.assert_allclose(smooth[:, columns][outside], exact[:, columns][outside], atol=1e-9)
    assert (~outside).any()
    others = [at for at in range(len(COLUMNS)) if at not in columns]
    np.testing.assert_array_equal(smooth[:, others], exact[:, others])


def test_smooth_flexion_has_no_jump_when_an_arm_swings_sideways() -> None:
    world = human_world()
    posture = PostureMap(world)
    q = np.tile(world.initial_configuration, (2001, 1))
    q[:, world.column["human.right_shoulder_Z"]] = 0.6
    q[:, world.column["human.right_shoulder_X"]] = np.linspace(0.3, 1.55, 2001)
    column = INDEX["upper_arm_flexion_right"]
    assert np.abs(np.diff(posture.angles(q)[:, column])).max() > 10.0
    assert np.abs(np.diff(posture.evaluate(q, smooth=True)[0][:, column])).max() < 0.5


def test_leg_shortfall_by_differences() -> None:
    world = human_world("solved")
    posture, q = PostureMap(world), anywhere(world, 20, seed=4)
    _, jacobian = posture.leg_shortfall(q)
    full = differences(lambda x: posture.leg_shortfall(x)[0], q)
    np.testing.assert_allclose(jacobian, full[:, :, posture.columns], atol=1e-6)


def test_a_world_without_a_human_has_no_posture() -> None:
    world = human_world()
    robots_only = World.__new__(World)
    robots_only.__dict__ = {**world.__dict__, "scene": type(world.scene)(**{**vars(world.scene), "humans": {}})}
    with pytest.raises(WorldError) as error:
        PostureMap(robots_only)
    says(error, "no human")
