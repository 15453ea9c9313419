"""The manifest of a dataset: one line of JSON for each time a recording was scored, kept beside the scores.

A line is added once the scores it speaks of are whole on disk, and the last line of a recording counts. A process that
ends in the middle of a line leaves a broken end, which is cut off when the manifest is opened again.
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
from reba.files import as_json, sha256_of

MANIFEST: Final = "_manifest.jsonl"
"""Its name; readers of Parquet datasets pass over what begins with an underscore."""
SYNC: Final = 0.5
"""[s] At most until a line is safe from a power cut; from the end of this process it is so at once."""
SCORED: Final = "scored"
FAILED: Final = "failed"
FIELDS: Final = (
    "recording", "input", "size", "modified", "hash", "version", "rules", "rules_hash", "options", "outcome",
)  # fmt: skip
"""Fields that every line has; `output`, `error`, `seconds`, `frames`, `finished` and `summary` follow."""


@dataclass(frozen=True, slots=True)
class Entry:
    """What the last line of a recording says, as far as it decides whether the recording is scored again.

    Attributes:
        recording: its name in the dataset.
        size, modified, hash: of the input: bytes, nanoseconds since 1970, SHA-256.
        version, rules_hash, options: what it was scored with; options as JSON text.
        outcome: `SCORED` or `FAILED`.
        place, length: of the line in the manifest [bytes].
    """

    recording: str
    size: int
    modified: int
    hash: str
    version: str
    rules_hash: str
    options: str
    outcome: str
    place: int
    length: int


class Manifest:
    """The manifest in a folder; entries by the absolute path of their input.

    Args:
        folder: of the dataset.

    Raises:
        RebaError: a line is damaged, or the file cannot be read or written.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / MANIFEST
        self.entries: dict[str, Entry] = {}
        self._synced = time.monotonic()
        try:
            self._file = self.path.open("a+b")
        except OSError as error:
            raise RebaError(f"{self.path}: cannot be used ({error.strerror or error}); choose another place") from error
        try:
            self._read()
        except BaseException:
            self._file.close()
            raise

    def append(self, line: dict[str, Any]) -> None:
        """Add a line; it survives the end of this process when this returns.

        Raises:
            RebaError: it cannot be written.
        """
        data = as_json(line).encode() + b"\n"
        try:
            place = self._file.seek(0, os.SEEK_END)
            self._file.write(data)
            self._file.flush()
            if time.monotonic() - self._synced > SYNC:
                self._sync()
        except OSError as error:
            raise RebaError(f"{self.path}: cannot be written ({error.strerror or error}); make room") from error
        self._add(line, place, len(data))

    def line(self, entry: Entry) -> dict[str, Any]:
        """Return the whole line of an entry."""
        self._file.seek(entry.place)
        found: dict[str, Any] = json.loads(self._file.read(entry.length))
        return found

    def close(self) -> None:
        """Make all lines safe."""
        self._sync()
        self._file.close()

    def _sync(self) -> None:
        os.fsync(self._file.fileno())
        self._synced = time.monotonic()

    def _read(self) -> None:
        whole = 0
        for number, (place, data) in enumerate(self._lines(), 1):
            try:
                self._add(json.loads(data), place, len(data))
            except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
                raise RebaError(
                    f"{self.path}: line {number} is damaged ({error}); delete the line to score its recording again"
                ) from error
            whole = place + len(data)
        self._file.truncate(whole)

    def _lines(self) -> Iterator[tuple[int, bytes]]:
        self._file.seek(0)
        place = 0
        for data in self._file:
            if data.endswith(b"\n"):
                yield place, data
            place += len(data)

    def _add(self, line: dict[str, Any], place: int, length: int) -> None:
        recording, path, size, modified, digest, version, _, rules, options, outcome = (line[name] for name in FIELDS)
        if not isinstance(recording, str) or not isinstance(path, str):
            raise TypeError("recording and input are no names")
        # The same options stand in every line: one text for all of them.
        text = json.dumps(options, sort_keys=True)
        same = next(reversed(self.entries.values())).options if self.entries else text
        self.entries[path] = Entry(
            recording, size, modified, digest, version, rules, same if same == text else text, outcome, place, length
        )


@dataclass(frozen=True)
class Content:
    """What identifies the content of a recording.

    Attributes:
        size: bytes of all its files.
        modified: of the file that changed last [ns since 1970].
        hash: SHA-256 of a file; of the names and hashes of its files for a folder.
    """

    size: int
    modified: int
    hash: str


def stamp(path: str | Path) -> tuple[int, int]:
    """Return size and time of change of a file or folder; (-1, -1) if it cannot be looked at."""
    try:
        found = [os.stat(file) for file in _files(Path(path))]
    except OSError:
        return -1, -1
    return sum(stat.st_size for stat in found), max((stat.st_mtime_ns for stat in found), default=0)


def content_hash(path: str | Path) -> str:
    """Return the SHA-256 of a file, or of a folder's names and hashes; "" if it cannot be read."""
    place = Path(path)
    try:
        if not place.is_dir():
            return sha256_of(place)
        lines = [f"{file.relative_to(place)} {sha256_of(file)}\n" for file in _files(place)]
    except OSError:
        return ""
    return hashlib.sha256("".join(lines).encode(errors="surrogateescape")).hexdigest()


def _files(path: Path) -> Iterator[Path]:
    if not path.is_dir():
        yield path
        return
    yield from sorted(file for file in path.rglob("*") if file.is_file())
