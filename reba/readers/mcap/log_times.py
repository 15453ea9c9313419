"""Log times of the messages that the rows of a stream come from, found by the times of the rows.

The messages are decoded once more, so that reading does not carry a log time through everything that joins and sorts
rows; memory grows with the rows only.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.readers.mcap.channels import DecodableChannel, batch_of
from reba.readers.mcap.contents import Contents
from reba.readers.mcap.decode import Batch, Piece
from reba.readers.mcap.records import LATEST, gather
from reba.readers.recording.stream import ReadLog

Nanoseconds = NDArray[np.int64]
ROUNDING: Final = 2000
"""[ns] Difference between the times of a row and of its message: floating-point errors of seconds since 1970."""
OTHER: Final = 0.5
"""[ns] By which a message of other signals, as of another person, counts as farther away."""
_TIMES: Final = 16
"""[bytes] Log time and publish time, directly before the payload of a message."""


def log_times(
    parts: Sequence[DecodableChannel], contents: Contents, zero: int, rows: Array, signals: frozenset[str]
) -> tuple[Nanoseconds, Nanoseconds]:
    """Return (n,) log and publish times [ns] of the messages that rows come from: of several at one time, of the last.

    An absent publish time (0) is the log time. Rows without a message, as of a table that was resampled, stand
    as far from the nearest message as their time does.

    Args:
        parts: channels of the stream.
        contents: of the recording.
        zero: time of the recording [ns] at time 0 of the rows.
        rows: (n,) times [s], increasing.
        signals: names of those that the rows were made of; of messages at one time those with one of them are chosen.
    """
    log, publish, away = (np.zeros(len(rows), np.int64) for _ in range(3))
    distance = np.full(len(rows), np.inf)
    decoders = {id(part): part.make(None) for part in parts}
    for container in contents.containers:
        moving = [part for part in parts if part.container is container and not part.static]
        for segment in contents.segments(container, moving):
            for part in moving:
                place, clock = contents.place(part, segment), contents.tracks[id(part)].clock
                if place is None or not place.count or clock is None or not len(rows):
                    continue
                batch = batch_of(container, segment, part.channel, place.first)
                pieces = place.pieces
                if pieces is None:
                    pieces = decoders[id(part)].decode(batch, ReadLog())
                for piece in pieces:
                    time, _ = clock.times(piece.number, piece.log, piece.stamp)
                    seconds = (time - zero) / 1e9
                    at = _nearest(rows, seconds)
                    offset = np.rint((rows[at] - seconds) * 1e9)
                    cost = np.abs(offset) + (0.0 if signals.intersection(piece.names) else OTHER)
                    # The best of each row comes last, of equal ones the last that was recorded.
                    order = np.argsort(-cost, kind="stable")
                    order = order[cost[order] <= distance[at[order]]]
                    raw = _raw_times(batch, piece, place.first)
                    log[at[order]], publish[at[order]] = raw[order, 0], raw[order, 1]
                    distance[at[order]], away[at[order]] = cost[order], offset[order]
        container.release()
    away[distance <= ROUNDING] = 0
    publish[publish == 0] = log[publish == 0]
    known = np.flatnonzero(np.isfinite(distance))
    if len(known):
        nearest = known[_nearest(rows[known], rows)]
        away = away[nearest] + np.rint((rows - rows[nearest]) * 1e9).astype(np.int64)
        log, publish = log[nearest], publish[nearest]
    return log + away, publish + away


def _nearest(rows: Array, seconds: Array) -> NDArray[np.intp]:
    """Return for each time the index of the nearest row."""
    after = np.minimum(np.searchsorted(rows, seconds), len(rows) - 1)
    before = np.maximum(after - 1, 0)
    return np.where(np.abs(rows[before] - seconds) <= np.abs(rows[after] - seconds), before, after)


def _raw_times(batch: Batch, piece: Piece, first: int) -> Nanoseconds:
    """Return (n, 2) log and publish times [ns] as they stand in the file; bags and databases have log times only."""
    if not batch.loaded.head:
        return np.repeat(batch.times[piece.number - first, None], 2, axis=1)
    starts = batch.starts[piece.number - first]
    raw = gather(np.frombuffer(batch.loaded.data, np.uint8), starts - _TIMES, _TIMES).view("<u8")
    return np.minimum(raw, np.uint64(LATEST)).astype(np.int64)
