"""The worst intervals: when, how long, why, and what would lower them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from reba.improve import Improvement, improve_frame, improve_frames, worst_stretch
from reba.posture import SIDES
from reba.report.phrases import risk, seconds, span
from reba.report.recording import Recording
from reba.report.stickfigure import SPOTS, Mark, stick_figure
from reba.report.words import PARTS
from reba.tables import LEVEL_OF, PART_MAXIMA

GOALS: Final[dict[str, str]] = {
    "least movement": "Least movement",
    "load only": "Load alone",
    "coupling only": "Grip alone",
}
"""Goals of `reba.improve` that are shown, with their titles."""


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


def worst(record: Recording) -> list[Worst]:
    """Return the worst intervals, highest score first."""
    return [_one(record, number, interval) for number, interval in enumerate(record.summary["worst"], 1)]


def worst_minute(record: Recording) -> tuple[float, float, tuple[tuple[str, str], ...]] | None:
    """Return start and end [s] of the worst minute and the changes that lower it in every one of its frames."""
    if not record.frames:
        return None
    frames = worst_stretch(record.scores)
    first, last = int(frames[0]), int(frames[-1])
    time = record.scores.time
    changes = _changes(improve_frames(record.scores, frames))
    return float(time[first]), float(time[last] + record.weights[last]), changes


def _one(record: Recording, number: int, interval: dict[str, Any]) -> Worst:
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


def _marks(record: Recording, frame: int) -> dict[str, Mark]:
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
