"""Score curves for plots: ranges per side, gaps, and min-max decimation.

One hour at 100 Hz has 360,000 frames. Of each of `BUCKETS` equal parts of the time axis a plot keeps the frames with
the lowest and the highest score, so every extreme is shown and every point is a recorded frame.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from reba.analysis.exposure import column, durations
from reba.analysis.score_table import ScoreTable
from reba.arrays import Array, Flags
from reba.method.scoring import ScoreArrays, score_angles

BUCKETS: Final = 2000
"""Parts of a time axis for decimation; about the pixels of a wide screen."""
DRAW_ALL: Final = 3
"""Frames per part up to which all frames are drawn: decimation keeps up to six points per part."""
VIEWS: Final[dict[str, str]] = {"reba": "Total", "reba_left": "Left arm", "reba_right": "Right arm"}
"""Totals of the score table that are shown -> their titles."""

PARTS_OF_MEANS: Final = 150
"""Equal parts of the time of a recording whose means are drawn where a curve changes too often to be seen itself."""


@dataclass(frozen=True)
class ScoreRange:
    """Every score of n frames with unmeasured angles at their best (`low`) and at their worst (`high`)."""

    low: ScoreArrays
    high: ScoreArrays


@dataclass(frozen=True)
class Curve:
    """One total over n frames: (n,) scores; `value` is NaN where undetermined, `low` and `high` are its range."""

    low: Array
    high: Array
    value: Array


@dataclass(frozen=True)
class StepCurve:
    """k points of a piecewise constant curve.

    Attributes:
        x: (k,) times of recorded frames [s].
        until: (k,) times at which the values end [s]; before a gap the end of the last frame.
        last: (k,) true for the last point before a gap or the end.
        frame: (k,) rows of the score table.
    """

    x: Array
    until: Array
    last: Flags
    frame: NDArray[np.int64]


def score_range(scores: ScoreTable) -> ScoreRange:
    """Return both ends of the range of every score."""
    angles = scores.angles
    low = score_angles(angles, scores.factors, scores.rules, "neutral")
    complete = not np.isnan(angles).any()
    return ScoreRange(low, low if complete else score_angles(angles, scores.factors, scores.rules, "worst"))


def score_curve(scores: ScoreTable, ends: ScoreRange, name: str) -> Curve:
    """Return one column of the score table with its range."""
    low, high = ends.low[name].astype(np.float64), ends.high[name].astype(np.float64)
    return Curve(low, high, column(scores, name))


def gaps_of(scores: ScoreTable) -> list[tuple[float, float]]:
    """Return intervals without samples, (start, end) [s]: those of the reader and those in the time column, merged."""
    time = scores.time
    gaps = [gap for gap in scores.postures.quality.gaps if gap[1] > gap[0]]
    if len(time) > 1:
        before = np.flatnonzero(np.diff(time) > durations(time)[:-1] + 1e-9)
        gaps += [(float(time[i]), float(time[i + 1])) for i in before.tolist()]
    merged: list[tuple[float, float]] = []
    for start, end in sorted(gaps):
        if merged and start <= merged[-1][1]:
            merged[-1] = (merged[-1][0], max(end, merged[-1][1]))
        else:
            merged.append((start, end))
    return merged


def steps(scores: ScoreTable, curve: Curve, gaps: list[tuple[float, float]], buckets: int = BUCKETS) -> StepCurve:
    """Return the points of a curve: all frames, or of long recordings the extremes of each bucket.

    Args:
        gaps: as from `gaps_of`; the curve is interrupted there.
        buckets: parts of the time axis; at most six points are kept in each.
    """
    time, weights = scores.time, durations(scores.time)
    n = len(time)
    if not n:
        return StepCurve(time, time, np.zeros(0, bool), np.zeros(0, np.int64))
    starts = np.array([start for start, _ in gaps])
    # A frame at the start of a gap is the last one of the piece before the gap.
    piece = np.searchsorted(starts, time, side="left")
    frames = np.arange(n)
    if n > DRAW_ALL * buckets:
        span = (time[-1] - time[0]) or 1.0
        bucket = np.minimum((time - time[0]) / span * buckets, buckets - 1).astype(np.int64)
        first = np.flatnonzero(np.append(True, (np.diff(bucket) != 0) | (np.diff(piece) != 0)))
        ends = np.append(first[1:], n) - 1
        extremes = [first, ends]
        for values in (curve.low, curve.high):
            extremes += [_lowest(values, first, n), _lowest(-values, first, n)]
        frames = np.unique(np.concatenate(extremes))
    last = np.append(np.diff(piece[frames]) != 0, True)
    until = np.where(last, time[frames] + weights[frames], np.append(time[frames][1:], 0.0))
    return StepCurve(time[frames], until, last, frames)


def _lowest(values: Array, first: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Return the first frame with the lowest value in each bucket."""
    keyed = values.astype(np.int64) * n + np.arange(n)
    lowest: NDArray[np.int64] = np.minimum.reduceat(keyed, first) % n
    return lowest


