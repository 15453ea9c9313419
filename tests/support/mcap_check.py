"""Everything that an MCAP file states of itself, compared with its bytes: indexes, counts, offsets and checksums."""

from __future__ import annotations

import io
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    Footer,
    Message,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.stream_reader import breakup_chunk

MAGIC = b"\x89MCAP0\r\n"
SUMMARY = (
    Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX,
    Opcode.METADATA_INDEX, Opcode.SUMMARY_OFFSET,
)  # fmt: skip


@dataclass
class Content:
    """Contents of a file, in its order; `messages` of each topic with their channels."""

    messages: dict[str, list[tuple[int, Message]]] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    schemas: dict[int, Schema] = field(default_factory=dict)
    metadata: list[Metadata] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)
    profile: str = ""
    library: str = ""
    private: list[bytes] = field(default_factory=list)
    chunks: list[Chunk] = field(default_factory=list)

    def payloads(self, topic: str) -> list[bytes]:
        """Return the messages of a topic."""
        return [message.data for _, message in self.messages[topic]]

    def logged(self, topic: str) -> list[int]:
        """Return the log times [ns] of a topic."""
        return [message.log_time for _, message in self.messages[topic]]


def checked(path: Path) -> Content:
    """Return what a file contains, after every statement in it was compared with its bytes."""
    data = path.read_bytes()
    assert data[:8] == data[-8:] == MAGIC
    content = Content()
    counts: Counter[int] = Counter()
    times: list[int] = []
    expected: dict[int, list[tuple[int, int]]] = {}
    starts: dict[int, tuple[Opcode | int, int]] = {}
    chunk_indexes: dict[int, tuple[Chunk, dict[int, int], int]] = {}
    summary: dict[int, list[bytes]] = {}
    groups: dict[int, list[int]] = {}
    data_end, footer, statistics = 0, None, None
    chunk_at = 0
    for at, opcode, body in records(data):
        stream = ReadDataStream(io.BytesIO(body))
        starts[at] = (opcode, 9 + len(body))
        assert footer is None
        if data_end:
            summary.setdefault(opcode, []).append(body)
            groups.setdefault(opcode, []).append(at)
            assert opcode in (*SUMMARY, Opcode.FOOTER)
            if opcode == Opcode.STATISTICS:
                statistics = Statistics.read(stream)
            elif opcode == Opcode.FOOTER:
                footer = (at, Footer.read(stream))
        elif opcode == Opcode.HEADER:
            assert at == 8
            content.profile, content.library = stream.read_prefixed_string(), stream.read_prefixed_string()
        elif opcode == Opcode.DATA_END:
            data_end = at + 9 + len(body)
        elif opcode == Opcode.CHUNK:
            assert not expected
            chunk = Chunk.read(stream)
            content.chunks.append(chunk)
            expected = {}
            logged = []
            for record, offset in zip(*inside_of(chunk), strict=True):
                if not isinstance(record, Message):
                    define(content, record)
                    continue
                topic = content.channels[record.channel_id].topic
                content.messages.setdefault(topic, []).append((record.channel_id, record))
                expected.setdefault(record.channel_id, []).append((record.log_time, offset))
                counts[record.channel_id] += 1
                logged.append(record.log_time)
            assert (chunk.message_start_time, chunk.message_end_time) == (min(logged), max(logged))
            times += logged
            chunk_at = at
            chunk_indexes[at] = (chunk, {}, 9 + len(body))
        elif opcode == Opcode.MESSAGE_INDEX:
            one = MessageIndex.read(stream)
            assert expected.pop(one.channel_id) == one.records
            chunk_indexes[chunk_at][1][one.channel_id] = at
        elif opcode == Opcode.SCHEMA:
            define(content, Schema.read(stream))
        elif opcode == Opcode.CHANNEL:
            define(content, Channel.read(stream))
        elif opcode == Opcode.METADATA:
            content.metadata.append(Metadata.read(stream))
        elif opcode == Opcode.ATTACHMENT:
            content.attachments.append(Attachment.read(stream))
        else:
            assert opcode >= 0x80, f"opcode {opcode}"
            content.private.append(body)
        assert not expected or opcode in (Opcode.CHUNK, Opcode.MESSAGE_INDEX), "messages without an index"
    assert footer is not None
    assert statistics is not None
    at, last = footer
    assert last.summary_start == data_end
    assert last.summary_crc == zlib.crc32(data[data_end : at + 9 + 16])
    assert statistics.channel_message_counts == counts
    assert statistics.message_count == len(times)
    assert (statistics.message_start_time, statistics.message_end_time) == (min(times), max(times))
    assert (statistics.schema_count, statistics.channel_count) == (len(content.schemas), len(content.channels))
    assert (statistics.attachment_count, statistics.metadata_count, statistics.chunk_count) == (
        len(content.attachments), len(content.metadata), len(chunk_indexes),
    )  # fmt: skip
    check_summary(content, summary, starts, chunk_indexes, data)
    for body in summary[Opcode.SUMMARY_OFFSET]:
        offset = SummaryOffset.read(ReadDataStream(io.BytesIO(body)))
        places = groups.get(offset.group_opcode, [offset.group_start] if not offset.group_length else [])
        assert offset.group_start == places[0]
        assert offset.group_length == sum(starts[place][1] for place in groups.get(offset.group_opcode, []))
    with path.open("rb") as file:  # and its own reader goes through all of it
        reader = make_reader(file, validate_crcs=True)
        assert sum(1 for _ in reader.iter_messages()) == len(times)
        assert len(list(reader.iter_metadata())) == len(content.metadata)
        assert len(list(reader.iter_attachments())) == len(content.attachments)
    return content


