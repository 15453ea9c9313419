"""Alerts: raised when a score stays high, cleared when it stays low, so that a flicker does neither."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from reba.tables import ACTION_LEVELS, LEVEL_OF


def score_of_level(risk: str) -> int:
    """Return the lowest REBA score of an action level.

    >>> score_of_level("high")
    8
    """
    level = [name for name, _ in ACTION_LEVELS].index(risk.replace("-", " "))
    return next(score for score in range(1, len(LEVEL_OF)) if LEVEL_OF[score] == level)


@dataclass
class Alert:
    """Follows one score over time.

    Attributes:
        score: from this on the score is high.
        hold: [s] a score has to stay high to raise the alert, and below to clear it.
        active: whether it is raised.
        since: [s] when it was raised.
        raised: how often it was.
    """

    score: int
    hold: float
    active: bool = False
    since: float | None = None
    raised: int = 0
    _turned: float | None = None

    def update(self, time: float, score: int, gap: bool) -> str | None:
        """Take up a frame; return "raised" or "cleared" where that happens with it.

        Args:
            time: [s].
            score: what the frame has at least.
            gap: whether the frame follows a gap, across which nothing is held.
        """
        above = score >= self.score
        if above == self.active:
            self._turned = None
            return None
        if self._turned is None or gap:
            self._turned = time
        if time - self._turned < self.hold - 1e-9:
            return None
        self.active, self.since, self._turned = above, time if above else None, None
        self.raised += above
        return "raised" if above else "cleared"

    def to_dict(self, event: str | None) -> dict[str, Any]:
        """Return what a line says of it."""
        return {"active": self.active, "since": self.since, "event": event}
