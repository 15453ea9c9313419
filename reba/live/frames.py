"""Scored input: postures of some frames that have come, with their factors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reba.factors import Factors

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Frames:
    """n frames, ready to be scored.

    Attributes:
        time: (n,) [s], increasing, later than all frames before.
        angles: (n, 22) [deg] in the order of `reba.COLUMNS`, NaN = not measured.
        factors: checked; scalars or (n,) arrays.
    """

    time: Array
    angles: Array
    factors: Factors


def later(time: Array, last: float) -> NDArray[np.bool_]:
    """Return which of (n,) times are later than `last` and all before them.

    >>> later(np.array([1.0, 3.0, 2.0, 3.0, 4.0]), 1.0).tolist()
    [False, True, False, False, True]
    """
    before = np.maximum.accumulate(np.concatenate([[last], np.nan_to_num(time, nan=-np.inf)]))[:-1]
    with np.errstate(invalid="ignore"):
        return np.asarray(time > before)
