"""A complete study: recordings -> scores, paired tests and report.

find_sources -> score_sources -> cells -> analyse -> summary.json, scores.parquet, report.html
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from lgp.errors import LgpError
from lgp.files import REPORT, SUMMARY
from lgp.statistics.paired_tests import require_statsmodels
from lgp.study.analysis import analyse
from lgp.study.conclusions import conclusion, disagreements, parts_conclusion
from lgp.study.recordings import Failure, Sources, find_sources
from lgp.study.report import render
from lgp.study.scoring import Scored, cells, limitations, missing_cells, score_sources
from reba.batch.run import ScoringOptions
from reba.checks import PATH, accepts, from_home, shown
from reba.errors import did_you_mean
from reba.files import as_json, write_atomic, write_folder, write_text
from reba.outputs import FileOutput, Output, check_outputs
from reba.provenance import with_provenance, write_parquet

if TYPE_CHECKING:
    import pandas as pd

FORMAT: Final = "lgp-study"
VERSION: Final = 1
OPTIONS: Final = ScoringOptions(missing="neutral")
"""Default scoring options: unmeasured angles count as neutral, and are listed in the report."""


@dataclass(frozen=True)
class Study:
    """Scored and analysed study.

    Attributes:
        recordings: one row per recording, see `lgp.study.scoring.Scored`.
        cells: one row per participant and condition: means weighted by the duration of the trials.
        summary: means, tests, conclusions, failures and warnings as plain data, with None for NaN.
    """

    recordings: pd.DataFrame
    cells: pd.DataFrame
    summary: dict[str, Any]

    @accepts(LgpError, folder=PATH)
    def save(self, folder: str | Path, *, command: str = "", names: bool = False) -> None:
        """Write `summary.json`, `scores.parquet` (one row per recording) and `report.html` into a folder.

        Args:
            folder: created if it does not exist.
            command: command line that reproduces the results, shown in the report.
            names: show labels of participants and folders in the report; tables and summary have them always.

        Raises:
            RebaError: a file cannot be written.
        """

        def write(part: Path) -> None:
            write_parquet(self.recordings, part / "scores.parquet")
            self.write_report(part / REPORT, command=command, names=names)
            write_text(part / SUMMARY, as_json(self.summary, indent=1) + "\n")

        write_folder(folder, write, last=SUMMARY)

    def write_report(self, path: str | Path, *, command: str = "", names: bool = False) -> None:
        """Write the report as one HTML file.

        Args:
            command: command line that reproduces the results, shown in the report.
            names: show labels of participants and folders; they are left out by default.

        Raises:
            RebaError: the file cannot be written.
        """
        check_outputs(FileOutput(path))
        html = render(self.summary, command=command, names=names)
        write_atomic(Path(path), lambda part: write_text(part, html))


def run_study(
    logs: str | Path | Sequence[str | Path],
    *,
    manifest: str | Path | None = None,
    pattern: str | None = None,
    conditions: Sequence[str] = (),
    options: ScoringOptions = OPTIONS,
    exclude: str | Path | None = None,
    outputs: Sequence[Output] = (),
    on_scored: Callable[[str], None] | None = None,
) -> Study:
    """Score the recordings of participants in several conditions, and compare the conditions with paired tests.

    Each recording needs a label with participant and condition: in its own metadata record `study`, in a manifest, or
    in its file name. The primary measure is the time-weighted mean REBA score; two conditions are compared with a
    paired t test and the exact signed-rank test, more with a repeated-measures ANOVA and Holm's correction of all
    pairs.

    Args:
        logs: a file or folder of recordings, or several; may be empty with a manifest.
        manifest: CSV file with the columns file, participant, condition and, if there are several, trial.
        pattern: of file names with the label, such as `{participant}_{condition}`.
        conditions: conditions to compare, in their order; by default all, in the order of the manifest or of their
            names. Differences are earlier minus later.
        options: for reading and scoring; by default unmeasured angles count as neutral.
        exclude: folder of results, which is not searched for recordings.
        outputs: what will be written of the study, `reba.outputs`: refused before the scoring where it cannot be
            written or would replace a recording.
        on_scored: called with the path of each recording after it was scored.

    Returns:
        The study; `.summary` holds means, tests and conclusions, `.save(folder)` writes tables and report.

    Raises:
        LgpError: a label or condition is missing or wrong, no recording can be scored, or statsmodels is not installed.
        RebaError: a file does not exist, or an option is wrong.
    """
    paths = [logs] if isinstance(logs, str | Path) else logs
    if not isinstance(paths, Sequence) or not all(isinstance(path, str | Path) for path in paths):
        raise LgpError(f"logs is {shown(logs)}; expected a path of recordings, or a list of paths")
    if isinstance(conditions, str) or not isinstance(conditions, Sequence):
        raise LgpError(
            f"conditions is {shown(conditions)}; expected a list of names such as ['ergonomic', 'non-ergonomic']"
        )
    require_statsmodels()
    options = options.with_files_read()
    names = [str(from_home(path)) for path in paths]
    labelled = find_sources(names, from_home(manifest), pattern, from_home(exclude))
    check_outputs(*outputs, inputs=[*(file for file, _ in labelled.named), *(one.input for one in labelled.unnamed)])
    sources, order, ignored = choose(labelled, conditions)
    scored, failure = score_sources(sources, options, on_scored)
    if failure is not None:
        raise LgpError(f"none of the recordings can be scored; the first: {failure.error}")
    table = cells(scored.recordings)
    return Study(scored.recordings, table, summarise(sources, scored, table, order, ignored))


def choose(sources: Sources, conditions: Sequence[str]) -> tuple[Sources, list[str], list[str]]:
    """Recordings of the chosen conditions, these in order, and the ignored conditions.

    Raises:
        LgpError: a chosen condition has no recording, or is repeated.
    """
    if not conditions:
        return sources, list(sources.conditions), []
    for name in conditions:
        if name not in sources.conditions:
            near = did_you_mean(name, sources.conditions)
            raise LgpError(
                f"--conditions: {name!r} has no recording{near}; expected some of {', '.join(sources.conditions)}"
            )
    if len(set(conditions)) < len(conditions):
        raise LgpError(f"--conditions: {', '.join(conditions)}: a condition is repeated; name each once")
    named = tuple(pair for pair in sources.named if pair[1].condition in conditions)
    absent = tuple(label for label in sources.absent if label.condition in conditions)
    ignored = [name for name in sources.conditions if name not in conditions]
    return replace(sources, named=named, absent=absent), list(conditions), ignored


def summarise(
    sources: Sources, scored: Scored, table: pd.DataFrame, conditions: Sequence[str], ignored: Sequence[str] = ()
) -> dict[str, Any]:
    """Content of `summary.json` as plain data, with None for NaN.

    Args:
        table: one row per participant and condition.
        ignored: conditions that are not compared.
    """
    results = analyse(table, conditions)
    missing = missing_cells(sources, scored, conditions)
    incomplete = {cell["participant"] for cell in missing}
    participants = sorted({*table["participant"].tolist(), *incomplete})
    plain: dict[str, Any] = json.loads(as_json({
        "format": FORMAT,
        "version": VERSION,
        "simulated": bool(scored.recordings["simulated"].any()),
        "conditions": list(conditions),
        "ignored_conditions": list(ignored),
        "participants": participants,
        "complete": [name for name in participants if name not in incomplete],
        "incomplete": [name for name in participants if name in incomplete],
        "missing": missing,
        "failed": [_failure(one) for one in scored.failed],
        "warnings": limitations(scored, results, table),
        "notes": scored.notes,
        "assumed": list(scored.assumed),
        "unmeasured": sorted(set[str]().union(*map(set, scored.unmeasured.values()))),
        "rules": scored.rules,
        **results,
        "recordings": scored.recordings.to_dict("records"),
    }))  # fmt: skip
    conclusions = {"verdict": conclusion(plain, list(conditions)), "parts_verdict": parts_conclusion(plain)}
    plain["warnings"] = [*disagreements(plain), *plain["warnings"]]
    return with_provenance({**{name: plain.pop(name) for name in ("format", "version")}, **conclusions, **plain})


def _failure(failure: Failure) -> dict[str, Any]:
    label = None if failure.label is None else asdict(failure.label)
    return {"input": failure.input, "error": failure.error, "label": label}
