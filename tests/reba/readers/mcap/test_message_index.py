"""Messages by the indexes of chunks: found as without them, also by indexes that are wrong."""

from __future__ import annotations

import struct
from collections.abc import Callable

import numpy as np
import pytest

from reba.readers.mcap.message_index import indexed_scan, listed
from reba.readers.mcap.records import scan
from tests.support import mcap_builder as make

ROWS = [(1 + at % 3, make.EPOCH_NS + at, bytes(40 + at % 5)) for at in range(60)]
HEAD = make.schema(1, "a/msg/A", "ros2msg", b"float64 a") + make.channel(1, 1, "/a", "cdr")
LATE = make.channel(2, 1, "/b", "cdr")
"""Stands behind 20 messages."""
MOST = 1000


def _chunk() -> tuple[bytes, list[bytes]]:
    """Return the records of a chunk of three channels, and its three message indexes."""
    data, places = HEAD, {1: b"", 2: b"", 3: b""}
    for at, (number, time, payload) in enumerate(ROWS):
        data += LATE if at == 20 else b""
        places[number] += struct.pack("<QQ", time, len(data))
        data += make.message(number, time, payload)
    return data, [make.record(make.INDEX, struct.pack("<H", key) + make.text(text)) for key, text in places.items()]


@pytest.mark.parametrize("publish_time", [False, True])
def test_a_true_index_gives_what_a_scan_finds(publish_time: bool) -> None:
    data, indexes = _chunk()
    found = indexed_scan(data, b"".join(indexes), MOST, publish_time=publish_time)
    want = scan(data, publish_time=publish_time)
    assert found is not None
    for name in ("payloads", "lengths", "channels", "times"):
        assert np.array_equal(getattr(found, name), getattr(want, name))
    assert (found.definitions, found.end, found.records) == (want.definitions, len(data), 63)
    assert len(found.definitions) == 3


def _shifted(data: bytes, indexes: list[bytes], shift: int) -> tuple[bytes, bytes]:
    """Return chunk and indexes with another offset of the message that is listed last."""
    index = b"".join(indexes)
    return data, index[:-8] + struct.pack("<Q", struct.unpack("<Q", index[-8:])[0] + shift & (1 << 64) - 1)


WRONG: dict[str, Callable[[bytes, list[bytes]], tuple[bytes, bytes]]] = {
    "none": lambda data, indexes: (data, b""),
    "a channel is missing": lambda data, indexes: (data, b"".join(indexes[1:])),
    "a channel is listed twice": lambda data, indexes: (data, b"".join([*indexes, indexes[0]])),
    "of another chunk": lambda data, indexes: (data + make.message(1, 0, b"more"), b"".join(indexes)),
    "inside a message": lambda data, indexes: _shifted(data, indexes, 1),
    "behind the chunk": lambda data, indexes: _shifted(data, indexes, 1 << 20),
    "far before the chunk": lambda data, indexes: _shifted(data, indexes, 1 << 63),
    "truncated": lambda data, indexes: (data, b"".join(indexes)[:-4]),
    "head truncated": lambda data, indexes: (data, b"".join(indexes) + indexes[0][:10]),
    "another record": lambda data, indexes: (data, b"".join(indexes) + LATE),
    "of half an entry": lambda data, indexes: (
        data,
        b"".join(indexes) + make.record(make.INDEX, struct.pack("<H", 1) + make.text(bytes(8))),
    ),
    "the chunk ends inside a record": lambda data, indexes: (data + b"\5", b"".join(indexes)),
    "a record exceeds the chunk": lambda data, indexes: (data + make.record(3, b"", length=99), b"".join(indexes)),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_index_gives_nothing(name: str) -> None:
    assert indexed_scan(*WRONG[name](*_chunk()), MOST, publish_time=False) is None


def test_damaged_messages_and_too_many_records_are_left_to_the_scan_which_says_so() -> None:
    data, indexes = _chunk()
    index = b"".join(indexes)
    first = int(listed(index)[0])
    short = data[:first] + make.message(1, 0, b"", length=10) + data[first + 31 :]
    assert indexed_scan(short, index, MOST, publish_time=False) is None
    other = data[:first] + b"\6" + data[first + 1 :]
    assert indexed_scan(other, index, MOST, publish_time=False) is None
    assert indexed_scan(data, index, 62, publish_time=False) is None
    assert indexed_scan(data, index, 63, publish_time=False) is not None
