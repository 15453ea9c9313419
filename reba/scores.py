"""From a posture table to scores: the factors, the activity, the score table.

PostureTable or DataFrame -> angles (n, 22) + factors + activity -> score_array -> Scores
"""

from __future__ import annotations

import dataclasses
import numbers
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from reba import activity as activity_
from reba.errors import PostureError, did_you_mean
from reba.factors import (
    ACTIVITIES,
    ASSUMED,
    ASSUMED_ACTIVITY,
    BOTH_SIDES,
    FACTORS,
    SUPPORTS,
    Factors,
    checked,
    expand_sides,
    flag,
)
from reba.posture import ANGLES, COLUMNS, INDEX, SIDES, PostureTable
from reba.rules import Rules, rules_of
from reba.scoring import SCORE_COLUMNS, UNKNOWN, Missing, refuse_infinite, score_array

if TYPE_CHECKING:
    from pathlib import Path

    from reba.improve import Improvement
    from reba.worksheet import Worksheet

RAISED = tuple(f"shoulder_raised_{side}" for side in SIDES)
"""Boolean columns that may stand in for `shoulder_elevation_*`."""
_ELEVATION = next(angle for angle in ANGLES if angle.name == "shoulder_elevation")


@dataclass(frozen=True)
class Scores:
    """Scores of one recording.

    Attributes:
        data: the score table: `time`, then `reba.scoring.SCORE_COLUMNS` as nullable integers; missing where the
            measured angles leave more than one value.
        postures: the posture table that was scored.
        rules: the rules, every threshold included.
        factors: the factors that were used, activity included.
        assumed: factors that nobody gave and what was assumed, and what the reader had to assume.
        unmeasured: angle columns without any value.
        activity_causes: for activity found in the movement: kind -> part -> share of frames.
        missing: what stands for undetermined scores.
    """

    data: pd.DataFrame
    postures: PostureTable
    rules: Rules
    factors: Factors
    assumed: tuple[str, ...]
    unmeasured: tuple[str, ...]
    missing: Missing = "range"
    activity_causes: dict[str, dict[str, float]] = field(default_factory=dict)

    @property
    def time(self) -> NDArray[np.float64]:
        """(n,) seconds."""
        return self.data["time"].to_numpy(np.float64)

    @property
    def angles(self) -> NDArray[np.float64]:
        """(n, 22) degrees in the order of `reba.COLUMNS`, NaN = not measured."""
        return angles_of(self.postures.data)

    def summary(self) -> dict[str, Any]:
        """Return exposure over the recording as plain data, as in `reba score --json`."""
        from reba.exposure import summarise

        return summarise(self)

    def explain(self, time: float) -> Worksheet:
        """Return the worksheet of the frame nearest to `time`: each point with the angle and rule that gave it."""
        from reba.worksheet import worksheet

        return worksheet(self, self.frame_at(time))

    def improve(self, time: float) -> list[Improvement]:
        """Return the smallest changes that bring the frame nearest to `time` to a lower action level."""
        from reba.improve import improve_frame

        return improve_frame(self, self.frame_at(time))

    def frame_at(self, time: float) -> int:
        """Return the row nearest to `time` [s].

        Raises:
            PostureError: the time lies outside the recording.
        """
        stamps = self.time
        if not isinstance(time, numbers.Real):
            raise PostureError(f"time is {time!r}; expected seconds")
        if not len(stamps) or not stamps[0] - 0.5 <= time <= stamps[-1] + 0.5:
            span = f"{stamps[0]:g} to {stamps[-1]:g} s" if len(stamps) else "no frames"
            raise PostureError(f"time {time:g} s lies outside the recording ({span}); choose a time inside")
        return int(np.argmin(np.abs(stamps - time)))


def score(
    postures: PostureTable | pd.DataFrame,
    *,
    rules: Rules | str | Path = "measured",
    activity: Literal["auto", "none"] | str = "auto",
    missing: Missing = "range",
    **factors: Any,
) -> Scores:
    """Score a recording.

    Args:
        postures: what `reba.read` returns, or any DataFrame with columns of the posture table (absent columns are
            not measured; without `time` frames are numbered by seconds).
        rules: preset, TOML file or record.
        activity: "auto" (from the movement), "none", or a comma list of static, repeated, unstable for the whole
            recording. A kind given as a factor or as a column replaces what the movement says.
        missing: what stands for scores left open by unmeasured angles, see `score_array`.
        **factors: load [kg], shock, coupling (or coupling_left, ...), support, arm_supported, static, ...: one value
            or one per frame; they replace columns of the same name.

    Raises:
        PostureError, RulesError: bad angles, factors or rules.

    Example:
        >>> frames = pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]})
        >>> score(frames, missing="neutral").data["reba"].tolist()
        [1, 2]
    """
    table = postures if isinstance(postures, PostureTable) else table_of(postures)
    chosen = rules_of(rules)
    angles = angles_of(table.data)
    refuse_infinite(angles)
    columns = {name: table.data[name].to_numpy() for name in (*FACTORS, *BOTH_SIDES) if name in table.data}
    given = expand_sides(columns)
    given |= expand_sides({name: value for name, value in factors.items() if value is not None})
    used = checked(Factors.of(given), len(table.data))
    kinds, causes = _activity(table.data, angles, used, activity, chosen)
    open_kinds = [kind for kind in ACTIVITIES if kind not in given]
    used = dataclasses.replace(used, **{kind: kinds[kind] for kind in open_kinds})
    assumed = [text for name, text in ASSUMED.items() if name not in given]
    assumed += [ASSUMED_ACTIVITY] if activity == "auto" and open_kinds else []
    arrays = score_array(angles, used, chosen, missing)
    scored: dict[str, Any] = {"time": table.data["time"].to_numpy(np.float64)}
    for name in SCORE_COLUMNS:
        values = arrays[name]
        scored[name] = pd.arrays.IntegerArray(values.view(np.int8), values == UNKNOWN)
    return Scores(
        data=pd.DataFrame(scored, copy=False),
        postures=table,
        rules=chosen,
        factors=used,
        assumed=(*table.assumed, *assumed),
        unmeasured=table.unmeasured,
        missing=missing,
        activity_causes={kind: parts for kind, parts in causes.items() if kind in open_kinds},
    )


