"""Exposure over time: time-weighted statistics, the worst intervals and their causes.

The weight of a frame is the time until the next one; across a gap it is one median period. Percentiles are
scores that occurred. Where unmeasured angles leave a score open, both ends of its range are
summarised and the shares of action levels name the undetermined rest.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from reba.analysis.contributions import PARTS
from reba.analysis.expected_exposure import expected_exposure, frame_distribution
from reba.analysis.score_table import SCORES, ScoreTable
from reba.analysis.verdict import verdict
from reba.analysis.worksheet import contributions
from reba.arrays import Array
from reba.checks import accepts
from reba.errors import PostureError
from reba.method.tables import ACTION_LEVELS, LEVEL_OF

HELD_SECONDS: Final = 1.0
"""[s] Shortest time of a sustained score; shorter peaks are likely measurement noise."""
WORST_INTERVALS: Final = 5
"""How many worst intervals are listed."""
INTERVAL_RULE: Final = (
    "An interval is a time at its score or above; a pause below it that is shorter than a second and than the times on "
    "either side does not end it."
)


@dataclass(frozen=True)
class Interval:
    """An interval of a recording in which REBA stays at or above a score.

    Attributes:
        start, end: [s], the end one period after the last frame.
        reba: the score that is reached throughout (by the low end of the range), short pauses aside.
        frame: the frame that stands for it: one of the highest in it, nearest to the middle.
    """

    start: float
    end: float
    reba: int
    frame: int


@dataclass(frozen=True)
class Distribution:
    """Time-weighted statistics of one score; None where no frame has it."""

    mean: float | None
    median: int | None
    p90: int | None
    max: int | None


def durations(time: Array) -> Array:
    """Return (n,) seconds that each frame stands for.

    Example:
        >>> durations(np.array([0.0, 0.1, 0.2, 9.0])).round(3).tolist()
        [0.1, 0.1, 0.1, 0.1]
    """
    if len(time) < 2:
        return np.ones(len(time))
    steps = np.diff(time)
    period = float(np.median(steps))
    longest = max(5 * period, 0.2)
    return np.append(np.where(steps > longest, period, steps), period)


def distribution(scores: NDArray[Any], weights: Array) -> Distribution:
    """Return the weighted statistics of (n,) scores; NaN entries are left out.

    Example:
        >>> distribution(np.array([1.0, 1.0, 8.0]), np.ones(3))
        Distribution(mean=3.3333333333333335, median=1, p90=8, max=8)
    """
    values = np.asarray(scores, np.float64)
    known = ~np.isnan(values)
    # Scores are integers from 1 to 15: the weight of each gives every statistic, without sorting the frames.
    time_at = np.bincount(values[known].astype(np.int64), weights[known])
    if not time_at.any():
        return Distribution(None, None, None, None)
    occurring = np.flatnonzero(time_at)
    share = np.cumsum(time_at[occurring]) / time_at.sum()
    median, p90 = (int(occurring[np.argmax(share >= q - 1e-9)]) for q in (0.5, 0.9))
    mean = float(np.arange(len(time_at)) @ time_at / time_at.sum())
    return Distribution(mean, median, p90, int(occurring[-1]))


def column(scores: ScoreTable, name: str) -> Array:
    """Return one column of the score table as (n,) floats, NaN where undetermined."""
    values: Array = scores.data[name].to_numpy(np.float64, na_value=np.nan)
    return values


def level_shares(scores: ScoreTable, name: str = "action_level") -> dict[str, float]:
    """Return the share of time in action levels "0" to "4" and "undetermined"."""
    weights = durations(scores.time)
    levels = column(scores, name)
    total = weights.sum() or 1.0
    return {**_level_times(levels, weights / total), "undetermined": float(weights[np.isnan(levels)].sum() / total)}


def _level_times(levels: Array, weights: Array) -> dict[str, float]:
    known = ~np.isnan(levels)
    times = np.bincount(levels[known].astype(np.int64), weights[known], minlength=len(ACTION_LEVELS))
    return {str(level): float(time) for level, time in enumerate(times)}


def sustained(scores: ScoreTable, seconds: float = HELD_SECONDS, *, end: Literal["low", "high"] = "low") -> int | None:
    """Return the highest score that is sustained for `seconds` (by one end of the range), or None."""
    timeline = _Timeline(scores, end)
    return next((score for score in timeline.scores if timeline.runs(score, seconds)[0].size), None)


def intervals(scores: ScoreTable, at_least: int) -> list[Interval]:
    """Return every interval in which the low end of REBA is at least a score; gaps end an interval."""
    timeline = _Timeline(scores)
    first, last = timeline.runs(at_least)
    return [timeline.interval(a, b, at_least) for a, b in zip(first.tolist(), last.tolist(), strict=True)]


def worst_intervals(scores: ScoreTable, count: int = WORST_INTERVALS) -> list[Interval]:
    """Return the worst intervals without overlap: that with the highest score in it first, then by the score held.

    One rule: an interval is a time at or above a score, and a pause below it that is shorter than a second and than
    the times on either side of it does not end it (`INTERVAL_RULE`). Intervals of at least one second come first,
    shorter ones only where there are not enough.
    """
    timeline = _Timeline(scores)
    chosen: list[tuple[int, int, int]] = []
    for least in (HELD_SECONDS, 0.0):
        for score in (score for score in timeline.scores if score > 1):
            first, last = timeline.merged(score, least)
            order = np.lexsort((first, timeline.start[first] - timeline.end[last]))
            for place in order.tolist():
                if len(chosen) == count:
                    break
                a, b = int(first[place]), int(last[place])
                if all(b < c or a > d for c, d, _ in chosen):
                    chosen.append((a, b, score))
    worst = [timeline.interval(a, b, score) for a, b, score in chosen]
    return sorted(worst, key=lambda s: (-timeline.reba[s.frame], -s.reba, s.start - s.end, s.start))


class _Timeline:
    """One end of REBA over time, cut at gaps and seams: start and end [s] of every frame, and where it is cut."""

    def __init__(self, scores: ScoreTable, end: str = "low") -> None:
        self.reba = scores.data[f"reba_{end}"].to_numpy(np.int16)
        self.scores = np.flatnonzero(np.bincount(self.reba, minlength=1))[::-1].tolist()
        self.start = scores.time
        weights = durations(self.start)
        self.end = self.start + weights
        self.broken = np.append(np.diff(self.start) > weights[:-1] + 1e-9, True)[: len(self.reba)]
        seams = np.searchsorted(self.start, scores.postures.quality.seams)
        self.broken[seams[seams > 0] - 1] = True

    def runs(self, at_least: int, seconds: float = 0.0) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return first and last frame of every run at or above a score that lasts for `seconds`."""
        above = self.reba >= at_least
        parted = ~above[:-1] | ~above[1:] | self.broken[:-1]
        first = np.flatnonzero(above & np.concatenate([[True], parted])[: len(above)])
        last = np.flatnonzero(above & np.concatenate([parted, [True]])[-len(above) :])
        long = self.end[last] - self.start[first] >= seconds - 1e-9
        return first[long], last[long]

    def merged(self, at_least: int, seconds: float) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return first and last frame of the runs at or above a score, joined across short pauses."""
        first, last = self.runs(at_least)
        pause = self.start[first[1:]] - self.end[last[:-1]]
        length = self.end[last] - self.start[first]
        cuts = np.cumsum(np.append(0, self.broken))  # gaps and seams before each frame
        short = pause < np.minimum(HELD_SECONDS, np.minimum(length[:-1], length[1:]))
        joined = short & (cuts[first[1:]] == cuts[last[:-1]])
        first, last = first[np.append(True, ~joined)[: len(first)]], last[np.append(~joined, True)[-len(last) :]]
        long = self.end[last] - self.start[first] >= seconds - 1e-9
        return first[long], last[long]

    def interval(self, first: int, last: int, held: int) -> Interval:
        """Return a run as an interval, with the frame that stands for it."""
        inside = self.reba[first : last + 1]
        worst = first + np.flatnonzero(inside == inside.max())
        middle = int(worst[np.argmin(np.abs(worst - (first + last) / 2))])
        return Interval(float(self.start[first]), float(self.end[last]), held, middle)


def summarise(scores: ScoreTable) -> dict[str, Any]:
    """Return the exposure of one recording as plain data (the object of `reba score --json` without paths).

    `reba` has a statistic only where the measured angles determine it; `range` always has both ends.
    """
    time = scores.time
    weights = durations(time)
    low, high = column(scores, "reba_low"), column(scores, "reba_high")
    shares = level_shares(scores)
    undetermined = shares.pop("undetermined")
    low_end, high_end = distribution(low, weights), distribution(high, weights)
    intervals = worst_intervals(scores)
    worst = []
    for interval in intervals:
        row = scores.data.iloc[interval.frame]
        reba = row["reba"]
        worst.append(
            {
                "time": float(row["time"]),
                "reba": None if pd.isna(reba) else int(reba),
                "reba_low": int(low[interval.frame]),
                "reba_high": int(high[interval.frame]),
                "start": interval.start,
                "end": interval.end,
                "held": interval.reba,
                "why": contributions(scores, interval.frame),
                **({"distribution": chances} if (chances := frame_distribution(scores, interval.frame)) else {}),
            }
        )
    ends = (low_end.p90, high_end.p90)
    return {
        "verdict": verdict(scores, weights, ends, [float(time[one.frame]) for one in intervals]),
        "frames": len(time),
        "seconds": float(weights.sum()),
        "rules": dataclasses.asdict(scores.rules),
        "profile": scores.postures.profile,
        "unmeasured": list(scores.unmeasured),
        "assumed": list(scores.assumed),
        "warnings": scores.postures.quality.notes(),
        "accounts": list(scores.postures.quality.accounts),
        "reba": dataclasses.asdict(_agreed(column(scores, "reba"), weights, low_end, high_end)),
        "range": {
            "mean_low": low_end.mean,
            "mean_high": high_end.mean,
            "median_low": low_end.median,
            "median_high": high_end.median,
            "p90_low": low_end.p90,
            "p90_high": high_end.p90,
            "max_low": low_end.max,
            "max_high": high_end.max,
        },
        "held": {"seconds": HELD_SECONDS, "reba": sustained(scores), "reba_high": sustained(scores, end="high")},
        "action_levels": shares,
        "action_level_undetermined": undetermined,
        "sides": {
            side: {
                "mean": distribution(column(scores, f"reba_{side}"), weights).mean,
                "action_levels": _side_shares(scores, side, weights),
            }
            for side in ("left", "right")
        },
        "worst": worst,
        "parts": {name: _part(column(scores, name), weights) for name in PARTS},
        "activity": scores.activity_causes,
        **({} if (expected := expected_exposure(scores, weights)) is None else {"distribution": expected}),
    }


def _agreed(reba: Array, weights: Array, low: Distribution, high: Distribution) -> Distribution:
    """Return the statistics of a score; where some frames are open, only those that both ends of the range agree on.

    The frames that happen to be determined are no sample of the others: their mean can even lie outside the range.
    """
    if not np.isnan(reba).any():
        return distribution(reba, weights)
    ends = {name: (getattr(low, name), getattr(high, name)) for name in ("mean", "median", "p90", "max")}
    return Distribution(**{name: a if a == b else None for name, (a, b) in ends.items()})


def _part(points: Array, weights: Array) -> dict[str, float | None]:
    """Return the mean of a part score over the frames that determine it, and their share of the time."""
    known = float(weights[~np.isnan(points)].sum() / (weights.sum() or 1.0))
    return {"mean": distribution(points, weights).mean, "determined": known}


def _side_shares(scores: ScoreTable, side: str, weights: Array) -> dict[str, float]:
    reba = column(scores, f"reba_{side}")
    levels = np.where(np.isnan(reba), np.nan, LEVEL_OF[np.nan_to_num(reba).astype(np.int64)])
    return _level_times(levels, weights / (weights.sum() or 1.0))


@accepts(PostureError, a=SCORES, b=SCORES)
def compare(a: ScoreTable, b: ScoreTable) -> dict[str, Any]:
    """Return the summaries of two recordings and b minus a for every figure both have.

    Part means are compared over frames in which they are known; a figure that one side lacks has no difference.
    """
    first, second = summarise(a), summarise(b)
    difference = {
        "reba": {key: _minus(first["reba"][key], second["reba"][key]) for key in first["reba"]},
        "range": {key: _minus(first["range"][key], second["range"][key]) for key in first["range"]},
        "held": _minus(first["held"]["reba"], second["held"]["reba"]),
        "action_levels": {
            level: _minus(first["action_levels"][level], second["action_levels"][level])
            for level in first["action_levels"]
        },
        "action_level_undetermined": _minus(first["action_level_undetermined"], second["action_level_undetermined"]),
        "parts": {part: _minus(first["parts"][part]["mean"], second["parts"][part]["mean"]) for part in PARTS},
    }
    only = {
        "only_a_unmeasured": sorted(set(a.unmeasured) - set(b.unmeasured)),
        "only_b_unmeasured": sorted(set(b.unmeasured) - set(a.unmeasured)),
    }
    return {"a": first, "b": second, "difference": difference, **only}


def _minus(a: float | None, b: float | None) -> float | None:
    return None if a is None or b is None else b - a
