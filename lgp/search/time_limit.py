"""The time limit of a search, which problems ask for while they are solved.

What only improves a known plan is stopped at the limit, in the middle of a solve; without a plan the path that is being
solved has some more time.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_END: ContextVar[float] = ContextVar("_END", default=math.inf)
_STOP: ContextVar[float] = ContextVar("_STOP", default=math.inf)


class TimeIsUp(Exception):
    """The time of a problem whose solution is not needed is up."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Limit the wall-clock time [s] of what is solved in here; a limit outside of it that ends earlier stays."""
    token = _END.set(min(_END.get(), time.perf_counter() + seconds))
    try:
        yield
    finally:
        _END.reset(token)


@contextmanager
def stopped_at_limit(grace: float = 0.0) -> Iterator[None]:
    """Let `stop_if_time_is_up` stop what is solved in here so many seconds after the time limit."""
    token = _STOP.set(_END.get() + grace)
    try:
        yield
    finally:
        _STOP.reset(token)


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


def stop_if_time_is_up() -> None:
    """Stop a solve that `stopped_at_limit` surrounds at its time limit; every iteration of a path asks here.

    Raises:
        TimeIsUp: the limit is reached.
    """
    if time.perf_counter() >= _STOP.get():
        raise TimeIsUp
