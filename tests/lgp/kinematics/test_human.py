"""The human: body measures, joints and limits, legs that keep the feet where they are."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.errors import SceneError
from lgp.kinematics import human
from lgp.kinematics.leg_ik import knees, solve_legs
from lgp.kinematics.robot import urdf_of
from lgp.scene import body_measures as body_measures_
from tests.support.lgp_worlds import human_world, needs_robots
from tests.support.says import says

BENT = st.tuples(
    *(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-0.45, -0.05), st.floats(-0.5, 0.5), st.floats(-0.2, 0.7))
)


def _frames(model: pin.Model, values: dict[str, float]) -> dict[str, pin.SE3]:
    q, data = pin.neutral(model), model.createData()
    for name, value in values.items():
        q[model.joints[model.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(model, data, q)
    return {frame.name: data.oMf[number].copy() for number, frame in enumerate(model.frames)}


@pytest.mark.parametrize("sex", ["male", "female"])
def test_stature_is_the_height_of_the_head(sex: str) -> None:
    heights = [_frames(human.human_model(stature, sex), {})["head"].translation[2] for stature in (1.5, 1.9)]
    assert heights[1] / heights[0] == pytest.approx(1.9 / 1.5)
    assert heights[1] == pytest.approx(1.9, rel=0.03)


def test_sexes_differ_in_proportion() -> None:
    male, female = (body_measures_.lengths(1.7, sex) for sex in ("male", "female"))
    assert female["thigh"] < male["thigh"]
    assert female["cervicale"] > male["cervicale"]


def test_both_sides_mirror() -> None:
    values = {"clavicle_joint_X": 0.2, "shoulder_Z": 0.5, "shoulder_X": 0.4, "shoulder_Y": 0.3, "elbow_Z": 1.0}
    values |= {"elbow_Y": 0.6, "wrist_Z": 0.2, "wrist_X": 0.1}
    frames = _frames(
        human.human_model(1.75, "male"), {f"{side}_{k}": v for side in ("left", "right") for k, v in values.items()}
    )
    mirror = np.diag([1.0, -1.0, 1.0])
    np.testing.assert_allclose(mirror @ frames["left_hand"].translation, frames["right_hand"].translation, atol=1e-12)
    np.testing.assert_allclose(
        mirror @ frames["left_hand"].rotation[:, 2], frames["right_hand"].rotation[:, 2], atol=1e-12
    )


@needs_robots
def test_every_joint_turns_as_in_human_urdf() -> None:
    theirs = pin.buildModelFromUrdf(str(urdf_of("human_description/robots/human.urdf")))
    ours = human.human_model(1.75, "male")
    shared = [name for name in list(ours.names)[1:] if not name.startswith("pelvis")]
    assert sorted(shared) == sorted(list(theirs.names)[1:])
    rng = np.random.default_rng(3)
    values = {name: float(rng.uniform(-0.8, 0.8)) for name in shared}
    own, other = _frames(ours, values), _frames(theirs, values)
    for name in shared:
        np.testing.assert_allclose(human.ISB.T @ own[name].rotation, other[name].rotation, atol=1e-9, err_msg=name)


@settings(max_examples=30, deadline=None)
@given(BENT, st.sampled_from(["male", "female"]), st.floats(1.45, 2.0))
def test_solved_legs_keep_the_soles(pelvis: tuple[float, ...], sex: str, stature: float) -> None:
    angles, beyond = solve_legs(np.array([pelvis]), stature, sex)
    if beyond.max() > 0.0:
        return
    model = human.human_model(stature, sex)
    standing = _frames(model, {})
    values = dict(zip(human.joint_names()[:5], pelvis, strict=True)) | {k: float(v[0]) for k, v in angles.items()}
    moved = _frames(model, values)
    for side in ("left", "right"):
        sole = f"{side}_sole"
        np.testing.assert_allclose(moved[sole].homogeneous, standing[sole].homogeneous, atol=1e-9)


@settings(max_examples=30, deadline=None)
@given(BENT)
def test_knees_agree_with_the_legs_and_with_differences(pelvis: tuple[float, ...]) -> None:
    x = np.array([pelvis])
    angles, _ = solve_legs(x, 1.75, "male")
    bend, slope, beyond, by_pelvis = knees(x, 1.75, "male")
    if beyond.max() > -1e-5:
        return
    assert bend[0].tolist() == pytest.approx([angles["left_knee_Z"][0], angles["right_knee_Z"][0]])
    for at in range(5):
        step = np.zeros(5)
        step[at] = 1e-6
        ahead, behind = knees(x + step, 1.75, "male"), knees(x - step, 1.75, "male")
        np.testing.assert_allclose((ahead[0] - behind[0]) / 2e-6, slope[:, :, at], rtol=1e-4, atol=1e-5)
        np.testing.assert_allclose((ahead[2] - behind[2]) / 2e-6, by_pelvis[:, :, at], atol=1e-6)


def test_a_pelvis_too_high_is_told_in_metres() -> None:
    bend, _, beyond, _ = knees(np.array([[0.0, 0.0, 0.05, 0.0, 0.0]]), 1.75, "male")
    assert bend == pytest.approx(0.0, abs=1e-9)
    assert beyond == pytest.approx(0.05, abs=1e-3)


def test_rest_is_the_lowest_score_with_the_feet_down() -> None:
    import reba
    from lgp.kinematics.posture import PostureMap

    for mode in ("planted", "solved", "locked"):
        world = human_world(mode)
        angles = PostureMap(world).angles(world.initial_configuration[None])
        assert reba.score_array(angles, rules="measured").reba[0] == 1
    world = human_world("planted")
    found = world.at(world.initial_configuration[None], world.planted)
    for sole, (rotation, position) in world.planted.items():
        np.testing.assert_allclose(found.placement(sole).position[0], position, atol=1e-9)
        np.testing.assert_allclose(found.placement(sole).rotation[0], rotation, atol=1e-9)


def test_wrong_bodies_are_refused() -> None:
    with pytest.raises(SceneError) as error:
        body_measures_.lengths(1.7, "femal")
    says(error, "expected one of male", "female", "did you mean 'female'")
    with pytest.raises(SceneError) as error:
        body_measures_.lengths(17, "male")
    says(error, "stature is 17 m", "expected 1.4 to 2.1 m")
