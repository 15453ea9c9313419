"""The verdict: the few numbers that stand first, in plain words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from reba.analysis.exposure import HELD_SECONDS
from reba.analysis.improve import Improvement, improve_frame, improve_frames, worst_interval
from reba.errors import join_names
from reba.method.tables import ACTION_LEVEL_FROM, ACTION_LEVELS, LEVEL_OF, PART_MAXIMA
from reba.posture.columns import SIDES
from reba.posture.skeleton import SPOTS, Mark, stick_figure
from reba.report.labels import PARTS, action, body_parts, percent, risk, seconds, span
from reba.report.sections import PartContribution
from reba.report.summary import RecordingSummary

NOTABLE: Final = 0.1
"""Effect of a part on the mean REBA from which the verdict names it."""
WHY_P90: Final = (
    "The headline is the 90th percentile of time (p90): REBA is at or below it for nine tenths of the recording. "
    "Unlike the maximum it is not moved by single flickering frames, and unlike the mean it does not hide the peaks."
)


@dataclass(frozen=True)
class Tile:
    """One number with its name and a short note."""

    name: str
    value: str
    note: str


@dataclass(frozen=True)
class Headline:
    """What stands first.

    Attributes:
        p90: the headline score or range; "" without frames.
        levels: lowest and highest action level of the headline.
        risk, action: their words.
        because: why there is a range, "" where there is none.
        sentences: the findings in plain words.
        tiles: the other numbers.
    """

    p90: str
    levels: tuple[int, int]
    risk: str
    action: str
    because: str
    sentences: tuple[str, ...]
    tiles: tuple[Tile, ...]


def verdict(record: RecordingSummary, effects: Sequence[PartContribution]) -> Headline:
    """Return the verdict on a recording.

    Args:
        record: the recording.
        effects: what each part adds, largest first.
    """
    if not record.frames:
        nothing = ("The recording holds no frames, so there is nothing to score.",)
        return Headline("", (0, 0), "not known", "", "", nothing, (_quality(record),))
    ends = record.summary["range"]
    low, high = ends["p90_low"], ends["p90_high"]
    levels = int(LEVEL_OF[low]), int(LEVEL_OF[high])
    actions = list(dict.fromkeys(action(level) for level in levels))
    worst = record.sustained
    demanding = demanding_time(record)
    tiles = (
        Tile(
            f"Worst score held for {HELD_SECONDS:g} s",
            span(*worst),
            f"{risk(*worst)}; single frames reach {span(ends['max_low'], ends['max_high'])}"
            if worst[0] is not None
            else f"nothing is held that long; single frames reach {span(ends['max_low'], ends['max_high'])}",
        ),
        Tile("Mean over time", span(ends["mean_low"], ends["mean_high"], 1), _median(record)),
        Tile("High or very high", _share(*demanding), "share of time at REBA 8 or above"),
        Tile("Worse side", *worse_side(record)),
        Tile("Scored", seconds(record.seconds), f"{record.frames:,} frames at {record.rate:.4g} Hz"),
        _quality(record),
    )
    return Headline(
        span(low, high),
        levels,
        risk(low, high),
        " or ".join(actions),
        reason(record),
        _sentences(record, effects),
        tiles,
    )


def demanding_time(record: RecordingSummary) -> tuple[float, float]:
    """Return the share of time at high or very high risk, at both ends of the range."""
    total = record.curves["reba"]
    first, second = (
        float(record.weights[end >= ACTION_LEVEL_FROM[3]].sum() / record.seconds) if record.seconds else 0.0
        for end in (total.low, total.high)
    )
    return first, second


def reason(record: RecordingSummary) -> str:
    """Return why the totals are a range, as a clause; "" where they are none."""
    if record.measured:
        return ""
    unmeasured = body_parts(record.scores.unmeasured)
    if not unmeasured:
        return "some angles are missing for part of the time"
    verb = "was" if len(unmeasured) == 1 and not unmeasured[0].endswith("s") else "were"
    return f"{join_names(unmeasured)} {verb} not measured"


def worse_side(record: RecordingSummary) -> tuple[str, str]:
    """Return which arm gives the higher total more often, and how often."""
    left, right = (record.curves[f"reba_{side}"].low for side in SIDES)
    higher = {
        "left": float(record.weights[left > right].sum() / record.seconds),
        "right": float(record.weights[right > left].sum() / record.seconds),
    }
    note = f"left higher {percent(higher['left'])} of the time, right {percent(higher['right'])}, else equal"
    note += "" if record.measured else "; unmeasured angles neutral"
    if abs(higher["left"] - higher["right"]) < 0.005:
        return "both alike", note
    return ("left" if higher["left"] > higher["right"] else "right"), note


def _share(low: float, high: float) -> str:
    first, second = percent(low), percent(high)
    return first if first == second else f"{first} to {second}"


def _median(record: RecordingSummary) -> str:
    ends = record.summary["range"]
    return f"time-weighted; median {span(ends['median_low'], ends['median_high'])}"


def _quality(record: RecordingSummary) -> Tile:
    return Tile("Data quality", record.grade.letter, record.grade.text)


def _sentences(record: RecordingSummary, effects: Sequence[PartContribution]) -> tuple[str, ...]:
    ends = record.summary["range"]
    low, high = ends["p90_low"], ends["p90_high"]
    clause = reason(record)
    where = f"between {low} and {high}" if low != high else f"{low}"
    found = [
        f"For nine tenths of the time REBA is {'at most a score ' if low != high else ''}{where}"
        f"{'' if low != high else ' or lower'} ({risk(low, high)} risk)"
        + (f": the range is there because {clause}." if clause and low != high else ".")
    ]
    longest = max(range(5), key=lambda level: record.summary["action_levels"][str(level)])
    share = record.summary["action_levels"][str(longest)]
    if share > 0:
        found.append(
            f"{percent(share)} of the time is at {ACTION_LEVELS[longest][0]} risk, more than at any other level."
        )
    open_share = record.summary["action_level_undetermined"]
    if open_share > 0:
        found.append(f"For {percent(open_share)} of the time the action level is not determined.")
    if record.scores.missing != "range" and not record.measured:
        taken = "neutral" if record.scores.missing == "neutral" else "at their worst"
        p90 = record.summary["reba"]["p90"]
        found.append(f"With unmeasured angles taken as {taken}, as asked for, p90 is {p90}; the ranges hold without.")
    if effects and effects[0].drop >= NOTABLE:
        first = effects[0]
        found.append(
            f"Largest driver: {first.title.lower()}. At the lowest score throughout, the mean would fall from "
            f"{first.mean + first.drop:.1f} to {first.mean:.1f}"
            + ("." if record.measured else " (unmeasured angles neutral).")
        )
    if not np.isfinite(record.rate):
        found.append("There is only one frame: durations and percentiles stand for that frame alone.")
    return tuple(found)


GOALS: Final[dict[str, str]] = {
    "least movement": "Least movement",
    "load only": "Load alone",
    "coupling only": "Grip alone",
}
"""Goals of `reba.analysis.improve` that are shown, with their titles."""


@dataclass(frozen=True)
class Worst:
    """One of the worst intervals.

    Attributes:
        number: from 1, as marked in the plot over time.
        start, end, time: [s] of the interval and of the frame that stands for it.
        length: in words.
        held: score that is held or exceeded.
        reba: score or range of the frame.
        levels: action levels of the frame's range.
        risk: in words.
        why: what gives the most points.
        changes: (goal, change in words).
        svg: the posture.
    """

    number: int
    start: float
    end: float
    time: float
    length: str
    held: int
    reba: str
    levels: tuple[int, int]
    risk: str
    why: tuple[str, ...]
    changes: tuple[tuple[str, str], ...]
    svg: str


def worst(record: RecordingSummary) -> list[Worst]:
    """Return the worst intervals, highest score first."""
    return [_one(record, number, interval) for number, interval in enumerate(record.summary["worst"], 1)]


def worst_minute(record: RecordingSummary) -> tuple[float, float, tuple[tuple[str, str], ...]] | None:
    """Return start and end [s] of the worst minute and the changes that lower it in every one of its frames."""
    if not record.frames:
        return None
    frames = worst_interval(record.scores)
    first, last = int(frames[0]), int(frames[-1])
    time = record.scores.time
    changes = _changes(improve_frames(record.scores, frames))
    return float(time[first]), float(time[last] + record.weights[last]), changes


def _one(record: RecordingSummary, number: int, interval: dict[str, Any]) -> Worst:
    scores, time = record.scores, interval["time"]
    frame = scores.frame_at(time)
    low, high = interval["reba_low"], interval["reba_high"]
    why = tuple(interval["why"])
    label = f"Stick figure at {time:.1f} s, REBA {span(low, high)}. " + "; ".join(why)
    support = np.atleast_1d(np.asarray(scores.factors.support))
    sitting = str(support[0] if len(support) == 1 else support[frame]).strip().lower() == "sitting"
    return Worst(
        number=number,
        start=interval["start"],
        end=interval["end"],
        time=time,
        length=seconds(interval["end"] - interval["start"]),
        held=interval["held"],
        reba=span(low, high),
        levels=(int(LEVEL_OF[low]), int(LEVEL_OF[high])),
        risk=risk(low, high),
        why=why,
        changes=_changes(improve_frame(scores, frame)),
        svg=stick_figure(scores.angles[frame], _marks(record, frame), label, sitting),
    )


def _marks(record: RecordingSummary, frame: int) -> dict[str, Mark]:
    """Return the part scores above their lowest, as far as they are known, for the joints of the figure."""
    marks = {}
    for name in PARTS:
        if name not in SPOTS:
            continue
        low, high = int(record.ends.low[name][frame]), int(record.ends.high[name][frame])
        side = next((side for side in SIDES if name.endswith(side)), "")
        most = PART_MAXIMA[name.removesuffix(f"_{side}")]
        if low > 1:
            marks[name] = Mark(f"{low}" if low == high else f"{low}+", (low - 1) / (most - 1))
    return marks


def _changes(improvements: list[Improvement]) -> tuple[tuple[str, str], ...]:
    return tuple((GOALS[one.goal], one.text()) for one in improvements if one.goal in GOALS)
