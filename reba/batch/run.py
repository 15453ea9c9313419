"""Scoring one recording or many: find the inputs, score each, write what was asked for; one bad file stops no other."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from reba.batch.manifest import MANIFEST
from reba.batch.parallel import run_parallel
from reba.batch.worker_pool import WorkerDied
from reba.errors import RebaError
from reba.method.scoring import Missing
from reba.readers import is_recording, is_recording_folder, read
from reba.scores import Scores, score
from reba.writers import SUFFIXES, write_scores

SCORED_SUFFIX: Final = ".scores.parquet"
"""Ending by which score tables among recordings are known."""


@dataclass(frozen=True)
class ScoringOptions:
    """How recordings are read and scored; the same for every input of a command."""

    profile: str = "auto"
    topic: str | None = None
    neutral: str = "none"
    strict: bool = False
    rules: str = "measured"
    activity: str = "auto"
    missing: Missing = "range"
    factors: dict[str, Any] = field(default_factory=dict)

    def read_and_score(self, path: str | Path) -> Scores:
        """Return the scores of one recording.

        Raises:
            RebaError: the recording or an option is bad.
        """

        postures = read(path, profile=self.profile, topic=self.topic, neutral=self.neutral, strict=self.strict)
        return score(postures, rules=self.rules, activity=self.activity, missing=self.missing, **self.factors)

    def anywhere(self) -> ScoringOptions:
        """Return the same for a process that works in another folder."""
        return replace(self, rules=_whole(self.rules), profile=_whole(self.profile))


@dataclass(frozen=True)
class RecordingResult:
    """What became of one input: its summary (the JSON object of a recording), or the error.

    Attributes:
        scores: the scores themselves, if they were asked for.
        hash: SHA-256 of the recording where the reader found it, "" otherwise.
    """

    input: str
    summary: dict[str, Any] | None = None
    error: str | None = None
    scores: Scores | None = None
    hash: str = ""


def find_inputs(given: Sequence[str]) -> list[str]:
    """Return the recordings named by files and folders, in order, each once.

    A folder that is itself one recording (a rosbag2 folder of splits) stays one input; any other folder gives the
    recordings in it, at any depth, but for the score tables that this command wrote there.

    Raises:
        RebaError: a path does not exist or cannot be looked into, or a folder holds no recording.
    """

    found: dict[str, None] = {}
    for name in given:
        path = Path(name)
        try:
            if not name or not path.exists():
                raise RebaError(f"{name or 'an empty name'}: there is no such file or folder; check the path")
            if not path.is_dir() or is_recording_folder(path):
                found[name] = None
                continue
            inside = _inside(path, is_recording, is_recording_folder, frozenset())
        except OSError as error:
            raise RebaError(f"{error.filename or name}: {error.strerror or error}; give files you may read") from error
        if not inside:
            raise RebaError(f"{name}: the folder holds no recording; `reba info FILE` says why a file is not one")
        found.update(dict.fromkeys(map(str, inside)))
    return list(found)


def _inside(
    folder: Path, is_file: Callable[[Path], bool], is_folder: Callable[[Path], bool], above: frozenset[Path]
) -> list[Path]:
    found: list[Path] = []
    if (folder / MANIFEST).is_file():  # scores that this command wrote
        return found
    above |= {folder.resolve()}
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or path.name.endswith(SCORED_SUFFIX):
            continue
        if path.is_dir():
            if path.resolve() in above:  # a link back to a folder that is being looked into
                continue
            found += [path] if is_folder(path) else _inside(path, is_file, is_folder, above)
        elif is_file(path):
            found.append(path)
    return found


def plan_output(inputs: Sequence[str], output: str | None) -> tuple[Path | None, Path | None]:
    """Return the file and the folder for the scores: one of them, or neither if nothing is to be written.

    One input and an ending of .parquet, .csv or .mcap name a file; everything else is a folder, see
    `reba.batch.dataset`.

    Raises:
        RebaError: several inputs but one output file, a file that is the recording, or an unknown ending.
    """
    if output is None:
        return None, None
    target = Path(output)
    if target.suffix.lower() in SUFFIXES and not target.is_dir():
        if len(inputs) > 1:
            raise RebaError(f"{output}: one file cannot hold the scores of {len(inputs)} recordings; give a folder")
        if target.resolve() == Path(inputs[0]).resolve():
            raise RebaError(f"{output}: this is the recording itself and would be lost; choose another name")
        return target, None
    if target.suffix and not target.is_dir() and len(inputs) == 1 and not output.endswith(("/", "\\")):
        raise RebaError(f"{output}: ending {target.suffix!r} is unknown; choose .parquet, .csv, .mcap or a folder")
    if not output or target.is_file():
        raise RebaError(f"{output or 'an empty name'}: this is no folder; give a folder for the scores")
    return None, target


def check_report(report: str | None, inputs: Sequence[str], output: Path | None = None) -> None:
    """Refuse a place for the report before the work is done.

    Raises:
        RebaError: it is one of the recordings or the score table, or a folder.
    """
    if report is None:
        return
    target = Path(report)
    if target.is_dir() or not report:
        raise RebaError(f"{report or 'an empty name'}: a report is one file; give a name like report.html")
    for taken, what in [*((name, "recording") for name in inputs), (output, "score table")]:
        if taken is not None and target.resolve() == Path(taken).resolve():
            raise RebaError(f"{report}: this is a {what} and would be lost; choose another name for the report")


def score_one(path: str, output: Path | None, options: ScoringOptions, keep: bool = False) -> RecordingResult:
    """Score one recording; an error of the recording is an outcome, not an exception."""
    try:
        scores = options.read_and_score(path)
        if output is not None:
            write_scores(scores, output)
        summary = {"input": path, **scores.summary(), "output": None if output is None else str(output)}
    except RebaError as error:
        return RecordingResult(path, error=str(error))
    except MemoryError:
        return RecordingResult(
            path, error=f"{path}: does not fit into memory; score parts of it, or fewer at the same time"
        )
    except Exception as error:  # whatever is wrong with one recording stops no other
        said = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        return RecordingResult(path, error=f"{path}: cannot be scored ({said}); please report it with the recording")
    return RecordingResult(path, summary=summary, scores=scores if keep else None, hash=scores.postures.quality.sha256)


def score_many(
    inputs: Sequence[str],
    output: Path | None,
    options: ScoringOptions,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
    keep: bool = False,
    done: Callable[[str], None] = lambda name: None,
) -> list[RecordingResult]:
    """Score every input, all of which stay in memory; `done` is called with the name of each one that ends.

    Args:
        inputs: recordings.
        output: file for the scores, if there is one input.
        options: how they are scored.
        jobs, scheduler: where, as for `reba.batch.parallel.run_parallel`.
        keep: whether the outcomes hold the scores themselves (for a report), not only their summaries.

    Raises:
        RebaError: the cluster cannot be used.
    """
    far = scheduler is not None
    target = output.resolve() if far and output is not None else output
    work = partial(_numbered, output=target, options=options.anywhere() if far else options, keep=keep)
    tasks = [(number, str(Path(name).resolve()) if far else name) for number, name in enumerate(inputs)]
    outcomes: dict[int, RecordingResult] = {}
    probe = partial(sees, tasks[0][1], "" if target is None else str(target.parent)) if tasks else None
    jobs = max(1, min(jobs, len(inputs)))
    for (number, path), result in run_parallel(work, tasks, jobs=jobs, scheduler=scheduler, probe=probe):
        outcome = RecordingResult(path, error=f"{path}: {result.reason}") if isinstance(result, WorkerDied) else result
        if outcome.summary is not None:
            outcome.summary.update(input=inputs[number], output=None if output is None else str(output))
        outcomes[number] = replace(outcome, input=inputs[number])
        done(inputs[number])
    return [outcomes[number] for number in sorted(outcomes)]


def sees(recording: str, folder: str = "", mark: str = "", text: str = "") -> str:
    """Return what this process lacks to score, "" if nothing.

    Args:
        recording: a file or folder it must be able to read.
        folder: that it must be able to write to, "" if it writes nothing.
        mark, text: a file in the folder and what it must hold, to know that it is the same folder.
    """
    place = Path(recording)
    if not place.exists() or not os.access(place, os.R_OK):
        return f"cannot read {recording}; keep recordings where every worker finds them under the same path"
    if folder and not os.access(folder, os.W_OK):
        return f"cannot write to {folder}; give a folder that every worker shares"
    try:
        same = not mark or Path(mark).read_text(encoding="utf-8") == text
    except OSError:
        same = False
    return "" if same else f"has another folder at {folder}; give a folder that every worker shares"


def _numbered(task: tuple[int, str], *, output: Path | None, options: ScoringOptions, keep: bool) -> RecordingResult:
    return score_one(task[1], output, options, keep)


def _whole(name: str) -> str:
    return str(Path(name).resolve()) if Path(name).is_file() else name
