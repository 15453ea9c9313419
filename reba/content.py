"""Whether a recording is still the same: its size and time of change, which are quick to look at, and its hash."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path


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
            return _sha256(place)
        lines = [f"{file.relative_to(place)} {_sha256(file)}\n" for file in _files(place)]
    except OSError:
        return ""
    return hashlib.sha256("".join(lines).encode(errors="surrogateescape")).hexdigest()


def _files(path: Path) -> Iterator[Path]:
    if not path.is_dir():
        yield path
        return
    yield from sorted(file for file in path.rglob("*") if file.is_file())


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
