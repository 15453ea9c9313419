"""The recordings that the page has been given, in a temporary folder, and what is computed from them."""

from __future__ import annotations

import secrets
import shutil
import threading
from collections.abc import AsyncIterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PureWindowsPath
from typing import Any, Final

from reba.checks import is_finite, shown
from reba.errors import RebaError
from reba.method.measurement_error import MEASUREMENTS
from reba.method.rules import PRESETS
from reba.outputs import LONGEST_NAME
from reba.posture.factors import COUPLINGS, SUPPORTS
from reba.posture.table import PostureTable
from reba.readers import read
from reba.readers.info import info
from reba.report import write_report
from reba.report.comparison import compared_figures, differing
from reba.report.summary import summarise
from reba.scores import Scores, score
from reba.writers import write_scores

SPARE_BYTES: Final = 1 << 30
"""Space that an upload leaves on the disk."""
MOST_TASKS: Final = 50
"""Tasks of one recording: each has a section of the report."""
LARGEST_LOAD: Final = 1e4
"""[kg] As of the commands."""
MOST_NAME: Final = 200
"""Letters of the name of a task."""
CHOICES: Final[Mapping[str, tuple[str, ...]]] = {
    "rules": tuple(PRESETS),
    "coupling": COUPLINGS,
    "support": SUPPORTS,
    "error": MEASUREMENTS,
}
"""Setting -> its values, beside none."""
READ_BY: Final = ("neutral", "topic")
"""Settings of `reba.read` that the page offers."""
COMPARED: Final = 6
"""Figures of a comparison that the page shows: those of REBA and the time at high risk; the report has all."""
RESULTS: Final[Mapping[str, str]] = {
    "report.html": "text/html; charset=utf-8",
    "scores.csv": "text/csv; charset=utf-8",
    "scores.xlsx": "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
}
"""File of a result -> its media type; the tables are of the first task."""


@dataclass
class Scored:
    """Scores of one recording, one for each task, and the folder of their files; of a comparison only the files."""

    name: str
    folder: Path
    scores: list[Scores] = field(default_factory=list)


class Recordings:
    """Recordings and results of one server.

    Args:
        folder: an empty one, which the caller removes.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._recordings: dict[str, Path] = {}
        self._results: dict[str, Scored] = {}
        self._work = threading.Lock()

    async def add(self, name: str, size: int | None, content: AsyncIterator[bytes]) -> dict[str, Any]:
        """Keep a recording that is sent; return its id and name.

        Raises:
            RebaError: the name cannot be one of a file, or the disk has too little space.
        """
        safe = _file_name(name)
        self._check_space(size or 0)
        key = secrets.token_urlsafe(9)
        place = self.folder / key
        place.mkdir()
        kept = place / safe
        try:
            with kept.open("wb") as file:
                async for part in content:
                    self._check_space(len(part))
                    file.write(part)
        except BaseException:
            shutil.rmtree(place, ignore_errors=True)
            raise
        self._recordings[key] = kept
        return {"id": key, "name": safe}

    def about(self, key: str, reading: Mapping[str, Any]) -> dict[str, Any]:
        """Return what was recognised in a recording, as plain data.

        Args:
            reading: any of `READ_BY`.

        Raises:
            RebaError: a value of `reading` is wrong, or the recording cannot be read.
        """
        path = self._path(key)
        with self._work:
            content = info(path, **_reading(reading)).to_dict()
        names = ("format", "title", "recognised", "usable", "frames", "seconds", "rate", "measured", "unmeasured",
                 "assumed", "warnings")  # fmt: skip
        return {name: content[name] for name in names} | {"topics": _topics(content["streams"])}

    def remove(self, key: str) -> None:
        """Forget a recording and delete its file."""
        path = self._path(key)
        del self._recordings[key]
        shutil.rmtree(path.parent, ignore_errors=True)

    def score(self, key: str, settings: Mapping[str, Any]) -> dict[str, Any]:
        """Score a recording, or each of its tasks; write report and tables, and return their summary.

        Args:
            settings: any of rules, load [kg], coupling, support, shock, arm_supported, error, those of `READ_BY`, and
                `tasks`: a list of {"name", "start", "end"} [s], by default one over the whole recording.

        Raises:
            RebaError: a setting is wrong, or the recording cannot be scored.
        """
        path = self._path(key)
        factors, rules, error = _settings(settings)
        tasks = _tasks(settings.get("tasks"), path.name)
        result = self._result(path.name)
        with self._work:
            for name, start, end in tasks:
                postures = read(path, start=start, end=end, **_reading(settings))
                one = score(_named(postures, name), rules=rules, error=error, **factors)
                result.scores.append(one)
            write_report(result.scores, result.folder / "report.html")
            write_scores(result.scores[0], result.folder / "scores.csv")
            if _has_openpyxl():
                write_scores(result.scores[0], result.folder / "scores.xlsx")
        files = [name for name in RESULTS if (result.folder / name).exists()]
        rows = [
            {"name": name, "start": start, "end": end, **_row(one.summary())}
            for (name, start, end), one in zip(tasks, result.scores, strict=True)
        ]
        return {"id": self._keep(result), "name": result.name, "rows": rows, "files": files}

    def result(self, code: str, name: str) -> Path:
        """Return a file of a result.

        Raises:
            RebaError: there is no such result or file.
        """
        if name not in RESULTS or not (self._scored(code).folder / name).is_file():
            raise RebaError(f"there is no file {name!r} of this result; score the recording again")
        return self._scored(code).folder / name

    def compare(self, first: str, second: str) -> dict[str, Any]:
        """Compare the first tasks of two results, second minus first, as plain data; write the report of both.

        Raises:
            RebaError: there is no such result.
        """
        before, after = self._scored(first), self._scored(second)
        if not (before.scores and after.scores):
            raise RebaError("a comparison cannot be compared; choose two results of recordings")
        result = self._result(f"{before.name} and {after.name}")
        with self._work:
            pair = [before.scores[0], after.scores[0]]
            a, b = map(summarise, pair)
            write_report(pair, result.folder / "report.html")
        return {
            "id": self._keep(result),
            "verdicts": [[one.name, one.summary["verdict"]["text"]] for one in (a, b)],
            "rows": [[row.name, row.first, row.second, row.change] for row in compared_figures(a, b)[:COMPARED]],
            "notes": list(differing(a, b)),
        }

    def _result(self, name: str) -> Scored:
        """Return a result without files in a folder of its own."""
        result = Scored(name, self.folder / f"result-{secrets.token_urlsafe(9)}")
        result.folder.mkdir()
        return result

    def _keep(self, result: Scored) -> str:
        """Keep a result whose files are written; return its id."""
        code = result.folder.name.removeprefix("result-")
        self._results[code] = result
        return code

    def _check_space(self, size: int) -> None:
        free = shutil.disk_usage(self.folder).free
        if size > free - SPARE_BYTES:
            text = f"the recording has {size} bytes, the disk has {free} left; make space, or use `reba score`"
            raise RebaError(text)

    def _path(self, key: str) -> Path:
        if key not in self._recordings:
            raise RebaError("the recording is not there any more; drop the file again")
        return self._recordings[key]

    def _scored(self, code: str) -> Scored:
        if code not in self._results:
            raise RebaError("the result is not there any more; score the recording again")
        return self._results[code]


def _file_name(name: str) -> str:
    """Return the last part of a name that a browser gives, which can be that of a file."""
    last = PureWindowsPath(name.replace("/", "\\")).name
    if not last or last.startswith(".") or not last.isprintable():
        raise RebaError(f"the file is named {name[:80]!r}; give it a name of letters, digits and an ending")
    if len(last.encode()) > LONGEST_NAME:
        raise RebaError(f"the name {last[:80]!r}... has {len(last.encode())} bytes; give one of at most {LONGEST_NAME}")
    return last


def _settings(given: Mapping[str, Any]) -> tuple[dict[str, Any], str, str | None]:
    known = {"load", "shock", "arm_supported", "tasks", *CHOICES, *READ_BY}
    unknown = sorted(set(given) - known)
    if unknown:
        raise RebaError(f"setting {unknown[0]!r} is unknown; known are {', '.join(sorted(known))}")
    for name, values in CHOICES.items():
        if given.get(name) not in (None, "", *values):
            raise RebaError(f"{name} is {given[name]!r}; expected one of {', '.join(values)}")
    load = given.get("load")
    if load is not None and not (is_finite(load) and 0 <= load <= LARGEST_LOAD):
        raise RebaError(f"load is {shown(load)} kg; expected a number from 0 to {LARGEST_LOAD:g}")
    for name in ("shock", "arm_supported"):
        if not isinstance(given.get(name), bool | None):
            raise RebaError(f"{name} is {shown(given[name])}; expected true or false")
    factors = {name: given[name] for name in ("coupling", "support") if given.get(name)}
    factors |= {name: True for name in ("shock", "arm_supported") if given.get(name)}
    factors |= {} if load is None else {"load": float(load)}
    return factors, given.get("rules") or "measured", given.get("error") or None


def _reading(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the settings that reading needs; what they may be, the readers say."""
    return {name: given[name] for name in READ_BY if given.get(name)}


