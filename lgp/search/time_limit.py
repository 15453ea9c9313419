"""The time limit of a search, which problems that improve a known solution ask for while they are solved."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_END: ContextVar[float] = ContextVar("_END", default=math.inf)


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Limit the wall-clock time [s] of what is solved in here."""
    token = _END.set(time.perf_counter() + seconds)
    try:
        yield
    finally:
        _END.reset(token)


def time_is_up() -> bool:
    """Return whether the time limit is reached.

    Example:
        >>> with time_limit(0.0):
        ...     time_is_up()
        True
        >>> time_is_up()
        False
    """
    return time.perf_counter() >= _END.get()
