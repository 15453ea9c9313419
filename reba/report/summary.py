"""Everything about one recording that the report's sections share, worked out once."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any, Final, Literal

import numpy as np

from reba.analysis.exposure import durations, sustained
from reba.arrays import Array
from reba.method.tables import LEVEL_OF
from reba.posture.columns import COLUMNS
from reba.posture.table import Quality
from reba.report.series import VIEWS, Curve, ScoreRange, bounds, curve, gaps
from reba.scores import Scores


@dataclass(frozen=True)
class RecordingSummary:
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
    sustained: tuple[int | None, int | None]
    ends: ScoreRange
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


def recording(scores: Scores) -> RecordingSummary:
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
    at_worst = longest if not width.any() else sustained(_at_worst(scores))
    return RecordingSummary(name, scores, summary, (longest, at_worst), ends, curves, weights, without, quality)


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


def shares_of_levels(record: RecordingSummary, name: str) -> dict[int | None, float]:
    """Return seconds in each action level of a total; None: the range spans more than one."""
    shown = record.curves[name]
    low, high = (np.where(np.isnan(shown.value), end, shown.value).astype(int) for end in (shown.low, shown.high))
    levels, same = LEVEL_OF[low], LEVEL_OF[low] == LEVEL_OF[high]
    found: dict[int | None, float] = {
        level: float(record.weights[same & (levels == level)].sum()) for level in range(5)
    }
    found[None] = float(record.weights[~same].sum())
    return found


Result = Literal["passed", "weak", "failed"]
GAPS: Final = (0.01, 0.10)
"""Share of the duration without samples: weak above the first, failed above the second."""
SKIPPED: Final = (0.001, 0.05)
"""Share of messages that could not be used."""
RATES: Final = (10.0, 2.0)
"""[Hz] Weak below the first, failed below the second: postures change within a few tenths of a second."""
RANGE: Final = (0.0, 3.0)
"""Mean width of the REBA range that unmeasured angles leave."""
RULE: Final = (
    "A: all checks passed. B: some are weak, none failed. C: one check failed. D: two or more failed, or no frames."
)


@dataclass(frozen=True)
class QualityCheck:
    """One check: what was looked at, how it ended, what was found and the rule that was applied."""

    what: str
    result: Result
    found: str
    rule: str


@dataclass(frozen=True)
class Grade:
    """A letter and the checks behind it."""

    letter: str
    checks: tuple[QualityCheck, ...]

    @property
    def text(self) -> str:
        """What keeps the grade from being A, in a few words."""
        found = []
        for result in ("failed", "weak"):
            names = [check.what.lower() for check in self.checks if check.result == result]
            found += [f"{result}: {', '.join(names)}"] if names else []
        return "; ".join(found) or "all checks passed"


def grade(quality: Quality, frames: int, seconds: float, missing: float, width: float, rate: float) -> Grade:
    """Grade a recording.

    Args:
        quality: what the reader found.
        frames: frames scored.
        seconds: from the first to the last frame.
        missing: [s] of it without samples.
        width: mean of REBA high minus low.
        rate: [Hz], NaN if unknown.

    Example:
        >>> grade(Quality(messages=100), 100, 10.0, 0.0, 0.0, 25.0).letter
        'A'
    """
    gaps = missing / seconds if seconds > 0 else 0.0
    skipped = quality.skipped / quality.messages if quality.messages else 0.0
    end = quality.ended_abnormally
    slow: Result = "weak" if np.isnan(rate) else _result(-rate, (-RATES[0], -RATES[1]))
    pace = "unknown" if np.isnan(rate) else f"{rate:.4g} Hz"
    open_range = f"leave a mean REBA range of {width:.1f} points" if width > 0 else "leave no range"
    unusable = f"{quality.skipped} of {quality.messages}" if quality.messages else "none reported"
    silent = f"{missing:.1f} s ({100 * gaps:.2g} %) without samples" if missing else "none"
    warned = f"{len(quality.warnings)}" if quality.warnings else "none"
    checks = (
        QualityCheck(
            "End of the recording", "failed" if end else "passed", end or "complete", "failed if it breaks off"
        ),
        QualityCheck("Unusable messages", _result(skipped, SKIPPED), unusable, _limits("share", SKIPPED)),
        QualityCheck("Gaps", _result(gaps, GAPS), silent, _limits("share of the duration", GAPS)),
        QualityCheck("Sampling rate", slow, pace, f"weak below {RATES[0]:g} Hz, failed below {RATES[1]:g} Hz"),
        QualityCheck(
            "Angles not measured",
            _result(width, RANGE),
            open_range,
            f"weak if they leave any range, failed above {RANGE[1]:g} points on average",
        ),
        QualityCheck(
            "Warnings of the reader", "weak" if quality.warnings else "passed", warned, "weak if there are any"
        ),
    )
    results = [check.result for check in checks]
    failed = results.count("failed")
    letter = "D" if failed > 1 or not frames else "C" if failed else "B" if "weak" in results else "A"
    return Grade(letter, checks)


def _result(value: float, limits: tuple[float, float]) -> Result:
    return "failed" if value > limits[1] else "weak" if value > limits[0] else "passed"


def _limits(what: str, limits: tuple[float, float]) -> str:
    return f"{what}: weak above {100 * limits[0]:g} %, failed above {100 * limits[1]:g} %"
