"""Score curves for plots: ranges per side, gaps, and as few points as a screen can show.

An hour at 100 Hz has 360,000 frames. A plot keeps, for every column of a screen, the frames with the lowest and the
highest score in it, so nothing that was reached is lost and every point shown is a frame that was recorded.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from reba.analysis.exposure import column, durations
from reba.arrays import Array, Flags
from reba.method.scoring import ScoreArrays, score_angles
from reba.scores import Scores

BUCKETS: Final = 2000
"""Columns that a time axis is divided into."""
DRAW_ALL: Final = 3
"""Frames per column up to which all of them are drawn."""
VIEWS: Final[dict[str, str]] = {"reba": "Total", "reba_left": "Left arm", "reba_right": "Right arm"}
"""Totals of the score table that are shown, with their titles."""


@dataclass(frozen=True)
class ScoreRange:
    """Every score of n frames with unmeasured angles at their best (`low`) and at their worst (`high`)."""

    low: ScoreArrays
    high: ScoreArrays


@dataclass(frozen=True)
class Curve:
    """One total over n frames: (n,) floats; `value` is NaN where undetermined, `low` and `high` hold its range."""

    low: Array
    high: Array
    value: Array


@dataclass(frozen=True)
class StepCurve:
    """Points of a curve that holds each value until the next point; k points.

    Attributes:
        x: (k,) [s] times of recorded frames.
        until: (k,) [s] how long the value holds; the end of the stretch for its last point.
        last: (k,) whether the point is the last one before a gap or the end.
        frame: (k,) row of the score table.
    """

    x: Array
    until: Array
    last: Flags
    frame: NDArray[np.int64]


def bounds(scores: Scores) -> ScoreRange:
    """Return both ends of the range of every score."""
    angles = scores.angles
    low = score_angles(angles, scores.factors, scores.rules, "neutral")
    complete = not np.isnan(angles).any()
    return ScoreRange(low, low if complete else score_angles(angles, scores.factors, scores.rules, "worst"))


def curve(scores: Scores, ends: ScoreRange, name: str) -> Curve:
    """Return one column of the score table with its range."""
    low, high = ends.low[name].astype(np.float64), ends.high[name].astype(np.float64)
    return Curve(low, high, column(scores, name))


def gaps(scores: Scores) -> list[tuple[float, float]]:
    """Return stretches without samples, (start, end) [s]: those the reader names and those the time column shows."""
    time = scores.time
    found = [gap for gap in scores.postures.quality.gaps if gap[1] > gap[0]]
    if len(time) > 1:
        broken = np.flatnonzero(np.diff(time) > durations(time)[:-1] + 1e-9)
        found += [(float(time[i]), float(time[i + 1])) for i in broken.tolist()]
    merged: list[tuple[float, float]] = []
    for start, end in sorted(found):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return merged


def steps(scores: Scores, curve: Curve, without: list[tuple[float, float]], buckets: int = BUCKETS) -> StepCurve:
    """Return the points of a curve: all frames, or the extremes of each bucket where there are more.

    Args:
        scores: of n frames.
        curve: the total to draw.
        without: gaps as from `gaps`; a stretch ends where one begins.
        buckets: columns of the time axis; at most six points are kept in each.
    """
    time, weights = scores.time, durations(scores.time)
    n = len(time)
    if not n:
        return StepCurve(time, time, np.zeros(0, bool), np.zeros(0, np.int64))
    starts = np.array([start for start, _ in without])
    # A frame whose successor lies behind the same gap start belongs to the stretch that ends there.
    stretch = np.searchsorted(starts, time, side="left")
    frames = np.arange(n)
    if n > DRAW_ALL * buckets:
        span = (time[-1] - time[0]) or 1.0
        bucket = np.minimum((time - time[0]) / span * buckets, buckets - 1).astype(np.int64)
        first = np.flatnonzero(np.append(True, (np.diff(bucket) != 0) | (np.diff(stretch) != 0)))
        ends = np.append(first[1:], n) - 1
        kept = [first, ends]
        for values in (curve.low, curve.high):
            kept += [_lowest(values, first, n), _lowest(-values, first, n)]
        frames = np.unique(np.concatenate(kept))
    last = np.append(np.diff(stretch[frames]) != 0, True)
    until = np.where(last, time[frames] + weights[frames], np.append(time[frames][1:], 0.0))
    return StepCurve(time[frames], until, last, frames)


def _lowest(values: Array, first: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Return the first frame with the lowest value in each bucket."""
    keyed = values.astype(np.int64) * n + np.arange(n)
    lowest: NDArray[np.int64] = np.minimum.reduceat(keyed, first) % n
    return lowest


def line(points: StepCurve, values: Array, shown: Flags) -> tuple[Array, Array]:
    """Return x and y of the shown stretches of a step line, NaN between them; each ends where its last value ends.

    Args:
        points: k points.
        values: (k,) values at the points.
        shown: (k,) which points belong to the line.
    """
    xs: list[Any] = []
    ys: list[Any] = []
    for a, b in _stretches(shown, points.last):
        xs += [points.x[a : b + 1], [points.until[b], np.nan]]
        ys += [values[a : b + 1], [values[b], np.nan]]
    return _joined(xs), _joined(ys)


def band(points: StepCurve, low: Array, high: Array, shown: Flags) -> tuple[Array, Array]:
    """Return closed polygons, NaN between them, around the area from `low` to `high` of each shown stretch."""
    xs: list[Any] = []
    ys: list[Any] = []
    for a, b in _stretches(shown, points.last):
        forth = np.column_stack([points.x[a : b + 1], points.until[a : b + 1]]).ravel()
        xs += [forth, forth[::-1], [np.nan]]
        ys += [np.repeat(high[a : b + 1], 2), np.repeat(low[a : b + 1], 2)[::-1], [np.nan]]
    return _joined(xs), _joined(ys)


def runs(points: StepCurve, flags: Flags, joined: float = 0.0) -> list[tuple[float, float]]:
    """Return (start, end) [s] of the stretches where a flag (k,) holds; those closer than `joined` [s] become one."""
    found: list[tuple[float, float]] = []
    for a, b in _stretches(flags, points.last):
        start, end = float(points.x[a]), float(points.until[b])
        if found and start - found[-1][1] <= joined:
            found[-1] = (found[-1][0], end)
        else:
            found.append((start, end))
    return found


def _stretches(shown: Flags, last: Flags) -> list[tuple[int, int]]:
    """Return first and last index of each stretch of shown points; a point before a gap ends one."""
    before = np.append(True, last[:-1] | ~shown[:-1]) if len(shown) else shown
    after = last | np.append(~shown[1:], True) if len(shown) else shown
    starts, stops = np.flatnonzero(shown & before), np.flatnonzero(shown & after)
    return list(zip(starts.tolist(), stops.tolist(), strict=True))


def _joined(pieces: list[Any]) -> Array:
    return np.concatenate(pieces)[:-1] if pieces else np.zeros(0)
