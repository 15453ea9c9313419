"""The comparison of two recordings: every figure of both and its difference, with what is not determined."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from reba.analysis.wording import both, percent, percentage_points, seconds, span
from reba.errors import join_names
from reba.method.tables import ACTION_LEVEL_FROM, ACTION_LEVELS, LEVEL_OF
from reba.report.labels import PARTS, body_parts
from reba.report.summary import RecordingSummary, seconds_of_levels

Ends = tuple[float, float]
"""Lowest and highest value that unmeasured angles leave."""


@dataclass(frozen=True)
class ComparedFigure:
    """One figure of both recordings and what it changes by, as text; `better`: 1 lower, -1 higher, 0 not certain."""

    name: str
    first: str
    second: str
    change: str
    better: int


def compared_figures(a: RecordingSummary, b: RecordingSummary) -> list[ComparedFigure]:
    """Return the rows of the comparison; a difference is the range over everything that is not determined."""
    if not (a.frames and b.frames):
        return []
    rows = []
    for key, name in (("p90", "90th percentile"), ("mean", "Mean"), ("median", "Median"), ("max", "Maximum")):
        ends = [(one.summary["range"][f"{key}_low"], one.summary["range"][f"{key}_high"]) for one in (a, b)]
        rows.append(_figure(f"REBA, {name.lower()}", ends[0], ends[1], _points if key == "mean" else span))
    high = f"Time at REBA {ACTION_LEVEL_FROM[3]} or more"
    # Seconds of recordings of different length are not judged: their share is.
    rows.append(_figure(high, _time_from(a), _time_from(b), _times, judged=False))
    rows.append(_figure(f"{high}, share", _share_from(a), _share_from(b), _percents, percentage_points))
    for level in reversed(range(len(ACTION_LEVELS))):
        name = f"At {ACTION_LEVELS[level][0]} risk"
        rows.append(_figure(name, _share_at(a, level), _share_at(b, level), _percents, percentage_points, judged=False))
    unknown = [(seconds_of_levels(one, "reba")[None] / one.seconds,) * 2 for one in (a, b)]
    rows.append(_figure("Not determined", unknown[0], unknown[1], _percents, percentage_points, judged=False))
    for part, title in PARTS.items():
        means = [
            tuple(float(np.average(end[part], weights=one.weights)) for end in (one.ends.low, one.ends.high))
            for one in (a, b)
        ]
        first, second = ((low, high) for low, high in means)
        rows.append(_figure(f"{title}, mean score", first, second, _points))
    return rows


def _time_from(one: RecordingSummary) -> Ends:
    curve = one.curves["reba"]
    low, high = (float(one.weights[end >= ACTION_LEVEL_FROM[3]].sum()) for end in (curve.low, curve.high))
    return low, high


def _share_from(one: RecordingSummary) -> Ends:
    low, high = _time_from(one)
    return low / one.seconds, high / one.seconds


def _share_at(one: RecordingSummary, level: int) -> Ends:
    """Return the share of time at an action level: where it is certain, and where it is possible."""
    curve = one.curves["reba"]
    low, high = (LEVEL_OF[np.asarray(end, np.intp)] for end in (curve.low, curve.high))
    certain, possible = (
        float(one.weights[frames].sum()) / one.seconds
        for frames in ((low == level) & (high == level), (low <= level) & (level <= high))
    )
    return certain, possible


def _points(low: float, high: float) -> str:
    return span(low, high, 2)


def _percents(low: float, high: float) -> str:
    return both(percent(low), percent(high))


def _times(low: float, high: float) -> str:
    return both(seconds(low), seconds(high))


def _figure(
    name: str,
    a: Ends,
    b: Ends,
    text: Callable[[float, float], str],
    change: Callable[[float, float], str] | None = None,
    *,
    judged: bool = True,
) -> ComparedFigure:
    """Return a row; `change` is the text of a difference where that of the figures does not fit it."""
    low, high = b[0] - a[1], b[1] - a[0]
    signs = [_signed(end, text) for end in (low, high)]
    same = text(0.0, 0.0) in signs  # also what rounds to no difference
    better = 0 if not judged or same or low <= 0 <= high else (1 if high < 0 else -1)
    difference = both(*signs) if change is None else change(low, high).replace("-", "−")
    return ComparedFigure(name, text(*a), text(*b), difference, better)


def _signed(value: float, text: Callable[[float, float], str]) -> str:
    shown = text(abs(value), abs(value))
    return shown if shown == text(0.0, 0.0) else f"{'+' if value > 0 else '−'}{shown}"


def differing(a: RecordingSummary, b: RecordingSummary) -> Iterator[str]:
    """Give what makes two recordings hard to compare, as sentences."""
    lacks = [set(one.scores.unmeasured) for one in (a, b)]
    for one, only in ((a, lacks[0] - lacks[1]), (b, lacks[1] - lacks[0])):
        if only:
            yield f"Not measured in {one.name} only: {join_names(body_parts(sorted(only)))}."
    if a.scores.rules != b.scores.rules:
        yield f"The rules differ: {a.scores.rules.name} and {b.scores.rules.name}."
    if (a.scores.error is None) != (b.scores.error is None):
        yield "Only one of them has a measurement error."
