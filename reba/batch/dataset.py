"""Growing dataset of scores: one Parquet file per recording in hive partitions, and a manifest of what was scored.

    DIR/_manifest.jsonl
    DIR/recording=shift.mcap/scores.parquet

pandas, pyarrow, DuckDB, Polars and Spark read the folder as one table with a column `recording`. A recording is scored
again only if its content, the rules, the options or the version differ, if it failed, or if its scores are missing.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from reba._version import __version__
from reba.batch.manifest import FAILED, LOCK, PARTITION, SCORED, STARTED, Content, Entry, Manifest
from reba.batch.run import RecordingResult, ScoringOptions
from reba.errors import RebaError
from reba.file_stamp import stamp_of
from reba.files import lock_exclusively
from reba.method.measurement_error import MeasurementError
from reba.method.rules import rules_of
from reba.open_file import open_regular
from reba.readers.recording.profile import Profile, profiles

SCORES_FILE: Final = "scores.parquet"
"""Name of the one file of a recording."""
MAX_NAME: Final = 200
"""Characters of a recording's name, percent-encoded; file systems accept 255, the prefix and a hash are added."""
NEW: Final = "new"
CHANGED: Final = "the file changed"
FAILED_BEFORE: Final = "failed before"
INTERRUPTED: Final = "was interrupted"
MISSING_SCORES: Final = "its scores are gone"
REPORT: Final = "a report needs every frame"


@dataclass(frozen=True)
class PendingRecording:
    """A recording that is to be scored.

    Attributes:
        input: path as on the command line.
        path: absolute path.
        recording: name in the dataset.
        output: file for its scores.
        reason: why it is scored, such as "new".
        previous_hash: hash at the last scoring if only the content can have changed, else "".
    """

    input: str
    path: str
    recording: str
    output: Path
    reason: str
    previous_hash: str = ""


