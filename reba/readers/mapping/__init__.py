"""Blocks of a stream -> one growing table of time and angles; raw signals are never kept."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reba.posture import COLUMNS
from reba.readers.mapping import Mapper, block_angles
from reba.readers.stream import ReadLog, Stream

Array = NDArray[np.float64]

PASSES = 3
"""A recording is read again when its unit, vertical or sides turn out otherwise than its first frames suggest."""


@dataclass
class Samples:
    """Time and angles of a recording.

    Attributes:
        table: (n, 23): time [s], then the 22 angles [deg].
        log: what the reader noticed.
    """

    table: Array
    log: ReadLog

    @property
    def time(self) -> Array:
        """(n,) [s], a view."""
        return self.table[:, 0]

    @property
    def angles(self) -> Array:
        """(n, 22) [deg], a view."""
        return self.table[:, 1:]

    @property
    def seconds(self) -> float:
        """Length of the recording."""
        return float(self.table[-1, 0] - self.table[0, 0]) if len(self.table) else 0.0


def collect(stream: Stream, mapper: Mapper) -> Samples:
    """Read a stream to its end and return its angles, in time order and each time once.

    The table grows in place by halves and is cut to size at the end, so at most half of it is spare.
    """
    table, log = _pass(stream, mapper)
    for _ in range(PASSES - 1):
        if mapper.settled():
            break
        del table
        table, log = _pass(stream, mapper)
    return Samples(in_order(table, log), log)


def _pass(stream: Stream, mapper: Mapper) -> tuple[Array, ReadLog]:
    """Return the (n, 23) rows of one reading."""
    log = ReadLog()
    mapper.begin()
    table = np.empty((max(stream.count or 0, 1024), 1 + len(COLUMNS)))
    n = 0
    for block in stream.blocks(log, mapper.wanted):
        size = len(block.time)
        if n + size > len(table):
            table.resize((max(n + size, len(table) * 3 // 2), table.shape[1]), refcheck=False)
        table[n : n + size, 0] = block.time
        table[n : n + size, 1:] = block_angles(mapper, block)
        n += size
    table.resize((n, table.shape[1]), refcheck=False)
    return table, log


def in_order(table: Array, log: ReadLog) -> Array:
    """Return rows sorted by their first column, times not finite or repeated left out and noted."""
    time = table[:, 0]
    if not np.isfinite(time).all():
        bad = int(np.sum(~np.isfinite(time)))
        log.warn(f"{bad} samples without a time were left out")
        table = table[np.isfinite(time)]
    if len(table) and np.any(np.diff(table[:, 0]) < 0):
        log.warn("samples were not in the order of their times; they were sorted")
        table = table[np.argsort(table[:, 0], kind="stable")]
    repeated = np.flatnonzero(np.diff(table[:, 0]) == 0) + 1
    if len(repeated):
        log.warn(f"{len(repeated)} samples repeat the time of the one before and were left out")
        table = np.delete(table, repeated, axis=0)
    return table
