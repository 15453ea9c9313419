"""What `reba score` tells and writes beside the scores: tables or JSON, the report, what failed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Final

import click

from reba.batch.dataset import NEW, Dataset
from reba.batch.dataset_run import DatasetRun, score_into
from reba.batch.manifest import MANIFEST
from reba.batch.run import RecordingResult, ScoringOptions
from reba.command_line import command_line, console
from reba.console import show_outcomes, show_totals
from reba.errors import RebaError
from reba.report import write_report

SHOWN: Final = 40
"""Recordings up to which each gets a line in the terminal; beyond, all of them together get one."""


def show(outcomes: Sequence[RecordingResult], file: Path | None, report: str | None, as_json: bool) -> int:
    """Tell what became of recordings that are all in memory, write the report, and return how many failed.

    Raises:
        RebaError: the only recording failed, or the report cannot be written.
    """
    failed = sum(outcome.error is not None for outcome in outcomes)
    _refuse(outcomes, failed)
    written = _report(report, [outcome.scores for outcome in outcomes if outcome.scores is not None])
    if as_json:
        print_outcomes(outcomes)
    else:
        show_outcomes(console(), outcomes)
        for place in [*([file] if file is not None and file.exists() else []), *written]:
            click.echo(f"written: {place}", err=True)
    return failed


def into_dataset(
    folder: Path,
    inputs: Sequence[str],
    options: ScoringOptions,
    report: str | None,
    as_json: bool,
    progress: AbstractContextManager[Callable[[str], None]],
    where: dict[str, Any],
) -> int:
    """Score into a dataset, tell what became of the recordings, write the report, and return how many failed.

    Raises:
        RebaError: the only recording failed, or something cannot be used or written.
    """
    with Dataset(folder) as dataset:
        with progress as advance:
            run = score_into(dataset, inputs, options, done=advance, **where)
        if len(inputs) == 1:
            _refuse(list(dataset.outcomes(inputs)), run.failed)
        written = _report(report, [run.scores[name] for name in inputs if name in run.scores])
        if as_json:
            print_outcomes(dataset.outcomes(inputs), dataset={"output": str(folder), **run.to_dict()})
            return run.failed
        if len(inputs) <= SHOWN:
            show_outcomes(console(), list(dataset.outcomes(inputs)))
        else:
            show_totals(console(), dataset.outcomes(inputs))
    for line in [f"{folder}: {_told(run)}; what became of each is in {MANIFEST}", *written]:
        click.echo(f"written: {line}", err=True)
    return run.failed


def print_outcomes(outcomes: Iterable[RecordingResult], **more: Any) -> None:
    """Print the JSON object of `reba score`, one recording after the other, so that none has to be kept.

    Args:
        outcomes: of all recordings.
        more: what follows the lists of recordings and failures.
    """
    failed = []
    click.echo('{"recordings": [', nl=False)
    separator = ""
    for outcome in outcomes:
        if outcome.error is not None:
            failed.append({"input": outcome.input, "error": outcome.error})
        else:
            click.echo(separator + json.dumps(outcome.summary, allow_nan=False), nl=False)
            separator = ", "
    rest = json.dumps({"failed": failed, **more}, allow_nan=False)
    click.echo(f"], {rest[1:]}")


def _told(run: DatasetRun) -> str:
    """Return what a run did in words."""
    reasons = ", ".join(f"{number} {'new' if why == NEW else f'again: {why}'}" for why, number in run.scored.items())
    words = [f"{run.scored.total()} scored" + (f" ({reasons})" if reasons else "")]
    words += [f"{run.unchanged} unchanged"] if run.unchanged else []
    words += [f"{run.failed} of them failed"] if run.failed else []
    return ", ".join(words)


def _refuse(outcomes: Sequence[RecordingResult], failed: int) -> None:
    if len(outcomes) == 1 and failed:
        raise RebaError(outcomes[0].error or "it could not be scored")


def _report(report: str | None, scores: list[Any]) -> list[str]:
    """Write the report if it was asked for, and return its place."""
    if report is None or not scores:
        return []

    write_report(report, scores, command=command_line("reba"))
    return [report]
