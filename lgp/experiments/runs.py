"""The two tables of the screwdriver experiment, and the folder that stores them run by run.

`runs`: one row per run and condition with the choice, its cost and true REBA scores. `paths`: one row per slice of
every human path, the grasp last; its posture columns are those of `reba`, so that `reba score` reads it. A finished run
is first appended to a journal on disk and later merged into the tables, so that an interrupted experiment continues.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from lgp.errors import LgpError
from lgp.files import EXPERIMENT_FILES, JOURNAL, SETTINGS
from reba.files import write_atomic, write_text
from reba.open_file import open_regular, read_regular, read_settings
from reba.outputs import FolderOutput, check_outputs
from reba.posture.columns import COLUMNS
from reba.provenance import MEMBER, other_version, parquet_provenance, with_provenance, write_parquet

if TYPE_CHECKING:
    import pandas as pd

CONDITIONS: Final = ("non-ergonomic", "ergonomic", "re-optimized")
TABLES: Final = ("left", "center", "right")
GRASP_TABLES: Final = (*TABLES, "start")
"""Tables from which the human may take the screwdriver: one of the three, or the one of its initial position."""
STARTS: Final = ("rest", "random")
RUN_COLUMNS: Final[dict[str, str]] = {
    "run": "int64",  # from 0; a run has the same heights in all conditions and initial postures
    "seed": "int64",  # of the experiment
    "condition": "string",  # one of CONDITIONS; of a family of manikins, who it is planned for and how
    "table": "string",  # one of GRASP_TABLES, missing if infeasible
    "height_left": "float64",  # [m]
    "height_center": "float64",
    "height_right": "float64",
    "chosen_height": "float64",  # [m] of the chosen table, NaN if infeasible
    "reba_grasp": "float64",  # true score of the last slice
    "reba_mean": "float64",  # mean true score over time
    "cost": "float64",  # of the plan, by the cost terms of the condition
    "feasible": "bool",
    "seconds": "float64",  # of planning, without problems that an earlier condition of the run had solved
    "actions": "string",  # in the notation of the paper, joined by "; "
    "initial": "string",  # initial posture, one of STARTS
    "reason": "string",  # why it is infeasible, else empty
    "faults": "int64",  # that the audit of the plan found, 0 if infeasible
    "duration": "float64",  # of the plan [s], NaN if infeasible
    "robot_effort": "float64",  # squared accelerations of the robots' joints over time [rad^2/s^3], NaN if infeasible
    "human_effort": "float64",  # those of the person's joints
}
"""Columns of runs.parquet and their types."""
NUMBERS: Final = ("chosen_height", "reba_grasp", "reba_mean", "cost", "duration", "robot_effort", "human_effort")
"""Columns of runs.parquet that every feasible run has, and no other."""
PATH_COLUMNS: Final[dict[str, str]] = {
    "run": "int64",
    "condition": "string",
    "initial": "string",
    "slice": "int64",  # from 0 over the whole path
    "phase": "int64",  # from 0
    "time": "float64",  # [s]
    "reba": "float64",  # true score
    "load": "float64",  # mass in the hands of the human [kg]
    **dict.fromkeys(COLUMNS, "float64"),  # [deg]
}
"""Columns of paths.parquet and their types; infeasible runs have no rows."""
KEY: Final = ("initial", "run", "condition")
"""Columns that identify a row of runs."""


def check_runs(frame: pd.DataFrame, conditions: Sequence[str] = CONDITIONS) -> pd.DataFrame:
    """Runs with the columns and types of `RUN_COLUMNS`, sorted by `KEY`, conditions as they are given.

    Raises:
        LgpError: a column is missing, unknown or of another type, a name is unknown, a row is a duplicate, a feasible
            run lacks a number, or the heights of a run differ between its rows.
    """
    runs = _typed(frame, RUN_COLUMNS, "runs")
    _names(runs, "condition", conditions)
    _names(runs, "initial", STARTS)
    feasible = runs[runs["feasible"]]
    _names(feasible, "table", GRASP_TABLES)
    bad = feasible[~np.isfinite(feasible[list(NUMBERS)].to_numpy()).all(axis=1)]
    if len(bad):
        raise LgpError(f"{_row(bad)}: feasible, but one of {', '.join(NUMBERS)} is not a number; plan the run again")
    duplicates = runs[runs.duplicated(list(KEY))]
    if len(duplicates):
        raise LgpError(f"{_row(duplicates)}: two rows in the runs; keep one of them")
    heights = [f"height_{table}" for table in TABLES]
    ranges = runs.groupby("run")[heights].agg(np.ptp)
    differ = (ranges.to_numpy() > 1e-9).any(axis=1)
    if differ.any():
        run = ranges.index[int(np.argmax(differ))]
        raise LgpError(f"run {run}: its table heights differ between its rows; expected the same in every condition")
    for table in TABLES:
        chosen = feasible[feasible["table"] == table]
        wrong = chosen[(chosen["chosen_height"] - chosen[f"height_{table}"]).abs() > 1e-9]
        if len(wrong):
            raise LgpError(f"{_row(wrong)}: chosen_height is not height_{table}, the height of its table")
    return _sorted(runs, [*KEY], conditions)


def check_paths(frame: pd.DataFrame, conditions: Sequence[str] = CONDITIONS) -> pd.DataFrame:
    """Paths with the columns and types of `PATH_COLUMNS`, sorted by `KEY` and slice.

    Raises:
        LgpError: a column is missing, unknown or of another type, a name is unknown, or a slice is a duplicate.
    """
    paths = _typed(frame, PATH_COLUMNS, "paths")
    _names(paths, "condition", conditions)
    _names(paths, "initial", STARTS)
    duplicates = paths[paths.duplicated([*KEY, "slice"])]
    if len(duplicates):
        number = duplicates["slice"].iloc[0]
        raise LgpError(f"{_row(duplicates)}: two rows for slice {number} in the paths; keep one of them")
    return _sorted(paths, [*KEY, "slice"], conditions)


def pivot(runs: pd.DataFrame, column: str, initial: str) -> pd.DataFrame:
    """Values of a column: one row per run, one column per condition; NaN if the run is infeasible or missing."""
    feasible = runs[(runs["initial"] == initial) & runs["feasible"]]
    return feasible.pivot(index="run", columns="condition", values=column).reindex(columns=list(CONDITIONS))


def empty(columns: dict[str, str]) -> pd.DataFrame:
    """Table without rows."""
    import pandas as pd

    return pd.DataFrame({name: pd.Series(dtype=kind) for name, kind in columns.items()})


def _typed(frame: pd.DataFrame, columns: dict[str, str], table: str) -> pd.DataFrame:
    missing = [name for name in columns if name not in frame.columns]
    unknown = [name for name in frame.columns if name not in columns]
    if missing or unknown:
        problem = f"column {missing[0]!r} is missing" if missing else f"column {unknown[0]!r} is unknown"
        raise LgpError(f"{table}: {problem}; expected {', '.join(columns)}")
    try:
        return frame[list(columns)].astype(columns)
    except (TypeError, ValueError) as error:
        raise LgpError(f"{table}: a column has another type than expected ({error})") from error


def _names(frame: pd.DataFrame, column: str, expected: Sequence[str]) -> None:
    wrong = frame[~frame[column].isin(expected)]
    if len(wrong):
        raise LgpError(f"{_row(wrong)}: {column} {wrong[column].iloc[0]!r}, expected one of {', '.join(expected)}")


def _row(frame: pd.DataFrame) -> str:
    first = frame.iloc[0]
    return f"run {first['run']}, {first['condition']}, {first['initial']}"


def _sorted(frame: pd.DataFrame, columns: list[str], conditions: Sequence[str]) -> pd.DataFrame:
    ranks = {name: rank for rank, name in enumerate((*STARTS, *conditions))}
    return frame.sort_values(
        columns, key=lambda values: values.map(ranks) if values.name in ("initial", "condition") else values
    ).reset_index(drop=True)


class RunStore:
    """Finished runs of an experiment in a folder: appended one by one, safe against interruption.

    Args:
        folder: created if it does not exist.
        settings: plain data that must be equal for all runs of a folder (scene, cost model, seed).
        conditions: names of the conditions of a run.

    Raises:
        LgpError: the folder holds runs of other settings or another version, is damaged or cannot be written.
    """

    def __init__(self, folder: str | Path, settings: Mapping[str, Any], conditions: Sequence[str] = CONDITIONS) -> None:
        if not isinstance(folder, str | Path):
            raise LgpError(f"folder is {folder!r}; expected the path of a folder for the results")
        self.folder, self.conditions = Path(folder), tuple(conditions)
        check_outputs(FolderOutput(folder, EXPERIMENT_FILES), error=LgpError)
        self._check_settings(json.loads(json.dumps(dict(settings))))
        self._runs, self._paths = self._checked(*_parquet(self.folder))
        self._read_journal()

    def done(self, initial: str) -> set[int]:
        """Numbers of the finished runs from one initial posture."""
        return set(self._runs.loc[self._runs["initial"] == initial, "run"].tolist())

    def complete(
        self,
        runs: int,
        initial: str,
        plan: Callable[[list[int]], Iterable[tuple[pd.DataFrame, pd.DataFrame]]],
        progress: Callable[[int, int], None] | None = None,
    ) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Plan the runs 0 to `runs` - 1 that are not finished yet, append each as it finishes, and return both tables.

        Args:
            initial: initial posture, one of `STARTS`.
            plan: plans the runs of these numbers and yields the tables of each.
            progress: called after each run with the number of finished runs and `runs`.

        Raises:
            LgpError: a run cannot be planned or appended.
            RebaError: a file cannot be written.
        """
        missing = sorted(set(range(runs)) - self.done(initial))
        for count, tables in enumerate(plan(missing), runs - len(missing) + 1):
            self.append(*tables)
            if progress is not None:
                progress(count, runs)
        return self.finish()

    def append(self, runs: pd.DataFrame, paths: pd.DataFrame) -> None:
        """Append a finished run with its paths, none if no condition is feasible; synchronised to disk on return.

        Raises:
            LgpError: `check_runs` or `check_paths` refuses the rows, the run is stored already, or cannot be written.
        """
        runs, paths = self._checked(runs, paths)
        stored = self._keys(self._runs) & self._keys(runs)
        if stored:
            raise LgpError(
                f"run {min(stored)[1]}: is in {self.folder} already; append only runs that are not in `done`"
            )
        line = json.dumps(with_provenance({"runs": _plain(runs), "paths": _plain(paths)})).encode() + b"\n"
        try:
            with open_regular(self.folder / JOURNAL, append=True) as file:
                file.write(line)
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise LgpError(f"{self.folder / JOURNAL}: cannot be written ({error.strerror or error})") from error
        self._add(runs, paths)

    def finish(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        """Write `runs.parquet` and `paths.parquet` and return both tables; more runs may follow.

        Raises:
            RebaError: a file cannot be written.
        """
        runs, paths = self.tables()
        # Order: paths, runs, journal. A run is finished once it is in runs.parquet or in the journal.
        write_atomic(self.folder / "paths.parquet", lambda part: write_parquet(paths, part))
        write_atomic(self.folder / "runs.parquet", lambda part: write_parquet(runs, part))
        (self.folder / JOURNAL).unlink(missing_ok=True)
        return runs, paths

    def tables(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        """All finished runs and their paths, sorted."""
        return self._checked(self._runs, self._paths)

    def _checked(self, runs: pd.DataFrame, paths: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
        return check_runs(runs, self.conditions), check_paths(paths, self.conditions)

    def _check_settings(self, settings: dict[str, Any]) -> None:
        file = self.folder / SETTINGS
        if not file.exists():
            text = json.dumps(settings, indent=1) + "\n"
            write_atomic(file, lambda part: write_text(part, text))
            return
        try:
            stored = json.loads(read_settings(file))
        except (OSError, ValueError, RecursionError) as error:
            raise LgpError(f"{file}: cannot be read ({error}); give another folder") from error
        if not isinstance(stored, dict):
            raise LgpError(f"{file}: expected a JSON object with the settings of the runs; give another folder")
        for name in (*settings, *stored):
            old, new = stored.get(name), settings.get(name)
            if old != new:
                raise LgpError(
                    f"{self.folder}: its runs were made with {name} {old!r}, not {new!r}; give another folder"
                )

    def _read_journal(self) -> None:
        file = self.folder / JOURNAL
        if not file.is_file():
            return
        lines = read_regular(file).splitlines(keepends=True)
        complete = [line for line in lines if line.endswith(b"\n")]
        if len(complete) < len(lines):
            # The process was stopped within a line: drop it, so that its run is planned again.
            def write_complete(part: Path) -> None:
                part.write_bytes(b"".join(complete))

            write_atomic(file, write_complete)
        for number, line in enumerate(complete, 1):
            try:
                data = json.loads(line)
                runs, paths = _frame(data["runs"], RUN_COLUMNS), _frame(data["paths"], PATH_COLUMNS)
            except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
                raise LgpError(
                    f"{file}: line {number} is damaged ({error}); delete the line to plan its run again"
                ) from error
            _check_version(self.folder, data.get(MEMBER))
            # A process stopped between writing the tables and removing the journal leaves a run in both.
            if not self._keys(self._runs) & self._keys(runs):
                self._add(*self._checked(runs, paths))

    def _add(self, runs: pd.DataFrame, paths: pd.DataFrame) -> None:
        self._runs, self._paths = _joined(self._runs, runs), _joined(self._paths, paths)

    @staticmethod
    def _keys(runs: pd.DataFrame) -> set[tuple[Any, ...]]:
        return set(runs[list(KEY)].itertuples(index=False, name=None))


def _parquet(folder: Path) -> tuple[pd.DataFrame, pd.DataFrame]:
    import pandas as pd

    files = folder / "runs.parquet", folder / "paths.parquet"
    if not files[0].is_file():
        return empty(RUN_COLUMNS), empty(PATH_COLUMNS)
    try:
        with open_regular(files[0]) as runs_file, open_regular(files[1]) as paths_file:
            runs, paths = pd.read_parquet(runs_file), pd.read_parquet(paths_file)
            origin = parquet_provenance(files[0])
    except (OSError, ValueError) as error:
        raise LgpError(f"{folder}: its runs cannot be read ({error}); give another folder") from error
    _check_version(folder, origin)
    # A process stopped between writing the two tables leaves paths without a run.
    finished = paths.set_index(list(KEY)).index.isin(runs.set_index(list(KEY)).index)
    return runs, paths[finished]


def _check_version(folder: Path, origin: Any) -> None:
    """Refuse runs of another version, by their provenance: one table must not mix the results of two."""
    if version := other_version(origin):
        raise LgpError(f"{folder}: its runs were {version}; give another folder, or use that version")


def _joined(first: pd.DataFrame, second: pd.DataFrame) -> pd.DataFrame:
    import pandas as pd

    return pd.concat([part for part in (first, second) if len(part)] or [first], ignore_index=True)


def _plain(frame: pd.DataFrame) -> dict[str, list[Any]]:
    """Return columns as lists that JSON holds; what is missing becomes null."""
    return {name: frame[name].astype(object).where(frame[name].notna(), None).tolist() for name in frame.columns}


def _frame(data: dict[str, list[Any]], columns: dict[str, str]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame({name: pd.Series(data[name], dtype=kind) for name, kind in columns.items()})
