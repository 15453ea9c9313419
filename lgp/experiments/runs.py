"""The two tables of an experiment: one row per run and condition, and one row per slice of every human path.

`runs`: what was chosen, what it cost, true REBA scores. `paths`: the posture of the human over time, whose last row
is the grasp; its posture columns are those of `reba`, so `reba score` reads it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from lgp.errors import LgpError
from reba.files import write_atomic, write_text
from reba.posture.columns import COLUMNS

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


JOURNAL: Final = "unfinished.jsonl"
SETTINGS: Final = "settings.json"


class RunStore:
    """The runs in a folder.

    Args:
        folder: made if it is not there.
        settings: what must not change between runs of a folder (scene, cost model, seed), plain data.

    Raises:
        LgpError: the folder holds runs of other settings, is damaged or cannot be written.

    Example:
        >>> store = RunStore("out", {"scene": "screwdriver", "seed": 0})     # doctest: +SKIP
        >>> for run in sorted(set(range(100)) - store.done("rest")):         # doctest: +SKIP
        ...     store.append(*plan_run(run))
        >>> runs, paths = store.finish()                                     # doctest: +SKIP
    """

    def __init__(self, folder: str | Path, settings: Mapping[str, Any]) -> None:
        self.folder = Path(folder)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise LgpError(f"{folder}: cannot be made ({error.strerror or error}); give another folder") from error
        self._settle(json.loads(json.dumps(dict(settings))))
        self._runs, self._paths = _parquet(self.folder)
        self._read_journal()

    def done(self, initial: str) -> set[int]:
        """Return the numbers of the runs that are finished with one start."""
        return set(self._runs.loc[self._runs["initial"] == initial, "run"].tolist())

    def append(self, runs: pd.DataFrame, paths: pd.DataFrame) -> None:
        """Add one finished run: its row of every condition, and its paths; safe on disk when this returns.

        Args:
            runs: rows with `RUN_COLUMNS`.
            paths: rows with `PATH_COLUMNS`, none where nothing was feasible.

        Raises:
            LgpError: the rows are not as `check_runs` and `check_paths` expect, there already, or cannot be written.
        """
        runs, paths = check_runs(runs), check_paths(paths)
        again = self._key(self._runs) & self._key(runs)
        if again:
            raise LgpError(f"run {min(again)[1]}: is in {self.folder} already; `done` says which are")
        line = json.dumps({"runs": _plain(runs), "paths": _plain(paths)}).encode() + b"\n"
        try:
            with (self.folder / JOURNAL).open("ab") as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise LgpError(f"{self.folder / JOURNAL}: cannot be written ({error.strerror or error})") from error
        self._add(runs, paths)

    def finish(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Write `runs.parquet` and `paths.parquet` and return both tables; more runs may follow.

        Raises:
            RebaError: they cannot be written.
        """
        runs, paths = self.tables()
        # Paths first: a run counts as finished by its row in runs.parquet or in the journal, which goes last.
        write_atomic(self.folder / "paths.parquet", lambda part: paths.to_parquet(part, index=False))
        write_atomic(self.folder / "runs.parquet", lambda part: runs.to_parquet(part, index=False))
        (self.folder / JOURNAL).unlink(missing_ok=True)
        return runs, paths

    def tables(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Return all finished runs and their paths, sorted."""
        return check_runs(self._runs), check_paths(self._paths)

    def _settle(self, settings: dict[str, Any]) -> None:
        file = self.folder / SETTINGS
        if not file.exists():
            text = json.dumps(settings, indent=1) + "\n"
            write_atomic(file, lambda part: write_text(part, text))
            return
        try:
            before = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError, RecursionError) as error:
            raise LgpError(f"{file}: cannot be read ({error}); give another folder") from error
        if not isinstance(before, dict):
            raise LgpError(f"{file}: holds no settings; give another folder")
        for name in (*settings, *before):
            old, new = before.get(name), settings.get(name)
            if old != new:
                raise LgpError(
                    f"{self.folder}: its runs were made with {name} {old!r}, not {new!r}; give another folder"
                )

    def _read_journal(self) -> None:
        file = self.folder / JOURNAL
        if not file.is_file():
            return
        lines = file.read_bytes().splitlines(keepends=True)
        whole = [line for line in lines if line.endswith(b"\n")]
        if len(whole) < len(lines):
            # The process ended in the middle of a line: that run is made again.
            def keep(part: Path) -> None:
                part.write_bytes(b"".join(whole))

            write_atomic(file, keep)
        for number, line in enumerate(whole, 1):
            try:
                data = json.loads(line)
                runs, paths = _frame(data["runs"], RUN_COLUMNS), _frame(data["paths"], PATH_COLUMNS)
            except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
                raise LgpError(
                    f"{file}: line {number} is damaged ({error}); delete it to make its run again"
                ) from error
            # Both hold a run where the process ended between writing the tables and removing the journal.
            if not self._key(self._runs) & self._key(runs):
                self._add(check_runs(runs), check_paths(paths))

    def _add(self, runs: pd.DataFrame, paths: pd.DataFrame) -> None:
        self._runs, self._paths = _joined(self._runs, runs), _joined(self._paths, paths)

    @staticmethod
    def _key(runs: pd.DataFrame) -> set[tuple[Any, ...]]:
        return set(runs[list(KEY)].itertuples(index=False, name=None))


def _parquet(folder: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    import pandas as pd

    files = folder / "runs.parquet", folder / "paths.parquet"
    if not files[0].is_file():
        return empty(RUN_COLUMNS), empty(PATH_COLUMNS)
    try:
        runs, paths = (pd.read_parquet(file) for file in files)
    except (OSError, ValueError) as error:
        raise LgpError(f"{folder}: its runs cannot be read ({error}); give another folder") from error
    # Paths without a run come from a process that ended between writing the two tables.
    whole = paths.set_index(list(KEY)).index.isin(runs.set_index(list(KEY)).index)
    return check_runs(runs), check_paths(paths[whole])


def _joined(first: pd.DataFrame, second: pd.DataFrame) -> pd.DataFrame:
    import pandas as pd

    return pd.concat([part for part in (first, second) if len(part)] or [first], ignore_index=True)


def _plain(frame: pd.DataFrame) -> dict[str, list[Any]]:
    """Return columns as lists that JSON holds; what is missing becomes null."""
    return {name: frame[name].astype(object).where(frame[name].notna(), None).tolist() for name in frame.columns}


def _frame(data: dict[str, list[Any]], columns: dict[str, str]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame({name: pd.Series(data[name], dtype=kind) for name, kind in columns.items()})
