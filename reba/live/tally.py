"""Exposure so far and over a rolling window: sums of whole nanoseconds, so that nothing drifts."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from statistics import median
from typing import Any, Final

from reba.tables import ACTION_LEVELS

LEVELS: Final = len(ACTION_LEVELS)
STEPS: Final = 501
"""Sample periods of which the median is taken."""


@dataclass(frozen=True)
class Stay:
    """A frame and how long it counts: `time` [s], `span` [ns], both ends of REBA, its level, whether it is high."""

    time: float
    span: int
    low: int
    high: int
    level: int | None
    above: bool


class Tally:
    """Sums over frames, each as long as it counts."""

    def __init__(self) -> None:
        self.total = self.above = self._low = self._high = 0
        self._levels = [0] * (LEVELS + 1)

    def add(self, stay: Stay, sign: int = 1) -> None:
        """Add a frame, or take it away again with `sign` -1."""
        span = sign * stay.span
        self.total += span
        self.above += span * stay.above
        self._low += span * stay.low
        self._high += span * stay.high
        self._levels[LEVELS if stay.level is None else stay.level] += span

    def mean(self) -> dict[str, float | None]:
        """Return the mean of both ends of REBA, and of REBA where they agree."""
        if not self.total:
            return {"mean": None, "mean_low": None, "mean_high": None}
        low, high = self._low / self.total, self._high / self.total
        return {"mean": low if self._low == self._high else None, "mean_low": low, "mean_high": high}

    def seconds(self) -> dict[str, float]:
        """Return the seconds in each action level, and those in which it is not determined."""
        names = [*map(str, range(LEVELS)), "undetermined"]
        return {name: span / 1e9 for name, span in zip(names, self._levels, strict=True)}


class Window(Tally):
    """The same over the last seconds.

    Args:
        seconds: length.
    """

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self.length = seconds
        self._stays: deque[Stay] = deque()

    def push(self, stay: Stay, now: float) -> None:
        """Add a frame and let go of those before the window that ends at `now` [s]."""
        self.add(stay)
        self._stays.append(stay)
        while self._stays and self._stays[0].time < now - self.length - 1e-9:
            self.add(self._stays.popleft(), -1)

    def to_dict(self) -> dict[str, Any]:
        """Return what a line says of it."""
        share = self.above / self.total if self.total else None
        return {"seconds": self.total / 1e9, **self.mean(), "share_above": share}


class Steps:
    """How long each frame counts: until the next one, across a gap one usual period; see `reba.exposure`."""

    def __init__(self) -> None:
        self._steps: deque[float] = deque(maxlen=STEPS)

    def add(self, step: float) -> bool:
        """Take up the step [s] to a frame; return whether it is a gap."""
        gap = step > 0.2 and bool(self._steps) and step > 5 * self.period()
        if not gap:
            self._steps.append(step)
        return gap

    def period(self) -> float:
        """Return the usual period [s]; a single frame counts a second."""
        return median(self._steps) if self._steps else 1.0
