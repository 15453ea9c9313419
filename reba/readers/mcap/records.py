"""MCAP records from bytes: https://mcap.dev/spec#records. Every length is checked against the bytes available."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

HEAD: Final = 9
"""[bytes] Opcode and length before the content of every record."""
MESSAGE_HEAD: Final = 22
"""[bytes] Channel, sequence, log time and publish time before the payload of a message."""
INDEX_HEAD: Final = 6
"""[bytes] Channel and byte count at the head of a MessageIndex record."""
LATEST: Final = 4_000_000_000_000_000_000
"""[ns] Latest time that is read, the year 2096; the sum and difference of two such times are in the range of int64."""
_HEAD = struct.Struct("<BQ")
_U16 = struct.Struct("<H")
_U32 = struct.Struct("<I")
_U64 = struct.Struct("<Q")
_PROBE: Final = 16
"""Records compared first: most runs are shorter."""
DEFINITIONS: Final = (Opcode.SCHEMA, Opcode.CHANNEL)
"""Records that say what messages are."""


class BadRecord(Exception):
    """A record with an impossible length or content; `offset` counts from the start of the parsed bytes."""

    def __init__(self, offset: int, what: str) -> None:
        self.offset = offset
        self.what = what
        super().__init__(what)


@dataclass(frozen=True)
class Schema:
    """A message definition: name, encoding, and text or descriptor."""

    id: int
    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True)
class Channel:
    """A topic of one publisher, with the encoding and schema of its messages (`schema_id` 0: none).

    `described` are the bytes of its metadata; reading does not need them, a copy includes them.
    """

    id: int
    schema_id: int
    topic: str
    encoding: str
    described: bytes = field(default=b"", compare=False)

    @property
    def metadata(self) -> dict[str, str]:
        """Metadata by name; empty where it is damaged."""
        return _pairs(Fields(self.described))


@dataclass(frozen=True)
class ChunkHead:
    """Head of a chunk: log times [ns], sizes [bytes], CRC-32 (0: none) and the offset of its records."""

    start: int
    end: int
    size: int
    crc: int
    compression: str
    records_at: int
    records_size: int


class Fields:
    """A cursor over the fields of one record.

    Raises:
        BadRecord: a field exceeds the end of the record.
    """

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.at = 0

    def _number(self, form: struct.Struct) -> int:
        if self.at + form.size > len(self.data):
            raise BadRecord(self.at, "a record ends inside a field")
        (value,) = form.unpack_from(self.data, self.at)
        self.at += form.size
        return int(value)

    def u16(self) -> int:
        """Return the next two bytes as a number."""
        return self._number(_U16)

    def u32(self) -> int:
        """Return the next four bytes as a number."""
        return self._number(_U32)

    def u64(self) -> int:
        """Return the next eight bytes as a number."""
        return self._number(_U64)

    def data32(self) -> bytes:
        """Return the bytes after a four-byte length."""
        length = self.u32()
        if self.at + length > len(self.data):
            raise BadRecord(
                self.at, f"a field of {length} bytes in a record with {len(self.data) - self.at} bytes left"
            )
        self.at += length
        return self.data[self.at - length : self.at]

    def text(self) -> str:
        """Return a string."""
        at = self.at
        try:
            return self.data32().decode()
        except UnicodeDecodeError as error:
            raise BadRecord(at, "a name is not UTF-8 text") from error


def schema(content: bytes) -> Schema:
    """Return the schema of a Schema record."""
    fields = Fields(content)
    return Schema(fields.u16(), fields.text(), fields.text(), fields.data32())


def channel(content: bytes) -> Channel:
    """Return the channel of a Channel record."""
    fields = Fields(content)
    return Channel(fields.u16(), fields.u16(), fields.text(), fields.text(), bytes(content[fields.at :]))


def chunk_head(content: bytes, length: int) -> ChunkHead:
    """Return the head of a chunk from the first bytes of its content, which is `length` bytes long.

    Raises:
        BadRecord: its records do not fill the record.
    """
    fields = Fields(content)
    start, end, size, crc = fields.u64(), fields.u64(), fields.u64(), fields.u32()
    compression, records_size = fields.text(), fields.u64()
    if fields.at + records_size != length:
        raise BadRecord(0, f"a chunk of {length} bytes declares records of {records_size} bytes")
    return ChunkHead(start, end, size, crc, compression, fields.at, records_size)


def statistics(content: bytes) -> tuple[int, int, dict[int, int]]:
    """Return the numbers of channels and of chunks, and the messages of each channel, from a Statistics record."""
    fields = Fields(content)
    fields.u64()
    fields.u16()
    channels = fields.u32()
    for _ in ("attachments", "metadata"):
        fields.u32()
    chunks = fields.u32()
    fields.u64()
    fields.u64()
    counts = np.frombuffer(fields.data32(), np.uint8)
    pairs = counts[: len(counts) // 10 * 10].reshape(-1, 10)
    numbers = pairs[:, 2:].copy().view("<u8")[:, 0]
    counted = dict(zip(pairs[:, :2].copy().view("<u2")[:, 0].tolist(), numbers.tolist(), strict=True))
    return channels, chunks, counted


def message_index(content: bytes) -> tuple[int, int]:
    """Return the channel and the number of messages that a MessageIndex record lists."""
    fields = Fields(content)
    return fields.u16(), fields.u32() // 16


@dataclass(frozen=True)
class Scan:
    """The n messages of a chunk, or of a run of records outside chunks.

    Attributes:
        payloads, lengths: (n,) start and length of each payload [bytes].
        channels: (n,) channel of each message.
        times: (n,) log time [ns].
        definitions: (opcode, start, stop) of schemas and channels among them.
        end: where the scan ended.
        records: how many records there are, of any kind.
    """

    payloads: NDArray[np.int64]
    lengths: NDArray[np.int64]
    channels: NDArray[np.uint16] | NDArray[np.int64]
    times: NDArray[np.int64]
    definitions: tuple[tuple[int, int, int], ...]
    end: int
    records: int = 0


def scan(data: bytes, *, complete: bool = True, most: int = 1 << 62, publish_time: bool = False) -> Scan:
    """Return the messages of a `complete` chunk, or the complete messages at the head of a window of the data section.

    With `publish_time` the times of the messages are those, and not the log times.

    In recordings of one topic most records have one size, so a run of equal heads is detected by one comparison.

    Raises:
        BadRecord: a record exceeds the end of the chunk, a message is shorter than its head, or there are more than
            `most` records.
    """
    starts: list[int] = []
    definitions: list[tuple[int, int, int]] = []
    at, end, last, left = 0, len(data), -1, most
    while at < end:
        if left <= 0:
            break
        left -= 1
        if end - at < HEAD:
            if complete:
                raise BadRecord(at, f"{end - at} bytes are left, fewer than the head of a record")
            break
        opcode, length = head_of(data, at)
        stop = at + HEAD + length
        if not complete and (opcode not in (Opcode.MESSAGE, *DEFINITIONS) or stop > end):
            break
        if stop > end:
            raise BadRecord(at, f"a record of {length} bytes where {end - at - HEAD} are left")
        if opcode == Opcode.MESSAGE:
            if length < MESSAGE_HEAD:
                raise BadRecord(at, f"a message record of {length} bytes, expected {MESSAGE_HEAD} or more")
            starts.append(at)
            if length == last:
                run = _run(data, at, HEAD + length)
                starts.extend(range(stop, stop + run * (HEAD + length), HEAD + length))
                stop += run * (HEAD + length)
                left -= run
            last = length
        elif opcode in DEFINITIONS:
            definitions.append((opcode, at + HEAD, stop))
        at = stop
    if left < 0 or (complete and at < end):
        raise BadRecord(at, f"more than {most} records, more than a file of this size can hold")
    return scan_of(data, np.array(starts, np.int64), definitions, at, most - left, publish_time=publish_time)


def head_of(data: bytes, at: int) -> tuple[int, int]:
    """Return opcode and length of the record that starts at `at`."""
    return _HEAD.unpack_from(data, at)


def _run(data: bytes, at: int, step: int) -> int:
    """Return how many records with the same opcode and length follow the one at `at`."""
    head = np.frombuffer(data, np.uint8, HEAD, at)
    possible = (len(data) - at) // step - 1
    for count in dict.fromkeys((min(_PROBE, possible), possible)):
        if count <= 0:
            return 0
        heads = np.ndarray((count, HEAD), np.uint8, data, at + step, (step, 1))
        equal = (heads == head).all(axis=1)
        if not equal.all():
            return int(np.argmin(equal))
    return possible


def scan_of(
    data: bytes,
    starts: NDArray[np.int64],
    definitions: list[tuple[int, int, int]],
    end: int,
    count: int,
    *,
    publish_time: bool,
    heads: NDArray[np.uint8] | None = None,
) -> Scan:
    """Return the messages that start at `starts`, of `count` records up to `end`; arguments as of `Scan` and `scan`."""
    if not len(starts):
        none = np.zeros(0, np.int64)
        return Scan(none, none, np.zeros(0, np.uint16), none, tuple(definitions), end, count)
    time_at = HEAD + (14 if publish_time else 6)
    if heads is None:
        heads = gather(np.frombuffer(data, np.uint8), starts, HEAD + MESSAGE_HEAD)
    lengths = heads[:, 1:HEAD].copy().view("<u8")[:, 0].astype(np.int64) - MESSAGE_HEAD
    channels = heads[:, HEAD : HEAD + 2].copy().view("<u2")[:, 0].astype(np.uint16)
    times = np.minimum(heads[:, time_at : time_at + 8].copy().view("<u8")[:, 0], np.uint64(LATEST))
    return Scan(starts + HEAD + MESSAGE_HEAD, lengths, channels, times.astype(np.int64), tuple(definitions), end, count)


def gather(data: NDArray[np.uint8], starts: NDArray[np.int64], width: int) -> NDArray[np.uint8]:
    """Return the (n, width) bytes that begin at each of the n `starts`."""
    windows = np.ndarray((len(data) - width + 1, width), np.uint8, data, 0, (1, 1))
    return windows[starts]


def metadata(content: bytes) -> tuple[str, dict[str, str]]:
    """Return name and texts by key of a metadata record; empty where it is damaged, which spoils no messages."""
    fields = Fields(content)
    try:
        name = fields.text()
    except BadRecord:
        return "", {}
    return name, _pairs(fields)


def _pairs(fields: Fields) -> dict[str, str]:
    """Return the map of texts that follows; empty where it is damaged."""
    result: dict[str, str] = {}
    try:
        pairs = Fields(fields.data32())
        while pairs.at < len(pairs.data):
            name = pairs.text()
            result[name] = pairs.text()
    except BadRecord:
        return {}
    return result
