"""Statistics of the angle columns of a recording, block by block: they decide without all frames in memory."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.posture.columns import ANGLES, COLUMNS, INDEX

LIMITS: Final[dict[str, tuple[float, float]]] = {
    "trunk_flexion": (-60.0, 180.0),
    "trunk_side_bend": (-90.0, 90.0),
    "trunk_twist": (-100.0, 100.0),
    "neck_flexion": (-90.0, 110.0),
    "neck_side_bend": (-75.0, 75.0),
    "neck_twist": (-110.0, 110.0),
    "knee_flexion": (-20.0, 175.0),
    "upper_arm_flexion": (-90.0, 200.0),
    "upper_arm_abduction": (-60.0, 90.0),
    "shoulder_elevation": (-40.0, 70.0),
    "lower_arm_flexion": (-20.0, 165.0),
    "wrist_flexion": (-110.0, 110.0),
    "wrist_deviation": (-60.0, 70.0),
    "wrist_twist": (-130.0, 140.0),
}
"""[deg] Anatomical limits: normal ranges (AAOS 1965; limits of human.urdf) with a margin for soft tissue."""
_LOW, _HIGH = np.array([LIMITS[angle.name] for angle in ANGLES for _ in angle.columns]).T
_ROWS: Final = 2000
Counts = NDArray[np.int64]


def _none() -> Counts:
    return np.zeros(len(COLUMNS), np.int64)


@dataclass
class ColumnStatistics:
    """Statistics of frames with the 22 angle columns.

    Attributes:
        frames: how many.
        known: (22,) frames with a finite value.
        low, high: (22,) smallest and largest finite value [deg]; infinite without one.
        beyond: (22,) frames beyond `LIMITS`; `beyond_turned`: of the angles with the opposite sign.
    """

    frames: int = 0
    known: Counts = field(default_factory=_none)
    low: Array = field(default_factory=lambda: np.full(len(COLUMNS), np.inf))
    high: Array = field(default_factory=lambda: np.full(len(COLUMNS), -np.inf))
    beyond: Counts = field(default_factory=_none)
    beyond_turned: Counts = field(default_factory=_none)

    def add(self, angles: Array) -> ColumnStatistics:
        """Add (n, 22) angles [deg], and return the statistics.

        >>> ColumnStatistics().add(np.zeros((3, 22))).add(np.full((2, 22), 8.0)).high[0]
        np.float64(8.0)
        """
        self.frames += len(angles)
        for start in range(0, len(angles), _ROWS):
            # Column by column, and comparing only columns with a value beyond the limits, for speed.
            part = np.ascontiguousarray(angles[start : start + _ROWS].T)
            finite = np.isfinite(part)
            self.known += np.count_nonzero(finite, axis=1)
            low, high = np.fmin.reduce(part, axis=1), np.fmax.reduce(part, axis=1)
            for count, sign, ends in ((self.beyond, 1.0, (low, high)), (self.beyond_turned, -1.0, (-high, -low))):
                for at in np.flatnonzero((ends[0] < _LOW) | (ends[1] > _HIGH)).tolist():
                    turned = sign * part[at]
                    count[at] += np.count_nonzero((turned < _LOW[at]) | (turned > _HIGH[at]))
            if np.isinf([low, high]).any():
                known = np.where(finite, part, np.nan)
                low, high = np.fmin.reduce(known, axis=1), np.fmax.reduce(known, axis=1)
            self.low, self.high = np.fmin(self.low, low), np.fmax(self.high, high)
        return self

    def turned(self, columns: Sequence[int]) -> ColumnStatistics:
        """Return the statistics with the opposite sign of some columns, by their positions."""
        at = list(columns)
        low, high = self.low.copy(), self.high.copy()
        beyond, turned = self.beyond.copy(), self.beyond_turned.copy()
        low[at], high[at] = -self.high[at], -self.low[at]
        beyond[at], turned[at] = self.beyond_turned[at], self.beyond[at]
        return dataclasses.replace(self, low=low, high=high, beyond=beyond, beyond_turned=turned)

    def without(self, at: Sequence[int]) -> ColumnStatistics:
        """Return the statistics as if the columns at these positions had no value."""
        kept = ~np.isin(np.arange(len(COLUMNS)), at)
        low, high = np.where(kept, self.low, np.inf), np.where(kept, self.high, -np.inf)
        known, beyond, turned = (np.where(kept, counts, 0) for counts in (self.known, self.beyond, self.beyond_turned))
        return dataclasses.replace(self, known=known, low=low, high=high, beyond=beyond, beyond_turned=turned)

    def empty_columns(self) -> list[str]:
        """Return the columns without any value."""
        return [column for column, index in INDEX.items() if not self.known[index]]

    def beyond_text(self, column: str) -> str:
        """Return in how many frames a column is beyond `LIMITS`, as text."""
        low, high = _LOW[INDEX[column]], _HIGH[INDEX[column]]
        return f"{self.beyond[INDEX[column]]} of {self.frames} frames beyond {low:g} .. {high:g} deg"
