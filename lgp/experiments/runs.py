"""The two tables of an experiment: one row per run and condition, and one row per slice of every human path.

`runs`: what was chosen, what it cost, true REBA scores. `paths`: the posture of the human over time, whose last row
is the grasp; its posture columns are those of `reba`, so `reba score` reads it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from lgp.errors import LgpError
from reba.posture import COLUMNS

if TYPE_CHECKING:
    import pandas as pd

CONDITIONS: Final = ("non-ergonomic", "ergonomic", "re-optimized")
TABLES: Final = ("left", "center", "right")
PLACES: Final = (*TABLES, "start")
"""Tables that the human may take the screwdriver from: one of the three, or the one where it lies at first."""
STARTS: Final = ("rest", "random")

RUN_COLUMNS: Final[dict[str, str]] = {
    "run": "int64",  # from 0; the same run has the same heights in all conditions and starts
    "seed": "int64",  # of the experiment
    "condition": "string",  # one of CONDITIONS
    "table": "string",  # one of PLACES, missing where infeasible
    "height_left": "float64",  # [m]
    "height_center": "float64",
    "height_right": "float64",
    "chosen_height": "float64",  # [m] of the chosen table, NaN where infeasible
    "reba_grasp": "float64",  # true score of the last slice
    "reba_mean": "float64",  # true score over all slices
    "cost": "float64",  # of the plan, by the condition's own terms
    "feasible": "bool",
    "seconds": "float64",  # of planning, less what an earlier condition of the run had solved
    "actions": "string",  # as the paper prints them, joined by "; "
    "initial": "string",  # one of STARTS
    "reason": "string",  # why it is infeasible, empty otherwise
}
"""Columns of runs.parquet and their types."""

PATH_COLUMNS: Final[dict[str, str]] = {
    "run": "int64",
    "condition": "string",
    "initial": "string",
    "slice": "int64",  # from 0 over the whole path
    "phase": "int64",  # from 0
    "time": "float64",  # [s]
    "reba": "float64",  # true score
    "load": "float64",  # [kg] that the human holds
    **dict.fromkeys(COLUMNS, "float64"),  # [deg]
}
"""Columns of paths.parquet and their types; infeasible runs have no rows."""

KEY: Final = ("initial", "run", "condition")
"""What identifies a row of runs."""


def check_runs(frame: pd.DataFrame) -> pd.DataFrame:
    """Return runs with the columns, types and order of `RUN_COLUMNS`.

    Raises:
        LgpError: a column is missing, unknown or of another type, a name is not one of those above, a row stands twice,
            a feasible run lacks a number, or the heights of a run differ between its rows.
    """
    runs = _typed(frame, RUN_COLUMNS, "runs")
    _names(runs, "condition", CONDITIONS)
    _names(runs, "initial", STARTS)
    feasible = runs[runs["feasible"]]
    _names(feasible, "table", PLACES)
    numbers = ["chosen_height", "reba_grasp", "reba_mean", "cost"]
    bad = feasible[~np.isfinite(feasible[numbers].to_numpy()).all(axis=1)]
    if len(bad):
        raise LgpError(f"{_row(bad)}: feasible, but one of {', '.join(numbers)} is not a number; plan it again")
    twice = runs[runs.duplicated(list(KEY))]
    if len(twice):
        raise LgpError(f"{_row(twice)}: stands twice in the runs; keep one of the two rows")
    heights = [f"height_{table}" for table in TABLES]
    spread = runs.groupby("run")[heights].agg(np.ptp)
    differ = (spread.to_numpy() > 1e-9).any(axis=1)
    if differ.any():
        run = spread.index[int(np.argmax(differ))]
        raise LgpError(f"run {run}: its table heights differ between its rows; expected the same in every condition")
    for table in TABLES:
        chosen = feasible[feasible["table"] == table]
        wrong = chosen[(chosen["chosen_height"] - chosen[f"height_{table}"]).abs() > 1e-9]
        if len(wrong):
            raise LgpError(f"{_row(wrong)}: chosen_height is not height_{table}, the height of its table")
    return _sorted(runs, [*KEY])


def check_paths(frame: pd.DataFrame) -> pd.DataFrame:
    """Return paths with the columns, types and order of `PATH_COLUMNS`.

    Raises:
        LgpError: a column is missing, unknown or of another type, a name is not one of those above, or a slice stands
            twice.
    """
    paths = _typed(frame, PATH_COLUMNS, "paths")
    _names(paths, "condition", CONDITIONS)
    _names(paths, "initial", STARTS)
    twice = paths[paths.duplicated([*KEY, "slice"])]
    if len(twice):
        raise LgpError(f"{_row(twice)}: slice {twice['slice'].iloc[0]} stands twice in the paths; keep one of the two")
    return _sorted(paths, [*KEY, "slice"])


def pivot(runs: pd.DataFrame, column: str, initial: str) -> pd.DataFrame:
    """Return one row per run and one column per condition; NaN where a run is infeasible or missing."""
    chosen = runs[(runs["initial"] == initial) & runs["feasible"]]
    return chosen.pivot(index="run", columns="condition", values=column).reindex(columns=list(CONDITIONS))


def empty(columns: dict[str, str]) -> pd.DataFrame:
    """Return a table without rows."""
    import pandas as pd

    return pd.DataFrame({name: pd.Series(dtype=kind) for name, kind in columns.items()})


def _typed(frame: pd.DataFrame, columns: dict[str, str], what: str) -> pd.DataFrame:
    missing = [name for name in columns if name not in frame.columns]
    unknown = [name for name in frame.columns if name not in columns]
    if missing or unknown:
        said = f"column {missing[0]!r} is missing" if missing else f"column {unknown[0]!r} is unknown"
        raise LgpError(f"{what}: {said}; expected {', '.join(columns)}")
    try:
        return frame[list(columns)].astype(columns)
    except (TypeError, ValueError) as error:
        raise LgpError(f"{what}: a column has another type than expected ({error})") from error


def _names(frame: pd.DataFrame, column: str, expected: tuple[str, ...]) -> None:
    wrong = frame[~frame[column].isin(expected)]
    if len(wrong):
        raise LgpError(f"{_row(wrong)}: {column} {wrong[column].iloc[0]!r}, expected one of {', '.join(expected)}")


def _row(frame: pd.DataFrame) -> str:
    first = frame.iloc[0]
    return f"run {first['run']}, {first['condition']}, {first['initial']}"


def _sorted(frame: pd.DataFrame, columns: list[str]) -> pd.DataFrame:
    ranks = {name: place for place, name in enumerate((*STARTS, *CONDITIONS))}
    return frame.sort_values(
        columns, key=lambda values: values.map(ranks) if values.name in ("initial", "condition") else values
    ).reset_index(drop=True)