def table_of(frame: pd.DataFrame) -> PostureTable:
    """Return a DataFrame as a posture table.

    Raises:
        PostureError: it is no DataFrame, no column is known, one stands twice or is no number, or time does not
            increase.
    """
    if not isinstance(frame, pd.DataFrame):
        raise PostureError(
            f"postures are of type {type(frame).__name__}; expected what reba.read returns or a DataFrame "
            "(arrays of angles go to reba.score_array)"
        )
    known = ("time", *COLUMNS, *FACTORS, *BOTH_SIDES, *RAISED)
    if not any(name in COLUMNS or name in RAISED for name in frame.columns):
        names = ", ".join(str(name) for name in list(frame.columns)[:6])
        hint = did_you_mean(str(frame.columns[0]), COLUMNS) if len(frame.columns) else ""
        raise PostureError(
            f"no angle column among: {names or 'none'}; expected some of {', '.join(COLUMNS[:3])}, ...{hint}"
        )
    columns: dict[str, Any] = {"time": np.arange(len(frame), dtype=np.float64)}
    used = [str(name) for name in frame.columns if str(name) in known]
    if twice := [name for name in dict.fromkeys(used) if used.count(name) > 1]:
        raise PostureError(f"column {twice[0]} stands {used.count(twice[0])} times; keep one of them")
    for name in used:
        if name in COLUMNS or name == "time":
            columns[name] = _numbers(frame, name)
        else:
            columns[name] = frame[name].to_numpy()
    time = columns["time"]
    bad = ~np.isfinite(time)
    if bad.any():
        where = int(np.argmax(bad))
        raise PostureError(f"time is {time[where]} at frame {where}; expected seconds at every frame")
    back = np.diff(time) <= 0
    if back.any():
        where = int(np.argmax(back))
        raise PostureError(
            f"time does not increase after frame {where} ({time[where]} s); sort the rows and drop duplicates"
        )
    # A misspelt column would otherwise only show as "not measured".
    near = [(str(n), did_you_mean(str(n), COLUMNS)) for n in frame.columns if str(n) not in known]
    wrong = [f"column {name!r} is not used{hint}" for name, hint in near if hint]
    table = PostureTable(pd.DataFrame(columns), source="DataFrame", recognised="posture table columns")
    table = dataclasses.replace(table, quality=dataclasses.replace(table.quality, warnings=tuple(wrong)))
    empty = np.isnan(angles_of(table.data)).all(axis=0)
    return dataclasses.replace(table, unmeasured=tuple(np.array(COLUMNS)[empty].tolist()))


def _numbers(frame: pd.DataFrame, name: str) -> NDArray[np.float64]:
    if (kind := frame[name].dtype.kind) in "mMc":
        what = "complex numbers" if kind == "c" else "dates"
        raise PostureError(f"column {name} holds {what}; expected {'seconds' if name == 'time' else 'degrees'}")
    try:
        return pd.to_numeric(frame[name]).to_numpy(np.float64, na_value=np.nan)
    except (TypeError, ValueError) as error:
        raise PostureError(f"column {name} holds something that is no number ({error}); expected degrees") from error


def angles_of(data: pd.DataFrame) -> NDArray[np.float64]:
    """Return the (n, 22) angles of a posture table, without a copy where its columns stand in one block."""
    if tuple(data.columns) == ("time", *COLUMNS):
        return data.to_numpy()[:, 1:]
    angles = np.full((len(data), len(COLUMNS)), np.nan)
    for index, name in enumerate(COLUMNS):
        if name in data:
            angles[:, index] = data[name]
    for side, name in enumerate(RAISED):
        if name in data:
            column = angles[:, INDEX["shoulder_elevation_left"] + side]
            raised = np.where(flag(name, data[name].to_numpy(), len(data)), _ELEVATION.worst, _ELEVATION.best)
            column[:] = np.where(np.isnan(column), raised, column)
    return angles


def _activity(
    data: pd.DataFrame, angles: NDArray[np.float64], used: Factors, activity: str, rules: Rules
) -> tuple[dict[str, Any], dict[str, dict[str, float]]]:
    """Return each kind of activity as the caller wants it found, and what caused it in the movement."""
    if activity == "auto":
        walking = np.broadcast_to(used.support, len(data)) == SUPPORTS[2]
        found = activity_.detect(data["time"].to_numpy(np.float64), angles, rules, walking)
        return {kind: getattr(found, kind) for kind in ACTIVITIES}, found.causes
    return {**named_activity(activity)}, {}


def named_activity(activity: str) -> dict[str, bool]:
    """Return which kinds of activity "none" or a comma list of them names.

    Raises:
        PostureError: a kind is unknown.
    """
    words = [] if activity == "none" else [word.strip() for word in str(activity).split(",")]
    for word in words:
        if word not in ACTIVITIES:
            raise PostureError(f"activity {word!r} is unknown; use auto, none or some of {', '.join(ACTIVITIES)}")
    return {kind: kind in words for kind in ACTIVITIES}
