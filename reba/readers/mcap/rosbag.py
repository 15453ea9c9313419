"""Structure of a ROS 1 bag, format 2.0: http://wiki.ros.org/Bags/Format/2.0.

A bag has chunks with messages and connections (a topic of one publisher) and, once it was closed, an index. As for
MCAP, the heads of all records are read and the index serves only to list connections and count messages. Messages are
read in the order of the file, which is that of recording: by time, the passes of a restarted clock would be mixed.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.errors import ReadError
from reba.readers.mcap.container import Container
from reba.readers.mcap.records import LATEST, BadRecord, Channel, ChunkHead, Scan, Schema
from reba.readers.mcap.store import ChunkRef

__all__ = ["BAG_MAGIC", "Bag"]
BAG_MAGIC: Final = b"#ROSBAG V"
"""First bytes of a bag of any version."""
_VERSION: Final = b"#ROSBAG V2.0\n"
_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = range(2, 8)
_OPERATIONS: Final = range(_MESSAGE, _CONNECTION + 1)
_U32 = struct.Struct("<I")
_TIME: Final = 8
"""[bytes] Seconds and nanoseconds."""
_MOST_HEADER: Final = 1 << 20
"""[bytes] Longest header of a record: a topic name and some numbers."""
Places = dict[bytes, tuple[int, int]]
"""Fields of a header: name -> start and stop of the value."""


class Bag(Container):
    """One ROS 1 bag, opened; attributes and errors as of `Container`."""

    format = "bag"
    magic = _VERSION
    foreign = ("is a bag of an old format, expected 2.0", "convert it with `rosbag fix OLD.bag NEW.bag`")
    message_head = 0

    def __init__(self, path: Path, *, check_crc: bool, limit_bytes: int) -> None:
        self._stated_chunks = 0
        self._chunk_at: dict[int, ChunkRef | None] = {}
        self._closed = False
        super().__init__(path, check_crc=check_crc, limit_bytes=limit_bytes)

    def _index(self) -> None:
        try:
            for at, header, length in self._records_of_file():
                self._note_record(at, header, length)
            if self._closed and self.ended_abnormally is None and self._indexed():
                for segment in self.segments:
                    self.counts.update(segment.channels or {})
            else:
                self._count()
        except BadRecord as error:
            raise self._damaged(error) from error
        if self._closed and self.ended_abnormally is None and self._stated_chunks > self._chunks:
            self.lost = (
                f"{self._stated_chunks - self._chunks} of the {self._stated_chunks} chunks that the file states are "
                "missing"
            )
        if not self._closed and self.ended_abnormally is None:
            self.ended_abnormally = f"no index at byte {self.source.size}, the recorder did not close the file"
        if self.ended_abnormally is not None:
            self.ended_abnormally += f"; {sum(self.counts.values())} messages read{self._time_span()}"

    def _indexed(self) -> bool:
        """Return whether the index has the time of every chunk, and every connection."""
        return all(
            segment.start and segment.channels is not None and segment.channels.keys() <= self.channels.keys()
            for segment in self.segments
        )

    def _records_of_file(self) -> Iterator[tuple[int, bytes, int]]:
        """Yield (offset of the data, header, length of the data) of each record; note a truncated end."""
        end = self.source.size
        while self._at < end:
            at = self._at
            size = _U32.unpack(self._window(at, 4))[0] if at + 4 <= end else end
            if size > _MOST_HEADER and at + 4 + size <= end:
                raise BadRecord(at, f"the header of a record declares {size} bytes")
            data_at = at + 4 + size + 4
            length = _U32.unpack(self._window(data_at - 4, 4))[0] if data_at <= end else 0
            if data_at + length > end:
                self.ended_abnormally = f"truncated inside a record at byte {at} of {end}"
                return
            self._records += 1
            if self._records > self._most_records:
                raise BadRecord(at, f"more than {self._most_records} records, more than a file of this size can hold")
            header = self._window(at + 4, size)
            self._at = data_at + length
            yield data_at, header, length

    def _note_record(self, at: int, header: bytes, length: int) -> None:
        """Update segments and definitions from one record of the file."""
        fields = _fields(header, at - len(header) - 4)
        operation = _number(header, fields, b"op", 1)
        if operation == _BAG:
            self._closed = _number(header, fields, b"index_pos", 8) > 0
            self._stated_chunks = _number(header, fields, b"chunk_count", 4)
            if _text(header, fields, b"encryptor"):
                what = f"the bag is encrypted ({_text(header, fields, b'encryptor')})"
                raise ReadError(self.path, what, hint="decrypt it with `rosbag decrypt` and give the result")
        elif operation == _CHUNK:
            compression = _text(header, fields, b"compression")
            head = ChunkHead(0, 0, _number(header, fields, b"size", 4), 0, compression, 0, length)
            self._add_chunk(at, at, head)
            self._chunk_at[at - len(header) - 8] = self.segments[-1] if head.size else None
        elif operation == _CHUNK_INFO:
            segment = self._chunk_at.get(_number(header, fields, b"chunk_pos", 8))
            if segment is not None and segment.chunk is not None:
                for name in (b"start_time", b"end_time"):
                    _number(header, fields, name, _TIME)
                values = _value(header, fields, b"start_time") + _value(header, fields, b"end_time")
                start, end = _times(values).tolist()
                segment.start, segment.chunk = start, replace(segment.chunk, start=start, end=end)
        elif operation == _INDEX and self.segments:
            hints = self.segments[-1].channels = self.segments[-1].channels or {}
            number = _number(header, fields, b"conn", 4)
            hints[number] = hints.get(number, 0) + _number(header, fields, b"count", 4)
        elif operation == _CONNECTION:
            self._check_size(at, length)
            self._add_connection(header, fields, self._window(at, length))
        elif operation not in _OPERATIONS:
            self._warn(f"the record at byte {at} has the unknown type {operation:#x} and was not read")

    def _define(self, data: bytes, scan: Scan) -> None:
        for _, start, stop in scan.definitions:
            size = _U32.unpack_from(data, start)[0]
            header = data[start + 4 : start + 4 + size]
            self._add_connection(header, _fields(header, start), data[start + 4 + size + 4 : stop])

    def _add_connection(self, header: bytes, fields: Places, data: bytes) -> None:
        """Add a connection; an id may be repeated, but not with another type."""
        number = _number(header, fields, b"conn", 4)
        described = _fields(data, 0)
        text = _value(data, described, b"message_definition")
        schema = Schema(number, _text(data, described, b"type"), "ros1msg", text)
        channel = Channel(number, number, _text(header, fields, b"topic"), "ros1")
        if self.schemas.setdefault(number, schema) != schema or self.channels.setdefault(number, channel) != channel:
            raise BadRecord(0, f"connection {number} is defined twice, differently")

    def _scan(self, segment: ChunkRef, data: bytes, most: int) -> Scan:
        return _scan(data, most)

    def _count_one(self, segment: ChunkRef) -> None:
        super()._count_one(segment)
        times = self.load(segment).scan.times
        if segment.chunk is not None and len(times):
            segment.start = int(times.min())
            segment.chunk = replace(segment.chunk, start=segment.start, end=int(times.max()))


def _fields(header: bytes, offset: int) -> Places:
    """Return the places of the fields of a header that starts at `offset`, for messages.

    Raises:
        BadRecord: a field exceeds the header or has no name.
    """
    fields: Places = {}
    at, end = 0, len(header)
    while at < end:
        size = _U32.unpack_from(header, at)[0] if at + 4 <= end else end
        at += 4
        name, separator, _ = header[at : at + min(size, end)].partition(b"=")
        if at + size > end or not separator:
            raise BadRecord(offset + at, f"a header field of {size} bytes where {max(end - at, 0)} are left")
        fields[name] = (at + len(name) + 1, at + size)
        at += size
    return fields


def _value(header: bytes, fields: Places, name: bytes) -> bytes:
    start, stop = fields.get(name, (0, 0))
    return header[start:stop]


def _number(header: bytes, fields: Places, name: bytes, width: int) -> int:
    value = _value(header, fields, name)
    if len(value) != width:
        raise BadRecord(0, f"a record has no field {name.decode()!r} of {width} bytes")
    return int.from_bytes(value, "little")


def _text(header: bytes, fields: Places, name: bytes) -> str:
    return _value(header, fields, name).decode(errors="replace")


def _scan(data: bytes, most: int) -> Scan:
    """Return the messages of a chunk; definitions are whole connection records.

    Raises:
        BadRecord: a record exceeds the end of the chunk or lacks a field, or there are more than `most`.
    """
    payloads: list[int] = []
    lengths: list[int] = []
    channels: list[int] = []
    times: list[bytes] = []
    definitions: list[tuple[int, int, int]] = []
    # Headers of messages of one connection differ in nothing but the time.
    time_at: dict[int, int] = {}
    connections: dict[bytes, int] = {}
    at, end, count = 0, len(data), 0
    while at < end:
        count += 1
        if count > most:
            raise BadRecord(at, f"more than {most} records, more than a file of this size can hold")
        size = _U32.unpack_from(data, at)[0] if at + 8 <= end else end
        data_at = at + 4 + size + 4
        length = _U32.unpack_from(data, data_at - 4)[0] if data_at <= end else 0
        if data_at + length > end:
            raise BadRecord(at, f"a record of {4 + size + 4 + length} bytes where {end - at} are left")
        header = data[at + 4 : at + 4 + size]
        place = time_at.get(size, 0)
        connection = connections.get(header[:place] + header[place + _TIME :])
        if connection is None:
            fields = _fields(header, at + 4)
            operation = _number(header, fields, b"op", 1)
            if operation == _MESSAGE:
                connection = _number(header, fields, b"conn", 4)
                _number(header, fields, b"time", _TIME)
                place = time_at[size] = fields[b"time"][0]
                connections[header[:place] + header[place + _TIME :]] = connection
            elif operation == _CONNECTION:
                definitions.append((operation, at, data_at + length))
            else:
                raise BadRecord(at, f"a record of type {operation:#x} in a chunk")
        if connection is not None:
            payloads.append(data_at)
            lengths.append(length)
            channels.append(connection)
            times.append(header[place : place + _TIME])
        at = data_at + length
    starts, sizes, numbers = (np.array(column, np.int64) for column in (payloads, lengths, channels))
    return Scan(starts, sizes, numbers, _times(b"".join(times)), tuple(definitions), at, count)


def _times(values: bytes) -> NDArray[np.int64]:
    """Return times [ns since 1970] from seconds and nanoseconds."""
    pairs = np.frombuffer(values, "<u4").reshape(-1, 2).astype(np.int64)
    return np.asarray(np.minimum(pairs[:, 0] * 1_000_000_000 + pairs[:, 1], LATEST))