@dataclass(frozen=True)
class PartMeans:
    """Time-weighted means of both ends of a curve in equal parts of its time; NaN in a part without frames.

    Attributes:
        edges: (k + 1,) ends of the parts [s].
        low, high: (k,) means.
    """

    edges: Array
    low: Array
    high: Array


def part_means(scores: ScoreTable, curve: Curve, parts: int) -> PartMeans:
    """Return the means of a curve, which has frames; a frame counts where it begins."""
    time, weights = scores.time, durations(scores.time)
    edges = np.linspace(time[0], time[-1] + weights[-1], parts + 1)
    part = np.clip(np.searchsorted(edges, time, side="right") - 1, 0, parts - 1)
    total = np.bincount(part, weights, parts)
    low, high = (np.bincount(part, weights * end, parts) for end in (curve.low, curve.high))
    with np.errstate(invalid="ignore"):
        return PartMeans(edges, low / total, high / total)


def changes(low: Array, high: Array) -> int:
    """Return how often a curve with a range changes."""
    return int(np.count_nonzero((np.diff(low) != 0) | (np.diff(high) != 0)))


def line(points: StepCurve, values: Array, shown: Flags) -> tuple[Array, Array]:
    """Return x [s] and y of a step line through the points `shown` (k,), with NaN between its pieces.

    A piece ends at the end of its last value; `values` (k,) belong to the points.
    """
    xs: list[Any] = []
    ys: list[Any] = []
    for a, b in _pieces(shown, points.last):
        xs += [points.x[a : b + 1], [points.until[b], np.nan]]
        ys += [values[a : b + 1], [values[b], np.nan]]
    return _joined(xs), _joined(ys)


def band(points: StepCurve, low: Array, high: Array, shown: Flags) -> tuple[Array, Array]:
    """Return x [s] and y of closed polygons from `low` to `high` of the shown points, with NaN between polygons."""
    xs: list[Any] = []
    ys: list[Any] = []
    for a, b in _pieces(shown, points.last):
        forth = np.column_stack([points.x[a : b + 1], points.until[a : b + 1]]).ravel()
        xs += [forth, forth[::-1], [np.nan]]
        ys += [np.repeat(high[a : b + 1], 2), np.repeat(low[a : b + 1], 2)[::-1], [np.nan]]
    return _joined(xs), _joined(ys)


def flag_intervals(points: StepCurve, flags: Flags, max_pause: float = 0.0) -> list[tuple[float, float]]:
    """Return (start, end) [s] of the intervals in which a flag (k,) is true, bridging pauses up to `max_pause` [s]."""
    intervals: list[tuple[float, float]] = []
    for a, b in _pieces(flags, points.last):
        start, end = float(points.x[a]), float(points.until[b])
        if intervals and start - intervals[-1][1] <= max_pause:
            intervals[-1] = (intervals[-1][0], end)
        else:
            intervals.append((start, end))
    return intervals


def _pieces(shown: Flags, last: Flags) -> list[tuple[int, int]]:
    """Return first and last index of each run of shown points; a point before a gap ends a run."""
    before = np.append(True, last[:-1] | ~shown[:-1]) if len(shown) else shown
    after = last | np.append(~shown[1:], True) if len(shown) else shown
    starts, stops = np.flatnonzero(shown & before), np.flatnonzero(shown & after)
    return list(zip(starts.tolist(), stops.tolist(), strict=True))


def _joined(pieces: list[Any]) -> Array:
    return np.concatenate(pieces)[:-1] if pieces else np.zeros(0)
