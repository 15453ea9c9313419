"""Scoring one recording or many: find the inputs, score each, write the outputs; a bad file stops no other one."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from reba.batch.manifest import LOCK, MANIFEST, PARTITION
from reba.batch.parallel import run_parallel
from reba.batch.worker_pool import WorkerDied
from reba.errors import RebaError, warn_user
from reba.method.measurement_error import MeasurementError
from reba.method.rules import Rules, rules_of
from reba.method.scoring import Missing
from reba.open_file import read_settings
from reba.outputs import FileOutput, FolderOutput, check_outputs
from reba.readers import is_recording, is_recording_folder, may_be_recording, read
from reba.readers.formats.score_file import is_score_file
from reba.readers.recording.profile import Profile, find_profile
from reba.recording_folder import entries_of
from reba.scored_files import score_recorded
from reba.scores import Scores, score
from reba.writers import SUFFIXES, table_output, write_scores

SCORED_SUFFIX: Final = ".scores.parquet"
"""Ending of score tables that versions before datasets wrote beside recordings; not taken as recordings."""
NAMED: Final = 3
"""Files that a warning names."""


@dataclass(frozen=True)
class ScoringOptions:
    """How recordings are read and scored; the same for every input of a command.

    Without `rules`, files of scores are scored by those that they were recorded with, recordings by "measured".
    """

    profile: str | Path | Profile = "auto"
    start: float | None = None
    end: float | None = None
    topic: str | None = None
    body: str | None = None
    neutral: str = "none"
    strict: bool = False
    rate: float | None = None
    rules: str | Path | Rules | None = "measured"
    activity: str = "auto"
    missing: Missing = "range"
    error: str | Path | MeasurementError | None = None
    factors: dict[str, Any] = field(default_factory=dict)

    def read_and_score(self, path: str | Path) -> Scores:
        """Return the scores of one recording.

        Raises:
            RebaError: the recording or an option cannot be used.
        """
        postures = read(
            path,
            profile=self.profile,
            start=self.start,
            end=self.end,
            topic=self.topic,
            body=self.body,
            neutral=self.neutral,
            strict=self.strict,
            rate=self.rate,
        )
        options: dict[str, Any] = {
            "activity": self.activity,
            "missing": self.missing,
            "error": self.error,
            **self.factors,
        }
        if self.rules is None and postures.scored is not None:
            return score_recorded(postures, **options)
        return score(postures, rules=self.rules or "measured", **options)

    def with_files_read(self) -> ScoringOptions:
        """Return equal options with the content of the files that they name, so that all recordings get the same.

        Raises:
            RebaError: a file cannot be used.
        """
        profile = self.profile if str(self.profile) == "auto" else find_profile(self.profile)
        error = None if self.error is None else MeasurementError.of(self.error)
        rules = None if self.rules is None else rules_of(self.rules)
        return replace(self, rules=rules, profile=profile, error=error)


@dataclass(frozen=True)
class RecordingResult:
    """Summary of one input (the JSON object of a recording) or its error; `scores` only if requested.

    `hash` is the SHA-256 of the recording if the reader computed it, else "". `unwritten`: it was scored, but its
    scores could not be written, and former ones are still there.
    """

    input: str
    summary: dict[str, Any] | None = None
    error: str | None = None
    scores: Scores | None = None
    hash: str = ""
    unwritten: bool = False


def find_inputs(names: Sequence[str]) -> list[str]:
    """Return the recordings named by files and folders, in order, each once.

    A folder that is itself one recording (a rosbag2 folder of splits) is one input; any other folder gives the
    recordings in it at any depth, except score tables. A folder in it that cannot be read is an input as well, as is
    a recording that cannot be read: scoring it is an error that names it. Of tables and workbooks that are no
    recordings there is one warning.

    Raises:
        RebaError: a path does not exist, or a folder contains no recording.
    """
    inputs: dict[str, None] = {}
    for name in names:
        path = Path(name)
        try:
            if not name or not path.exists():
                raise RebaError(f"{name or 'an empty name'}: there is no such file or folder; check the path")
            recordings, others = _recordings_in(path) if path.is_dir() else ([path], [])
        except OSError as error:
            raise RebaError(f"{error.filename or name}: {error.strerror or error}; give readable files") from error
        if not recordings:
            raise RebaError(f"{name}: the folder contains no recording; `reba info FILE` says why a file is not one")
        if others:
            more = f" and {len(others) - NAMED} more" if len(others) > NAMED else ""
            listed = ", ".join(str(other.relative_to(path)) for other in others[:NAMED])
            warn_user(f"{name}: left out as no recordings: {listed}{more}; `reba info FILE` says why")
        inputs.update(dict.fromkeys([name] if recordings == [path] else map(str, recordings)))
    return list(inputs)


def _recordings_in(top: Path) -> tuple[list[Path], list[Path]]:
    """Return the recordings below a folder or the folder itself, with the folders that cannot be read, and the files
    that have a name as recordings have and are none; both sorted.

    Each real folder is entered once, however many links name it.
    """
    recordings: list[Path] = []
    others: list[Path] = []
    entered: set[tuple[int, int]] = set()
    folders, links = [top], deque[Path]()
    while folders or links:
        folder = folders.pop() if folders else links.popleft()  # links last: a path without links is preferred
        try:
            status = folder.stat()
            if (status.st_dev, status.st_ino) in entered:
                continue
            entered.add((status.st_dev, status.st_ino))
            if is_recording_folder(folder):
                recordings.append(folder)
            elif not (folder / MANIFEST).is_file():  # else a dataset of scores
                for path in entries_of(folder):
                    if path.name.startswith(".") or path.name.endswith(SCORED_SUFFIX):
                        continue
                    if path.is_dir():
                        (links if path.is_symlink() else folders).append(path)
                    elif is_recording(path):
                        recordings += [] if is_score_file(path) else [path]
                    elif may_be_recording(path):
                        others.append(path)
        except OSError:  # whoever reads the folder as a recording gets the error
            recordings.append(folder)
    return sorted(recordings), sorted(others)


def scores_output(output: str) -> FileOutput | FolderOutput:
    """Return what is written for the scores: an ending of a table names a file, any other name a dataset's folder."""
    named_folder = output.endswith(("/", os.sep)) or os.path.isdir(output)
    if Path(output).suffix.lower() in SUFFIXES and not named_folder:
        return table_output(output)
    return FolderOutput(output, (MANIFEST, LOCK, f"{PARTITION}*/*"))


