"""Frames -> one record each: scores, the rolling window, exposure so far, the alert."""

from __future__ import annotations

import dataclasses
from collections import deque
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any, Final

from reba.errors import RebaError
from reba.live.frames import Frames
from reba.method.rules import Rules, rules_of
from reba.method.scoring import SCORE_COLUMNS, UNKNOWN, ScoreArrays, score_angles
from reba.method.tables import ACTION_LEVELS, LEVEL_OF


class LiveScorer:
    """Scores frames and keeps count; its memory is bounded by the window.

    Args:
        rules: preset, TOML file or record.
        window: [s] length of the rolling window.
        alert: when to alert.

    Example:
        >>> session = Session("measured", 60.0, Alert(8, 1.0))
        >>> session.frames
        0
    """

    def __init__(self, rules: Rules | str | Path, window: float, alert: Alert) -> None:
        if not window > 0:
            raise RebaError(f"window is {window:g} s; expected more than 0")
        self.rules = rules_of(rules)
        self.alert = alert
        self.frames = 0
        self.max_low = self.max_high = 0
        self.first = self.last = float("nan")
        self._window = Window(window)
        self._tally = ExposureTotals()
        self._steps = FrameDurations()
        self._open: TimedScore | None = None

    def add(self, frames: Frames) -> tuple[list[dict[str, Any]], ScoreArrays]:
        """Return one record for each of n frames, and their scores."""
        arrays = score_angles(frames.angles, frames.factors, self.rules)
        columns = [arrays[name].tolist() for name in SCORE_COLUMNS]
        records = []
        for time, *values in zip(frames.time.tolist(), *columns, strict=True):
            scores = {
                name: None if value == UNKNOWN else value for name, value in zip(SCORE_COLUMNS, values, strict=True)
            }
            records.append(self._record(time, scores))
        return records, arrays

    def _record(self, time: float, scores: dict[str, Any]) -> dict[str, Any]:
        low, high = scores["reba_low"], scores["reba_high"]
        gap = self._count(time)
        above = low >= self.alert.score
        self._open = TimedScore(time, 0, low, high, scores["action_level"], above)
        self.max_low, self.max_high = max(self.max_low, low), max(self.max_high, high)
        event = self.alert.update(time, low, gap)
        head = {"time": time, **{name: scores[name] for name in HEAD}}
        parts = {name: value for name, value in scores.items() if name not in HEAD}
        return {
            **head,
            **parts,
            "window": self._window.to_dict(),
            "exposure": self.exposure(),
            "alert": self.alert.to_dict(event),
        }

    def _count(self, time: float) -> bool:
        """Count the frame before, now that its end is known; return whether a gap follows it."""
        if self._open is None:
            self.first = time
        self.frames += 1
        gap = False
        if self._open is not None:
            step = time - self.last
            gap = self._steps.add(step)
            self._close(self._steps.period() if gap else step, time)
        self.last = time
        return gap

    def _close(self, seconds: float, now: float) -> None:
        if self._open is not None:
            stay = dataclasses.replace(self._open, span=round(seconds * 1e9))
            self._tally.add(stay)
            self._window.push(stay, now)

    def exposure(self) -> dict[str, Any]:
        """Return exposure up to the newest frame."""
        return {"seconds": self._tally.total / 1e9, **self._tally.mean(), "action_levels": self._tally.seconds()}

    def summary(self) -> dict[str, Any]:
        """Return the exposure of everything, the last frame counted for one usual period. The session is over."""
        self._close(self._steps.period(), self.last)
        self._open = None
        return {
            "frames": self.frames,
            "start": self.first if self.frames else None,
            "end": self.last if self.frames else None,
            "rules": self.rules.name,
            "max_low": self.max_low or None,
            "max_high": self.max_high or None,
            "exposure": self.exposure(),
            "alerts": {"score": self.alert.score, "hold": self.alert.hold, "raised": self.alert.raised},
        }


HEAD = ("reba", "reba_low", "reba_high", "action_level")
"""Columns that stand first in a record."""
LEVELS: Final = len(ACTION_LEVELS)
STEPS: Final = 501
"""Sample periods of which the median is taken."""


@dataclass(frozen=True)
class TimedScore:
    """A frame and how long it counts: `time` [s], `span` [ns], both ends of REBA, its level, whether it is high."""

    time: float
    span: int
    low: int
    high: int
    level: int | None
    above: bool


class ExposureTotals:
    """Sums over frames, each as long as it counts."""

    def __init__(self) -> None:
        self.total = self.above = self._low = self._high = 0
        self._levels = [0] * (LEVELS + 1)

    def add(self, stay: TimedScore, sign: int = 1) -> None:
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


class Window(ExposureTotals):
    """The same over the last seconds.

    Args:
        seconds: length.
    """

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self.length = seconds
        self._stays: deque[TimedScore] = deque()

    def push(self, stay: TimedScore, now: float) -> None:
        """Add a frame and let go of those before the window that ends at `now` [s]."""
        self.add(stay)
        self._stays.append(stay)
        while self._stays and self._stays[0].time < now - self.length - 1e-9:
            self.add(self._stays.popleft(), -1)

    def to_dict(self) -> dict[str, Any]:
        """Return what a line says of it."""
        share = self.above / self.total if self.total else None
        return {"seconds": self.total / 1e9, **self.mean(), "share_above": share}


class FrameDurations:
    """How long each frame counts: until the next one, across a gap one usual period; see `reba.analysis.exposure`."""

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
