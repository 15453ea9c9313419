"""From a posture table to scores: the factors, the activity, the score table.

PostureTable or DataFrame -> angles (n, 22) + factors + activity -> score_array -> Scores
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd

from reba.analysis.activity import detect
from reba.analysis.exposure import summarise
from reba.analysis.improve import Improvement, improve_frame
from reba.analysis.score_table import ScoreTable
from reba.analysis.worksheet import Worksheet, worksheet
from reba.arrays import Array
from reba.checks import TEXT, accepts
from reba.errors import PostureError, warn_user
from reba.method.distribution import LIKELY_COLUMNS
from reba.method.measurement_error import ErrorInput, MeasurementError
from reba.method.rules import Rules, rules_of
from reba.method.scoring import SCORE_COLUMNS, Missing, score_angles
from reba.method.tables import UNKNOWN, Scores8
from reba.posture.factors import (
    ACTIVITIES,
    ASSUMED,
    ASSUMED_ACTIVITY,
    BOTH_SIDES,
    FACTORS,
    SUPPORTS,
    Factors,
    checked,
    expand_sides,
)
from reba.posture.named_angles import RADIANS_TEXT, flag_columns, refuse_infinite, warn_if_radians
from reba.posture.table import PostureTable, angles_of, table_of
from reba.report.plots import plot

if TYPE_CHECKING:
    from plotly.graph_objects import Figure


@dataclass(frozen=True)
class Scores(ScoreTable):
    """Scores of one recording with their summary, worksheets and improvements; attributes as of `ScoreTable`."""

    def summary(self) -> dict[str, Any]:
        """Return exposure over the recording as plain data, as in `reba score --json`."""
        return summarise(self)

    def explain(self, time: float) -> Worksheet:
        """Return the worksheet of the frame nearest to `time`: each point with the angle and rule that gave it."""
        return worksheet(self, self.frame_at(time))

    def improve(self, time: float) -> list[Improvement]:
        """Return the smallest changes that bring the frame nearest to `time` to a lower action level."""
        return improve_frame(self, self.frame_at(time))

    def plot(self) -> Figure:
        """Return the report's plot of REBA over time as a plotly figure, which notebooks show interactively.

        Raises:
            PostureError: there is no frame.

        Example:
            >>> frames = pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]})
            >>> score(frames).plot().layout.yaxis.title.text
            'REBA'
        """
        return plot(self)


@accepts(PostureError, activity=TEXT)
def score(
    postures: PostureTable | pd.DataFrame | Mapping[str, Any] | Sequence[Mapping[str, Any]],
    *,
    rules: Rules | str | Path = "measured",
    activity: Literal["auto", "none"] | str = "auto",
    missing: Missing = "range",
    error: ErrorInput | None = None,
    **factors: Any,
) -> Scores:
    """Score a recording.

    Args:
        postures: what `reba.read` returns, or data with columns of the posture table in any order: a DataFrame, a
            mapping of columns or a list of rows by name (absent columns are not measured; a name without a side stands
            for both; without `time` frames are numbered by seconds).
        rules: preset, TOML file or record.
        activity: "auto" (from the movement), "none", or a comma list of static, repeated, unstable for the
            recording. A kind given as a factor or as a column replaces the one detected.
        missing: what stands for scores left open by unmeasured angles, see `score_array`.
        error: measurement error of the angles, see `MeasurementError.of`: "inertial", a TOML file, ...; the table then
            has the most likely score, the range of 95 % and the probability of action levels beside the scores, which
            stay as they are. None: none of this.
        **factors: load [kg], shock, coupling (or coupling_left, ...), support, arm_supported, static, ...: one value
            or one per frame; they replace columns of the same name.

    Raises:
        PostureError, RulesError: bad angles, factors, measurement error or rules.

    Warns:
        RadiansWarning: the angles look like radians, and no reader has warned before.
        UserWarning: the postures are those of a file of scores, which were recorded with other rules.

    Example:
        >>> frames = pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]})
        >>> score(frames, missing="neutral").data["reba"].tolist()
        [1, 2]
    """
    table = postures if isinstance(postures, PostureTable) else table_of(postures)
    chosen = rules_of(rules)
    recorded = (table.scored or {}).get("rules")
    if isinstance(recorded, dict) and recorded != dataclasses.asdict(chosen):
        name = recorded.get("name")
        text = f"{table.source}: its scores were recorded with rules {name!r}, these are by {chosen.name!r}"
        warn_user(text)
    angles = angles_of(table.data)
    refuse_infinite(angles)
    if RADIANS_TEXT not in table.quality.warnings:  # unless a reader has warned
        warn_if_radians(angles)
    columns = {name: table.data[name].to_numpy() for name in (*FACTORS, *BOTH_SIDES) if name in table.data}
    named = expand_sides(columns)
    named |= expand_sides({name: value for name, value in factors.items() if value is not None})
    used = checked(Factors.of(named), len(table.data))
    kinds, causes = _activity(table, angles, used, activity, chosen)
    open_kinds = [kind for kind in ACTIVITIES if kind not in named]
    used = dataclasses.replace(used, **{kind: kinds[kind] for kind in open_kinds})
    assumed = [text for name, text in ASSUMED.items() if name not in named]
    assumed += [ASSUMED_ACTIVITY] if activity == "auto" and open_kinds else []
    spread = None if error is None else MeasurementError.of(error).without(flag_columns(table.data))
    arrays = score_angles(angles, used, chosen, missing, error=spread)
    scored: dict[str, Any] = {"time": table.data["time"].to_numpy(np.float64)}
    for name in SCORE_COLUMNS:
        values = arrays[name]
        scored[name] = _integers(values)
    if arrays.distribution is not None:
        for name, values in arrays.distribution.columns().items():
            scored[name] = _integers(values) if name in LIKELY_COLUMNS else values
    return Scores(
        data=pd.DataFrame(scored, copy=False),
        postures=table,
        rules=chosen,
        factors=used,
        assumed=(*table.assumed, *assumed),
        unmeasured=table.unmeasured,
        missing=missing,
        activity_causes={kind: parts for kind, parts in causes.items() if kind in open_kinds},
        error=spread,
        distribution=arrays.distribution,
    )


def _integers(scores: Scores8) -> Any:
    """Return scores as a nullable integer column without a copy."""
    return pd.arrays.IntegerArray(scores.view(np.int8), scores == UNKNOWN)


def _activity(
    table: PostureTable, angles: Array, used: Factors, activity: str, rules: Rules
) -> tuple[dict[str, Any], dict[str, dict[str, float]]]:
    """Return each kind of activity, detected or named by the caller, and its causes in the movement."""
    if activity != "auto":
        return {**named_activity(activity)}, {}
    walking = np.asarray(used.support) == SUPPORTS[2]
    if table.movement is None:
        everywhere = np.broadcast_to(walking, len(table.data))
        detected = detect(table.data["time"].to_numpy(np.float64), angles, rules, everywhere, table.quality.seams)
        return {kind: getattr(detected, kind) for kind in ACTIVITIES}, detected.causes
    movement = table.movement
    own = slice(table.first_frame, table.first_frame + len(table.data))
    everywhere = walking
    if walking.ndim:
        everywhere = np.zeros(0, bool) if movement.support is None else movement.support == SUPPORTS[2]
        if not np.array_equal(everywhere[own], walking):
            raise PostureError(
                "support is given for the frames of one block, but the activity depends on those of other blocks too; "
                "give one support for all, or activity='none'"
            )
    key = rules, everywhere.tobytes()
    if key not in movement.known:
        everywhere = np.broadcast_to(everywhere, len(movement.time))
        movement.known[key] = detect(movement.time, movement.column, rules, everywhere, movement.seams)
    detected = movement.known[key]
    return {kind: getattr(detected, kind)[own] for kind in ACTIVITIES}, detected.causes


def named_activity(activity: str) -> dict[str, bool]:
    """Return which kinds of activity "none" or a comma list of them names; unknown kinds are refused."""
    words = [] if activity == "none" else [word.strip() for word in str(activity).split(",")]
    for word in words:
        if word not in ACTIVITIES:
            raise PostureError(f"activity {word!r} is unknown; use auto, none or some of {', '.join(ACTIVITIES)}")
    return {kind: kind in words for kind in ACTIVITIES}
