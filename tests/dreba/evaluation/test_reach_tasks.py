"""The figure, the tasks, the staged minimiser and the graduated model that they judge."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import dreba
import reba
from dreba.evaluation import reach_tasks as figure
from dreba.evaluation import reach_tasks as reach
from dreba.surrogates.graduated import GraduatedModel
from dreba.surrogates.soft import SoftModel

pytestmark = pytest.mark.slow


@cache
def graduated() -> GraduatedModel:
    poses = dreba.sample(10_000, rng=41)
    first = dreba.QuadraticModel().fit(poses.angles, poses.reba)
    return GraduatedModel.of(first, SoftModel(ladder=(8.0, 2.0), updates=300).fit(poses.angles, poses.reba))


@pytest.mark.parametrize("side", ["left", "right"])
def test_hand_jacobian_agrees_with_finite_differences(side: str) -> None:
    rng = np.random.default_rng(1)
    low, high = figure.limits()
    for dofs in rng.uniform(low, high, (5, 22)):
        step = 1e-4 * np.eye(22)
        slope = np.stack(
            [(figure.hand(dofs + e, side)[0] - figure.hand(dofs - e, side)[0]) / 2e-4 for e in step], axis=1
        )
        assert figure.hand(dofs, side)[1] == pytest.approx(slope, abs=1e-9)


def test_hands_mirror_each_other() -> None:
    rng = np.random.default_rng(2)
    low, high = figure.limits()
    dofs = rng.uniform(low, high)
    mirrored = dofs.copy()
    for place, name in enumerate(figure.DOFS):
        if name.startswith(("trunk", "neck")) and not name.endswith("flexion"):
            mirrored[place] = -dofs[place]
        if name.endswith("_left"):
            other = figure.DOFS.index(name.replace("_left", "_right"))
            mirrored[place], mirrored[other] = dofs[other], dofs[place]
    left, right = figure.hand(dofs, "left")[0], figure.hand(mirrored, "right")[0]
    assert right == pytest.approx(left * [1.0, -1.0, 1.0], abs=1e-12)


def test_known_postures_of_the_figure() -> None:
    straight = np.zeros(22)
    assert figure.hand(straight, "left")[0] == pytest.approx([0.0, 0.129 * 1.75, (0.818 - 0.387) * 1.75], abs=1e-9)
    forward = straight.copy()
    forward[figure.DOFS.index("upper_arm_flexion_left")] = 90.0
    assert figure.hand(forward, "left")[0] == pytest.approx([0.387 * 1.75, 0.129 * 1.75, 0.818 * 1.75], abs=1e-9)
    squat = straight.copy()
    squat[[figure.DOFS.index(f"knee_flexion_{side}") for side in ("left", "right")]] = 90.0
    assert figure.hand(squat, "left")[0][2] < figure.hand(straight, "left")[0][2] - 0.2
    assert reba.score_array(figure.posture(figure.neutral())[None]).reba[0] == 1


def test_tasks_and_starts_repeat_with_their_seed() -> None:
    assert reach.tasks(6, 3) == reach.tasks(6, 3)
    assert reach.tasks(6, 3) != reach.tasks(6, 4)
    box = reach.tasks(2, 3)[1].targets
    assert box["left"][1] - box["right"][1] == pytest.approx(reach.BOX)
    low, high = figure.limits()
    for kind in ("random", "neutral"):
        found = reach.starts(kind, 10, 1)
        assert ((found >= low) & (found <= high)).all()
        assert np.array_equal(found, reach.starts(kind, 10, 1))


def test_models_of_all_columns_in_another_order_solve_the_same_tasks() -> None:
    poses = dreba.sample(300, rng=1)
    model, other = (
        dreba.QuadraticModel(joints=joints).fit(poses, poses.reba) for joints in (None, tuple(reversed(reba.COLUMNS)))
    )
    (one,), (two,) = reach.method_of(model).objectives, reach.method_of(other).objectives
    for pose in poses.angles[:5]:
        assert two(pose)[0] == pytest.approx(one(pose)[0], abs=1e-6)
        assert two(pose)[1] == pytest.approx(one(pose)[1], abs=1e-6)


def test_graduated_solves_tasks_better_than_a_sharp_cost_alone() -> None:
    given = reach.tasks(4, 5)
    starts = reach.starts("random", 4, 5).reshape(4, 1, 22)
    staged = reach.run(reach.method_of(graduated()), given, starts)
    sharp = reach.run(reach.method_of(graduated(), temperature=2.0), given, starts)
    assert staged.infeasible == 0.0
    assert staged.mean < sharp.mean
    best = reach.best_known([staged, sharp])
    assert staged.share_best(best) <= staged.share_best_of_starts(best) <= 1.0
    assert staged.evaluations > sharp.evaluations / 10
