"""Scoring one recording or many: find the inputs, score each, write what was asked for; one bad file stops no other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from reba.errors import RebaError
from reba.scores import Scores, score
from reba.scoring import Missing
from reba.writers import SUFFIXES, write_scores

SCORED_SUFFIX: Final = ".scores.parquet"
"""Ending of score tables when a folder is the output."""


@dataclass(frozen=True)
class Options:
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
        from reba.readers import read

        postures = read(path, profile=self.profile, topic=self.topic, neutral=self.neutral, strict=self.strict)
        return score(postures, rules=self.rules, activity=self.activity, missing=self.missing, **self.factors)


@dataclass(frozen=True)
class Outcome:
    """What became of one input: its summary (the JSON object of a recording), or the error."""

    input: str
    summary: dict[str, Any] | None = None
    error: str | None = None
    scores: Scores | None = None


def find_inputs(given: Sequence[str]) -> list[str]:
    """Return the recordings named by files and folders, in order, each once.

    A folder that is itself one recording (a rosbag2 folder of splits) stays one input; any other folder gives the
    recordings in it, at any depth, but for the score tables that this command wrote there.

    Raises:
        RebaError: a path does not exist or cannot be looked into, or a folder holds no recording.
    """
    from reba.readers import is_recording, is_recording_folder

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


def plan_outputs(inputs: Sequence[str], output: str | None) -> list[Path | None]:
    """Return where each score table goes.

    One input and an ending of .parquet, .csv or .mcap name a file; everything else is a folder that gets
    `<input>.scores.parquet` for each input.

    Raises:
        RebaError: several inputs but one output file.
    """
    if output is None:
        return [None] * len(inputs)
    target = Path(output)
    if target.suffix.lower() in SUFFIXES and not target.is_dir():
        if len(inputs) > 1:
            raise RebaError(f"{output}: one file cannot hold the scores of {len(inputs)} recordings; give a folder")
        if target.resolve() == Path(inputs[0]).resolve():
            raise RebaError(f"{output}: this is the recording itself and would be lost; choose another name")
        return [target]
    if target.suffix and not target.is_dir() and len(inputs) == 1:
        raise RebaError(f"{output}: ending {target.suffix!r} is unknown; choose .parquet, .csv, .mcap or a folder")
    names: dict[str, int] = {}
    outputs: list[Path | None] = []
    for name in inputs:
        stem = Path(name).name or Path(name).resolve().name
        names[stem] = names.get(stem, 0) + 1
        again = f"-{names[stem]}" if names[stem] > 1 else ""
        outputs.append(target / f"{stem}{again}{SCORED_SUFFIX}")
    return outputs


def check_report(report: str | None, inputs: Sequence[str], outputs: Sequence[Path | None] = ()) -> None:
    """Refuse a place for the report before the work is done.

    Raises:
        RebaError: it is one of the recordings or of the score tables, or a folder.
    """
    if report is None:
        return
    target = Path(report)
    if target.is_dir() or not report:
        raise RebaError(f"{report or 'an empty name'}: a report is one file; give a name like report.html")
    for taken, what in [*((name, "recording") for name in inputs), *((name, "score table") for name in outputs)]:
        if taken is not None and target.resolve() == Path(taken).resolve():
            raise RebaError(f"{report}: this is a {what} and would be lost; choose another name for the report")


def score_one(path: str, output: Path | None, options: Options, keep: bool) -> Outcome:
    """Score one recording; an error of the recording is an outcome, not an exception."""
    try:
        scores = options.read_and_score(path)
        if output is not None:
            write_scores(scores, output)
    except RebaError as error:
        return Outcome(path, error=str(error))
    summary = {"input": path, **scores.summary(), "output": None if output is None else str(output)}
    return Outcome(path, summary=summary, scores=scores if keep else None)


def score_many(
    inputs: Sequence[str],
    outputs: Sequence[Path | None],
    options: Options,
    *,
    jobs: int = 1,
    keep: bool = False,
    done: Callable[[Outcome], None] = lambda outcome: None,
) -> list[Outcome]:
    """Score every input, in parallel processes if `jobs` is more than one; `done` is called as each one ends.

    Args:
        keep: whether the outcomes hold the scores themselves (for a report), not only their summaries.
    """
    work = list(zip(inputs, outputs, strict=True))
    outcomes: list[Outcome] = []
    if jobs == 1 or len(work) == 1:
        results = (score_one(path, output, options, keep) for path, output in work)
    else:
        from joblib import Parallel, delayed

        parallel = Parallel(n_jobs=jobs, return_as="generator")
        results = parallel(delayed(score_one)(path, output, options, keep) for path, output in work)
    for outcome in results:
        outcomes.append(outcome)
        done(outcome)
    return outcomes
