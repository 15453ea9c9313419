"""Quality control: gaps, frozen frames, neutral posture."""

from __future__ import annotations

import numpy as np
import pytest

from reba.errors import RebaError
from reba.readers.quality_control import equal_frames, find_gaps, frozen_warning, parse_neutral
from tests.support.says import says
from tests.support.synthetic_bodies import RATE


@pytest.mark.parametrize("spec", ["", "first", "first:0s", "first:-1s", "at:x", "last:3s", "none "])
def test_bad_neutral_is_refused(spec: str) -> None:
    with pytest.raises(RebaError) as caught:
        parse_neutral(spec)
    says(caught, repr(spec), "none, first:3s", "at:12.5")


def test_gaps_and_frozen_stretches() -> None:
    time = np.concatenate([np.arange(50) / RATE, 5.0 + np.arange(50) / RATE])
    assert find_gaps(time) == ((0.98, 5.0),)
    assert find_gaps(np.arange(5) * 10.0) == ()
    angles = np.random.default_rng(1).normal(size=(100, 22))
    assert frozen_warning(np.arange(100) / RATE, equal_frames(angles)) is None
    angles[20:80] = angles[20]
    says(frozen_warning(np.arange(100) / RATE, equal_frames(angles)) or "", "equal frames", "0.40 s")
