"""MCAP recordings made byte by byte, so that every field of them can be wrong.

A sound one holds 2000 joint states of six joints (100 Hz) in seven chunks.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
import zstandard
from rosbags.typesys import Stores, get_typestore

MAGIC = b"\x89MCAP0\r\n"
COUNT, PER_CHUNK = 2000, 323
EPOCH_NS = 1_700_000_000 * 10**9
STEP_NS = 10_000_000
NAMES = ("trunk", "neck", "left_elbow", "right_elbow", "left_knee", "right_knee")
JOINT_STATE = "sensor_msgs/msg/JointState"
SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX, CHUNK_INDEX = 3, 4, 5, 6, 7, 8
TYPES = get_typestore(Stores.ROS2_JAZZY)


def positions() -> np.ndarray:
    """Return the (2000, 6) positions [rad] that the recordings hold."""
    return np.random.default_rng(7).normal(size=(COUNT, len(NAMES)))


def definition(name: str) -> bytes:
    """Return the ros2msg text of a type."""
    return TYPES.generate_msgdef(name, ros_version=2)[0].encode()


def header(stamp: int, frame: str = "") -> Any:
    """Return a std_msgs/Header."""
    moment = TYPES.types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9))
    return TYPES.types["std_msgs/msg/Header"](moment, frame)


def joint_state(stamp: int, names: Sequence[str], values: np.ndarray, *, little: bool = True) -> bytes:
    """Return a sensor_msgs/JointState in CDR, without velocities and efforts."""
    none = np.zeros(0)
    message = TYPES.types[JOINT_STATE](header(stamp), list(names), np.asarray(values, float), none, none)
    return bytes(TYPES.serialize_cdr(message, JOINT_STATE, little_endian=little))


@cache
def payloads(little: bool = True) -> tuple[bytes, ...]:
    """Return the 2000 messages."""
    return tuple(
        joint_state(EPOCH_NS + index * STEP_NS, NAMES, row, little=little) for index, row in enumerate(positions())
    )


def text(value: str | bytes) -> bytes:
    """Return a string or bytes behind a four-byte length."""
    data = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(data)) + data


def record(opcode: int, content: bytes, length: int | None = None) -> bytes:
    """Return a record, with a false length if given."""
    return struct.pack("<BQ", opcode, len(content) if length is None else length) + content


def schema(number: int, name: str, encoding: str, data: bytes) -> bytes:
    """Return a Schema record."""
    return record(SCHEMA, struct.pack("<H", number) + text(name) + text(encoding) + text(data))


def channel(number: int, schema_id: int, topic: str, encoding: str) -> bytes:
    """Return a Channel record without metadata."""
    return record(CHANNEL, struct.pack("<HH", number, schema_id) + text(topic) + text(encoding) + text(b""))


def message(number: int, time: int, payload: bytes, length: int | None = None) -> bytes:
    """Return a Message record, with a false length if given."""
    return record(MESSAGE, struct.pack("<HIQQ", number, 0, time, time) + payload, length)


@dataclass(frozen=True)
class Plan:
    """How a recording is written; the defaults give a sound one.

    Attributes:
        chunks: messages of each chunk as (channel, log time, payload).
        definitions: Schema and Channel records.
        compression: what chunks say, `pack` what is done.
        records: alters the records of the chunk with this index before they are packed.
        crc: XOR on the CRC of the second chunk; `crc_of_records`: whether CRCs are those of the altered records.
        change: alters the record of the chunk with this index (index, record, content) -> record.
        between: bytes behind each chunk.
        index, summary, closed: whether message indexes, a summary, an end are written.
        chunked: whether messages stand in chunks.
        summary_shift: added to the offset of the summary; `index_shift` to the offsets in chunk indexes.
    """

    chunks: tuple[tuple[tuple[int, int, bytes], ...], ...]
    definitions: tuple[bytes, ...] = (
        schema(1, JOINT_STATE, "ros2msg", definition(JOINT_STATE)),
        channel(1, 1, "/joint_states", "cdr"),
    )
    compression: str = "zstd"
    pack: Callable[[bytes], bytes] = field(default=lambda data: zstandard.ZstdCompressor().compress(data))
    records: Callable[[int, bytes], bytes] = field(default=lambda index, data: data)
    change: Callable[[int, bytes], bytes] = field(default=lambda index, data: data)
    crc: int = 0
    crc_of_records: bool = False
    between: bytes = b""
    index: bool = True
    summary: bool = True
    closed: bool = True
    chunked: bool = True
    summary_shift: int = 0
    index_shift: int = 0


def whole(messages: Iterable[bytes] | None = None, **changes: Any) -> Plan:
    """Return the plan of 2000 messages on channel 1."""
    given = payloads() if messages is None else tuple(messages)
    rows = [(1, EPOCH_NS + index * STEP_NS, payload) for index, payload in enumerate(given)]
    return replace(Plan(split(rows)), **changes)


def split(rows: Sequence[tuple[int, int, bytes]]) -> tuple[tuple[tuple[int, int, bytes], ...], ...]:
    """Return rows in chunks of 323."""
    return tuple(tuple(rows[at : at + PER_CHUNK]) for at in range(0, len(rows), PER_CHUNK))


def build(plan: Plan) -> bytes:
    """Return the bytes of a recording."""
    data = bytearray(MAGIC + record(1, text("ros2") + text("hostile")))
    indexes, counts = [], {}
    for number, rows in enumerate(plan.chunks):
        for row in rows:
            counts[row[0]] = counts.get(row[0], 0) + 1
        head = b"".join(plan.definitions) if number == 0 else b""
        inside = head + b"".join(message(*row) for row in rows)
        if not plan.chunked:
            data += inside
            continue
        start = len(data)
        data += plan.change(number, chunk(plan, number, rows, inside))
        length = len(data) - start
        if plan.index:
            data += b"".join(message_index(known, rows, len(head)) for known in sorted({row[0] for row in rows}))
        times = [row[1] for row in rows]
        places = struct.pack("<QQQQ", min(times), max(times), start + plan.index_shift, length)
        indexes.append(
            record(CHUNK_INDEX, places + text(b"") + struct.pack("<Q", 0) + text(plan.compression) + bytes(16))
        )
        data += plan.between
    if plan.closed:
        data += record(15, struct.pack("<I", 0))
        data += ending(plan, len(data), indexes, counts)
    return bytes(data)


def chunk(plan: Plan, number: int, rows: Sequence[tuple[int, int, bytes]], inside: bytes) -> bytes:
    """Return a Chunk record."""
    times = [row[1] for row in rows]
    changed = plan.records(number, inside)
    crc = zlib.crc32(changed if plan.crc_of_records else inside) ^ (plan.crc if number == 1 else 0)
    inside = changed
    packed = plan.pack(inside)
    head = struct.pack("<QQQI", min(times), max(times), len(inside), crc) + text(plan.compression)
    return record(CHUNK, head + struct.pack("<Q", len(packed)) + packed)


def message_index(number: int, rows: Sequence[tuple[int, int, bytes]], at: int) -> bytes:
    """Return the MessageIndex record of a channel in a chunk whose messages start at `at`."""
    entries = b""
    for row in rows:
        if row[0] == number:
            entries += struct.pack("<QQ", row[1], at)
        at += 31 + len(row[2])
    return record(INDEX, struct.pack("<H", number) + text(entries))


def ending(plan: Plan, start: int, indexes: Sequence[bytes], counts: dict[int, int]) -> bytes:
    """Return summary, footer and magic."""
    summary = b""
    if plan.summary:
        pairs = b"".join(struct.pack("<HQ", *pair) for pair in counts.items())
        channels = sum(1 for known in plan.definitions if known[0] == CHANNEL)
        numbers = struct.pack("<QHIIIIQQ", sum(counts.values()), 1, channels, 0, 0, len(indexes), 0, 0)
        summary = b"".join(plan.definitions) + record(11, numbers + text(pairs)) + b"".join(indexes)
    places = struct.pack("<QQ", start + plan.summary_shift if plan.summary else 0, 0)
    footer = struct.pack("<BQ", 2, 20) + places
    return summary + footer + struct.pack("<I", zlib.crc32(summary + footer)) + MAGIC
