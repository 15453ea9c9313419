"""Whether a file or folder is still what it was: a stamp is taken before it is read and compared afterwards.

A stamp has size, times and identity of every file, so it differs after any write, replacement or change of a link, also
where size and modification time were kept: no program can set the time of the last status change. Times have the
resolution of a clock tick; a change within the tick of the former one would not show, so `stamp_before` waits until
that tick is over.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from reba.errors import ReadError

TICK: Final = 20_000_000
"""[ns] Longest tick of a clock whose times have fractions of a second: 10 ms on Linux, 16 ms on Windows; rounded up."""
WHOLE_SECONDS: Final = 2_000_000_000
"""[ns] Tick of file systems that keep whole seconds: 1 s or 2 s."""
_SECOND: Final = 1_000_000_000
CHANGED_WHILE_READ: Final = "changed while it was read"
TRY_AGAIN: Final = "score it again when it is complete"


@dataclass(frozen=True)
class Stamp:
    """State of a file, or of a folder and the files in it.

    Attributes:
        place: path without links.
        entries: name, device, inode, size [bytes], last modification and last status change [ns since 1970] of the
            path itself, which may be a link, of what it names, and of each file in a folder.
        size: sum over the files [bytes].
        modified, changed: latest modification and status change of a file [ns since 1970].
    """

    place: str
    entries: tuple[tuple[str, int, int, int, int, int], ...]
    size: int = -1
    modified: int = -1
    changed: int = -1


def files_of(path: str | Path) -> list[Path]:
    """Return the file itself, or the files directly in a folder by name, which are what a recording in splits is."""
    place = Path(path)
    return sorted(file for file in place.iterdir() if file.is_file()) if place.is_dir() else [place]


def stamp_of(path: str | Path) -> Stamp:
    """Return the stamp of a file or folder; one without entries if it cannot be read.

    >>> stamp_of("no such file").size
    -1
    """
    place = os.path.realpath(path)
    try:
        files = {file.name: os.stat(file) for file in files_of(path)}
        entries = [("", os.lstat(path)), ("", os.stat(path)), *files.items()]
    except OSError:
        return Stamp(place, ())
    return Stamp(
        place,
        tuple(_entry(name, status) for name, status in entries),
        sum(file.st_size for file in files.values()),
        max((file.st_mtime_ns for file in files.values()), default=0),
        max((file.st_ctime_ns for file in files.values()), default=0),
    )


def stamp_before(path: str | Path) -> Stamp:
    """Return the stamp of what is going to be read, once the clock tick of its last change is over."""
    stamp = stamp_of(path)
    tick = TICK if stamp.changed % _SECOND else WHOLE_SECONDS
    time.sleep(min(max(stamp.changed + tick - time.time_ns(), 0), tick) / _SECOND)
    return stamp


@contextmanager
def unchanged(path: str | Path) -> Iterator[None]:
    """Guard the reading of a file or folder.

    Raises:
        ReadError: it changed meanwhile, which also explains any other error of the reading.
    """
    before = stamp_before(path)
    try:
        yield
    except Exception as error:
        if stamp_of(path) != before:
            raise ReadError(path, CHANGED_WHILE_READ, hint=TRY_AGAIN) from error
        raise
    if stamp_of(path) != before:
        raise ReadError(path, CHANGED_WHILE_READ, hint=TRY_AGAIN)


def _entry(name: str, status: os.stat_result) -> tuple[str, int, int, int, int, int]:
    return name, status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns, status.st_ctime_ns