class Dataset:
    """A dataset open for writing, by one process at a time; the folder is created if missing.

    Raises:
        RebaError: the folder cannot be used, its manifest is damaged, or another process writes to it.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder).resolve()
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = open_regular(self.folder / LOCK, append=True, buffering=0)
        except OSError as error:
            raise _unwritable(folder, error) from error
        self.token = os.urandom(8).hex()
        self._paths: dict[str, str] = {}
        with contextlib.ExitStack() as failed:
            failed.callback(self._lock.close)
            if not lock_exclusively(self._lock.fileno()):
                raise RebaError(
                    f"{folder}: another command is writing to it; wait until that ends or choose another folder"
                )
            self.manifest = Manifest(self.folder)
            failed.callback(self.manifest.close)
            self._names = {entry.recording: path for path, entry in self.manifest.entries.items()}
            try:
                self._recover()
            except OSError as error:
                raise _unwritable(folder, error) from error
            failed.pop_all()

    def __enter__(self) -> Dataset:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        self.manifest.close()
        if kind is None:
            self._lock.truncate(0)
        else:  # workers were stopped while they wrote; the token stays, for what one on another machine may still write
            self._remove_unfinished()
        self._lock.close()

    def pending(
        self, inputs: Sequence[str], settings: dict[str, Any], *, rescore_all: bool = False
    ) -> list[PendingRecording]:
        """Return the recordings that have to be scored, in the order of the inputs.

        Args:
            settings: `scoring_settings` of the run.
            rescore_all: include unchanged recordings.
        """
        pending = []
        for path, name in {self._path(name): name for name in inputs}.items():
            entry = self.manifest.entries.get(path)
            reason = NEW if entry is None else self._reason(entry, path, settings)
            if not reason and rescore_all:
                reason = REPORT
            if reason:
                recording = self._unique_name(path) if entry is None else entry.recording
                previous_hash = entry.hash if entry is not None and reason == CHANGED else ""
                output = self.output(recording)
                pending.append(PendingRecording(name, path, recording, output, reason, previous_hash))
        return pending

    def begin(self, pending: PendingRecording, error: str | None = None) -> None:
        """Append that a recording which has scores is scored again: they count no longer, whatever ends the scoring.

        Args:
            error: why the scoring ended with the former scores in place.
        """
        entry = self.manifest.entries.get(pending.path)
        if entry is not None and entry.outcome != FAILED:
            line = {**self.manifest.line(entry), "outcome": STARTED, "error": error}
            self.manifest.append(line, at_once=error is None)

    def record(
        self,
        pending: PendingRecording,
        result: RecordingResult,
        content: Content,
        settings: dict[str, Any],
        seconds: float,
    ) -> None:
        """Append the result of a recording to the manifest; the scores of a failed recording are removed.

        Args:
            content: of the input when it was scored.
            settings: `scoring_settings` of the run.
            seconds: duration of the scoring [s].
        """
        failed = result.error is not None
        if failed:
            _remove_scores(pending.output)
        summary = {} if result.summary is None else dict(result.summary)
        for name in ("input", "output"):
            summary.pop(name, None)
        line = {
            "recording": pending.recording,
            "input": pending.path,
            **asdict(content),
            **settings,
            "outcome": FAILED if failed else SCORED,
            "output": None if failed else f"{pending.output.parent.name}/{pending.output.name}",
            "error": result.error,
            "why": pending.reason,
            "frames": summary.get("frames"),
            "seconds": round(seconds, 3),
            "finished": datetime.now(UTC).isoformat(timespec="seconds"),
            "summary": summary or None,
        }
        self.manifest.append(line)

    def confirm(self, pending: PendingRecording, content: Content) -> None:
        """Append a line for a recording whose times changed but whose content did not."""
        line = self.manifest.line(self.manifest.entries[pending.path])
        self.manifest.append({**line, **asdict(content), "outcome": SCORED})

    def results(self, inputs: Iterable[str]) -> Iterator[RecordingResult]:
        """Yield the result of each recording in the manifest, read one by one."""
        for name in inputs:
            entry = self.manifest.entries.get(self._path(name))
            if entry is None:
                continue
            line = self.manifest.line(entry)
            if entry.outcome != SCORED:
                yield RecordingResult(name, error=line["error"])
            else:
                output = str(self.output(entry.recording))
                yield RecordingResult(name, summary={"input": name, **line["summary"], "output": output})

    def output(self, recording: str) -> Path:
        """Return the path of the score file of a recording."""
        return self.folder / f"{PARTITION}{_encoded(recording)}" / SCORES_FILE

    def _reason(self, entry: Entry, path: str, settings: dict[str, Any]) -> str:
        """Return why a recording has to be scored again, "" if its scores are valid."""
        for field, reason in (("rules_hash", "other rules"), ("version", "another version")):
            if getattr(entry, field) != settings[field]:
                return reason
        if entry.options != json.dumps(settings["options"], sort_keys=True):
            return "other options"
        if entry.outcome == FAILED:
            return FAILED_BEFORE
        if entry.outcome == STARTED:
            return INTERRUPTED
        if not self.output(entry.recording).is_file():
            return MISSING_SCORES
        now = stamp_of(path)
        then = (entry.size, entry.modified, entry.changed)
        return "" if (now.size, now.modified, now.changed) == then else CHANGED

    def _path(self, name: str) -> str:
        """Return the absolute path of an input without links: that of the first time it is asked for."""
        return self._paths.setdefault(name, str(Path(name).resolve()))

    def _unique_name(self, path: str) -> str:
        """Return a unique name in the dataset: the file name, with a hash of the path if another recording has it."""
        file_name = Path(path).name or "recording"
        while len(_encoded(file_name)) > MAX_NAME:
            file_name = file_name[:-1]
        path_hash = hashlib.sha256(os.fsencode(path)).hexdigest()[:8]
        name = file_name if self._names.setdefault(file_name, path) == path else f"{file_name}-{path_hash}"
        self._names[name] = path
        return name

    def _recover(self) -> None:
        """Remove what a stopped process left, and write a token to the lock file that only a regular end removes."""
        self._lock.seek(0)
        if self._lock.read():
            self._remove_unfinished()
        self._lock.truncate(0)
        self._lock.write(self.token.encode())

    def _remove_unfinished(self) -> None:
        """Remove scores that are in no line of the manifest."""
        scored = {entry.recording for entry in self.manifest.entries.values() if entry.outcome != FAILED}
        folders = {self.output(recording).parent.name for recording in scored}
        for folder in self.folder.glob(f"{PARTITION}*"):
            for file in folder.glob(f".{SCORES_FILE}.*.part"):
                file.unlink(missing_ok=True)
            if folder.name not in folders:
                _remove_scores(folder / SCORES_FILE)


def scoring_settings(options: ScoringOptions) -> dict[str, Any]:
    """Return everything but the recording that determines scores, as fields of a manifest line.

    Raises:
        RebaError: a file of rules or a profile cannot be used.
    """
    options = options.with_files_read()
    rules, profile = rules_of(options.rules or "measured"), options.profile
    values = {name: value for name, value in vars(options).items() if name not in ("rules", "error")}
    if isinstance(profile, Profile):
        values["profile"] = profile.name if profile in profiles() else f"{profile.name} {_digest(asdict(profile))}"
    if isinstance(options.error, MeasurementError):  # without one, options are as in manifests of former versions
        values["error"] = f"{options.error.name} {_digest(asdict(options.error))}"
    return {
        "version": __version__,
        "rules": rules.name,
        "rules_hash": _digest(asdict(rules)),
        "options": values,
    }


def _encoded(recording: str) -> str:
    """Return a name percent-encoded for a path, which readers of hive layouts decode."""
    text = quote(recording, safe=" ", errors="surrogateescape")
    # The glob `**/*.parquet` must match score files only, not the folder of a recording in Parquet.
    return f"{text.removesuffix('.parquet')}%2Eparquet" if text.endswith(".parquet") else text


def _unwritable(folder: str | Path, error: OSError) -> RebaError:
    return RebaError(f"{folder}: cannot be written to ({error.strerror or error}); choose another folder")


def _digest(fields: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()[:16]


def _remove_scores(file: Path) -> None:
    """Remove the score file of a recording, and its folder if that is empty then."""
    file.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        file.parent.rmdir()
