"""Sources of live frames: the protocol of growing message stores, and growing MCAP files."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Protocol

from mcap.opcode import Opcode

from reba.errors import ReadError
from reba.open_file import open_regular
from reba.readers.mcap import MAX_CHUNK
from reba.readers.mcap.bytes import MAGIC, ZSTD_MAGIC
from reba.readers.mcap.container import Container
from reba.readers.mcap.records import HEAD, BadRecord
from reba.readers.mcap.store import ChunkRef, Loaded, Store
from reba.readers.mcap.summary import Summary
from reba.readers.recording.stream import BlockDecoder, ReadLog, Stream


def block_decoder(stream: Stream, names: Sequence[str] | None, log: ReadLog) -> BlockDecoder:
    """Return the decoder from segments of a stream to blocks; a stream without segments is refused."""
    if stream.follow is None:
        raise ReadError(stream.name, "this kind of stream cannot be followed", hint="give MCAP or JSON lines")
    return stream.follow(log, names)


AGAIN = "start again to follow what is there now"


class SourceChanged(ReadError):
    """The file under the path is another one, or none any more: what was followed has ended."""


class GrowingStore(Store, Protocol):
    """A message store whose segments arrive one by one.

    Attributes:
        span: first and last log time [ns], None before the first message.
        finished: no more segments can arrive.
        ready: the first message determines how all are read, so no data need to be collected first.
        skipped: messages that could not be read.
    """

    span: tuple[int, int] | None
    finished: bool
    ready: bool
    skipped: int

    def grow(self) -> ChunkRef | None:
        """Return the next complete segment and append it to `segments`; None if there is none yet.

        Raises:
            ReadError: the source is damaged.
            SourceChanged: it is replaced, removed or cut.
        """

    def forget(self) -> None:
        """Remove all segments from memory."""

    def wait(self, seconds: float) -> None:
        """Wait at most this long for more data [s]."""


EMPTY_FILE_SECONDS = 0.05
"""[s] Between two checks of a file that has no bytes yet."""


class GrowingMcap(Container):
    """One growing MCAP file, which has at least the magic bytes; satisfies `GrowingStore`.

    Attributes:
        before: first and last log time [ns] of the file under this name before; if this one begins with the same
            message, it is that file again, cut, and messages that were read are not read twice.
    """

    ready = False
    skipped = 0
    before: tuple[int, int] | None = None

    def __init__(self, path: Path) -> None:
        self.finished = False
        self._summary = Summary()
        super().__init__(path, check_crc=True, limit_bytes=MAX_CHUNK)
        self._inode = os.stat(path).st_ino
        self._changed = ""

    def _index(self) -> None:
        """Index nothing on opening: `grow` reads the records."""

    def grow(self) -> ChunkRef | None:
        """Return the next complete chunk or run of messages, None if there is none yet."""
        self._refresh()
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
            if self._changed:
                raise SourceChanged(self.path, self._changed, hint=AGAIN)
            return None
        self._count_one(self.segments[-1])
        return self.segments[-1]

    def load(self, segment: ChunkRef) -> Loaded:
        """Return the records of a segment, checked, without messages that were read from this file before."""
        loaded = super().load(segment)
        if self.before is None or self.span is None or self.span[0] != self.before[0]:
            return loaded
        scan, new = loaded.scan, loaded.scan.times > self.before[1]
        rest = replace(
            scan,
            payloads=scan.payloads[new],
            lengths=scan.lengths[new],
            channels=scan.channels[new],
            times=scan.times[new],
        )
        return replace(loaded, scan=rest)

    def forget(self) -> None:
        """Remove all segments from memory."""
        self.segments.clear()
        self.release()

    def wait(self, seconds: float) -> None:
        """Sleep: there is no portable event for a file that grows."""
        time.sleep(seconds)

    def _refresh(self) -> None:
        """Read the size of the file again; of one that was replaced or removed the rest is read first."""
        try:
            same = os.stat(self.path).st_ino == self._inode
        except OSError:
            self._changed = "the file was removed"
        else:
            self._changed = "" if same else "the file was replaced by another"
        if self.source.refresh():
            self._ahead = (0, b"")
        if self.source.size < self._at:
            raise SourceChanged(
                self.path, f"the file became shorter ({self.source.size} bytes, {self._at} were read)", hint=AGAIN
            )

    def _check_tail(self) -> None:
        """Refuse a record that declares more bytes than a record may have, as it would never be complete."""
        head = self._window(self._at, HEAD)
        if len(head) == HEAD and head[0]:
            self._check_size(self._at, int.from_bytes(head[1:], "little"))


def opened_again(before: GrowingMcap) -> GrowingMcap | None:
    """Return the file that is now under the path of a file, None as long as there is none with the magic bytes."""
    with suppress(OSError, ReadError):
        if len(_first_bytes(before.path)) == len(MAGIC):
            after = open_growing(before.path, 0.0)
            after.before = before.span
            return after
    return None


def open_growing(path: Path, until_idle: float | None) -> GrowingMcap:
    """Open a plain MCAP file that is being written, as soon as it has its magic bytes.

    Args:
        until_idle: longest wait for these bytes [s], None for no limit.

    Raises:
        ReadError: there is no such file, it is not a plain MCAP file, or it stays empty.
    """
    if not path.exists():
        raise ReadError(path, "no such file", hint="start the recorder first, or give - to read lines from a pipe")
    if not path.is_file():
        raise ReadError(path, "not a file", hint="give the .mcap file that is being written, the newest of its folder")
    start = time.monotonic()
    while len(head := _first_bytes(path)) < len(MAGIC):
        if until_idle is not None and time.monotonic() - start > until_idle:
            raise ReadError(path, "the file is empty", hint="start the recorder, or give a longer --until-idle")
        time.sleep(EMPTY_FILE_SECONDS)
    if head.startswith(ZSTD_MAGIC):
        raise ReadError(path, "is a compressed file, so its recording has ended", hint="score it with `reba score`")
    if head != MAGIC:
        raise ReadError(
            path, "does not start with the MCAP magic bytes", hint="follow an .mcap file, or pipe JSON lines to -"
        )
    return GrowingMcap(path)


def _first_bytes(path: Path) -> bytes:
    try:
        with open_regular(path) as file:
            return file.read(len(MAGIC))
    except OSError as error:
        raise ReadError(path, error.strerror or str(error), hint="give a readable file") from error
