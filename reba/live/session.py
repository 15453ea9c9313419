"""Live scores: frames -> one record each with scores, rolling window, exposure so far and alert."""

from __future__ import annotations

import dataclasses
from collections import Counter, deque
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any, Final

from reba.errors import RebaError
from reba.live.frames import Frames
from reba.live.notices import Notice
from reba.method.rules import Rules, rules_of
from reba.method.scoring import SCORE_COLUMNS, ScoreArrays, score_angles
from reba.method.tables import ACTION_LEVELS, LEVEL_OF, UNKNOWN
from reba.provenance import with_provenance


class LiveScorer:
    """Scores frames and accumulates exposure; its memory is bounded by the rolling `window` [s].

    Example:
        >>> scorer = LiveScorer("measured", 60.0, Alert(8, 1.0))
        >>> scorer.frames
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
        self.missing = 0.0
        self.notices: Counter[str] = Counter()
        self._window = Window(window)
        self._totals = ExposureTotals()
        self._durations = FrameDurations()
        self._current: TimedScore | None = None
        self._begins = False

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
        self._current = TimedScore(time, 0, low, high, scores["action_level"], above)
        self.max_low, self.max_high = max(self.max_low, low), max(self.max_high, high)
        event = self.alert.update(time, low, gap)
        head = {"time": time, **{name: scores[name] for name in HEAD}}
        parts = {name: value for name, value in scores.items() if name not in HEAD}
        return with_provenance(
            {
                **head,
                **parts,
                "window": self._window.to_dict(),
                "exposure": self.exposure(),
                "alert": self.alert.to_dict(event),
            }
        )

    def _count(self, time: float) -> bool:
        """Count the previous frame, whose end is now known; return whether a gap follows it."""
        if self._current is None:
            self.first = time
        self.frames += 1
        gap = False
        if self._current is not None:
            step = time - self.last
            gap = self._durations.add(step)
            period = self._durations.period()
            self.missing += step - period if gap else 0.0
            self._close(period if gap else step, time)
        self.last = time
        return gap

    def _close(self, seconds: float, now: float) -> None:
        if self._current is not None:
            timed = dataclasses.replace(self._current, span=round(seconds * 1e9))
            self._totals.add(timed)
            if not self._begins:
                self._window.push(timed, now)
            self._begins = False

    def exposure(self, missing: float = 0.0) -> dict[str, Any]:
        """Return exposure up to the newest frame; `missing`: time since then [s]."""
        seconds = {"seconds": self._totals.total / 1e9, "missing": round(self.missing + missing, 9)}
        return {**seconds, **self._totals.mean(), "action_levels": self._totals.seconds()}

    def notice(self, notice: Notice) -> dict[str, Any]:
        """Return the line of a change of the signal; without a signal, and in a new segment, no alert is active."""
        event = None
        self.notices[notice.kind] += 1
        if notice.segment or not notice.followed:
            event = self.alert.stop()
        if notice.segment:
            self._window, self._begins = Window(self._window.length), True
        time = {} if notice.time is None else {"time": notice.time}
        return with_provenance(
            {
                **time,
                "notice": notice.to_dict(),
                "exposure": self.exposure(notice.missing),
                "alert": self.alert.to_dict(event),
            }
        )

    def summary(self, missing: float = 0.0) -> dict[str, Any]:
        """Return the exposure of all frames, the last one counted for the median period, and end the scoring.

        `missing`: time since the last frame [s].
        """
        self._close(self._durations.period(), self.last)
        self._current = None
        return with_provenance(
            {
                "frames": self.frames,
                "start": self.first if self.frames else None,
                "end": self.last if self.frames else None,
                "rules": self.rules.name,
                "max_low": self.max_low or None,
                "max_high": self.max_high or None,
                "exposure": self.exposure(missing),
                "notices": dict(self.notices),
                "alerts": {"score": self.alert.score, "hold": self.alert.hold, "raised": self.alert.raised},
            }
        )


HEAD = ("reba", "reba_low", "reba_high", "action_level")
"""Columns at the beginning of a record."""
LEVELS: Final = len(ACTION_LEVELS)
PERIODS: Final = 501
"""Number of latest sample periods whose median is the usual period: some seconds at 100 Hz, and odd."""


@dataclass(frozen=True)
class TimedScore:
    """Score of one frame: `time` [s], duration `span` [ns], range of REBA, action level, alert score reached."""

    time: float
    span: int
    low: int
    high: int
    level: int | None
    above: bool


class ExposureTotals:
    """Sums over frames, weighted by their durations."""

    def __init__(self) -> None:
        self.total = self.above = self._low = self._high = 0
        self._levels = [0] * (LEVELS + 1)

    def add(self, timed: TimedScore, sign: int = 1) -> None:
        """Add a frame, or subtract it with `sign` -1."""
        span = sign * timed.span
        self.total += span
        self.above += span * timed.above
        self._low += span * timed.low
        self._high += span * timed.high
        self._levels[LEVELS if timed.level is None else timed.level] += span

    def mean(self) -> dict[str, float | None]:
        """Return the mean of both ends of REBA, and the mean of REBA if they are equal."""
        if not self.total:
            return {"mean": None, "mean_low": None, "mean_high": None}
        low, high = self._low / self.total, self._high / self.total
        return {"mean": low if self._low == self._high else None, "mean_low": low, "mean_high": high}

    def seconds(self) -> dict[str, float]:
        """Return action level -> time [s], and the time in which the level is undetermined."""
        names = [*map(str, range(LEVELS)), "undetermined"]
        return {name: span / 1e9 for name, span in zip(names, self._levels, strict=True)}


class Window(ExposureTotals):
    """Sums over the frames of the last `seconds` [s]."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self.length = seconds
        self._scores: deque[TimedScore] = deque()

    def push(self, timed: TimedScore, now: float) -> None:
        """Add a frame and subtract those before the window that ends at `now` [s]."""
        self.add(timed)
        self._scores.append(timed)
        while self._scores and self._scores[0].time < now - self.length - 1e-9:
            self.add(self._scores.popleft(), -1)

    def to_dict(self) -> dict[str, Any]:
        """Return the member `window` of a record."""
        share = self.above / self.total if self.total else None
        return {"seconds": self.total / 1e9, **self.mean(), "share_above": share}


