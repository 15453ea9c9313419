"""An MCAP file, record by record: https://mcap.dev/spec.

Chunks come as the bytes of their records, packed or not, so that those of another file are copied without decoding;
their indexes are made from their messages. Statistics, indexes and the summary follow at the end.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterable
from typing import BinaryIO, Final

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from reba.readers.mcap.bytes import MAGIC, crc32
from reba.readers.mcap.records import HEAD, MESSAGE_HEAD, gather, scan

MOST_IDS: Final = 65_535
"""Largest id of a schema or a channel; 0 means none."""
_LOG_TIME: Final = HEAD + 6
"""[bytes] Of the log time from the start of a message record."""


class McapFile:
    """Writer of one file.

    Args:
        stream: open for bytes, at its start.
        profile, library: of the header.
    """

    def __init__(self, stream: BinaryIO, profile: str, library: str) -> None:
        self._stream = stream
        self._at = 0
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self._counts: Counter[int] = Counter()
        self._span: tuple[int, int] | None = None
        self._chunks: list[bytes] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._write(MAGIC)
        self._write(_bytes_of(Header(profile=profile, library=library)))

    def define(self, definition: Schema | Channel) -> None:
        """Write a schema or channel, before the first message that needs it."""
        if isinstance(definition, Schema):
            self.schemas[definition.id] = definition
        else:
            self.channels[definition.id] = definition
        self._write(_bytes_of(definition))

    def chunk(self, data: bytes, *, packed: bytes | None = None, compression: str = "zstd") -> int:
        """Write a chunk with the records `data` and an index of its messages; return their latest log time [ns].

        One without messages is left out, and gives 0.

        Args:
            data: records of messages, and of schemas and channels that are defined alike.
            packed: the same as they are compressed already, by `compression`.
        """
        scanned = scan(data)
        if not len(scanned.payloads):
            return 0
        if packed is None:
            import zstandard

            packed = zstandard.compress(data)
        starts = scanned.payloads - MESSAGE_HEAD - HEAD
        times = gather(np.frombuffer(data, np.uint8), starts + _LOG_TIME, 8).view("<u8")[:, 0]
        first, last = int(times.min()), int(times.max())
        head = struct.pack("<QQQI", first, last, len(data), crc32(data)) + _text(compression)
        start = self._record(Opcode.CHUNK, head + struct.pack("<Q", len(packed)), packed)
        end = self._at
        places = {}
        entries = np.column_stack([times, starts.astype("<u8")])
        for number in np.unique(scanned.channels).tolist():
            mine = entries[scanned.channels == number]
            self._counts[number] += len(mine)
            places[number] = self._record(Opcode.MESSAGE_INDEX, struct.pack("<HI", number, mine.nbytes), mine.tobytes())
        index = ChunkIndex(
            chunk_length=end - start,
            chunk_start_offset=start,
            compression=compression,
            compressed_size=len(packed),
            message_end_time=last,
            message_index_length=self._at - end,
            message_index_offsets=places,
            message_start_time=first,
            uncompressed_size=len(data),
        )
        self._chunks.append(_bytes_of(index))
        self._span = (first, last) if self._span is None else (min(first, self._span[0]), max(last, self._span[1]))
        return last

    def metadata(self, name: str, texts: dict[str, str]) -> None:
        """Write a metadata record."""
        start = self._at
        self._write(_bytes_of(Metadata(name=name, metadata=texts)))
        self._metadata.append(MetadataIndex(offset=start, length=self._at - start, name=name))

    def copy(self, opcode: int, length: int, parts: Iterable[bytes], index: McapRecord | None = None) -> None:
        """Write a record of another file, its content of `length` bytes in parts, and list it by its `index`."""
        start = self._at
        self._write(struct.pack("<BQ", opcode, length))
        for part in parts:
            self._write(part)
        if isinstance(index, MetadataIndex | AttachmentIndex):
            index.offset, index.length = start, self._at - start
            if isinstance(index, MetadataIndex):
                self._metadata.append(index)
            else:
                self._attachments.append(index)

    def finish(self) -> None:
        """Write the end of the data, the summary and the footer."""
        self._write(_bytes_of(DataEnd(data_section_crc=0)))
        start = self._at
        first, last = self._span or (0, 0)
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self.channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=self._counts.total(),
            message_end_time=last,
            message_start_time=first,
            metadata_count=len(self._metadata),
            schema_count=len(self.schemas),
        )
        groups: dict[Opcode, Iterable[bytes]] = {
            Opcode.SCHEMA: map(_bytes_of, self.schemas.values()),
            Opcode.CHANNEL: map(_bytes_of, self.channels.values()),
            Opcode.STATISTICS: [_bytes_of(statistics)],
            Opcode.CHUNK_INDEX: self._chunks,
            Opcode.ATTACHMENT_INDEX: map(_bytes_of, self._attachments),
            Opcode.METADATA_INDEX: map(_bytes_of, self._metadata),
        }
        summary, offsets = b"", b""
        for opcode, group in groups.items():
            data = b"".join(group)
            if data:
                at = start + len(summary)
                offsets += _bytes_of(SummaryOffset(group_opcode=opcode, group_start=at, group_length=len(data)))
                summary += data
        at = start + len(summary)
        footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, at)
        crc = crc32(summary + offsets + footer)
        self._write(summary + offsets + _bytes_of(Footer(start, at, crc)) + MAGIC)

    def _record(self, opcode: Opcode, *parts: bytes) -> int:
        """Write a record, and return where it starts."""
        start = self._at
        self._write(struct.pack("<BQ", opcode, sum(map(len, parts))))
        for part in parts:
            self._write(part)
        return start

    def _write(self, data: bytes) -> None:
        self._stream.write(data)
        self._at += len(data)


def _bytes_of(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()


def _text(value: str) -> bytes:
    data = value.encode()
    return struct.pack("<I", len(data)) + data


def message(channel: int, sequence: int, log_time: int, publish_time: int, data: bytes) -> bytes:
    """Return the record of a message."""
    head = struct.pack("<BQHIQQ", Opcode.MESSAGE, MESSAGE_HEAD + len(data), channel, sequence, log_time, publish_time)
    return head + data
