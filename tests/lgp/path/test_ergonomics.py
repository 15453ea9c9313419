"""The ergonomic cost: its gradient, and its Hessian in convex blocks."""

from __future__ import annotations

import numpy as np
import pytest

import dreba
import reba
from lgp.path.ergonomics import Ergonomics
from tests.support.lgp_worlds import human_world


@pytest.mark.parametrize(("kind", "sums"), [("convex", True), ("soft", False)])
def test_the_ergonomic_hessian_has_convex_blocks(kind: str, sums: bool) -> None:
    world = human_world("solved")
    cost = Ergonomics(world, dreba.load(kind))
    assert (len(cost.parts) > 5) == sums
    assert sorted(np.concatenate(cost.parts).tolist()) == sorted(set(np.concatenate(cost.parts).tolist()))
    q = np.tile(world.initial_configuration, (6, 1))
    q[:, cost.columns] += 0.1 * np.random.default_rng(1).normal(size=(6, len(cost.columns)))
    q = np.clip(q, world.lower, world.upper)
    value, gradient, blocks = cost.quadratic_model(q, np.zeros(6))
    assert value == pytest.approx(cost.value(q, np.zeros(6)))
    assert [block.shape for block in blocks] == [(6, len(part), len(part)) for part in cost.parts]
    assert all(np.linalg.eigvalsh(block).min() > -1e-6 * np.abs(block).max() for block in blocks)
    for at, column in enumerate(cost.columns):
        step = np.zeros(world.nq)
        step[column] = 1e-6
        difference = (cost.value(q + step, np.zeros(6)) - cost.value(q - step, np.zeros(6))) / 2e-6
        assert gradient[:, at] == pytest.approx(difference, abs=1e-3 * max(1.0, np.abs(gradient).max()))


def test_the_order_of_the_joints_of_a_model_changes_nothing() -> None:
    world = human_world("solved")
    poses = dreba.sample(300, rng=1)
    q = np.tile(world.initial_configuration, (6, 1))
    joints = tuple(reversed(reba.COLUMNS))
    models = (dreba.ConvexModel(joints=names).fit(poses, poses.reba) for names in (None, joints))
    one, other = (Ergonomics(world, model) for model in models)
    q[:, one.columns] += 0.1 * np.random.default_rng(1).normal(size=(6, len(one.columns)))
    assert other.value(q, np.zeros(6)) == pytest.approx(one.value(q, np.zeros(6)), abs=1e-6)
    assert other.lower_bound == pytest.approx(one.lower_bound, abs=1e-6)
    assert other.quadratic_model(q, np.zeros(6))[1] == pytest.approx(one.quadratic_model(q, np.zeros(6))[1], abs=1e-5)


def test_the_hessian_of_a_sum_holds_the_curvature_of_the_angles() -> None:
    world = human_world("solved")
    cost = Ergonomics(world, dreba.load("convex"))
    q = world.initial_configuration[None].copy()
    # Away from the knots of the hinges, where second derivatives jump.
    for name, value in (("clavicle_joint_X", 0.05), ("shoulder_Z", 0.65), ("shoulder_X", 0.33)):
        q[0, world.column[f"human.right_{name}"]] = value
    part = next(p for p in cost.parts if world.column["human.right_shoulder_Z"] in cost.columns[p])
    number = [np.array_equal(part, other) for other in cost.parts].index(True)
    columns = cost.columns[part]

    def gradient(at: np.ndarray) -> np.ndarray:
        return cost.quadratic_model(at, np.zeros(1))[1][0, part]

    true = np.array([(gradient(q + 1e-5 * row) - gradient(q - 1e-5 * row)) / 2e-5 for row in np.eye(world.nq)[columns]])
    values, vectors = np.linalg.eigh(0.5 * (true + true.T))
    clipped = (vectors * np.maximum(values, 0.0)) @ vectors.T
    assert cost.quadratic_model(q, np.zeros(1))[2][number][0] == pytest.approx(clipped, abs=1e-2 * np.abs(values).max())