class FrameDurations:
    """Duration of each frame: until the next one, before a gap the median period; see `reba.analysis.exposure`."""

    def __init__(self) -> None:
        self._durations: deque[float] = deque(maxlen=PERIODS)

    def add(self, step: float) -> bool:
        """Add the time from one frame to the next [s]; return whether it is a gap."""
        gap = step > 0.2 and bool(self._durations) and step > 5 * self.period()
        if not gap:
            self._durations.append(step)
        return gap

    def period(self) -> float:
        """Return the median period [s]; 1 s for a single frame."""
        return median(self._durations) if self._durations else 1.0


def score_of_level(risk: str) -> int:
    """Return the lowest REBA score of an action level.

    >>> score_of_level("high")
    8
    """
    level = [name for name, _ in ACTION_LEVELS].index(risk.replace("-", " "))
    return next(score for score in range(1, len(LEVEL_OF)) if LEVEL_OF[score] == level)


@dataclass
class Alert:
    """Alert with hysteresis in time.

    Attributes:
        score: REBA score from which on the alert is raised.
        hold: time for which the score must persist to raise or to clear the alert [s].
        active: whether the alert is raised, at the time `since` [s].
        raised: number of alerts so far.
    """

    score: int
    hold: float
    active: bool = False
    since: float | None = None
    raised: int = 0
    _changed_at: float | None = None

    def update(self, time: float, score: int, gap: bool) -> str | None:
        """Add a frame at `time` [s]; return "raised" or "cleared" if the alert changes with it.

        Args:
            score: lower end of the REBA range.
            gap: the frame follows a gap, which restarts the hold time.
        """
        above = score >= self.score
        if above == self.active:
            self._changed_at = None
            return None
        if self._changed_at is None or gap:
            self._changed_at = time
        if time - self._changed_at < self.hold - 1e-9:
            return None
        self.active, self.since, self._changed_at = above, time if above else None, None
        self.raised += above
        return "raised" if above else "cleared"

    def stop(self) -> str | None:
        """End the alert without a signal; return "cleared" if it was active."""
        was_active = self.active
        self.active, self.since, self._changed_at = False, None, None
        return "cleared" if was_active else None

    def to_dict(self, event: str | None) -> dict[str, Any]:
        """Return the member `alert` of a record."""
        return {"active": self.active, "since": self.since, "event": event}
