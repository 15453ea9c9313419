"""Output of `reba score` besides the scores: tables or JSON, the report, failures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Final

from reba.batch.dataset import NEW, Dataset
from reba.batch.dataset_run import DatasetRun, score_into
from reba.batch.manifest import MANIFEST
from reba.batch.run import RecordingResult, ScoringOptions
from reba.camera import pictures_of_all
from reba.command_line import command_line, echo
from reba.console import show_results, show_totals
from reba.errors import RebaError
from reba.files import as_json
from reba.provenance import with_provenance
from reba.report import write_report
from reba.terminal import console

MAX_LISTED: Final = 40
"""Recordings up to which each has a line in the terminal; of more, only the totals are printed."""


def show(
    results: Sequence[RecordingResult], file: Path | None, report: str | None, form: dict[str, Any], as_json: bool
) -> int:
    """Print results, write the report, and return the number of failed recordings.

    Raises:
        RebaError: the only recording failed, or the report cannot be written.
    """
    failed = sum(result.error is not None for result in results)
    _raise_single_failure(results, failed)
    written = _write_report(report, form, [one.scores for one in results if one.scores is not None], results)
    if as_json:
        print_results(results)
    else:
        show_results(console(), results)
        for path in [*([file] if file is not None and file.exists() else []), *written]:
            echo(f"written: {path}", err=True)
    return failed


def into_dataset(
    folder: Path,
    inputs: Sequence[str],
    options: ScoringOptions,
    report: str | None,
    form: dict[str, Any],
    as_json: bool,
    progress: AbstractContextManager[Callable[[str], None]],
    where: dict[str, Any],
) -> int:
    """Score into a dataset, print the results, write the report, and return the number of failed recordings.

    Raises:
        RebaError: the only recording failed, or the dataset or the report cannot be written.
    """
    with Dataset(folder) as dataset:
        with progress as advance:
            run = score_into(dataset, inputs, options, on_done=advance, **where)
        if len(inputs) == 1:
            _raise_single_failure(list(dataset.results(inputs)), run.failed)
        written = _write_report(
            report, form, [run.scores[name] for name in inputs if name in run.scores], dataset.results(inputs)
        )
        if as_json:
            print_results(dataset.results(inputs), dataset={"output": str(folder), **run.to_dict()})
            return run.failed
        if len(inputs) <= MAX_LISTED:
            show_results(console(), list(dataset.results(inputs)))
        else:
            show_totals(console(), dataset.results(inputs))
    for line in [f"{folder}: {_counts(run)}; the results of each recording are in {MANIFEST}", *written]:
        echo(f"written: {line}", err=True)
    return run.failed


def print_results(results: Iterable[RecordingResult], **more: Any) -> None:
    """Print the JSON object of `reba score` recording by recording, so that memory does not grow with their number.

    `more` are further members of the object, after the lists of recordings and failures.
    """
    failed = []
    echo('{"recordings": [', nl=False, data=True)
    separator = ""
    for result in results:
        if result.error is not None:
            failed.append({"input": result.input, "error": result.error})
        else:
            echo(separator + as_json(result.summary, non_finite="refuse"), nl=False, data=True)
            separator = ", "
    rest = as_json(with_provenance({"failed": failed, **more}), non_finite="refuse")
    echo(f"], {rest[1:]}", data=True)


def _counts(run: DatasetRun) -> str:
    """Return the counts of a run as text."""
    reasons = ", ".join(
        f"{number} {'new' if reason == NEW else f'again: {reason}'}" for reason, number in run.scored.items()
    )
    parts = [f"{run.scored.total() - run.failed} scored"]
    parts += [f"{run.failed} failed"] if run.failed else []
    done = ", ".join(parts) + (f" ({reasons})" if reasons else "")
    return done + (f", {run.unchanged} unchanged" if run.unchanged else "")


def _raise_single_failure(results: Sequence[RecordingResult], failed: int) -> None:
    if len(results) == 1 and failed:
        raise RebaError(results[0].error or "the recording could not be scored")


def _write_report(
    report: str | None, form: dict[str, Any], scores: list[Any], results: Iterable[RecordingResult]
) -> list[str]:
    """Write the report if requested, with the recordings that failed, and return its path."""
    if report is None or not scores:
        return []
    report_on(scores, report, form, [(one.input, one.error) for one in results if one.error is not None])
    return [report]


def report_on(scores: list[Any], report: str, form: Mapping[str, Any], failed: Sequence[tuple[str, str]] = ()) -> None:
    """Write the report of a command, with pictures of a camera if they were asked for.

    Args:
        form: values of `report_form`.
        failed: path and error of recordings that could not be scored.

    Raises:
        RebaError: the report cannot be written, or no recording has the camera that was named.
    """
    form = dict(form)
    look, camera = form.pop("images"), form.pop("camera")
    pictures = [] if look is None else pictures_of_all(scores, look, camera)
    for one in pictures:
        if one.note:
            echo(f"note: {one.note}", err=True)
    write_report(scores, report, command=command_line("reba"), failed=failed, pictures=pictures, **form)
