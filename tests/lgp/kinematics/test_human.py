"""The human model: stature, mirrored sides, joints of human.urdf."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from lgp.kinematics import human
from lgp.kinematics.robot import urdf_of
from tests.support.lgp_worlds import needs_robots


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
