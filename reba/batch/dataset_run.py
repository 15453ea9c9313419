"""Scoring into a dataset: what is due, by processes or a cluster, each result written down as it comes."""

from __future__ import annotations

import contextlib
import os
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from reba.batch.dataset import LOCK, Dataset, PendingRecording, settings
from reba.batch.manifest import Content, content_hash, stamp
from reba.batch.parallel import run_parallel
from reba.batch.run import RecordingResult, ScoringOptions, score_one, sees
from reba.batch.worker_pool import WorkerDied
from reba.scores import Scores


@dataclass
class DatasetRun:
    """What a run did.

    Attributes:
        recordings: that were asked for.
        scored: how many were scored for each reason, such as "new"; failed ones count too.
        unchanged: recordings that were scored before.
        failed: how many failed.
        frames: that were scored.
        seconds: that the run took.
        scores: by input, if they were to be kept.
    """

    recordings: int
    scored: Counter[str] = field(default_factory=Counter)
    unchanged: int = 0
    failed: int = 0
    frames: int = 0
    seconds: float = 0.0
    scores: dict[str, Scores] = field(default_factory=dict)

    def to_dict(self) -> dict[str, Any]:
        """Return the counts as plain data."""
        return {
            "scored": dict(self.scored),
            "unchanged": self.unchanged,
            "failed": self.failed,
            "frames": self.frames,
            "seconds": round(self.seconds, 3),
        }


@dataclass(frozen=True)
class ScoredPart:
    """What became of a part, where it was scored; `outcome` is None if its content turned out to be the same."""

    outcome: RecordingResult | None
    content: Content
    seconds: float


def score_into(
    dataset: Dataset,
    inputs: Sequence[str],
    options: ScoringOptions,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    keep: bool = False,
    done: Callable[[str], None] = lambda name: None,
) -> DatasetRun:
    """Score what a dataset lacks; each recording is safe as soon as it is done.

    Args:
        dataset: open.
        inputs: recordings.
        options: how they are scored.
        jobs, scheduler: where, as for `reba.batch.parallel.run_parallel`.
        keep: whether the run holds the scores themselves (for a report); then everything is scored.
        done: called with the name of each recording.

    Raises:
        RebaError: options are wrong, the cluster cannot be used, or the dataset cannot be written.

    Example:
        >>> with Dataset("scores") as dataset:                                    # doctest: +SKIP
        ...     run = score_into(dataset, ["a.mcap", "b.mcap"], Options(), jobs=2)
    """
    start = time.perf_counter()
    with_ = settings(options)
    parts = dataset.due(inputs, with_, everything=keep)
    recordings = len({Path(name).resolve() for name in inputs})
    run = DatasetRun(recordings, unchanged=recordings - len(parts))
    far = scheduler is not None
    work = partial(score_part, options=options.anywhere() if far else options, keep=keep, far=far)
    probe = None
    if parts:
        lock = str(dataset.folder / LOCK)
        probe = partial(sees, parts[0].path, str(dataset.folder), lock, dataset.token)
    for part, result in run_parallel(work, parts, jobs=min(jobs, max(len(parts), 1)), scheduler=scheduler, probe=probe):
        _take(dataset, run, part, result, with_)
        done(part.input)
    run.seconds = time.perf_counter() - start
    return run


def score_part(part: PendingRecording, *, options: ScoringOptions, keep: bool, far: bool = False) -> ScoredPart:
    """Score one recording into its file, which is safe on disk when this returns.

    Args:
        part: the recording.
        options: how it is scored.
        keep: whether the scores come back too.
        far: whether this process may work in another folder than the one that asked.
    """
    start = time.perf_counter()
    path = part.path if far else part.input
    size, modified = stamp(path)
    if part.before and content_hash(path) == part.before:
        return ScoredPart(None, Content(size, modified, part.before), time.perf_counter() - start)
    outcome = score_one(path, part.output, options, keep)
    if outcome.error is None:
        _settle(part.output)
    content = Content(size, modified, outcome.hash or content_hash(path))
    return ScoredPart(outcome, content, time.perf_counter() - start)


def _take(
    dataset: Dataset, run: DatasetRun, part: PendingRecording, result: ScoredPart | WorkerDied, with_: dict[str, Any]
) -> None:
    """Write a result down and count it."""
    if isinstance(result, WorkerDied):
        outcome = RecordingResult(part.input, error=f"{part.input}: {result.reason}")
        result = ScoredPart(outcome, Content(*stamp(part.path), content_hash(part.path)), 0.0)
    if result.outcome is None:
        dataset.confirm(part, result.content)
        run.unchanged += 1
        return
    dataset.record(part, result.outcome, result.content, with_, result.seconds)
    run.scored[part.why] += 1
    run.failed += result.outcome.error is not None
    run.frames += 0 if result.outcome.summary is None else result.outcome.summary["frames"]
    if result.outcome.scores is not None:
        run.scores[part.input] = result.outcome.scores


def _settle(file: Path) -> None:
    """Make a file safe from a power cut, and its name."""
    for place in (file, file.parent):
        with contextlib.suppress(OSError):  # some systems do not do this for folders
            handle = os.open(place, os.O_RDONLY)
            try:
                os.fsync(handle)
            finally:
                os.close(handle)
