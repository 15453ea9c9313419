"""The REBA ribbon: true scores over the whole plan, in runs of equal score."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lgp.plan_record import Plan
from reba.report.words import LEVEL_COLOURS, TEXT_ON
from reba.tables import ACTION_LEVELS, LEVEL_OF


@dataclass(frozen=True)
class Run:
    """Slices of one score: start and end [s], score, action level, its colour and that of text on it."""

    start: float
    end: float
    score: int
    level: int
    colour: str
    ink: str


def runs(plan: Plan) -> tuple[Run, ...]:
    """Return the ribbon of a plan; () without a human. Each slice counts from the one before it."""
    scores = plan.reba()
    if scores is None:
        return ()
    total = np.asarray(scores.reba, dtype=int)
    time = np.concatenate([[0.0], plan.time])
    firsts = np.flatnonzero(np.diff(total, prepend=-1))
    lasts = np.append(firsts[1:], len(total))
    return tuple(
        _run(float(time[first]), float(time[last]), int(total[first]))
        for first, last in zip(firsts, lasts, strict=True)
    )


def risk(level: int) -> str:
    """Return the words of an action level."""
    return ACTION_LEVELS[level][0]


def _run(start: float, end: float, score: int) -> Run:
    level = int(LEVEL_OF[score])
    colour = LEVEL_COLOURS[level]
    return Run(round(start, 6), round(end, 6), score, level, colour, TEXT_ON.get(colour, "#1b2430"))
