"""Records as JSON lines, written as soon as they are there."""

from __future__ import annotations

import math
import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from types import FrameType
from typing import IO, Any, Final

from reba.files import as_json


@cache
def encoder() -> Callable[[Any], bytes]:
    """Return what turns plain data into JSON text: orjson if installed, which is five times as fast."""
    try:
        import orjson
    except ImportError:
        return lambda record: as_json(record).encode()
    return orjson.dumps


def write_lines(stream: IO[bytes], records: Iterable[Mapping[str, Any]]) -> None:
    """Write one line for each record and hand them over at once."""
    encode = encoder()
    lines = memoryview(b"".join(encode(record) + b"\n" for record in records))
    with _Whole():
        # Unbuffered output may take a part only when a signal comes.
        while lines:
            lines = lines[stream.write(lines) :]
        stream.flush()


class _Whole:
    """Puts off an interrupt until lines are written whole; the second one is heeded at once."""

    def __init__(self) -> None:
        self._noted = False
        self._before: Any = None

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._noted:
            raise KeyboardInterrupt
        self._noted = True

    def __enter__(self) -> None:
        if threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._note)

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)
        if self._noted:
            raise KeyboardInterrupt


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