def plan_outputs(
    names: Sequence[str], inputs: Sequence[str], output: str | None, report: str | None
) -> tuple[Path | None, Path | None]:
    """Return (file, folder) for the scores: one of them, or neither without an output.

    Args:
        names: files and folders as given.
        inputs: the recordings in them, `find_inputs`.
        output: file, or folder of a `reba.batch.dataset`.
        report: file.

    Raises:
        RebaError: an output cannot be written, would replace a recording or another output, or the same command would
            find other recordings once it is written; several inputs but one output file, or an unknown ending.
    """
    target = None if output is None else scores_output(output)
    check_outputs(target, None if report is None else FileOutput(report), inputs=inputs)
    if output is None:
        return None, None
    path = Path(output)
    if isinstance(target, FileOutput):
        if len(inputs) > 1:
            raise RebaError(f"{output}: one file cannot contain the scores of {len(inputs)} recordings; give a folder")
        if _searched(path.resolve().parent, names):
            raise RebaError(f"{output}: lies in a folder that is searched for recordings; choose a place outside")
        return path, None
    if path.suffix and not path.is_dir() and len(inputs) == 1 and not output.endswith(("/", os.sep)):
        raise RebaError(f"{output}: ending {path.suffix!r} is unknown; choose .parquet, .csv, .mcap, .xlsx or a folder")
    folder = path.resolve()
    if _searched(folder, names) and any(folder in Path(name).resolve().parents for name in inputs):
        hint = f"give another folder, such as {path / 'scores'}"
        raise RebaError(f"{output}: holds recordings, which a folder of scores is not searched for; {hint}")
    return None, path


