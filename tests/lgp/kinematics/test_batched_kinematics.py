"""Many configurations at once are placed as Pinocchio places them one by one."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.kinematics.batched_kinematics import BatchedKinematics
from lgp.kinematics.world import LOOP_UP_TO, World
from tests.support.lgp_worlds import human_world, needs_robots, screwdriver_world


def one_by_one(model: pin.Model, q: np.ndarray, frames: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    data = model.createData()
    spatial, rotation, position = [], [], []
    for configuration in q:
        spatial.append(pin.computeJointJacobians(model, data, configuration).reshape(6, model.nq).copy())
        placed = [pin.updateFramePlacement(model, data, frame).copy() for frame in frames]
        rotation.append([one.rotation for one in placed])
        position.append([one.translation for one in placed])
    return np.array(rotation), np.array(position), np.array(spatial)


def random_tree(seed: int) -> pin.Model:
    """A tree of joints of every kind, with frames on all of them and on the world."""
    rng = np.random.default_rng(seed)
    model = pin.Model()
    kinds = [pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ, pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ]
    for number in range(int(rng.integers(1, 12))):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        unaligned = pin.JointModelRevoluteUnaligned if rng.integers(2) else pin.JointModelPrismaticUnaligned
        kind = kinds[int(rng.integers(6))]() if rng.integers(2) else unaligned(axis)
        joint = model.addJoint(int(rng.integers(model.njoints)), kind, pin.SE3.Random(), f"joint {number}")
        model.addFrame(pin.Frame(f"frame {number}", joint, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    model.addFrame(pin.Frame("fixed", 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    return model


@given(seed=st.integers(0, 10_000), n=st.integers(1, 5))
@settings(max_examples=40, deadline=None)
def test_any_tree(seed: int, n: int) -> None:
    pin.seed(seed)
    model = random_tree(seed)
    q = np.random.default_rng(seed).uniform(-3.0, 3.0, (n, model.nq))
    frames = [number for number, frame in enumerate(model.frames) if frame.type == pin.FrameType.OP_FRAME]
    found = BatchedKinematics(model).at(q, frames)
    for mine, theirs in zip((found.rotation, found.position, found.spatial), one_by_one(model, q, frames), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-12)


@pytest.mark.parametrize("make", [human_world, pytest.param(screwdriver_world, marks=needs_robots)])
def test_a_world_is_placed_the_same_way_by_few_and_by_many(make: object) -> None:
    world = make()  # type: ignore[operator]
    assert isinstance(world, World)
    q = np.random.default_rng(0).uniform(world.lower, world.upper, (2 * LOOP_UP_TO, world.nq))
    names = [*world.scene.hands, *(world.model.frames[number].name for number in range(5, 12))]
    many, few = world.at(q, names), [world.at(row[None], names) for row in q]
    np.testing.assert_allclose(many.rotation, np.concatenate([one.rotation for one in few]), atol=1e-12)
    np.testing.assert_allclose(many.position, np.concatenate([one.position for one in few]), atol=1e-12)
    np.testing.assert_allclose(many.spatial, np.concatenate([one.spatial for one in few]), atol=1e-12)