def _topics(streams: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the streams and persons of which one can be chosen, none where there is no choice."""
    names = [
        name
        for stream in streams
        for name in ([f"{stream['name']}#{body}" for body in stream["bodies"]] or [stream["name"]])
    ]
    return names if len(names) > 1 else []


def _tasks(given: Any, whole: str) -> list[tuple[str, float | None, float | None]]:
    if given is None or given == []:
        return [(whole, None, None)]
    if not isinstance(given, list) or len(given) > MOST_TASKS or not all(isinstance(one, Mapping) for one in given):
        raise RebaError(f"tasks: expected a list of at most {MOST_TASKS} with name, start and end")
    tasks = []
    for one in given:
        unknown = sorted(set(one) - {"name", "start", "end"})
        if unknown or not isinstance(one.get("name", ""), str):
            raise RebaError(f"task {shown(one)}: expected a text as name, start and end")
        name, times = (one.get("name") or whole)[:MOST_NAME], [one.get("start"), one.get("end")]
        for time in times:
            if time is not None and not is_finite(time):
                raise RebaError(f"task {name!r}: {shown(time)} is no time; expected seconds")
        tasks.append((name, *(None if time is None else float(time) for time in times)))
    return tasks  # type: ignore[return-value]


def _named(postures: PostureTable, name: str) -> PostureTable:
    """Return postures under the name of their task, which heads their section of the report."""
    return replace(postures, source=name, files=postures.inputs)


def _row(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the page shows of a summary."""
    return {
        "verdict": summary["verdict"]["text"],
        "high_seconds": summary["verdict"]["high_seconds"],
        "frames": summary["frames"],
        "seconds": summary["seconds"],
        "reba": summary["reba"],
        "range": summary["range"],
        "action_levels": summary["action_levels"],
        "undetermined": summary["action_level_undetermined"],
        "worst": summary["worst"][:3],
        "assumed": summary["assumed"],
        "unmeasured": summary["unmeasured"],
    }


def _has_openpyxl() -> bool:
    try:
        import openpyxl  # noqa: F401
    except ImportError:
        return False
    return True
