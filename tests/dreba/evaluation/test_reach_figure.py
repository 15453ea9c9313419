"""The figure of the reach tasks: positions and slopes of its hands."""

from __future__ import annotations

import numpy as np
import pytest

import reba
from dreba.evaluation import reach_figure as figure


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


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_hand_seen_from_its_shoulder_does_not_depend_on_trunk_and_legs(side: str) -> None:
    rng = np.random.default_rng(3)
    low, high = figure.limits()
    for dofs in rng.uniform(low, high, (5, 22)):
        upright = np.where(np.isin(np.arange(22), figure.ARMS[side]), dofs, 0.0)
        seen = [figure.from_shoulder(one[None], side, tuple(figure.hand(one, side)[0])) for one in (dofs, upright)]
        assert seen[0] == pytest.approx(seen[1], abs=1e-12)
