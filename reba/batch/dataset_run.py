"""Scoring into a dataset: pending recordings are scored in parallel, and each result is recorded as it arrives."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from reba.batch.dataset import Dataset, PendingRecording, scoring_settings
from reba.batch.manifest import LOCK, Content, content_hash
from reba.batch.parallel import run_parallel
from reba.batch.run import RecordingResult, ScoringOptions, access_probe, score_one
from reba.batch.worker_pool import WorkerDied
from reba.errors import ReadError
from reba.file_stamp import CHANGED_WHILE_READ, TRY_AGAIN, stamp_before, stamp_of
from reba.scores import Scores


@dataclass
class DatasetRun:
    """Counts of a run.

    Attributes:
        recordings: distinct inputs.
        scored: reason, such as "new" -> number of recordings, failed ones included.
        unchanged: recordings with valid scores from an earlier run.
        frames: scored frames.
        seconds: duration of the run [s].
        scores: input -> scores, if requested.
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
class ScoredRecording:
    """Result of a pending recording; `result` is None if its content had not changed."""

    result: RecordingResult | None
    content: Content
    seconds: float


def score_into(
    dataset: Dataset,
    inputs: Sequence[str],
    options: ScoringOptions,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    keep_scores: bool = False,
    on_done: Callable[[str], None] = lambda name: None,
) -> DatasetRun:
    """Score the pending recordings of a dataset; each result is on disk before the next one is recorded.

    Args:
        jobs, scheduler: see `reba.batch.parallel.run_parallel`.
        keep_scores: return the scores themselves (for a report); every recording is scored then.
        on_done: called with the name of each finished recording.
    """
    start = time.perf_counter()
    options = options.with_files_read()
    settings = scoring_settings(options)
    pending = dataset.pending(inputs, settings, rescore_all=keep_scores)
    recordings = len({Path(name).resolve() for name in inputs})
    run = DatasetRun(recordings, unchanged=recordings - len(pending))
    remote = scheduler is not None
    work = partial(
        score_pending,
        options=options,
        keep_scores=keep_scores,
        remote=remote,
    )
    lock = str(dataset.folder / LOCK)
    probe = access_probe([one.path for one in pending], str(dataset.folder), lock, dataset.token)
    jobs = min(jobs, max(len(pending), 1))
    for recording, result in run_parallel(work, _begun(dataset, pending), jobs=jobs, scheduler=scheduler, probe=probe):
        _record(dataset, run, recording, result, settings)
        on_done(recording.input)
    run.seconds = time.perf_counter() - start
    return run


def _begun(dataset: Dataset, pending: Iterable[PendingRecording]) -> Iterator[PendingRecording]:
    """Yield recordings to a pool that takes each shortly before it is scored."""
    for one in pending:
        dataset.begin(one)
        yield one


def score_pending(
    pending: PendingRecording, *, options: ScoringOptions, keep_scores: bool, remote: bool = False
) -> ScoredRecording:
    """Score one recording into its file, which is on disk when this returns.

    Args:
        keep_scores: return the scores themselves as well.
        remote: the working folder of this process may differ from that of the command: use absolute paths.
    """
    start = time.perf_counter()
    path = pending.path if remote else pending.input
    before = stamp_before(path)
    result: RecordingResult | None = None
    digest = content_hash(path) if pending.previous_hash else ""
    if not digest or digest != pending.previous_hash:
        result = score_one(path, pending.output, options, keep_scores)
        digest = result.hash or content_hash(path)
    if before.place != pending.path or stamp_of(path) != before:
        result = RecordingResult(path, error=str(ReadError(path, CHANGED_WHILE_READ, hint=TRY_AGAIN)))
    return ScoredRecording(result, Content.of(before, digest), time.perf_counter() - start)


def _record(
    dataset: Dataset,
    run: DatasetRun,
    pending: PendingRecording,
    scored: ScoredRecording | WorkerDied,
    settings: dict[str, Any],
) -> None:
    """Append a result to the manifest and count it."""
    if isinstance(scored, WorkerDied):
        failure = RecordingResult(pending.input, error=f"{pending.input}: {scored.reason}")
        scored = ScoredRecording(failure, Content.of(stamp_of(pending.path), content_hash(pending.path)), 0.0)
    result = scored.result
    if result is None:
        dataset.confirm(pending, scored.content)
        run.unchanged += 1
        return
    if result.unwritten and pending.output.is_file():
        dataset.begin(pending, result.error)
    else:
        dataset.record(pending, result, scored.content, settings, scored.seconds)
    run.scored[pending.reason] += 1
    run.failed += result.error is not None
    run.frames += 0 if result.summary is None else result.summary["frames"]
    if result.scores is not None:
        run.scores[pending.input] = result.scores
