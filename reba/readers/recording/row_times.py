"""Times of the rows of a file that has no other clock: damaged ones, coarse ones, and those that start again.

times as they stand in the rows -> `row_times` -> times that go on, NaN for damaged ones, and where they start again
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np

from reba.arrays import Array, Flags

CENTURY: Final = 1e8
"""[s] A time that is farther from the others is damaged: no recording lasts three years; a choice."""
BACK: Final = 0.5
"""[s] By which times may run back, or differ from those of both neighbours, without a restart; a choice."""
ROWS_PER_RESTART: Final = 10
"""Times that run back more often than once in so many rows are in no order, and are sorted; a choice."""
ROWS_PER_DAMAGED: Final = 5
"""More damaged times than one in so many rows are no damage, but rows in no order; a choice."""
COARSE: Final = 0.1
"""[s] Steps of time from which on several rows in each are no repetition, but a time that was rounded; a choice."""
ROWS_PER_STEP: Final = 3
"""Rows that have one time, from which on it was rounded and the rows are not those of two bodies; a choice."""


@dataclass(frozen=True)
class RowTimes:
    """Times of rows.

    Attributes:
        time: (n,) [s], NaN for damaged ones.
        seams: times [s] of the first row after each restart.
        notes: sentences for the user.
    """

    time: Array
    seams: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()


def row_times(time: Array) -> RowTimes:
    """Return the times of rows in their order from (n,) times [s] as they stand in the file.

    Where times start again (files joined one behind the other, a player that loops), they go on by one step, since the
    pause is not known. Rows of one rounded time, such as a whole second, are spread evenly over its step.

    >>> row_times(np.tile(np.arange(20.0), 3)).seams
    (20.0, 40.0)
    """
    notes = []
    damaged = _damaged(time)
    known = ~damaged & np.isfinite(time)
    good = time[known]
    if damaged.any():
        notes.append(f"{np.count_nonzero(damaged)} times are far from those of the rows beside them: left out")
    seams = np.zeros(0, np.intp)
    steps = np.diff(good)
    if not (steps > 0).all():
        good, seams = _going_on(good)
        steps = np.diff(good)
        if len(seams):
            notes.append(f"times start again {len(seams)} times: how long the pauses were is not known")
    if np.any(steps < 0):
        notes.append(f"time runs backwards {np.sum(steps < 0)} times, first after {good[np.argmax(steps < 0)]:.6g} s")
    elif np.any(steps == 0):
        even, step = _spread(good)
        rounded = even is not good
        more = f": it is rounded to {step:g} s, and the rows of each step were spread evenly" if rounded else ""
        notes.append(f"{np.sum(steps == 0)} samples have the time of the one before{more}")
        good = even
    result = np.full(len(time), np.nan)
    result[known] = good
    return RowTimes(result, tuple(good[seams].tolist()), tuple(notes))


def _damaged(time: Array) -> Flags:
    """Return which times are of another century, or far from those of both neighbours, which are near each other."""
    with np.errstate(invalid="ignore"):
        damaged = np.asarray(np.abs(time - np.nanmedian(time)) > CENTURY) if np.isfinite(time).any() else time != time
    at = np.flatnonzero(~damaged & np.isfinite(time))
    steps = np.diff(time[at])
    if len(at) < 4 or (steps > 0).all():
        return damaged
    near = max(BACK, 5.0 * float(np.median(np.abs(steps))))
    beside = time[at][2:] - time[at][:-2]
    between = (beside >= 0) & (beside <= near)
    out = (steps[:-1] < -BACK) & (steps[1:] > BACK) | (steps[:-1] > BACK) & (steps[1:] < -BACK)
    alone = np.concatenate([[steps[0] < -BACK and steps[1] >= 0], between & out, [steps[-1] < -BACK]])
    # A restart has more rows than one behind it.
    alone[-1] &= not alone[-2]
    if len(at) < ROWS_PER_RESTART or np.count_nonzero(alone) * ROWS_PER_DAMAGED <= len(at):
        damaged[at[alone]] = True
    return damaged


def _going_on(time: Array) -> tuple[Array, np.ndarray]:
    """Return (n,) times in which each restart goes on by one step, and the positions of the rows after restarts.

    Parts that do not overlap are no restart: they were joined in another order, and are sorted.
    """
    steps = np.diff(time)
    cuts = np.flatnonzero(steps < -BACK) + 1
    if not len(cuts) or len(cuts) * ROWS_PER_RESTART > len(time):
        return time, cuts[:0]
    spans = sorted((float(part.min()), float(part.max())) for part in np.split(time, cuts))
    if not any(after[0] < before[1] - BACK for before, after in pairwise(spans)):
        return time, cuts[:0]
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    steps[cuts - 1] = step
    return np.concatenate([time[:1], time[0] + np.cumsum(steps)]), cuts


def _spread(time: Array) -> tuple[Array, float]:
    """Return (n,) times of which those that are equal are spread over their step, and the step [s]; else `time`."""
    first = np.concatenate([[0], np.flatnonzero(np.diff(time)) + 1])
    counts = np.diff(np.append(first, len(time)))
    usual = int(np.median(counts))
    if len(first) < 3 or usual < ROWS_PER_STEP:
        return time, 0.0
    step = float(np.median(np.diff(time[first])))
    if step < COARSE:
        return time, step
    places = np.arange(len(time)) - np.repeat(first, counts)
    # The first and the last step may not be complete.
    places[: counts[0]] += max(0, usual - int(counts[0]))
    counts[[0, -1]] = np.maximum(counts[[0, -1]], usual)
    size = np.repeat(counts, np.diff(np.append(first, len(time))))
    return time + places * step / size, step
