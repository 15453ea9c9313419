"""The comparison of two recordings: every figure of both and its difference, with what is not determined."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from reba.analysis.wording import TIE, both, percent, percentage_points, seconds, share_digits
from reba.errors import join_names
from reba.method.tables import ACTION_LEVEL_FROM, ACTION_LEVELS, LEVEL_OF
from reba.report.labels import PARTS, body_parts
from reba.report.summary import RecordingSummary, seconds_of_levels

Ends = tuple[float, float]
"""Lowest and highest value that unmeasured angles leave."""
MINUS: Final = "\N{MINUS SIGN}"


@dataclass(frozen=True)
class ComparedFigure:
    """One figure of both recordings and what it changes by, as text; `better`: 1 lower, -1 higher, 0 not certain."""

    name: str
    first: str
    second: str
    change: str
    better: int


@dataclass(frozen=True)
class _Kind:
    """How the numbers of a row are written.

    Attributes:
        text: of a number.
        shown: the number that the text says; differences are those of these, as readers work them out.
        change: text of both ends of a difference, where that of the numbers does not fit.
    """

    text: Callable[[float], str]
    shown: Callable[[float], float]
    change: Callable[[float, float], str] | None = None


def _rounded(digits: int) -> _Kind:
    return _Kind(lambda value: f"{value:.{digits}f}", lambda value: round(value, digits))


def _seconds_shown(value: float) -> float:
    value += TIE
    return round(value, 1) if value < 60 else float(int(value)) if value < 7200 else 60.0 * (int(value) // 60)


_TIMES: Final = _Kind(seconds, _seconds_shown)


def _shares(*ends: Ends) -> _Kind:
    digits = share_digits(*(share for both_ends in ends for share in both_ends))
    return _Kind(
        partial(percent, digits=digits),
        lambda share: round(share + TIE / 1e4, digits + 2),
        lambda low, high: percentage_points(low, high, digits).replace("-", MINUS),
    )


def compared_figures(a: RecordingSummary, b: RecordingSummary) -> list[ComparedFigure]:
    """Return the rows of the comparison; a difference is the range over everything that is not determined."""
    if not (a.frames and b.frames):
        return []
    rows = []
    for key, name in (("p90", "90th percentile"), ("mean", "Mean"), ("median", "Median"), ("max", "Maximum")):
        ends = [(one.summary["range"][f"{key}_low"], one.summary["range"][f"{key}_high"]) for one in (a, b)]
        rows.append(_figure(f"REBA, {name.lower()}", ends[0], ends[1], _rounded(2 if key == "mean" else 0)))
    high = f"Time at REBA {ACTION_LEVEL_FROM[3]} or more"
    # Seconds of recordings of different length are not judged: their share is.
    rows.append(_figure(high, _time_from(a), _time_from(b), _TIMES, judged=False))
    shares = _share_from(a), _share_from(b)
    rows.append(_figure(f"{high}, share", *shares, _shares(*shares)))
    for level in reversed(range(len(ACTION_LEVELS))):
        shares = _share_at(a, level), _share_at(b, level)
        rows.append(_figure(f"At {ACTION_LEVELS[level][0]} risk", *shares, _shares(*shares), judged=False))
    unknown = [(seconds_of_levels(one, "reba")[None] / one.seconds,) * 2 for one in (a, b)]
    rows.append(_figure("Not determined", unknown[0], unknown[1], _shares(*unknown), judged=False))
    for part, title in PARTS.items():
        means = [
            tuple(float(np.average(end[part], weights=one.weights)) for end in (one.ends.low, one.ends.high))
            for one in (a, b)
        ]
        first, second = ((low, high) for low, high in means)
        rows.append(_figure(f"{title}, mean score", first, second, _rounded(2)))
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


def _figure(name: str, a: Ends, b: Ends, kind: _Kind, *, judged: bool = True) -> ComparedFigure:
    """Return a row; of a difference that may be none it is not said which is better."""
    (a_low, a_high), (b_low, b_high) = ((kind.shown(low), kind.shown(high)) for low, high in (a, b))
    low, high = b_low - a_high, b_high - a_low
    signs = [_signed(end, kind.text) for end in (low, high)]
    same = kind.text(0.0) in signs
    better = 0 if not judged or same or low <= 0 <= high else (1 if high < 0 else -1)
    first, second = (both(*map(kind.text, ends)) for ends in (a, b))
    return ComparedFigure(name, first, second, both(*signs) if kind.change is None else kind.change(low, high), better)


def _signed(value: float, text: Callable[[float], str]) -> str:
    shown = text(abs(value))
    return shown if shown == text(0.0) else f"{'+' if value > 0 else MINUS}{shown}"


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
