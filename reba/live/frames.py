"""Postures of new frames with their factors, and the options of reading them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from reba.arrays import Array, Flags
from reba.posture.factors import Factors
from reba.posture.named_angles import look_like_radians
from reba.readers.quality_control import AROUND, parse_neutral


@dataclass(frozen=True)
class Frames:
    """n frames for scoring.

    Attributes:
        time: (n,) [s], increasing, later than all earlier frames.
        angles: (n, 22) [deg] in the order of `reba.COLUMNS`, NaN = not measured.
        factors: checked; scalars or (n,) arrays.
    """

    time: Array
    angles: Array
    factors: Factors

    def part(self, rows: slice) -> Frames:
        """Return some of the frames."""
        factors = {
            field.name: value[rows]
            for field in fields(self.factors)
            if isinstance(value := getattr(self.factors, field.name), np.ndarray) and len(value) == len(self.time)
        }
        return Frames(self.time[rows], self.angles[rows], replace(self.factors, **factors))


def is_later(time: Array, last: float) -> Flags:
    """Return (n,) flags: true for times later than `last` and than all times before them.

    >>> is_later(np.array([1.0, 3.0, 2.0, 3.0, 4.0]), 1.0).tolist()
    [False, True, False, False, True]
    """
    before = np.maximum.accumulate(np.concatenate([[last], np.nan_to_num(time, nan=-np.inf)]))[:-1]
    with np.errstate(invalid="ignore"):
        return np.asarray(time > before)


SETTLE_SECONDS = 2.0
"""[s] Data read before the first frame is yielded; a person usually moves every joint within that time."""


@dataclass(frozen=True)
class ReadingOptions:
    """Options of reading a source as in `reba.read`; `settle`: data from which the reading is decided [s]."""

    profile: str = "auto"
    topic: str | None = None
    neutral: str = "none"
    settle: float = SETTLE_SECONDS


UNIT_SECONDS = 10.0
"""[s] First angles that show the unit; a choice: no person keeps every joint within three degrees that long."""


class UnitCheck:
    """Tells once, from the first angles, whether they look like radians; see `reba.RadiansWarning`.

    >>> check = UnitCheck()
    >>> frames = Frames(np.arange(12.0), np.full((12, 22), 0.4), Factors())
    >>> check.finds_radians(frames), check.finds_radians(frames)
    (True, False)
    """

    def __init__(self) -> None:
        self._angles: list[Array] | None = []
        self._start = np.inf

    def finds_radians(self, frames: Frames) -> bool:
        """Take further frames; return whether the unit is clear now, and radians."""
        if self._angles is None or not len(frames.time):
            return False
        self._start = min(self._start, float(frames.time[0]))
        self._angles.append(frames.angles)
        return frames.time[-1] - self._start >= UNIT_SECONDS and self.ends_in_radians()

    def ends_in_radians(self) -> bool:
        """Decide from the frames so far, if that was not done: no more will come."""
        angles, self._angles = self._angles, None
        return bool(angles) and look_like_radians(np.concatenate(angles or []))


class NotEnoughData(Exception):
    """The first segments do not suffice for the decision."""


def neutral_until(spec: str, start: float) -> float:
    """Return the time [s] at which the neutral interval ends; -inf for "none". `start`: time of the first frame [s].

    >>> neutral_until("first:3s", 10.0), neutral_until("at:12.5", 10.0)
    (13.0, 13.0)

    Raises:
        RebaError: the text has another form.
    """
    if parse_neutral(spec) is None:
        return float("-inf")
    kind, _, seconds = spec.partition(":")
    length = float(seconds.strip().rstrip("s"))
    return start + length if kind.strip() == "first" else length + AROUND
