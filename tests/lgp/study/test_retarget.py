"""Retargeting to another stature: working hands keep their positions."""

from __future__ import annotations

import numpy as np
import pytest

import lgp
from lgp.kinematics.world import World
from lgp.study.retarget import Retarget, hand_positions

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("stature", [1.55, 1.90])
def test_another_stature_reaches_the_same_place(planned: lgp.Plan, stature: float) -> None:
    retarget = Retarget(planned)
    assert retarget.motion(retarget.stature) is retarget.planned
    motion = retarget.motion(stature)
    assert motion.miss < 0.005
    assert motion.posture.shape == planned.posture.shape
    assert not np.allclose(motion.posture[-1], planned.posture[-1], atol=1.0)
    positions, _ = hand_positions(World(retarget.scene), retarget.path)
    assert positions == pytest.approx(retarget.hands)
