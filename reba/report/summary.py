"""Figures of one recording that the sections of the report share, and the data quality grade."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any, Final, Literal

import numpy as np

from reba.analysis.exposure import durations
from reba.analysis.exposure import summarise as exposure_of
from reba.analysis.score_table import ScoreTable
from reba.arrays import Array
from reba.method.tables import LEVEL_OF
from reba.posture.columns import COLUMNS
from reba.posture.table import Quality
from reba.report.series import VIEWS, Curve, ScoreRange, gaps_of, score_curve, score_range


@dataclass(frozen=True)
class RecordingSummary:
    """One scored recording with derived figures.

    Attributes:
        name: file name without folders.
        scores: scores whose angles are one contiguous array.
        summary: `scores.summary()`.
        sustained: highest score sustained for a second, at both ends of the range.
        ends: every score with unmeasured angles at their best and worst.
        curves: total -> its curve, see `reba.report.series.VIEWS`.
        weights: (n,) duration of each frame [s].
        gaps: (start, end) of intervals without samples [s].
    """

    name: str
    scores: ScoreTable
    summary: dict[str, Any]
    sustained: tuple[int | None, int | None]
    ends: ScoreRange
    curves: dict[str, Curve]
    weights: Array
    gaps: list[tuple[float, float]]
    quality_grade: QualityGrade

    @property
    def frames(self) -> int:
        """Number of frames."""
        return len(self.weights)

    @property
    def seconds(self) -> float:
        """Scored duration without gaps [s]."""
        return float(self.weights.sum())

    @property
    def length(self) -> float:
        """Time from the first frame to the end of the last [s], at least a millisecond."""
        time = self.scores.time
        return max(float(time[-1] - time[0] + self.weights[-1]), 1e-3) if self.frames else 1e-3

    @property
    def rate(self) -> float:
        """Sampling rate [Hz], NaN if unknown."""
        return sampling_rate(self.scores)

    @property
    def fully_measured(self) -> bool:
        """Whether the totals are single scores in every frame."""
        total = self.curves["reba"]
        return bool((total.low == total.high).all())


def summarise(scores: ScoreTable) -> RecordingSummary:
    """Return the figures of one recording that the sections share."""
    scores = _contiguous(scores)
    weights = durations(scores.time)
    ends = score_range(scores)
    curves = {name: score_curve(scores, ends, name) for name in VIEWS}
    gaps = gaps_of(scores)
    width = curves["reba"].high - curves["reba"].low
    gap_seconds = sum(end - start for start, end in gaps)
    grade = quality_grade(
        scores.postures.quality,
        frames=len(weights),
        seconds=float(weights.sum()) + gap_seconds,
        gap_seconds=gap_seconds,
        width=float(np.average(width, weights=weights)) if len(weights) else 0.0,
        rate=sampling_rate(scores),
    )
    name = PurePath(scores.postures.source.replace("\\", "/")).name or "recording"
    summary = exposure_of(scores)
    held = summary["held"]["reba"], summary["held"]["reba_high"]
    return RecordingSummary(name, scores, summary, held, ends, curves, weights, gaps, grade)


def _contiguous(scores: ScoreTable) -> ScoreTable:
    """Return the scores with the angles in one contiguous array, which every section reads without copying."""
    import pandas as pd

    block = np.column_stack([scores.time, scores.angles])
    data = pd.DataFrame(block, columns=["time", *COLUMNS], copy=False)
    return dataclasses.replace(scores, postures=dataclasses.replace(scores.postures, data=data))


def sampling_rate(scores: ScoreTable) -> float:
    """Return the median sampling rate [Hz]: the reader's, else from the time column; NaN for less than two frames."""
    rate = scores.postures.quality.rate
    if np.isnan(rate) and len(scores.data) > 1:
        # Stamps carry rounding: 10 Hz must not show as 9.999999.
        rate = round(1.0 / float(np.median(np.diff(scores.time))), 6)
    return rate


def seconds_of_levels(record: RecordingSummary, name: str) -> dict[int | None, float]:
    """Return action level -> time [s] of a total; None: the range spans more than one level."""
    curve = record.curves[name]
    low, high = (np.where(np.isnan(curve.value), end, curve.value).astype(int) for end in (curve.low, curve.high))
    levels, same = LEVEL_OF[low], LEVEL_OF[low] == LEVEL_OF[high]
    seconds: dict[int | None, float] = {
        level: float(record.weights[same & (levels == level)].sum()) for level in range(5)
    }
    seconds[None] = float(record.weights[~same].sum())
    return seconds


