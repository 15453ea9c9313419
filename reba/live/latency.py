"""How long frames take, in buckets that grow by two hundredths: percentiles without keeping the values."""

from __future__ import annotations

import math
from collections import Counter
from typing import Final

GROWTH: Final = 1.02
LEAST: Final = 1e-6
"""[s] Shorter times count as this."""


class Latency:
    """Percentiles of times [s], to 2 %.

    >>> times = Latency()
    >>> for value in range(1, 101):
    ...     times.add(value / 1000)
    >>> round(times.percentile(0.5), 3), round(times.percentile(0.99), 2)
    (0.051, 0.1)
    """

    def __init__(self) -> None:
        self._buckets: Counter[int] = Counter()
        self._count = 0

    def add(self, seconds: float, times: int = 1) -> None:
        """Take up a time, for several frames at once if they took it together."""
        self._buckets[math.ceil(math.log(max(seconds, LEAST) / LEAST, GROWTH))] += times
        self._count += times

    def percentile(self, share: float) -> float | None:
        """Return the time that a share of the frames does not exceed, None without frames."""
        left = share * self._count
        for bucket in sorted(self._buckets):
            left -= self._buckets[bucket]
            if left <= 1e-9:
                return LEAST * GROWTH**bucket
        return None

    def to_dict(self) -> dict[str, float | None]:
        """Return median, 99th percentile and maximum [ms]."""
        found = {"p50_ms": self.percentile(0.5), "p99_ms": self.percentile(0.99), "max_ms": self.percentile(1.0)}
        return {name: None if value is None else round(1000 * value, 3) for name, value in found.items()}
