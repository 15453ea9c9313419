"""A folder of scores that grows: one Parquet file a recording in a hive layout, and the manifest that says of what.

    DIR/_manifest.jsonl
    DIR/recording=shift.mcap/scores.parquet

pandas, pyarrow, DuckDB, Polars and Spark read the folder as one table with a column `recording`. A recording is scored
once: again only if its content, the rules, the options or the version differ, if it failed, or if its scores are gone.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

from reba._version import __version__
from reba.batch.manifest import FAILED, SCORED, Content, Entry, Manifest, stamp
from reba.batch.run import RecordingResult, ScoringOptions
from reba.errors import RebaError
from reba.method.rules import rules_of

PART: Final = "scores.parquet"
"""Name of the one file of a recording."""
KEY: Final = "recording="
LOCK: Final = "_lock"
"""Held while a command writes to the dataset; not empty after one that did not end by itself."""
LONGEST: Final = 200
"""Characters of a name in a path, written for a path; file systems end at 255."""
NEW: Final = "new"
CHANGED: Final = "the file changed"
RETRIED: Final = "failed before"
GONE: Final = "its scores are gone"
ASKED: Final = "a report needs every frame"


@dataclass(frozen=True)
class PendingRecording:
    """A recording that is to be scored.

    Attributes:
        input: as it was given.
        path: where it is read from.
        recording: its name in the dataset.
        output: the file its scores go to.
        why: it is scored.
        before: hash of its content when it was scored last, if nothing but the content can have changed.
    """

    input: str
    path: str
    recording: str
    output: Path
    why: str
    before: str = ""


class Dataset:
    """A dataset that is open for writing; one process at a time.

    Args:
        folder: made if it is not there.

    Raises:
        RebaError: the folder cannot be used, its manifest is damaged, or another process writes to it.
    """

    def __init__(self, folder: str | Path) -> None:
        self.folder = Path(folder).resolve()
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock = (self.folder / LOCK).open("a+b")
        except OSError as error:
            raise RebaError(f"{folder}: cannot be written to ({error.strerror or error}); choose another") from error
        self.token = os.urandom(8).hex()
        try:
            _hold(self._lock.fileno(), folder)
            self.manifest = Manifest(self.folder)
            self._names = {entry.recording: path for path, entry in self.manifest.entries.items()}
            self._begin()
        except BaseException:
            self._lock.close()
            raise

    def __enter__(self) -> Dataset:
        return self

    def __exit__(self, *_: object) -> None:
        self.manifest.close()
        self._lock.truncate(0)
        self._lock.close()

    def due(self, inputs: Sequence[str], with_: dict[str, Any], *, everything: bool = False) -> list[PendingRecording]:
        """Return the recordings that have to be scored, in order.

        Args:
            inputs: files and folders that are recordings.
            with_: `settings` they are scored with.
            everything: score also what has not changed.
        """
        parts = []
        for path, name in {str(Path(name).resolve()): name for name in inputs}.items():
            entry = self.manifest.entries.get(path)
            why = NEW if entry is None else self._why(entry, path, with_)
            if not why and everything:
                why = ASKED
            if why:
                recording = self._name(path) if entry is None else entry.recording
                before = entry.hash if entry is not None and why == CHANGED else ""
                parts.append(PendingRecording(name, path, recording, self.output(recording), why, before))
        return parts

    def record(
        self, part: PendingRecording, outcome: RecordingResult, content: Content, with_: dict[str, Any], seconds: float
    ) -> None:
        """Write down what became of a recording.

        Args:
            part: the recording.
            outcome: its summary or the error.
            content: of the input, as it was scored.
            with_: `settings` it was scored with.
            seconds: that it took.
        """
        failed = outcome.error is not None
        if failed:
            _remove(part.output)
        summary = {} if outcome.summary is None else dict(outcome.summary)
        for name in ("input", "output"):
            summary.pop(name, None)
        line = {
            "recording": part.recording,
            "input": str(Path(part.input).resolve()),
            **asdict(content),
            **with_,
            "outcome": FAILED if failed else SCORED,
            "output": None if failed else f"{part.output.parent.name}/{part.output.name}",
            "error": outcome.error,
            "why": part.why,
            "frames": summary.get("frames"),
            "seconds": round(seconds, 3),
            "finished": datetime.now(UTC).isoformat(timespec="seconds"),
            "summary": summary or None,
        }
        self.manifest.append(line)

    def confirm(self, part: PendingRecording, content: Content) -> None:
        """Write down that a recording is the same under another time of change."""
        line = self.manifest.line(self.manifest.entries[str(Path(part.input).resolve())])
        self.manifest.append({**line, **asdict(content)})

    def outcomes(self, inputs: Iterable[str]) -> Iterator[RecordingResult]:
        """Yield what is known of each recording, read from the manifest one by one."""
        for name in inputs:
            entry = self.manifest.entries.get(str(Path(name).resolve()))
            if entry is None:
                continue
            line = self.manifest.line(entry)
            if entry.outcome == FAILED:
                yield RecordingResult(name, error=line["error"])
            else:
                place = str(self.output(entry.recording))
                yield RecordingResult(name, summary={"input": name, **line["summary"], "output": place})

    def output(self, recording: str) -> Path:
        """Return the file with the scores of a recording."""
        return self.folder / f"{KEY}{_quoted(recording)}" / PART

    def _why(self, entry: Entry, path: str, with_: dict[str, Any]) -> str:
        for field, what in (("rules_hash", "other rules"), ("version", "another version")):
            if getattr(entry, field) != with_[field]:
                return what
        if entry.options != json.dumps(with_["options"], sort_keys=True):
            return "other options"
        if entry.outcome == FAILED:
            return RETRIED
        if not self.output(entry.recording).is_file():
            return GONE
        return "" if stamp(path) == (entry.size, entry.modified) else CHANGED

    def _name(self, path: str) -> str:
        """Return a name that no other recording has: the file's own, with a hash of its place if that is taken."""
        own = Path(path).name or "recording"
        while len(_quoted(own)) > LONGEST:
            own = own[:-1]
        place = hashlib.sha256(os.fsencode(path)).hexdigest()[:8]
        name = own if self._names.setdefault(own, path) == path else f"{own}-{place}"
        self._names[name] = path
        return name

    def _begin(self) -> None:
        """Clean up after a process that was killed, and leave a mark that only an orderly end takes away."""
        self._lock.seek(0)
        if self._lock.read():
            known = {entry.recording for entry in self.manifest.entries.values() if entry.outcome == SCORED}
            names = {self.output(recording).parent.name for recording in known}
            for folder in self.folder.glob(f"{KEY}*"):
                for file in folder.glob(f".{PART}.*.part"):
                    file.unlink(missing_ok=True)
                if folder.name not in names:
                    _remove(folder / PART)
        self._lock.truncate(0)
        self._lock.write(self.token.encode())
        self._lock.flush()