def records(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield offset, opcode and content of each top-level record."""
    at = len(MAGIC)
    while at < len(data) - len(MAGIC):
        length = int.from_bytes(data[at + 1 : at + 9], "little")
        assert at + 9 + length <= len(data) - len(MAGIC)
        yield at, data[at], data[at + 9 : at + 9 + length]
        at += 9 + length


def inside_of(chunk: Chunk) -> tuple[list[object], list[int]]:
    """Return the records of a chunk and their offsets, after comparing its checksum."""
    inside = list(breakup_chunk(chunk, validate_crc=True))
    data = unpacked(chunk)
    assert len(data) == chunk.uncompressed_size
    assert zlib.crc32(data) == chunk.uncompressed_crc
    offsets, at = [], 0
    while at < len(data):
        if data[at] < 0x80:
            offsets.append(at)
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    return inside, offsets


def unpacked(chunk: Chunk) -> bytes:
    """Return the records of a chunk."""
    if chunk.compression == "zstd":
        import zstandard

        return zstandard.decompress(chunk.data, max_output_size=chunk.uncompressed_size)
    if chunk.compression == "lz4":
        import lz4.frame

        return bytes(lz4.frame.decompress(chunk.data))
    return chunk.data


def define(content: Content, record: object) -> None:
    """Add a definition; a repeated one has to be equal, and the schema of a channel known before it."""
    known = content.schemas if isinstance(record, Schema) else content.channels
    assert isinstance(record, Schema | Channel)
    assert known.setdefault(record.id, record) == record  # type: ignore[arg-type]
    if isinstance(record, Channel):
        assert record.schema_id == 0 or record.schema_id in content.schemas


def check_summary(content, summary, starts, chunk_indexes, data) -> None:  # type: ignore[no-untyped-def]
    """Compare definitions and indexes of the summary with the data section."""

    def read(opcode: Opcode, kind: type) -> list:  # type: ignore[type-arg]
        return [kind.read(ReadDataStream(io.BytesIO(body))) for body in summary.get(opcode, [])]

    assert {schema.id: schema for schema in read(Opcode.SCHEMA, Schema)} == content.schemas
    assert {channel.id: channel for channel in read(Opcode.CHANNEL, Channel)} == content.channels
    chunks = read(Opcode.CHUNK_INDEX, ChunkIndex)
    assert [index.chunk_start_offset for index in chunks] == list(chunk_indexes)
    for index in chunks:
        chunk, places, length = chunk_indexes[index.chunk_start_offset]
        assert index.chunk_length == length
        assert index.message_index_offsets == places
        assert index.message_index_length == sum(starts[place][1] for place in places.values())
        assert (index.message_start_time, index.message_end_time) == (chunk.message_start_time, chunk.message_end_time)
        assert (index.compression, index.compressed_size) == (chunk.compression, len(chunk.data))
        assert index.uncompressed_size == chunk.uncompressed_size
    for index in read(Opcode.METADATA_INDEX, MetadataIndex):
        assert starts[index.offset] == (Opcode.METADATA, index.length)
    for index, one in zip(read(Opcode.ATTACHMENT_INDEX, AttachmentIndex), content.attachments, strict=True):
        assert starts[index.offset] == (Opcode.ATTACHMENT, index.length)
        assert (index.name, index.media_type, index.data_size) == (one.name, one.media_type, len(one.data))
        assert (index.log_time, index.create_time) == (one.log_time, one.create_time)
    assert len(summary.get(Opcode.METADATA_INDEX, [])) == len(content.metadata)
