"""Simulated recordings: reproducible, and equal to the plan without variability."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import lgp
from lgp.errors import LgpError
from lgp.study.movement import MotionVariability
from lgp.study.simulate import simulated
from tests.support.says import says

pytestmark = pytest.mark.slow
CONDITIONS = ("lean", "plan")


def test_the_same_seed_gives_the_same_people(planned: lgp.Plan) -> None:
    def draw(seed: int) -> Iterator[Any]:
        return simulated(dict.fromkeys(CONDITIONS, planned), participants=2, seed=seed, rate=10.0)

    first, again, other = list(draw(1)), list(draw(1)), list(draw(2))
    assert all(np.array_equal(a.movement.angles, b.movement.angles) for a, b in zip(first, again, strict=True))
    assert first[0].stature != other[0].stature
    assert not np.array_equal(first[0].movement.angles[:5], first[1].movement.angles[:5])
    with pytest.raises(LgpError) as error:
        simulated({"a": planned}, offsets={"a": {"trunk": 1.0}})
    says(error, "'trunk'", "expected a name of reba.COLUMNS")
    with pytest.raises(LgpError) as error:
        simulated({"a": planned}, offsets={"b": {"trunk_flexion": 1.0}})
    says(error, "'b'", "expected a")


def test_without_variation_every_participant_follows_the_plan(planned: lgp.Plan) -> None:
    still = MotionVariability(stature=1.75, stature_sd=0, habit=0, occasion=0, motor=0, speed=0, pace=0)
    (log_,) = simulated({"a": planned}, participants=1, rate=10.0, vary=still)
    assert log_.stature == planned.scene.human.stature  # type: ignore[union-attr]
    slices = np.round(planned.time - planned.time[0], 6)
    at = np.isin(np.round(log_.movement.time, 6), slices)
    assert log_.movement.angles[at] == pytest.approx(planned.posture, abs=1e-6)
    assert log_.movement.load[at].tolist() == planned.carried.tolist()
