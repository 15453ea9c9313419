"""The score table of a recording together with the postures, rules and factors it was computed from."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
import pandas as pd

from reba.arrays import Array
from reba.checks import MOMENT, accepts, instance
from reba.errors import PostureError
from reba.method.distribution import ScoreDistribution
from reba.method.measurement_error import MeasurementError
from reba.method.rules import Rules
from reba.method.scoring import Missing
from reba.posture.factors import Factors
from reba.posture.table import PostureTable, angles_of


@dataclass(frozen=True)
class ScoreTable:
    """Scores of one recording, with what they were computed from.

    Attributes:
        data: the score table: `time`, then `reba.method.scoring.SCORE_COLUMNS` as nullable integers; missing where the
            measured angles leave more than one value.
        postures: the posture table that was scored.
        rules: the rules, every threshold included.
        factors: the factors that were used, activity included.
        assumed: defaults of the factors that were not given, and assumptions of the reader.
        unmeasured: angle columns without any value.
        activity_causes: for activity detected in the movement: kind -> part -> share of frames.
        missing: what stands for undetermined scores.
        error: the measurement error of the angles, None if none was given.
        distribution: what that error implies for every frame; `data` then has its columns too.
    """

    data: pd.DataFrame
    postures: PostureTable
    rules: Rules
    factors: Factors
    assumed: tuple[str, ...]
    unmeasured: tuple[str, ...]
    missing: Missing = "range"
    activity_causes: dict[str, dict[str, float]] = field(default_factory=dict)
    error: MeasurementError | None = None
    distribution: ScoreDistribution | None = None

    @property
    def time(self) -> Array:
        """(n,) seconds."""
        return self.data["time"].to_numpy(np.float64)

    @property
    def angles(self) -> Array:
        """(n, 22) degrees in the order of `reba.COLUMNS`, NaN = not measured."""
        return angles_of(self.postures.data)

    @accepts(PostureError, time=MOMENT)
    def frame_at(self, time: float) -> int:
        """Return the row nearest to `time` [s].

        Raises:
            PostureError: the time lies outside the recording.
        """
        stamps = self.time
        if not len(stamps) or not stamps[0] - 0.5 <= time <= stamps[-1] + 0.5:
            span = f"{stamps[0]:g} to {stamps[-1]:g} s" if len(stamps) else "no frames"
            raise PostureError(f"time {time:g} s lies outside the recording ({span}); choose a time inside")
        return int(np.argmin(np.abs(stamps - time)))


SCORES: Final = instance("what reba.score returns", ScoreTable)
"""What public functions take as the scores of one recording."""
