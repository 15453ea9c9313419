"""Verdict, figures and worst intervals: what a reader of the report sees first."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from reba.analysis.exposure import HELD_SECONDS
from reba.analysis.wording import interval as lasting
from reba.analysis.wording import moment, percent, seconds, span
from reba.errors import join_names
from reba.method.tables import ACTION_LEVEL_FROM, LEVEL_OF, PART_MAXIMA
from reba.posture.columns import SIDES
from reba.posture.skeleton import SPOTS, VIEWS, Mark, stick_figure
from reba.report.labels import PARTS, action, body_parts, risk
from reba.report.summary import RecordingSummary

WHY_P90: Final = (
    "The headline is the time-weighted 90th percentile (p90): REBA is at or below it for 90 % of the recording. "
    "Single noisy frames change the maximum but not the 90th percentile, and the mean hides peaks that it shows."
)


@dataclass(frozen=True)
class Tile:
    """One number with its name and a short note."""

    name: str
    value: str
    note: str


@dataclass(frozen=True)
class Headline:
    """The headline of a recording.

    Attributes:
        verdict: how bad, for how long, when and why.
        p90: 90th percentile, a score or a range; "" without frames.
        levels: lowest and highest action level of the 90th percentile, with the names `risk` and `action`.
        because: reason of the range, "" for a single score.
        sentences: findings as text.
        tiles: further figures.
    """

    verdict: str
    p90: str
    levels: tuple[int, int]
    risk: str
    action: str
    because: str
    sentences: tuple[str, ...]
    tiles: tuple[Tile, ...]


def headline(record: RecordingSummary) -> Headline:
    """Return the headline of a recording."""
    verdict = record.summary["verdict"]["text"]
    if not record.frames:
        sentences = ("The recording contains no frames, so there is no score.",)
        return Headline(verdict, "", (0, 0), "not known", "", "", sentences, (_quality_tile(record),))
    ends = record.summary["range"]
    low, high = ends["p90_low"], ends["p90_high"]
    levels = int(LEVEL_OF[low]), int(LEVEL_OF[high])
    actions = list(dict.fromkeys(action(level) for level in levels))
    highest = record.sustained
    peak = f"single frames reach {span(ends['max_low'], ends['max_high'])}"
    tiles = (
        Tile(
            f"Highest score sustained for {HELD_SECONDS:g}\u00a0s",
            sustained_text(record),
            f"{risk(*highest) if highest[0] is not None else 'no score is sustained that long'}; {peak}",
        ),
        Tile("Mean over time", span(ends["mean_low"], ends["mean_high"], 1), _median(record)),
        Tile("High or very high", _share(*high_risk_share(record)), "share of time at REBA 8 or above"),
        Tile("Worse side", *worse_side(record)),
        Tile("Scored", seconds(record.seconds), f"{record.frames:,} frames at {record.rate:.4g} Hz"),
        _quality_tile(record),
    )
    return Headline(
        verdict,
        span(low, high),
        levels,
        risk(low, high),
        " or ".join(actions),
        range_reason(record),
        _sentences(record),
        tiles,
    )


def sustained_text(record: RecordingSummary) -> str:
    """Return the highest score sustained for a second, "none" where no score lasts that long."""
    return "none" if record.sustained[0] is None else span(*record.sustained)


def high_risk_share(record: RecordingSummary) -> tuple[float, float]:
    """Return the share of time at high or very high risk, at both ends of the range."""
    total = record.curves["reba"]
    first, second = (
        float(record.weights[end >= ACTION_LEVEL_FROM[3]].sum() / record.seconds) if record.seconds else 0.0
        for end in (total.low, total.high)
    )
    return first, second


def range_reason(record: RecordingSummary) -> str:
    """Return the reason why the totals are a range as a clause, "" if they are single scores."""
    if record.fully_measured:
        return ""
    unmeasured = body_parts(record.scores.unmeasured)
    if not unmeasured:
        return "some angles are missing for part of the time"
    verb = "was" if len(unmeasured) == 1 and not unmeasured[0].endswith("s") else "were"
    return f"{join_names(unmeasured)} {verb} not measured"


def worse_side(record: RecordingSummary) -> tuple[str, str]:
    """Return the arm that has the higher total for a longer time, and a note with the shares of time."""
    left, right = (record.curves[f"reba_{side}"].low for side in SIDES)
    higher = {
        "left": float(record.weights[left > right].sum() / record.seconds),
        "right": float(record.weights[right > left].sum() / record.seconds),
    }
    note = f"left higher {percent(higher['left'])} of the time, right {percent(higher['right'])}"
    note += ", else equal" if sum(higher.values()) < 1 - 1e-9 else ""
    note += "" if record.fully_measured else "; unmeasured angles neutral"
    if abs(higher["left"] - higher["right"]) < 0.005:
        return "both equal", note
    return ("left" if higher["left"] > higher["right"] else "right"), note


def _share(low: float, high: float) -> str:
    first, second = percent(low), percent(high)
    return first if first == second else f"{first} to {second}"


def _median(record: RecordingSummary) -> str:
    ends = record.summary["range"]
    return f"time-weighted; median {span(ends['median_low'], ends['median_high'])}"


def _quality_tile(record: RecordingSummary) -> Tile:
    return Tile("Data quality", record.quality_grade.letter, record.quality_grade.text)


def _sentences(record: RecordingSummary) -> tuple[str, ...]:
    ends = record.summary["range"]
    low, high = ends["p90_low"], ends["p90_high"]
    clause = range_reason(record)
    sentences = []
    if clause and low != high:
        sentences.append(f"REBA is a range because {clause}.")
    open_share = record.summary["action_level_undetermined"]
    if open_share > 0:
        sentences.append(f"For {percent(open_share)} of the time the action level is not determined.")
    if record.scores.missing != "range" and not record.fully_measured:
        fill = "neutral" if record.scores.missing == "neutral" else "worst"
        p90 = record.summary["reba"]["p90"]
        sentences.append(
            f"With unmeasured angles set to their {fill} values, as requested, p90 is {p90}; ranges are without that."
        )
    if not np.isfinite(record.rate):
        sentences.append("There is only one frame: durations and percentiles describe that frame alone.")
    return tuple(sentences)


@dataclass(frozen=True)
class WorstInterval:
    """One of the worst intervals.

    Attributes:
        number: from 1, as marked in the plot over time.
        start, end, time: of the interval and of its representative frame [s].
        lasting: from when to when, and how long, as text; `shown`: the time of the frame as text.
        sustained: score that every frame of the interval reaches.
        reba: score or range of the frame, with its action `levels` at both ends and the name of its `risk`.
        why: angles and factors with the most points.
        likely: what the measurement error implies for the frame, "" without one.
        svg: drawing of the posture; `printed` has two larger views for the first printed page.
    """

    number: int
    start: float
    end: float
    time: float
    lasting: str
    shown: str
    sustained: int
    reba: str
    levels: tuple[int, int]
    risk: str
    why: tuple[str, ...]
    likely: str
    svg: str
    printed: str


def worst_intervals(record: RecordingSummary) -> list[WorstInterval]:
    """Return the worst intervals, that with the highest score first."""
    return [_worst_interval(record, number, interval) for number, interval in enumerate(record.summary["worst"], 1)]


def _worst_interval(record: RecordingSummary, number: int, interval: dict[str, Any]) -> WorstInterval:
    scores, time = record.scores, interval["time"]
    frame = scores.frame_at(time)
    low, high = interval["reba_low"], interval["reba_high"]
    why = tuple(interval["why"])
    label = f"Stick figure at {time:.1f} s, REBA {span(low, high)}. " + "; ".join(why)
    support = np.atleast_1d(np.asarray(scores.factors.support))
    sitting = str(support[0] if len(support) == 1 else support[frame]).strip().lower() == "sitting"
    return WorstInterval(
        number=number,
        start=interval["start"],
        end=interval["end"],
        time=time,
        lasting=lasting(interval["start"], interval["end"]),
        shown=moment(time, 1 if interval["end"] - interval["start"] >= 0.1 else 2),
        sustained=interval["held"],
        reba=span(low, high),
        levels=(int(LEVEL_OF[low]), int(LEVEL_OF[high])),
        risk=risk(low, high),
        why=why,
        likely=_likely(interval.get("distribution")),
        svg=stick_figure(scores.angles[frame], _marks(record, frame), label, sitting),
        printed=stick_figure(scores.angles[frame], _marks(record, frame), label, sitting, (VIEWS[0], VIEWS[-1])),
    )


def _likely(chances: dict[str, Any] | None) -> str:
    """Return the distribution of one frame as text."""
    if chances is None:
        return ""
    likely = chances["reba_likely"]
    first = "With measurement error the most likely score is " + ("not determined" if likely is None else f"{likely}")
    both = span(chances["reba_95_low"], chances["reba_95_high"])
    return f"{first}; REBA is {both} with a probability of 95 %."


def _marks(record: RecordingSummary, frame: int) -> dict[str, Mark]:
    """Return part -> mark for the joints of the drawing: the known part scores above the lowest one."""
    marks = {}
    for name in PARTS:
        if name not in SPOTS:
            continue
        low, high = int(record.ends.low[name][frame]), int(record.ends.high[name][frame])
        side = next((side for side in SIDES if name.endswith(side)), "")
        highest = PART_MAXIMA[name.removesuffix(f"_{side}")]
        if low > 1:
            marks[name] = Mark(f"{low}" if low == high else f"{low}+", (low - 1) / (highest - 1))
    return marks
