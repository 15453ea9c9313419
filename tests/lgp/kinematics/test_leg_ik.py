"""Closed-form legs: soles stay in place, knees and their derivatives."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import reba
from lgp.kinematics import human
from lgp.kinematics.leg_ik import STRAIGHTEST, knees, solve_legs
from lgp.kinematics.posture import PostureMap
from tests.support.lgp_worlds import human_world


def test_knees_and_their_slope_belong_together_beyond_the_length_of_a_leg() -> None:
    heights = np.concatenate([np.linspace(-0.3, -0.002, 12), np.linspace(-0.0015, 0.003, 19), [0.02, 0.2]])
    pelvis = np.zeros((len(heights), 5))
    pelvis[:, 2] = heights
    pelvis[:, [0, 1, 3, 4]] = np.random.default_rng(3).uniform(-0.02, 0.02, (len(heights), 4))
    bend, slope, beyond, by_pelvis = knees(pelvis, 1.75, "male")
    assert (beyond > 0.0).sum() > 20
    assert (bend[beyond <= 0.0] >= STRAIGHTEST).all()
    assert (bend > 0.0).sum() > 50
    assert (bend[beyond > 0.0] < STRAIGHTEST).all()
    step = 1e-7
    for joint in range(5):
        moved = np.zeros(5)
        moved[joint] = step
        high, low = (knees(pelvis + sign * moved, 1.75, "male") for sign in (1.0, -1.0))
        np.testing.assert_allclose(slope[:, :, joint], (high[0] - low[0]) / (2 * step), rtol=2e-3, atol=2e-4)
        np.testing.assert_allclose(by_pelvis[:, :, joint], (high[2] - low[2]) / (2 * step), atol=1e-6)


BENT = st.tuples(
    *(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(-0.45, -0.05), st.floats(-0.5, 0.5), st.floats(-0.2, 0.7))
)


def _frames(model: pin.Model, values: dict[str, float]) -> dict[str, pin.SE3]:
    q, data = pin.neutral(model), model.createData()
    for name, value in values.items():
        q[model.joints[model.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(model, data, q)
    return {frame.name: data.oMf[number].copy() for number, frame in enumerate(model.frames)}


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


def test_a_pelvis_too_high_exceeds_the_legs_by_metres() -> None:
    bend, _, beyond, _ = knees(np.array([[0.0, 0.0, 0.05, 0.0, 0.0]]), 1.75, "male")
    assert bend == pytest.approx(0.0, abs=1e-9)
    assert beyond == pytest.approx(0.05, abs=1e-3)


def test_rest_is_the_lowest_score_with_the_feet_down() -> None:

    for mode in ("planted", "solved", "locked"):
        world = human_world(mode)
        angles = PostureMap(world).angles(world.initial_configuration[None])
        assert reba.score_array(angles, rules="measured").reba[0] == 1
    world = human_world("planted")
    found = world.at(world.initial_configuration[None], world.planted)
    for sole, (rotation, position) in world.planted.items():
        np.testing.assert_allclose(found.placement(sole).position[0], position, atol=1e-9)
        np.testing.assert_allclose(found.placement(sole).rotation[0], rotation, atol=1e-9)
