"""Content of the section on measurement error: the error of every angle, and what it implies for levels and scores."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from reba.analysis.wording import percent, span
from reba.method.distribution import SHARE
from reba.method.measurement_error import MeasurementError
from reba.method.tables import ACTION_LEVEL_FROM, UNKNOWN
from reba.posture.columns import COLUMNS_OF, INDEX
from reba.report.series import Curve
from reba.report.summary import RecordingSummary


@dataclass(frozen=True)
class AngleError:
    """The error of one angle, of both sides where these are alike.

    Attributes:
        sd, bias: [deg] as text.
        source: where the numbers come from, "" if not given.
        chosen: whether they are a choice because no source gives them.
    """

    name: str
    sd: str
    bias: str
    source: str
    chosen: bool


@dataclass(frozen=True)
class ReachedLevel:
    """Share of time at an action level or above: as scored, and expected under the error; ranges as text."""

    level: int
    scored: str
    expected: str


@dataclass(frozen=True)
class ErrorSection:
    """The section on measurement error.

    Attributes:
        bars: (label, [(level, share of time)]) expected shares, lowest level first.
        curve: 95 % range and most likely score of every frame.
    """

    name: str
    title: str
    sentences: tuple[str, ...]
    reached: tuple[ReachedLevel, ...]
    bars: tuple[tuple[str, tuple[tuple[int, float], ...]], ...]
    angles: tuple[AngleError, ...]
    curve: Curve


def error_section(record: RecordingSummary) -> ErrorSection | None:
    """Return the section of a recording, None if no measurement error was given or there are no frames."""
    error, implied = record.scores.error, record.scores.distribution
    if error is None or implied is None or not record.frames:
        return None
    expected = record.summary["distribution"]
    likely = np.where(implied.reba_likely == UNKNOWN, np.nan, implied.reba_likely)
    curve = Curve(implied.reba_95_low.astype(np.float64), implied.reba_95_high.astype(np.float64), likely)
    return ErrorSection(
        error.name,
        error.title,
        _sentences(expected, record.fully_measured),
        _reached(record, expected),
        tuple(
            (f"Expected{label}", tuple(_shares(expected, end)))
            for end, label in (
                (("low", ""),)
                if record.fully_measured
                else (("low", ", unmeasured neutral"), ("high", ", unmeasured at worst"))
            )
        ),
        _angles(error),
        curve,
    )


def _sentences(expected: dict[str, Any], measured: bool) -> tuple[str, ...]:
    levels = {level: _ends(ends) for level, ends in expected["at_least"].items()}
    mean = span(expected["mean_low"], expected["mean_high"], 1)
    sentences = [
        f"If each angle is off by an independent normal error of the size below, REBA is {mean} on average over time, "
        f"and with a probability of {levels['2']} at medium risk or above, of {levels['3']} at high risk or above "
        "(probabilities averaged over time).",
        f"In a frame, REBA lies with a probability of {percent(SHARE)} in a range that is {expected['mean_width']:.1f} "
        f"points wide on average.{_agreement(expected['likely_is_reba'], measured)}",
        "Errors raise scores more often than they lower them where an angle is close to neutral, because REBA counts "
        "departures in either direction.",
    ]
    if not measured:
        sentences.append("Ranges of probabilities are due to unmeasured angles: neutral, and at their worst.")
    if expected["approximate"]:
        sentences.append(f"Approximate: {expected['approximate']}.")
    return tuple(sentences)


def _agreement(share: float | None, measured: bool) -> str:
    """Return for how long the score is the most likely one, as a sentence."""
    if share is None:
        return ""
    where = "" if measured else ", where both are determined"
    return f" The score is also the most likely one for {percent(share)} of the time{where}."


def _ends(ends: dict[str, float]) -> str:
    first, second = percent(ends["low"]), percent(ends["high"])
    return first if first == second else f"{first} to {second}"


def _shares(expected: dict[str, Any], end: str) -> list[tuple[int, float]]:
    reached = [1.0, *(ends[end] for ends in expected["at_least"].values()), 0.0]
    return [(level, reached[level] - reached[level + 1]) for level in range(len(reached) - 1)]


def _reached(record: RecordingSummary, expected: dict[str, Any]) -> tuple[ReachedLevel, ...]:
    rows = []
    for level, ends in reversed(expected["at_least"].items()):
        scored = {
            end: float(record.weights[values >= ACTION_LEVEL_FROM[int(level)]].sum() / record.seconds)
            for end, values in (("low", record.curves["reba"].low), ("high", record.curves["reba"].high))
        }
        rows.append(ReachedLevel(int(level), _ends(scored), _ends(ends)))
    return tuple(rows)


def _angles(error: MeasurementError) -> tuple[AngleError, ...]:
    rows = []
    for name, columns in COLUMNS_OF.items():
        places = [INDEX[column] for column in columns]
        alike = len({(error.sd[at], error.bias[at], error.sources[at]) for at in places}) == 1
        for column, at in list(zip(columns, places, strict=True))[: 1 if alike else None]:
            title = (name if alike else column).replace("_", " ").replace("lower arm", "elbow")
            rows.append(
                AngleError(title, f"{error.sd[at]:g}", f"{error.bias[at]:g}", error.sources[at], column in error.chosen)
            )
    return tuple(rows)
