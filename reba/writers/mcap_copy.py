"""What an MCAP recording contains, copied into another file: topics, attachments, metadata, private records.

Chunks are copied as they are, unless the ids of their channels differ between the files of a recording, or they have
messages of channels that are not defined, which readers refuse.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, MetadataIndex, Schema

from reba.errors import RebaError
from reba.provenance import generator
from reba.readers.mcap import records
from reba.readers.mcap.bytes import ByteSource
from reba.readers.mcap.container import Container
from reba.readers.mcap.records import HEAD, MESSAGE_HEAD, BadRecord, Fields
from reba.readers.mcap.store import ChunkRef, Loaded
from reba.writers.mcap_file import MOST_IDS, McapFile

STEP: Final = 1 << 20
"""[bytes] Copied at once of attachments."""
CRC: Final = 4
"""[bytes] Behind the data of an attachment."""
NO_COPY: Final = "choose the ending .parquet or .csv"
Identity = tuple[Any, ...]


class McapCopy:
    """What is copied of the files of a recording; their equal schemas and channels become one.

    Attributes:
        profile: of the header, "" where the files differ.
        library: of the header, behind the name of this program.
        schemas, channels: definitions in the copy by id.

    Raises:
        RebaError: the files define more channels than one file can.
    """

    def __init__(self, files: Sequence[Container]) -> None:
        self._files = files
        headers = [file.header() for file in files]
        profiles = {profile for profile, _ in headers}
        self.profile = profiles.pop() if len(profiles) == 1 else ""
        libraries = dict.fromkeys(library for _, library in headers if library)
        written = next((library for library in libraries if library.startswith(generator())), "")
        self.library = written or generator() + (f" ({'; '.join(libraries)})" if libraries else "")
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self._numbers: list[dict[int, int]] = []
        known: dict[Identity, int] = {}
        for file in files:
            schema_ids = {0: 0}
            for schema in file.schemas.values():
                identity: Identity = ("schema", schema.name, schema.encoding, schema.data)
                number = known.setdefault(identity, _id(self.schemas, schema.id or None))
                schema_ids[schema.id] = number
                self.schemas[number] = Schema(id=number, name=schema.name, encoding=schema.encoding, data=schema.data)
            numbers: dict[int, int] = {}
            seen: Counter[Identity] = Counter()
            for channel in file.channels.values():
                schema_id = schema_ids.get(channel.schema_id, 0)
                identity = ("channel", channel.topic, channel.encoding, schema_id, channel.described)
                seen[identity] += 1  # publishers of one topic stay channels of their own
                number = known.setdefault((*identity, seen[identity]), _id(self.channels, channel.id))
                numbers[channel.id] = number
                self.channels[number] = Channel(
                    id=number,
                    topic=channel.topic,
                    message_encoding=channel.encoding,
                    metadata=channel.metadata,
                    schema_id=schema_id,
                )
            self._numbers.append(numbers)

    @property
    def is_cdr(self) -> bool:
        """Whether all messages are those of ROS 2."""
        return not self.topics_beside("cdr")

    def topics_beside(self, encoding: str) -> list[str]:
        """Return the topics whose messages have another encoding."""
        return [channel.topic for channel in self.channels.values() if channel.message_encoding != encoding]

    def write(self, file: McapFile, between: Callable[[int], None]) -> None:
        """Copy everything but the header; `between` is called with the latest log time [ns] after each chunk.

        Raises:
            ReadError: a chunk is damaged.
        """
        for schema in self.schemas.values():
            file.define(schema)
        for channel in self.channels.values():
            file.define(channel)
        for source, numbers in zip(self._files, self._numbers, strict=True):
            others = [(at, (opcode, length)) for opcode, at, length in source.others if opcode != Opcode.HEADER]
            places: list[tuple[int, Any]] = [*others, *((one.offset, one) for one in source.segments)]
            for at, one in sorted(places, key=lambda place: place[0]):
                if isinstance(one, ChunkRef):
                    between(self._copy_chunk(file, source, source.load(one), numbers))
                else:
                    _copy_other(file, source.source, at, *one)
            source.release()

    def _copy_chunk(self, file: McapFile, source: Container, loaded: Loaded, numbers: dict[int, int]) -> int:
        """Copy the messages of a segment, and return the latest log time of them [ns]."""
        segment = loaded.segment
        # `unpacked`: its messages were packed one by one.
        if segment.unpacked or not self._same_ids(loaded, numbers):
            return file.chunk(_renumbered(loaded, numbers))
        if segment.chunk is None:
            return file.chunk(loaded.data)
        packed = source.source.read_at(segment.offset, segment.size)
        return file.chunk(loaded.data, packed=packed, compression=segment.chunk.compression)

    def _same_ids(self, loaded: Loaded, numbers: dict[int, int]) -> bool:
        """Return whether messages and definitions of a chunk mean the same in the copy."""
        if any(numbers.get(number) != number for number in np.unique(loaded.scan.channels).tolist()):
            return False
        for opcode, start, stop in loaded.scan.definitions:
            content = loaded.data[start:stop]
            if opcode == Opcode.SCHEMA:
                schema = records.schema(content)
                mine = self.schemas.get(schema.id)
                if mine is None or (mine.name, mine.encoding, mine.data) != (schema.name, schema.encoding, schema.data):
                    return False
            else:
                channel = records.channel(content)
                copied = self.channels.get(channel.id)
                damaged = not channel.metadata and any(channel.described)
                if numbers.get(channel.id) != channel.id or copied is None or damaged:
                    return False
                if copied.schema_id != channel.schema_id:
                    return False
        return True


def _id(taken: Mapping[int, Any], wanted: int | None) -> int:
    """Return the wanted id, or one that is free."""
    return free_id(taken) if wanted is None or wanted in taken else wanted


def free_id(taken: Mapping[int, Any]) -> int:
    """Return an id for a schema or channel that is not taken.

    Raises:
        RebaError: all are.
    """
    for number in (max(taken, default=0) + 1, *range(1, MOST_IDS + 1)):
        if number not in taken and number <= MOST_IDS:
            return number
    raise RebaError(f"the recording defines {MOST_IDS} topics, as many as an MCAP file can; {NO_COPY} for its scores")


def _copy_other(file: McapFile, source: ByteSource, at: int, opcode: int, length: int) -> None:
    """Copy an attachment, a metadata record or a private record; a damaged one is copied and not listed."""
    head = Fields(source.read_at(at, min(length, STEP)))
    index: AttachmentIndex | MetadataIndex | None = None
    try:
        if opcode == Opcode.METADATA:
            index = MetadataIndex(offset=0, length=0, name=head.text())
        elif opcode == Opcode.ATTACHMENT:
            logged, created, name, media_type, size = head.u64(), head.u64(), head.text(), head.text(), head.u64()
            if head.at + size + CRC != length:
                raise BadRecord(head.at, "its length is wrong")
            index = AttachmentIndex(
                offset=0, length=0, log_time=logged, create_time=created, data_size=size, name=name,
                media_type=media_type,
            )  # fmt: skip
    except BadRecord:
        index = None
    file.copy(opcode, length, _parts(source, at, length), index)


def _parts(source: ByteSource, at: int, length: int) -> Iterator[bytes]:
    for start in range(at, at + length, STEP):
        yield source.read_at(start, min(STEP, at + length - start))


def _renumbered(loaded: Loaded, numbers: dict[int, int]) -> bytes:
    """Return the messages of a chunk with their lengths and the ids of their channels in the copy.

    Those of unknown channels are left out.
    """
    lookup = np.full(MOST_IDS + 1, -1)
    for number, new in numbers.items():
        lookup[number] = new
    scan = loaded.scan
    ids = lookup[scan.channels]
    kept = ids >= 0
    starts, stops = scan.payloads[kept] - MESSAGE_HEAD - HEAD, (scan.payloads + scan.lengths)[kept]
    data = np.frombuffer(loaded.data, np.uint8).copy()
    data[starts + HEAD], data[starts + HEAD + 1] = ids[kept] & 0xFF, ids[kept] >> 8
    lengths = (scan.lengths[kept] + MESSAGE_HEAD).astype("<u8").view(np.uint8).reshape(-1, 8)
    data[starts[:, None] + np.arange(1, 9)] = lengths
    edges = np.zeros(len(data) + 1, np.int8)
    edges[starts] += 1
    edges[stops] -= 1
    return data[np.cumsum(edges[:-1], dtype=np.int8).astype(bool)].tobytes()
