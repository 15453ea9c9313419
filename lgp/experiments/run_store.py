"""A folder of runs that can be added to: finished runs are safe at once, and a killed experiment goes on where it was.

While runs are made, each finished one is a line of `unfinished.jsonl`; `finish` turns all of them into `runs.parquet`
and `paths.parquet`. `settings.json` holds what every run of the folder has in common.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from lgp.errors import LgpError
from lgp.experiments.runs import KEY, PATH_COLUMNS, RUN_COLUMNS, check_paths, check_runs, empty
from reba.writers import write_atomic, write_text

if TYPE_CHECKING:
    import pandas as pd

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
