"""Exposure under measurement error: what the distribution of every frame implies for a recording.

Shares of time and means are expected values: they are sums over frames, so they hold whether the errors of different
frames depend on each other or not. Percentiles and maxima of a recording would depend on that and are not given.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from reba.analysis.score_table import ScoreTable
from reba.arrays import Array
from reba.method.distribution import LEVELS, LIKELY_COLUMNS, SHARE
from reba.method.tables import UNKNOWN
from reba.posture.columns import COLUMNS

APPROXIMATE = "upper arms against gravity: errors propagated to first order, independent of the trunk's"
"""Why a distribution is not exact."""


def frame_distribution(scores: ScoreTable, frame: int) -> dict[str, float | None]:
    """Return the columns that a measurement error adds, for one frame; None where undetermined, empty without one."""
    if scores.distribution is None:
        return {}
    columns = {name: values[frame].item() for name, values in scores.distribution.columns().items()}
    return {name: None if name in LIKELY_COLUMNS and value == UNKNOWN else value for name, value in columns.items()}


def expected_exposure(scores: ScoreTable, weights: Array) -> dict[str, Any] | None:
    """Return the distribution of a recording as plain data, None without a measurement error.

    `likely_is_reba` is the share of time in which the score is the most likely one, where both are determined.

    Args:
        weights: (n,) duration of each frame [s].
    """
    implied, error = scores.distribution, scores.error
    if implied is None or error is None:
        return None
    total = weights.sum() or 1.0
    shares = weights / total

    def mean(values: Any) -> float:
        return float(values @ shares)

    reba = scores.data["reba"].to_numpy(np.float64, na_value=np.nan)
    determined = ~np.isnan(reba) & (implied.reba_likely != UNKNOWN)
    same = determined & (implied.reba_likely == reba)
    width = implied.reba_95_high.astype(np.int64) - implied.reba_95_low
    return {
        "error": error.to_dict(),
        "exact": implied.exact,
        "approximate": "" if implied.exact else APPROXIMATE,
        "mean_low": mean(implied.mean_low),
        "mean_high": mean(implied.mean_high),
        "at_least": {
            str(level): {"low": mean(implied.level_low[level - 1]), "high": mean(implied.level_high[level - 1])}
            for level in LEVELS
        },
        "range": {"share": SHARE, "mean_low": mean(implied.reba_95_low), "mean_high": mean(implied.reba_95_high)},
        "mean_width": mean(width),
        "likely_is_reba": float(weights[same].sum() / weights[determined].sum()) if determined.any() else None,
        "without_error": [column for column, sd in zip(COLUMNS, error.sd, strict=True) if sd == 0.0],
    }
