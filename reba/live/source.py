"""What live frames are read from: a store of messages that grows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

from reba.errors import ReadError
from reba.readers.mcap.container import Segment, Store
from reba.readers.mcap.streams import Intake
from reba.readers.stream import ReadLog, Stream


def followed(stream: Stream, names: Sequence[str] | None, log: ReadLog) -> Intake:
    """Return what turns segments of a stream into blocks.

    Raises:
        ReadError: the stream does not come in segments.
    """
    if stream.follow is None:
        raise ReadError(stream.name, "this kind of stream cannot be followed", hint="give MCAP or JSON lines")
    return stream.follow(log, names)


class Source(Store, Protocol):
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

    def grow(self) -> Segment | None:
        """Return the next complete segment, None if there is none yet; it stays in `segments`.

        Raises:
            ReadError: the source is damaged, or was replaced.
        """

    def forget(self) -> None:
        """Let go of the segments there are."""

    def wait(self, seconds: float) -> None:
        """Wait for more, at most this long."""
