"""The data quality grade: a few plain checks, each passed, weak or failed.

A: every check passed. B: only weak ones beside passed ones. C: one check failed. D: two or more failed, or no frames.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from reba.posture import Quality

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
class Check:
    """One check: what was looked at, how it ended, what was found and the rule that was applied."""

    what: str
    result: Result
    found: str
    rule: str


@dataclass(frozen=True)
class Grade:
    """A letter and the checks behind it."""

    letter: str
    checks: tuple[Check, ...]

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
        Check("End of the recording", "failed" if end else "passed", end or "complete", "failed if it breaks off"),
        Check("Unusable messages", _result(skipped, SKIPPED), unusable, _limits("share", SKIPPED)),
        Check("Gaps", _result(gaps, GAPS), silent, _limits("share of the duration", GAPS)),
        Check("Sampling rate", slow, pace, f"weak below {RATES[0]:g} Hz, failed below {RATES[1]:g} Hz"),
        Check(
            "Angles not measured",
            _result(width, RANGE),
            open_range,
            f"weak if they leave any range, failed above {RANGE[1]:g} points on average",
        ),
        Check("Warnings of the reader", "weak" if quality.warnings else "passed", warned, "weak if there are any"),
    )
    results = [check.result for check in checks]
    failed = results.count("failed")
    letter = "D" if failed > 1 or not frames else "C" if failed else "B" if "weak" in results else "A"
    return Grade(letter, checks)


def _result(value: float, limits: tuple[float, float]) -> Result:
    return "failed" if value > limits[1] else "weak" if value > limits[0] else "passed"


def _limits(what: str, limits: tuple[float, float]) -> str:
    return f"{what}: weak above {100 * limits[0]:g} %, failed above {100 * limits[1]:g} %"
