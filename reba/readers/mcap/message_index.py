"""Messages of a chunk by its MessageIndex records, https://mcap.dev/spec#message-index-op0x07.

An index may be wrong, so nothing is taken from it unchecked: the records that it lists, and those between them, have to
follow each other from the first byte of the chunk to its last, which only the true ones do.
"""

from __future__ import annotations

import struct
from typing import Final

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from reba.readers.mcap.records import DEFINITIONS, HEAD, INDEX_HEAD, MESSAGE_HEAD, Scan, gather, head_of, scan_of

_INDEX: Final = struct.Struct("<BQHI")
"""Head of a MessageIndex record: opcode, length, channel, bytes of the entries."""
ENTRY: Final = 16
"""[bytes] Log time and offset of a message."""


def listed(index: bytes) -> NDArray[np.int64]:
    """Return the offsets of messages that MessageIndex records list, in their order in the chunk; none if damaged."""
    parts: list[NDArray[np.uint64]] = []
    at = 0
    while at < len(index):
        opcode, length, _, size = _INDEX.unpack_from(index, at) if at + _INDEX.size <= len(index) else (0, 0, 0, 1)
        start, at = at + _INDEX.size, at + HEAD + length
        if opcode != Opcode.MESSAGE_INDEX or size != length - INDEX_HEAD or size % ENTRY or at > len(index):
            return np.zeros(0, np.int64)
        parts.append(np.frombuffer(index, "<u8", size // 8, start)[1::2])
    return np.sort(np.concatenate(parts).astype(np.int64)) if parts else np.zeros(0, np.int64)


def indexed_scan(data: bytes, index: bytes, most: int, *, publish_time: bool) -> Scan | None:
    """Return the messages of a chunk, as `records.scan` does, None where the index is not that of the chunk."""
    starts, end = listed(index), len(data)
    if not len(starts) or starts[0] < 0 or starts[-1] > end - HEAD - MESSAGE_HEAD:
        return None
    heads = gather(np.frombuffer(data, np.uint8), starts, HEAD + MESSAGE_HEAD)
    lengths = heads[:, 1:HEAD].copy().view("<u8")[:, 0]
    if (heads[:, 0] != Opcode.MESSAGE).any() or (lengths < MESSAGE_HEAD).any() or (lengths > end).any():
        return None
    stops = starts + HEAD + lengths.astype(np.int64)
    before, after = np.append(0, stops), np.append(starts, end)
    definitions: list[tuple[int, int, int]] = []
    count = len(starts)
    for gap in np.flatnonzero(before != after).tolist():
        at, stop = int(before[gap]), int(after[gap])
        while at < stop:
            opcode, length = head_of(data, at) if stop - at >= HEAD else (Opcode.MESSAGE, 0)
            if opcode == Opcode.MESSAGE:
                return None
            start, at = at + HEAD, at + HEAD + length
            count += 1
            if opcode in DEFINITIONS:
                definitions.append((opcode, start, at))
        if at != stop:
            return None
    return (
        scan_of(data, starts, definitions, end, count, publish_time=publish_time, heads=heads)
        if count <= most
        else None
    )
