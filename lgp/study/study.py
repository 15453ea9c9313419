"""A study from beginning to end: recordings in; scores, tests and a page out.

find_sources -> score_sources -> cells -> analyse -> summary.json, scores.parquet, report.html
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from lgp.errors import LgpError
from lgp.statistics.paired_tests import require_statsmodels
from lgp.study.analysis import analyse
from lgp.study.conclusions import agreement, parts_sentence, verdict
from lgp.study.recordings import Sources, find_sources
from lgp.study.report import render
from lgp.study.scoring import Scored, cells, missing_cells, score_sources, warnings
from reba.batch.run import ScoringOptions
from reba.errors import did_you_mean
from reba.files import as_json, write_atomic, write_text
from reba.method.rules import rules_of

if TYPE_CHECKING:
    import pandas as pd

FORMAT: Final = "lgp-study"
VERSION: Final = 1
OPTIONS: Final = ScoringOptions(missing="neutral")
"""How recordings are scored by default: angles that no recording holds count as neutral, and the report says so."""


@dataclass(frozen=True)
class Study:
    """A scored study.

    Attributes:
        recordings: one row per recording, see `lgp.study.scoring.Scored`.
        cells: one row per participant and condition.
        summary: everything that was found, as plain data.
    """

    recordings: pd.DataFrame
    cells: pd.DataFrame
    summary: dict[str, Any]

    def save(self, folder: str | Path, command: str = "") -> None:
        """Write summary.json, scores.parquet (one row per recording) and report.html into a folder.

        Raises:
            RebaError: a file cannot be written.
        """
        place = Path(folder)
        text = as_json(self.summary, indent=1) + "\n"
        write_atomic(place / "summary.json", lambda part: write_text(part, text))
        write_atomic(place / "scores.parquet", lambda part: self.recordings.to_parquet(part, index=False))
        self.write_report(place / "report.html", command)

    def write_report(self, path: str | Path, command: str = "") -> None:
        """Write the page as one HTML file.

        Raises:
            RebaError: the file cannot be written.
        """

        html = render(self.summary, command=command)
        write_atomic(Path(path), lambda part: write_text(part, html))


def study(
    logs: Sequence[str],
    *,
    manifest: str | Path | None = None,
    pattern: str | None = None,
    conditions: Sequence[str] = (),
    options: ScoringOptions = OPTIONS,
    without: str | Path | None = None,
    done: Callable[[str], None] = lambda file: None,
) -> Study:
    """Score the recordings of a study and compare its conditions.

    Args:
        logs: files and folders; may be empty with a manifest.
        manifest: CSV file that names participant and condition of each recording.
        pattern: file names that do, such as `{participant}_{condition}`; by default the recordings themselves do.
        conditions: their order, and which count; by default all, in the manifest's order or by name. Differences are
            earlier minus later.
        options: how recordings are read and scored.
        without: a folder for results, in which no recordings are looked for.
        done: called with each file that was scored.

    Raises:
        LgpError: labels or conditions are wrong, or statsmodels is not installed.
        RebaError: a file does not exist, an option is wrong, or no recording at all can be scored.

    Example:
        >>> study(["logs"]).summary["verdict"]                              # doctest: +SKIP
        'The mean REBA score is 0.84 lower with ergonomic than with non-ergonomic ...'
    """

    require_statsmodels()
    rules_of(options.rules)
    found = find_sources(logs, manifest, pattern, None if without is None else Path(without))
    sources, order, ignored = choose(found, conditions)
    scored, nothing = score_sources(sources, options, done)
    if nothing is not None:
        raise LgpError(f"none of the recordings can be used; the first: {nothing.error}")
    table = cells(scored.recordings)
    return Study(scored.recordings, table, summarise(sources, scored, table, order, ignored))


def choose(sources: Sources, conditions: Sequence[str]) -> tuple[Sources, list[str], list[str]]:
    """Return the recordings of the wanted conditions, these in order, and the names of conditions left aside.

    Raises:
        LgpError: a wanted condition has no recording, or stands twice.
    """
    if not conditions:
        return sources, list(sources.conditions), []
    for name in conditions:
        if name not in sources.conditions:
            near = did_you_mean(name, sources.conditions)
            raise LgpError(f"--conditions: {name!r} has no recording{near}; there are {', '.join(sources.conditions)}")
    if len(set(conditions)) < len(conditions):
        raise LgpError(f"--conditions: {', '.join(conditions)}: one of them stands twice; name each once")
    named = tuple(pair for pair in sources.named if pair[1].condition in conditions)
    absent = tuple(label for label in sources.absent if label.condition in conditions)
    ignored = [name for name in sources.conditions if name not in conditions]
    return replace(sources, named=named, absent=absent), list(conditions), ignored


def summarise(
    sources: Sources, scored: Scored, table: pd.DataFrame, conditions: Sequence[str], ignored: Sequence[str] = ()
) -> dict[str, Any]:
    """Return everything that was found as plain data; what is not a number is None.

    Args:
        sources: the recordings with their labels.
        scored: their scores.
        table: one row per participant and condition.
        conditions: in their order.
        ignored: conditions that were left aside on purpose.
    """
    found = analyse(table, conditions)
    gaps = missing_cells(sources, scored, conditions)
    simulated = scored.recordings["simulated"]
    people = sorted({*table["participant"].tolist(), *(gap["participant"] for gap in gaps)})
    without = {gap["participant"] for gap in gaps}
    plain: dict[str, Any] = json.loads(as_json({
        "format": FORMAT,
        "version": VERSION,
        "simulated": bool(simulated.any()),
        "conditions": list(conditions),
        "ignored_conditions": list(ignored),
        "participants": people,
        "complete": [name for name in people if name not in without],
        "incomplete": [name for name in people if name in without],
        "missing": gaps,
        "failed": [_failure(one) for one in scored.failed],
        "warnings": warnings(scored, found, table),
        "notes": scored.notes,
        "assumed": list(scored.assumed),
        "unmeasured": sorted(set[str]().union(*map(set, scored.unmeasured.values()))),
        "rules": scored.rules,
        **found,
        "recordings": scored.recordings.to_dict("records"),
    }))  # fmt: skip
    said = {"verdict": verdict(plain, list(conditions)), "parts_verdict": parts_sentence(plain)}
    plain["warnings"] = [*agreement(plain), *plain["warnings"]]
    return {**{name: plain.pop(name) for name in ("format", "version")}, **said, **plain}


def _failure(one: Any) -> dict[str, Any]:
    label = None if one.label is None else asdict(one.label)
    return {"input": one.input, "error": one.error, "label": label}
