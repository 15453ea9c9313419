"""Frames -> one record each: scores, the rolling window, exposure so far, the alert."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

from reba.errors import RebaError
from reba.live.alert import Alert
from reba.live.frames import Frames
from reba.live.tally import Stay, Steps, Tally, Window
from reba.rules import Rules, rules_of
from reba.scoring import SCORE_COLUMNS, UNKNOWN, ScoreArrays, score_array


class Session:
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
        self._tally = Tally()
        self._steps = Steps()
        self._open: Stay | None = None

    def add(self, frames: Frames) -> tuple[list[dict[str, Any]], ScoreArrays]:
        """Return one record for each of n frames, and their scores."""
        arrays = score_array(frames.angles, frames.factors, self.rules)
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
        self._open = Stay(time, 0, low, high, scores["action_level"], above)
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
