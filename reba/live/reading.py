"""What the caller chose about reading a source."""

from __future__ import annotations

from dataclasses import dataclass

from reba.readers.neutral import AROUND, parse_neutral

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
