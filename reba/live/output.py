"""Records as JSON lines without delay, and percentiles of the latency."""

from __future__ import annotations

import contextlib
import math
import signal
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from types import FrameType
from typing import IO, Any, Final

from reba.files import as_json
from reba.interrupts import WORDS


@cache
def encoder() -> Callable[[Any], bytes]:
    """Return the function that encodes plain data as JSON: orjson if installed, which is five times as fast."""
    try:
        import orjson
    except ImportError:
        return lambda record: as_json(record).encode()

    def encode(record: Any) -> bytes:
        # orjson refuses surrogates, and escapes no other control characters than those that JSON forbids.
        with contextlib.suppress(TypeError):
            line = orjson.dumps(record)
            if line.isascii() and b"\x7f" not in line:
                return line
        return as_json(record).encode()

    return encode


def write_lines(stream: IO[bytes], records: Iterable[Mapping[str, Any]]) -> None:
    """Write one line per record and flush."""
    encode = encoder()
    lines = memoryview(b"".join(encode(record) + b"\n" for record in records))
    with _DeferredSignals():
        # A signal can interrupt an unbuffered write after a part of the bytes.
        while lines:
            lines = lines[stream.write(lines) :]
        stream.flush()


class _DeferredSignals:
    """Defers Ctrl-C and SIGTERM until complete lines are written; a second one is acted on at once."""

    def __init__(self) -> None:
        self._received: int | None = None
        self._previous: dict[int, Any] = {}

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self._received is not None:
            self._restore()
            signal.raise_signal(number)
        self._received = number

    def _restore(self) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def __enter__(self) -> None:
        if threading.current_thread() is threading.main_thread():
            self._previous = {number: signal.getsignal(number) for number in WORDS}
            for number, handler in self._previous.items():
                if handler is not signal.SIG_IGN:
                    signal.signal(number, self._note)

    def __exit__(self, *_: object) -> None:
        self._restore()
        if self._received is not None:
            signal.raise_signal(self._received)


BUCKET_RATIO: Final = 1.02
"""Ratio of the upper ends of neighbouring buckets: percentiles are accurate to 2 %."""
SHORTEST: Final = 1e-6
"""[s] Upper end of the first bucket."""


class Latency:
    """Percentiles of times [s], accurate to 2 %, in bounded memory.

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
        """Count a time [s], `times` times if several frames share it."""
        self._buckets[math.ceil(math.log(max(seconds, SHORTEST) / SHORTEST, BUCKET_RATIO))] += times
        self._count += times

    def percentile(self, share: float) -> float | None:
        """Return the time [s] that a share of the frames does not exceed, None without frames."""
        remaining = share * self._count
        for bucket in sorted(self._buckets):
            remaining -= self._buckets[bucket]
            if remaining <= 1e-9:
                return SHORTEST * BUCKET_RATIO**bucket
        return None

    def to_dict(self) -> dict[str, float | None]:
        """Return median, 99th percentile and maximum [ms]."""
        values = {"p50_ms": self.percentile(0.5), "p99_ms": self.percentile(0.99), "max_ms": self.percentile(1.0)}
        return {name: None if value is None else round(1000 * value, 3) for name, value in values.items()}