Outcome = Literal["passed", "weak", "failed"]
GAPS: Final = (0.01, 0.10)
"""Share of the duration without samples: weak above the first, failed above the second."""
SKIPPED: Final = (0.001, 0.05)
"""Share of messages that could not be used: weak above the first, failed above the second."""
RATES: Final = (10.0, 2.0)
"""Sampling rate [Hz]: weak below the first, failed below the second; postures change within tenths of a second."""
WIDTHS: Final = (0.0, 3.0)
"""Mean width of the REBA range [score]: weak above the first, failed above the second, the width of an action level."""
GRADE_RULE: Final = (
    "A: all checks passed. B: some are weak, none failed. C: one check failed. D: two or more failed, or no frames."
)


@dataclass(frozen=True)
class QualityCheck:
    """One check of the data quality: the observed value, its result and the rule."""

    name: str
    result: Outcome
    observed: str
    rule: str


@dataclass(frozen=True)
class QualityGrade:
    """Data quality grade, A to D, with the checks from which it follows."""

    letter: str
    checks: tuple[QualityCheck, ...]

    @property
    def text(self) -> str:
        """Failed and weak checks as text."""
        parts = []
        for result in ("failed", "weak"):
            names = [check.name.lower() for check in self.checks if check.result == result]
            parts += [f"{result}: {', '.join(names)}"] if names else []
        return "; ".join(parts) or "all checks passed"


def quality_grade(
    quality: Quality, frames: int, seconds: float, gap_seconds: float, width: float, rate: float
) -> QualityGrade:
    """Return the data quality grade of a recording.

    Args:
        frames: number of scored frames.
        seconds: duration from the first to the last frame [s].
        gap_seconds: part of the duration without samples [s].
        width: time-weighted mean width of the REBA range [score].
        rate: sampling rate [Hz], NaN if unknown.

    Example:
        >>> quality_grade(Quality(messages=100), 100, 10.0, 0.0, 0.0, 25.0).letter
        'A'
    """
    gaps = gap_seconds / seconds if seconds > 0 else 0.0
    skipped = quality.skipped / quality.messages if quality.messages else 0.0
    end = quality.ended_abnormally
    rate_result: Outcome = "weak" if np.isnan(rate) else _result(-rate, (-RATES[0], -RATES[1]))
    rate_text = "unknown" if np.isnan(rate) else f"{rate:.4g} Hz"
    open_range = f"leave a mean REBA range of {width:.1f} points" if width > 0 else "leave no range"
    unusable = f"{quality.skipped} of {quality.messages}" if quality.messages else "none reported"
    without_samples = f"{gap_seconds:.1f} s ({100 * gaps:.2g} %) without samples" if gap_seconds else "none"
    warnings = f"{len(quality.warnings)}" if quality.warnings else "none"
    checks = (
        QualityCheck("End of the recording", "failed" if end else "passed", end or "complete", "failed if truncated"),
        QualityCheck("Unusable messages", _result(skipped, SKIPPED), unusable, _limits("share", SKIPPED)),
        QualityCheck("Gaps", _result(gaps, GAPS), without_samples, _limits("share of the duration", GAPS)),
        QualityCheck(
            "Sampling rate", rate_result, rate_text, f"weak below {RATES[0]:g} Hz, failed below {RATES[1]:g} Hz"
        ),
        QualityCheck(
            "Angles not measured",
            _result(width, WIDTHS),
            open_range,
            f"weak if they leave any range, failed above {WIDTHS[1]:g} points on average",
        ),
        QualityCheck(
            "Warnings of the reader", "weak" if quality.warnings else "passed", warnings, "weak if there are any"
        ),
    )
    results = [check.result for check in checks]
    failed = results.count("failed")
    letter = "D" if failed > 1 or not frames else "C" if failed else "B" if "weak" in results else "A"
    return QualityGrade(letter, checks)


def _result(value: float, limits: tuple[float, float]) -> Outcome:
    return "failed" if value > limits[1] else "weak" if value > limits[0] else "passed"


def _limits(what: str, limits: tuple[float, float]) -> str:
    return f"{what}: weak above {100 * limits[0]:g} %, failed above {100 * limits[1]:g} %"
