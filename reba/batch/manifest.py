"""The manifest of a dataset: a journal with one JSON line for each scoring of a recording, stored with the scores.

A line is appended after the scores are complete on disk; the last line of a recording is valid. A process that ends
while it writes a line leaves an incomplete last line, which is removed when the manifest is opened again.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from reba.errors import RebaError
from reba.file_stamp import Stamp, files_of
from reba.files import as_json, sha256_of
from reba.open_file import open_regular

MANIFEST: Final = "_manifest.jsonl"
"""File name; readers of Parquet datasets ignore names that begin with an underscore."""
LOCK: Final = "_lock"
"""File that is locked while a command writes to the dataset; not empty after a command that was killed."""
PARTITION: Final = "recording="
"""Prefix of a recording's folder: the partition column of the hive layout."""
SYNC_SECONDS: Final = 0.5
"""[s] Between two fsync calls: a power cut loses lines of this time at most, the end of this process loses none."""
SCORED: Final = "scored"
FAILED: Final = "failed"
STARTED: Final = "started"
"""Outcome of scoring again what has scores: until the next line of the recording they may be the former or new ones."""
FIELDS: Final = (
    "recording", "input", "size", "modified", "hash", "version", "rules", "rules_hash", "options", "outcome",
)  # fmt: skip
"""Fields that are required in every line; `output`, `error`, `seconds`, `frames`, `finished` and `summary` follow.

`changed` is missing in lines of former versions: their recordings are compared by hash once.
"""


@dataclass(frozen=True, slots=True)
class Entry:
    """The fields of a recording's last line that decide whether the recording is scored again.

    Attributes:
        recording: name in the dataset.
        size, modified, changed, hash: of the input, as in `Content`.
        version, rules_hash, options: of the scoring; options as JSON text.
        outcome: `SCORED`, `FAILED` or `STARTED`.
        offset, length: of the line in the manifest [bytes].
    """

    recording: str
    size: int
    modified: int
    changed: int | None
    hash: str
    version: str
    rules_hash: str
    options: str
    outcome: str
    offset: int
    length: int


class Manifest:
    """The manifest of the dataset in a folder.

    Attributes:
        entries: absolute path of the input -> its last line.

    Raises:
        RebaError: a line is damaged, or the file cannot be read or written.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / MANIFEST
        self.entries: dict[str, Entry] = {}
        self._synced = time.monotonic()
        try:
            self._file = open_regular(self.path, append=True)
        except OSError as error:
            raise RebaError(
                f"{self.path}: cannot be used ({error.strerror or error}); choose another folder"
            ) from error
        try:
            self._read()
        except BaseException:
            self._file.close()
            raise

    def append(self, line: dict[str, Any], *, at_once: bool = False) -> None:
        """Append a line; after the return it survives the end of this process, and a power cut if `at_once`."""
        data = as_json(line).encode() + b"\n"
        try:
            offset = self._file.seek(0, os.SEEK_END)
            self._file.write(data)
            self._file.flush()
            if at_once or time.monotonic() - self._synced > SYNC_SECONDS:
                self._sync()
        except OSError as error:
            raise RebaError(f"{self.path}: cannot be written ({error.strerror or error}); free disk space") from error
        self._add(line, offset, len(data))

    def line(self, entry: Entry) -> dict[str, Any]:
        """Return the complete line of an entry."""
        self._file.seek(entry.offset)
        line: dict[str, Any] = json.loads(self._file.read(entry.length))
        return line

    def close(self) -> None:
        """Write all lines to disk and close the file."""
        self._sync()
        self._file.close()

    def _sync(self) -> None:
        os.fsync(self._file.fileno())
        self._synced = time.monotonic()

    def _read(self) -> None:
        complete = 0
        for number, (offset, data) in enumerate(self._lines(), 1):
            try:
                self._add(json.loads(data), offset, len(data))
            except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
                raise RebaError(
                    f"{self.path}: line {number} is damaged ({error}); delete the line to score its recording again"
                ) from error
            complete = offset + len(data)
        self._file.truncate(complete)

    def _lines(self) -> Iterator[tuple[int, bytes]]:
        self._file.seek(0)
        offset = 0
        for data in self._file:
            if data.endswith(b"\n"):
                yield offset, data
            offset += len(data)

    def _add(self, line: dict[str, Any], offset: int, length: int) -> None:
        recording, path, size, modified, digest, version, _, rules, options, outcome = (line[name] for name in FIELDS)
        if not isinstance(recording, str) or not isinstance(path, str):
            raise TypeError("recording and input must be text")
        text = json.dumps(options, sort_keys=True)
        if self.entries:
            # Most lines have equal options: sharing one text keeps the memory of a million entries small.
            previous = next(reversed(self.entries.values())).options
            text = previous if previous == text else text
        changed = line.get("changed")
        self.entries[path] = Entry(
            recording, size, modified, changed, digest, version, rules, text, outcome, offset, length
        )


@dataclass(frozen=True)
class Content:
    """Identity of the content of a recording.

    Attributes:
        size, modified, changed: as in `reba.file_stamp.Stamp`.
        hash: SHA-256 of a file; for a folder of the names and hashes of its files.
    """

    size: int
    modified: int
    changed: int
    hash: str

    @classmethod
    def of(cls, stamp: Stamp, digest: str) -> Content:
        """Return the content with this hash of a file that has this stamp."""
        return cls(stamp.size, stamp.modified, stamp.changed, digest)


def content_hash(path: str | Path) -> str:
    """Return the SHA-256 of a file, or of the names and hashes of a folder's files; "" if it cannot be read."""
    source = Path(path)
    try:
        if not source.is_dir():
            return sha256_of(source)
        lines = [f"{file.name} {sha256_of(file)}\n" for file in files_of(source)]
    except OSError:
        return ""
    return hashlib.sha256("".join(lines).encode(errors="surrogateescape")).hexdigest()
