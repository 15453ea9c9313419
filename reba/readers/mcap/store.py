"""Store of messages: segments, and the channels to which their messages belong.

An MCAP file, a ROS 1 bag, a rosbag2 database and a live source are stores; all that follows is the same for them.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from reba.readers.mcap import records
from reba.readers.mcap.records import Channel, ChunkHead, Scan, Schema


@dataclass
class ChunkRef:
    """A chunk, or a run of message records outside chunks.

    Attributes:
        offset: where its records (packed or not) start in the file.
        size: their bytes in the file.
        chunk: the head of the chunk, None for records outside chunks.
        start: earliest log time [ns].
        channels: messages of each channel by the message indexes after it, a hint that may be wrong; None: unknown.
        indexes: where the MessageIndex records after it start and end in the file.
        scanned: whether its records are counted already.
        checked: whether its CRC was compared, so that it need not be when the chunk is read again.
        unpacked: bytes of its messages that were compressed one by one and are counted already.
    """

    offset: int
    size: int
    chunk: ChunkHead | None
    start: int
    channels: dict[int, int] | None = None
    indexes: tuple[int, int] = (0, 0)
    scanned: bool = False
    checked: bool = False
    unpacked: int = 0


@dataclass
class Loaded:
    """Unpacked records of one segment and the positions of its messages; a payload follows a head [bytes] in MCAP."""

    segment: ChunkRef
    data: bytes
    scan: Scan
    head: int = field(default=records.HEAD + records.MESSAGE_HEAD, kw_only=True)

    def where(self, payload: int) -> str:
        """Return the place of the message with this payload, for messages."""
        at = payload - self.head
        if self.segment.chunk is None:
            return f"byte {self.segment.offset + at}"
        return f"byte {at} of the chunk at byte {self.segment.offset}"


class Store(Protocol):
    """Source of streams: segments of messages and the channels they belong to; attributes as of `Container`."""

    path: Path
    segments: list[ChunkRef]
    schemas: dict[int, Schema]
    channels: dict[int, Channel]
    counts: Counter[int]

    def load(self, segment: ChunkRef) -> Loaded:
        """Return the records of a segment, checked."""

    def release(self) -> None:
        """Free the memory of the loaded segment."""


class StoredFile(Store, Protocol):
    """One file of a recording; attributes as of `Container`."""

    format: str
    ended_abnormally: str | None
    lost: str | None
    warnings: list[str]

    def store_of(self, channel: int) -> Store:
        """Return a store that loads the messages of a channel, also of a type without postures."""