def settings(options: ScoringOptions) -> dict[str, Any]:
    """Return what scores depend on beside the recording, as it stands in the manifest.

    Raises:
        RebaError: the rules or the profile cannot be used.
    """

    rules = rules_of(options.rules)
    given = asdict(replace(options, rules=rules.name))
    del given["rules"]
    if Path(options.profile).is_file():
        given["profile"] = f"{Path(options.profile).name} {_digest(Path(options.profile).read_bytes())}"
    return {
        "version": __version__,
        "rules": rules.name,
        "rules_hash": _digest(json.dumps(asdict(rules), sort_keys=True).encode()),
        "options": given,
    }


def count(parts: Iterable[PendingRecording]) -> dict[str, int]:
    """Return how many recordings there are for each reason."""
    return dict(Counter(part.why for part in parts))


def _quoted(recording: str) -> str:
    """Return a name as it stands in a path; readers of hive layouts turn it back."""
    text = quote(recording, safe=" ", errors="surrogateescape")
    # A folder that ends like a file would be found by `**/*.parquet`.
    return f"{text.removesuffix('.parquet')}%2Eparquet" if text.endswith(".parquet") else text


def _digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()[:16]


def _remove(part: Path) -> None:
    """Remove the scores of a recording and its folder, if that holds nothing else."""
    part.unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        part.parent.rmdir()


def _hold(file: int, folder: str | Path) -> None:
    """Take the lock, which the system gives back however the process ends; there is none on some file systems."""
    try:
        import fcntl
    except ImportError:
        return
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise RebaError(f"{folder}: another command is writing to it; wait for its end or choose another") from error
    except OSError:
        return
