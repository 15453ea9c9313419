"""Everything about one recording that the report's sections share, worked out once."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import PurePath
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reba.exposure import durations, held
from reba.posture import COLUMNS
from reba.report.grade import Grade, grade
from reba.report.series import VIEWS, Bounds, Curve, bounds, curve, gaps
from reba.tables import LEVEL_OF

if TYPE_CHECKING:
    from reba.scores import Scores

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Recording:
    """One scored recording with what is derived from it.

    Attributes:
        name: file name, without folders.
        scores: as scored, the angles in one block.
        summary: `scores.summary()`.
        held: highest score held for a second, at both ends of the range.
        ends: every score with unmeasured angles at their best and worst.
        curves: total -> its curve, see `reba.report.series.VIEWS`.
        weights: (n,) [s] that each frame stands for.
        gaps: (start, end) [s] of stretches without samples.
        grade: data quality.
    """

    name: str
    scores: Scores
    summary: dict[str, Any]
    held: tuple[int | None, int | None]
    ends: Bounds
    curves: dict[str, Curve]
    weights: Array
    gaps: list[tuple[float, float]]
    grade: Grade

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.weights)

    @property
    def seconds(self) -> float:
        """Duration that is scored, gaps left out [s]."""
        return float(self.weights.sum())

    @property
    def rate(self) -> float:
        """Sampling rate [Hz], NaN if unknown."""
        return sampling_rate(self.scores)

    @property
    def measured(self) -> bool:
        """Whether the totals are known in every frame."""
        total = self.curves["reba"]
        return bool((total.low == total.high).all())


def recording(scores: Scores) -> Recording:
    """Work out what the sections share."""
    scores = _in_one_block(scores)
    weights = durations(scores.time)
    ends = bounds(scores)
    curves = {name: curve(scores, ends, name) for name in VIEWS}
    without = gaps(scores)
    width = curves["reba"].high - curves["reba"].low
    silent = sum(end - start for start, end in without)
    quality = grade(
        scores.postures.quality,
        frames=len(weights),
        seconds=float(weights.sum()) + silent,
        missing=silent,
        width=float(np.average(width, weights=weights)) if len(weights) else 0.0,
        rate=sampling_rate(scores),
    )
    name = PurePath(scores.postures.source.replace("\\", "/")).name or "recording"
    summary = scores.summary()
    longest = summary["held"]["reba"]
    at_worst = longest if not width.any() else held(_at_worst(scores))
    return Recording(name, scores, summary, (longest, at_worst), ends, curves, weights, without, quality)


def _in_one_block(scores: Scores) -> Scores:
    """Return the scores with angles that every section can look at without copying 22 columns."""
    import pandas as pd

    block = np.column_stack([scores.time, scores.angles])
    data = pd.DataFrame(block, columns=["time", *COLUMNS], copy=False)
    return dataclasses.replace(scores, postures=dataclasses.replace(scores.postures, data=data))


def _at_worst(scores: Scores) -> Scores:
    return dataclasses.replace(scores, data=scores.data.assign(reba_low=scores.data["reba_high"]))


def sampling_rate(scores: Scores) -> float:
    """Return the median sampling rate [Hz]: the reader's, else from the time column; NaN for less than two frames."""
    rate = scores.postures.quality.rate
    if np.isnan(rate) and len(scores.data) > 1:
        # Stamps carry rounding: 10 Hz must not show as 9.999999.
        rate = round(1.0 / float(np.median(np.diff(scores.time))), 6)
    return rate


def shares_of_levels(record: Recording, name: str) -> dict[int | None, float]:
    """Return seconds in each action level of a total; None: the range spans more than one."""
    shown = record.curves[name]
    low, high = (np.where(np.isnan(shown.value), end, shown.value).astype(int) for end in (shown.low, shown.high))
    levels, same = LEVEL_OF[low], LEVEL_OF[low] == LEVEL_OF[high]
    found: dict[int | None, float] = {
        level: float(record.weights[same & (levels == level)].sum()) for level in range(5)
    }
    found[None] = float(record.weights[~same].sum())
    return found
