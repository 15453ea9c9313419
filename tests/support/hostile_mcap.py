"""Broken, odd and hostile MCAP recordings, and what a reader must do with each: right data, or one clear error.

    python -m tests.support.hostile_mcap OUTDIR

The cases are those of a survey of nine reader set-ups, each of which failed on several, and some more.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import lz4.frame
import numpy as np
import zstandard

from tests.support import mcap_builder as make
from tests.support.mcap_builder import COUNT, EPOCH_NS, MAGIC, NAMES, PER_CHUNK, STEP_NS

BOMB = 6 << 30
_LENGTH_AT = 1


@dataclass(frozen=True)
class Case:
    """One recording and what reading it must give.

    Attributes:
        build: makes the bytes.
        error: words of the error, "" if it is read.
        rows: the first so many of the 2000 rows come with the right values.
        without: of these, rows that do not come.
        values: changes the positions that must come.
        ended: words on the abnormal end, "" if it ends well.
        skipped: messages that must be counted as of no use.
        reason: words on the first of them.
        warning: words of a warning.
        suffix: of the file name.
        limit: the limit that the reader is given [bytes].
    """

    build: Callable[[], bytes]
    error: str = ""
    rows: int = COUNT
    without: tuple[int, ...] = ()
    values: Callable[[], np.ndarray] = make.positions
    ended: str = ""
    skipped: int = 0
    reason: str = ""
    warning: str = ""
    suffix: str = ".mcap"
    limit: int = 1 << 30


def _sound(**changes: object) -> bytes:
    return make.build(make.whole(**changes))


def _cut_in_chunk() -> bytes:
    third = _chunk_starts(_sound())[2]
    return _sound()[: third + 2000]


def _chunk_starts(data: bytes) -> list[int]:
    at, starts = len(MAGIC), []
    while at < len(data) - len(MAGIC):
        opcode, length = struct.unpack_from("<BQ", data, at)
        if opcode == make.CHUNK:
            starts.append(at)
        at += 9 + length
    return starts


def _in_third(number: int, data: bytes, alter: Callable[[bytearray], None]) -> bytes:
    changed = bytearray(data)
    if number == 2:
        alter(changed)
    return bytes(changed)


def _chunk_length(length: int) -> bytes:
    def alter(data: bytearray) -> None:
        struct.pack_into("<Q", data, _LENGTH_AT, length)

    return _sound(change=lambda number, data: _in_third(number, data, alter))


def _unpacked_size(size: int) -> bytes:
    def alter(data: bytearray) -> None:
        struct.pack_into("<Q", data, 9 + 16, size)

    return _sound(change=lambda number, data: _in_third(number, data, alter))


def _flipped() -> bytes:
    def alter(data: bytearray) -> None:
        data[len(data) // 2] ^= 1

    return _sound(change=lambda number, data: _in_third(number, data, alter))


def _flipped_stored() -> bytes:
    def alter(data: bytearray) -> None:
        data[-10] ^= 1

    plain = {"compression": "", "pack": bytes}
    return _sound(change=lambda number, data: _in_third(number, data, alter), **plain)


def _message_length(crc_of_result: bool) -> bytes:
    def alter(data: bytearray) -> None:
        length = 31 + len(make.payloads()[0])
        struct.pack_into("<Q", data, 5 * length + 1, 1 << 40)

    plan = make.whole(records=lambda number, data: _in_third(number, data, alter))
    return make.build(make.replace(plan, crc_of_records=crc_of_result))


def _bomb() -> bytes:
    """Return 200 kB of zstd that unpack to 6 GiB of zeros: one frame of run-length blocks (RFC 8878, section 3.1.1)."""
    block = 1 << 17
    count = BOMB // block
    runs = [(block << 3 | 1 << 1 | (index == count - 1)).to_bytes(3, "little") + b"\0" for index in range(count)]
    return b"\x28\xb5\x2f\xfd\x00\x38" + b"".join(runs)


def _with_bomb(declared: int) -> bytes:
    packed = _bomb()

    def change(number: int, data: bytes) -> bytes:
        if number != 2:
            return data
        head = data[9 : 9 + 16] + struct.pack("<QI", declared, 0) + make.text("zstd")
        return make.record(make.CHUNK, head + struct.pack("<Q", len(packed)) + packed)

    return _sound(change=change)


def _payload(index: int, changed: Callable[[bytes], bytes]) -> bytes:
    messages = list(make.payloads())
    messages[index] = changed(messages[index])
    return make.build(make.whole(messages))


def _set_u32(at: int, value: int) -> Callable[[bytes], bytes]:
    def changed(data: bytes) -> bytes:
        return data[:at] + struct.pack("<I", value) + data[at + 4 :]

    return changed


def _with_nan() -> np.ndarray:
    values = make.positions()
    values[100:200, 2] = np.nan
    return values


def _nan_positions() -> bytes:
    return make.build(make.whole(_messages(_with_nan())))


def _messages(values: np.ndarray) -> list[bytes]:
    return [make.joint_state(EPOCH_NS + at * STEP_NS, NAMES, row) for at, row in enumerate(values)]


def _last_without_positions() -> bytes:
    empty = [make.joint_state(EPOCH_NS + at * STEP_NS, NAMES, np.zeros(0)) for at in range(COUNT - 100, COUNT)]
    return make.build(make.whole([*make.payloads()[:-100], *empty]))


def _two_publishers() -> bytes:
    rows = []
    for at, row in enumerate(make.positions()):
        time = EPOCH_NS + at * STEP_NS
        rows += [(1, time, make.joint_state(time, NAMES[:3], row[:3]))]
        rows += [(2, time, make.joint_state(time, NAMES[3:], row[3:]))]
    plan = make.whole()
    second = make.channel(2, 1, "/joint_states", "cdr")
    return make.build(make.replace(plan, chunks=make.split(rows), definitions=(*plan.definitions, second)))


def _shuffled() -> bytes:
    order = np.random.default_rng(3).permutation(COUNT).tolist()
    rows = [(1, EPOCH_NS + at * STEP_NS, make.payloads()[at]) for at in order]
    return make.build(make.Plan(make.split(rows)))


def _without_schema(schema_id: int) -> bytes:
    return _sound(definitions=(make.channel(1, schema_id, "/joint_states", "cdr"),))


def _message_packed(damaged: int | None = None) -> bytes:
    packer = zstandard.ZstdCompressor(write_checksum=True)
    packed = [packer.compress(payload) for payload in make.payloads()]
    if damaged is not None:
        packed[damaged] = packed[damaged][:-1] + bytes([packed[damaged][-1] ^ 1])
    return make.build(make.whole(packed))


def _conflicting() -> bytes:
    again = make.channel(1, 1, "/other", "cdr")
    return _sound(records=lambda number, data: data + again if number == 3 else data, crc_of_records=True)


_LZ4 = {"compression": "lz4", "pack": lz4.frame.compress}
_PLAIN = {"compression": "", "pack": bytes}
_COUNT_AT = 4 + 8 + 4 + 4
"""Byte of the number of names in a message: behind header, stamp and the empty frame."""

CASES: dict[str, Case] = {
    "sound": Case(_sound),
    "cut_inside_a_chunk": Case(_cut_in_chunk, rows=2 * PER_CHUNK, ended="truncated inside a chunk"),
    "cut_inside_a_record_head": Case(
        lambda: _sound()[: _chunk_starts(_sound())[2] + 5], rows=2 * PER_CHUNK, ended="truncated inside the head"
    ),
    "killed_before_the_end": Case(lambda: _sound(closed=False), ended="did not close"),
    "zeros_at_the_end": Case(lambda: _sound(closed=False) + bytes(5000), ended="zeros"),
    "no_summary": Case(lambda: _sound(summary=False)),
    "wrong_crc": Case(lambda: _sound(crc=1), error="CRC"),
    "flipped_byte": Case(_flipped, error="chunk"),
    "flipped_byte_stored": Case(_flipped_stored, error="CRC"),
    "unknown_compression": Case(lambda: _sound(compression="brot"), error="'brot'"),
    "chunk_length_2_62": Case(lambda: _chunk_length(1 << 62), error="closed properly"),
    "chunk_length_3_gib": Case(lambda: _chunk_length(3 << 30), error="closed properly"),
    "unpacked_size_2_45": Case(lambda: _unpacked_size(1 << 45), error="limit_bytes"),
    "unpacked_size_wrong": Case(lambda: _unpacked_size(1000), error="declares 1000"),
    "message_length_2_40": Case(lambda: _message_length(True), error="1099511627776"),
    "message_length_2_40_wrong_crc": Case(lambda: _message_length(False), error="CRC"),
    "bomb": Case(lambda: _with_bomb(BOMB), error="limit_bytes"),
    "bomb_that_declares_little": Case(lambda: _with_bomb(1 << 16), error="damaged"),
    "bomb_that_declares_half": Case(lambda: _with_bomb(1 << 29), error="chunk"),
    "no_schema": Case(lambda: _without_schema(0), rows=0),
    "missing_schema": Case(lambda: _without_schema(99), rows=0),
    "empty": Case(bytes, error="empty"),
    "only_magic": Case(lambda: MAGIC, error="no records"),
    "not_mcap": Case(lambda: b"PK\x03\x04" + bytes(100), error="magic"),
    "wrong_last_magic": Case(lambda: _sound()[:-4] + b"xxxx", warning="magic"),
    "no_message_index": Case(lambda: _sound(index=False)),
    "half_a_message": Case(
        lambda: _payload(1000, lambda data: data[: len(data) // 2]), without=(1000,), skipped=1, reason="exceed"
    ),
    "string_count_2_31": Case(
        lambda: _payload(1000, _set_u32(_COUNT_AT + 4, 1 << 31)), without=(1000,), skipped=1, reason="string length"
    ),
    "array_count_2_31": Case(
        lambda: _payload(1000, _set_u32(_COUNT_AT, 1 << 31)), without=(1000,), skipped=1, reason="array of 2147483648"
    ),
    "big_endian": Case(lambda: make.build(make.whole(make.payloads(False)))),
    "nan_positions": Case(_nan_positions, values=_with_nan),
    "last_without_positions": Case(
        _last_without_positions, rows=COUNT - 100, skipped=100, reason="0 positions for 6 names"
    ),
    "two_publishers": Case(_two_publishers),
    "shuffled_times": Case(_shuffled, warning="order of time"),
    "summary_offset_outside": Case(lambda: _sound(summary_shift=1 << 40)),
    "chunk_index_wrong": Case(lambda: _sound(index_shift=777)),
    "private_records": Case(lambda: _sound(between=make.record(0x90, b"private"))),
    "no_chunks": Case(lambda: _sound(chunked=False)),
    "no_chunks_cut": Case(
        lambda: _sound(chunked=False, closed=False)[:-10], rows=COUNT - 1, ended="truncated inside a record"
    ),
    "lz4": Case(lambda: _sound(**_LZ4)),
    "stored": Case(lambda: _sound(**_PLAIN)),
    "packed_messages": Case(_message_packed),
    "packed_message_damaged": Case(
        lambda: _message_packed(damaged=3), without=(3,), skipped=1, reason="zstd data are damaged"
    ),
    "packed_messages_bomb": Case(
        lambda: make.build(make.whole([zstandard.ZstdCompressor().compress(bytes(1 << 22))] * 10)),
        error="messages declare more than",
        limit=1 << 24,
    ),
    "packed_file": Case(lambda: zstandard.ZstdCompressor().compress(_sound()), suffix=".mcap.zstd"),
    "packed_file_cut": Case(
        lambda: zstandard.ZstdCompressor().compress(_sound())[:-3000],
        rows=5 * PER_CHUNK,
        ended="truncated inside a chunk",
        suffix=".mcap.zstd",
    ),
    "packed_file_bomb": Case(_bomb, error="unpacks to more", limit=1 << 24, suffix=".mcap.zstd"),
    "definitions_contradict": Case(_conflicting, error="defined twice"),
}
"""All cases by name."""


def write(name: str, folder: Path) -> Path:
    """Write the recording of a case into a folder and return its path."""
    path = folder / f"{name}{CASES[name].suffix}"
    path.write_bytes(CASES[name].build())
    return path


if __name__ == "__main__":
    target = Path(sys.argv[1])
    target.mkdir(parents=True, exist_ok=True)
    for case in CASES:
        print(write(case, target))
