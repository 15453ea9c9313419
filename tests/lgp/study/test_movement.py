"""Motion variability: noise, statures, offsets of known size."""

from __future__ import annotations

import numpy as np
import pytest

import lgp
from lgp.study.movement import VARIATION, perform, person, smooth_noise
from lgp.study.retarget import Retarget


def test_noise_is_smooth_and_of_unit_variance() -> None:
    noise = smooth_noise(np.random.default_rng(0), 60_000, 30.0, 0.4)
    assert noise.std(axis=0) == pytest.approx(np.ones(22), abs=0.1)
    assert np.diff(noise, axis=0).std() < 0.15
    assert noise[:100].std() == pytest.approx(1.0, abs=0.4)


def test_people_differ_and_stay_adults() -> None:
    people = [person(np.random.default_rng([0, n])) for n in range(300)]
    statures = np.array([one.stature for one in people])
    assert statures.mean() == pytest.approx(VARIATION.stature, abs=0.03)
    assert statures.min() >= VARIATION.statures[0]
    assert statures.max() <= VARIATION.statures[1]


@pytest.mark.slow
def test_an_offset_is_in_every_frame(planned: lgp.Plan) -> None:
    body = Retarget(planned).planned
    who = person(np.random.default_rng(0))
    plain, shifted = (perform(body, who, np.random.default_rng(1), offset=shift) for shift in (0.0, np.full(22, 7.0)))
    gap = shifted.angles - plain.angles
    assert np.median(gap) == pytest.approx(7.0)
    assert gap.min() >= -1e-9  # joints that end at straight
