"""What the values of a joint show over a whole recording: its range, its unit, whether it moves at all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FAR = 7.0
"""[rad] No anatomical joint turns further: values beyond are degrees in a field of radians."""

WILD = 4.0 * np.pi
"""[rad] Beyond this a single value is damage, not a posture."""

STILL = 1e-3
"""[deg] A joint that never leaves its value by more does not move; no sensor is that quiet."""


class JointRanges:
    """Ranges of k joints, taken up block by block; no value is kept."""

    def __init__(self, size: int) -> None:
        self.low, self.high = np.full(size, np.inf), np.full(size, -np.inf)
        self.seen, self.beyond = np.zeros(size), np.zeros(size)
        self.wild = 0

    def add(self, index: int, data: Array, radians: bool) -> Array:
        """Take up (n,) values of a joint and return them, damaged ones as NaN."""
        good = data[np.isfinite(data)]
        self.seen[index] += len(good)
        if radians and len(good) and max(good.max(), -good.min()) > FAR:
            self.beyond[index] += float(np.sum(np.abs(good) > FAR))
            self.wild += int(np.sum(np.abs(good) > WILD))
            good = good[np.abs(good) <= WILD]
            data = np.where(np.abs(data) <= WILD, data, np.nan)
        if len(good):
            self.low[index] = min(self.low[index], float(good.min()))
            self.high[index] = max(self.high[index], float(good.max()))
        return data

    @property
    def known(self) -> NDArray[np.bool_]:
        """(k,) joints that have a value."""
        return self.low <= self.high

    def far(self) -> int:
        """Return how many joints lie beyond `FAR` in a fifth of their samples or more."""
        return int(np.sum(self.beyond > 0.2 * np.maximum(self.seen, 1.0)))

    def largest(self) -> float:
        """Return the largest absolute value of all joints, 0 without any."""
        known = self.known
        return float(np.max(np.maximum(np.abs(self.low[known]), np.abs(self.high[known])), initial=0.0))

    def still(self, to_degrees: float) -> tuple[Array, NDArray[np.bool_]]:
        """Return the (k,) middle of each range [deg] and which joints never leave it."""
        known = self.known
        low, high = np.where(known, self.low, np.nan), np.where(known, self.high, np.nan)
        return (low + high) / 2.0 * to_degrees, known & ((high - low) * to_degrees <= STILL)
