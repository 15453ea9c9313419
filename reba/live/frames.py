"""Scored input: postures of some frames that have come, with their factors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reba.arrays import Array, Flags
from reba.posture.factors import Factors
from reba.readers.quality_control import AROUND, parse_neutral


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


def later(time: Array, last: float) -> Flags:
    """Return which of (n,) times are later than `last` and all before them.

    >>> later(np.array([1.0, 3.0, 2.0, 3.0, 4.0]), 1.0).tolist()
    [False, True, False, False, True]
    """
    before = np.maximum.accumulate(np.concatenate([[last], np.nan_to_num(time, nan=-np.inf)]))[:-1]
    with np.errstate(invalid="ignore"):
        return np.asarray(time > before)


SETTLE = 2.0
"""[s] Of a source that are looked at before the first frame is handed out."""


@dataclass(frozen=True)
class Reading:
    """How a source is read; as in `reba.read`, with `settle` [s] to look at first."""

    profile: str = "auto"
    topic: str | None = None
    neutral: str = "none"
    settle: float = SETTLE


class NotYet(Exception):
    """The first segments do not suffice to decide."""


def neutral_until(spec: str, start: float) -> float:
    """Return the time [s] at which the neutral stretch is over, `start` being the first frame's; -inf for "none".

    >>> neutral_until("first:3s", 10.0), neutral_until("at:12.5", 10.0)
    (13.0, 13.0)

    Raises:
        RebaError: the text is wrong.
    """
    if parse_neutral(spec) is None:
        return float("-inf")
    kind, _, seconds = spec.partition(":")
    length = float(seconds.strip().rstrip("s"))
    return start + length if kind.strip() == "first" else length + AROUND
