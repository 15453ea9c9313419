"""What live frames are read from: a store of messages that grows."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from mcap.opcode import Opcode

from reba.errors import ReadError
from reba.readers.mcap import MAX_CHUNK
from reba.readers.mcap.bytes import MAGIC, ZSTD_MAGIC
from reba.readers.mcap.container import ChunkRef, Container, Store, Summary
from reba.readers.mcap.records import HEAD, BadRecord
from reba.readers.recording.stream import BlockDecoder, ReadLog, Stream


def followed(stream: Stream, names: Sequence[str] | None, log: ReadLog) -> BlockDecoder:
    """Return what turns segments of a stream into blocks.

    Raises:
        ReadError: the stream does not come in segments.
    """
    if stream.follow is None:
        raise ReadError(stream.name, "this kind of stream cannot be followed", hint="give MCAP or JSON lines")
    return stream.follow(log, names)


class GrowingStore(Store, Protocol):
    """A store whose segments come one by one.

    Attributes:
        span: first and last log time [ns], None before the first message.
        finished: whether nothing can come any more.
        ready: whether what it holds is clear from the first message on, so that no settling is needed.
        skipped: messages that could not even be taken up.
    """

    span: tuple[int, int] | None
    finished: bool
    ready: bool
    skipped: int

    def grow(self) -> ChunkRef | None:
        """Return the next complete segment, None if there is none yet; it stays in `segments`.

        Raises:
            ReadError: the source is damaged, or was replaced.
        """

    def forget(self) -> None:
        """Let go of the segments there are."""

    def wait(self, seconds: float) -> None:
        """Wait for more, at most this long."""


WHILE = 0.05
"""[s] Pause while a file has not even its first bytes."""


class Growing(Container):
    """One MCAP file that grows; what `reba.live.sources.GrowingStore` asks for.

    Args:
        path: the file, which holds at least the first magic bytes.

    Raises:
        ReadError: it is no MCAP file.
    """

    ready = False
    skipped = 0

    def __init__(self, path: Path) -> None:
        self.finished = False
        self._summary = Summary()
        super().__init__(path, check_crc=True, limit_bytes=MAX_CHUNK)
        self._inode = os.stat(path).st_ino

    def _index(self) -> None:
        """Nothing is walked on opening: `grow` does it."""

    def grow(self) -> ChunkRef | None:
        """Return the next complete chunk or run of messages, None if there is none yet.

        Raises:
            ReadError: a record is damaged, or the file was replaced, removed or cut.
        """
        self._look_again()
        known = len(self.segments)
        self.ended_abnormally = None
        try:
            for at, opcode, length in self._walk(False):
                self._note(self._summary, at, opcode, length)
                self.finished |= opcode == Opcode.FOOTER
                if len(self.segments) > known:
                    break
            if self.ended_abnormally is not None:
                self._check_tail()
        except BadRecord as error:
            raise self._damaged(error) from error
        if len(self.segments) == known:
            return None
        self._count_one(self.segments[-1])
        return self.segments[-1]

    def forget(self) -> None:
        """Let go of the segments there are."""
        self.segments.clear()
        self.release()

    def wait(self, seconds: float) -> None:
        """Sleep: files have no event that every system tells."""
        time.sleep(seconds)

    def _look_again(self) -> None:
        """Take up the size of the file."""
        try:
            now = os.stat(self.path)
        except OSError as error:
            raise ReadError(
                self.path, f"the file is gone ({error.strerror})", hint="start again with the new one"
            ) from error
        if now.st_ino != self._inode:
            raise ReadError(self.path, "the file was replaced by another", hint="start again to follow the new one")
        if self.source.refresh():
            self._ahead = (0, b"")
        if self.source.size < self._at:
            raise ReadError(
                self.path,
                f"the file became shorter ({self.source.size} bytes, {self._at} were read)",
                hint="start again; a recorder only appends",
            )

    def _check_tail(self) -> None:
        """Refuse a record that never will be complete: it declares more than any record may hold."""
        head = self._window(self._at, HEAD)
        if len(head) == HEAD and head[0]:
            self._check_size(self._at, int.from_bytes(head[1:], "little"))


def open_growing(path: Path, until_idle: float | None) -> Growing:
    """Open a file that is being written, as soon as it has its first bytes.

    Args:
        path: the file.
        until_idle: [s] how long to wait for them, None for ever.

    Raises:
        ReadError: there is no such file, it is no plain MCAP file, or nothing was written to it.
    """
    if not path.exists():
        raise ReadError(path, "no such file", hint="start the recorder first, or give - to read lines from a pipe")
    if not path.is_file():
        raise ReadError(path, "not a file", hint="give the .mcap file that is being written, the newest of its folder")
    start = time.monotonic()
    while len(head := _first_bytes(path)) < len(MAGIC):
        if until_idle is not None and time.monotonic() - start > until_idle:
            raise ReadError(path, "nothing was written to it", hint="start the recorder, or wait longer")
        time.sleep(WHILE)
    if head.startswith(ZSTD_MAGIC):
        raise ReadError(
            path, "is compressed as a whole, which only happens after recording", hint="score it with `reba score`"
        )
    if head != MAGIC:
        raise ReadError(
            path, "does not start with the MCAP magic bytes", hint="follow an .mcap file, or pipe JSON lines to -"
        )
    return Growing(path)


def _first_bytes(path: Path) -> bytes:
    try:
        with path.open("rb") as file:
            return file.read(len(MAGIC))
    except OSError as error:
        raise ReadError(path, error.strerror or str(error), hint="give a readable file") from error