def _searched(folder: Path, names: Sequence[str]) -> bool:
    """Return whether a folder is one of those, or below one, that are searched for recordings."""
    return any(Path(name).is_dir() and Path(name).resolve() in (folder, *folder.parents) for name in names)


def score_one(
    path: str, output: Path | None, options: ScoringOptions, keep_scores: bool = False, as_ros: bool = False
) -> RecordingResult:
    """Score one recording; an error of the recording is a result, not an exception."""
    scores: Scores | None = None
    try:
        scores = options.read_and_score(path)
        if output is not None:
            write_scores(scores, output, as_ros=as_ros)
        summary = {"input": path, **scores.summary(), "output": None if output is None else str(output)}
    except RebaError as error:
        return RecordingResult(path, error=str(error), unwritten=scores is not None)
    except MemoryError:
        return RecordingResult(path, error=f"{path}: does not fit into memory; score parts of it, or use fewer --jobs")
    except Exception as error:  # an unexpected error of one recording must not stop the others
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        return RecordingResult(path, error=f"{path}: cannot be scored ({reason}); please report it with the recording")
    sha256 = scores.postures.quality.sha256
    return RecordingResult(path, summary=summary, scores=scores if keep_scores else None, hash=sha256)


def score_many(
    inputs: Sequence[str],
    output: Path | None,
    options: ScoringOptions,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    keep_scores: bool = False,
    as_ros: bool = False,
    on_done: Callable[[str], None] = lambda name: None,
) -> list[RecordingResult]:
    """Score every input and return the results in the order of the inputs.

    Args:
        output: file for the scores, if there is one input.
        jobs, scheduler: see `reba.batch.parallel.run_parallel`.
        keep_scores: return the scores themselves (for a report), not only their summaries.
        as_ros: write scores of an .mcap as ROS messages.
        on_done: called with the name of each finished input.
    """
    remote = scheduler is not None
    target = output.resolve() if remote and output is not None else output
    options = options.with_files_read()
    work = partial(_score_numbered, output=target, options=options, keep_scores=keep_scores, as_ros=as_ros)
    tasks = [(number, str(Path(name).resolve()) if remote else name) for number, name in enumerate(inputs)]
    results: dict[int, RecordingResult] = {}
    probe = access_probe([path for _, path in tasks], "" if target is None else str(target.parent))
    jobs = max(1, min(jobs, len(inputs)))
    for (number, path), result in run_parallel(work, tasks, jobs=jobs, scheduler=scheduler, probe=probe):
        if isinstance(result, WorkerDied):
            result = RecordingResult(path, error=f"{path}: {result.reason}")
        if result.summary is not None:
            result.summary.update(input=inputs[number], output=None if output is None else str(output))
        results[number] = replace(result, input=inputs[number])
        on_done(inputs[number])
    return [results[number] for number in sorted(results)]


def access_probe(recordings: Sequence[str], *others: str) -> Callable[[], str] | None:
    """Return what checks a worker's access, `access_problem`, with a recording that can be read here, if any can."""
    readable = (one for one in recordings if not access_problem(one))
    first = next(readable, None)
    return None if first is None else partial(access_problem, first, *others)


def access_problem(recording: str, folder: str = "", mark: str = "", text: str = "") -> str:
    """Return why this process cannot access the files of a task, "" if it can.

    Args:
        recording: file or folder that must be readable.
        folder: folder that must be writable, "" if nothing is written.
        mark, text: a file in the folder and its expected content, which proves that the folder is the shared one.
    """
    source = Path(recording)
    if not source.exists() or not os.access(source, os.R_OK):
        return f"cannot read {recording}; keep recordings under a path that is the same on every worker"
    if folder and not os.access(folder, os.W_OK):
        return f"cannot write to {folder}; give a folder that every worker shares"
    try:
        same = not mark or read_settings(mark) == text
    except OSError:
        same = False
    return "" if same else f"has another folder at {folder}; give a folder that every worker shares"


def _score_numbered(
    task: tuple[int, str], *, output: Path | None, options: ScoringOptions, keep_scores: bool, as_ros: bool
) -> RecordingResult:
    return score_one(task[1], output, options, keep_scores, as_ros)
