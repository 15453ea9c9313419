"""Summary section of an MCAP file: whether it can be relied on, and what it states that the data section lacks."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

from mcap.opcode import Opcode

from reba.readers.mcap import records
from reba.readers.mcap.bytes import ByteSource, crc32
from reba.readers.mcap.records import Channel, Schema

FOOTER: Final = 20
"""[bytes] Content of a Footer record."""


@dataclass
class Summary:
    """Summary section and footer of a file.

    Attributes:
        schemas, channels: definitions by id.
        counts: messages of each channel, None without a Statistics record.
        channel_count, chunks: of the Statistics record.
        indexes: number of ChunkIndex records.
        start: end of the data section in the file.
        footer: start of the summary and of its offsets, CRC-32 (0: none); None without a footer.
        footer_at: place of the footer.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] | None = None
    channel_count: int = -1
    chunks: int = 0
    indexes: int = 0
    start: int = 0
    footer: tuple[int, int, int] | None = None
    footer_at: int = 0

    def add(self, opcode: int, content: bytes) -> None:
        """Add a Schema, Channel or Statistics record.

        Raises:
            BadRecord: its content is damaged.
        """
        if opcode == Opcode.SCHEMA:
            schema = records.schema(content)
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            channel = records.channel(content)
            self.channels[channel.id] = channel
        else:
            self.channel_count, self.chunks, self.counts = records.statistics(content)

    def undamaged(self, source: ByteSource, limit_bytes: int) -> bool:
        """Return whether there is a footer, and the bytes have the CRC that it states, if any."""
        if self.footer is None:
            return False
        start, _, crc = self.footer
        size = self.footer_at - start
        if crc == 0:
            return True
        # The CRC covers the footer up to the CRC itself.
        whole = size + records.HEAD + FOOTER - 4
        return 0 <= size <= limit_bytes and crc32(source.read_at(start, whole)) == crc

    def holds(self, channels: Mapping[int, Channel], indexed: Iterable[int]) -> bool:
        """Return whether it can replace the data section: complete, with a CRC (correct, see `undamaged`).

        Args:
            channels: of the data section.
            indexed: channels of the message indexes.
        """
        if self.footer is None or self.counts is None:
            return False
        start, _, crc = self.footer
        listed = self.channels.keys() | channels.keys()
        return (
            crc != 0
            and start == self.start
            and self.channel_count == len(self.channels)
            and {*indexed, *self.counts} <= listed
            and all(self.channels.get(number, known) == known for number, known in channels.items())
        )

    def missing(self, chunks: int, counts: Mapping[int, int]) -> str | None:
        """Return what the file states to have beyond the `chunks` and messages (`counts`) that were found."""
        stated = max(self.chunks, self.indexes)
        if stated > chunks:
            return f"{stated - chunks} of the {stated} chunks that the file states are missing"
        missing = sum((Counter(self.counts or {}) - Counter(counts)).values())
        return f"{missing} messages that the file states are missing" if missing else None
