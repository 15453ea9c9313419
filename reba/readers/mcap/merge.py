"""Pieces of many messages -> blocks: one row for each time, one column for each name.

A message may have a part of the signals (two publishers, one transform per message). A row joins the values of one
time; an absent signal has its last value if that is not older than `HOLD`, else NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from reba.arrays import Array, Flags, Indices
from reba.readers.mcap.decode import NO_STAMP, Piece
from reba.readers.mcap.extract import POSE
from reba.readers.recording.stream import Block, ReadLog

HOLD: Final = 0.5
"""[s] How long the last value of a signal is used for rows without it."""
TOGETHER: Final = 0.0004
"""[s] Transforms sent one by one with closer stamps belong to one frame (drivers that stamp each one)."""
MOST_SIGNALS: Final = 2000
"""Largest number of names of a stream: protects memory from names that change with every message."""
BLOCK_ROWS: Final = 4096
"""Messages in a block."""


class Clock:
    """Converts the times of pieces to seconds since the epoch of the stream.

    Attributes:
        source: "header.stamp" or "log_time" (or "time" for rows of a posture table).
        zero: time of the source clock at time 0 [ns].
        epoch: Unix time of time 0 [ns].
    """

    def __init__(self, source: str, zero: int, epoch: int) -> None:
        self.source = source
        self.zero = zero
        self.epoch = epoch
        self._lag = 0

    def seconds(self, piece: Piece, log: ReadLog) -> Array:
        """Return (n,) times [s]; messages without a stamp have their log time, shifted by the last known lag."""
        if self.source == "log_time":
            return np.asarray((piece.log - self.zero) / 1e9)
        stamped = piece.stamp != NO_STAMP
        if stamped.all():
            if len(stamped):
                self._lag = int(piece.stamp[-1]) - int(piece.log[-1])
            return np.asarray((piece.stamp - self.zero) / 1e9)
        log.warn("some messages have no time stamp; their log time is used, shifted by the lag of the others")
        return np.asarray((np.where(stamped, piece.stamp, piece.log + self._lag) - self.zero) / 1e9)


class Merger:
    """Collects pieces and returns them as blocks.

    Args:
        names: first columns; others are added as they appear.
        parents: frames only: their parents.
        frames: whether a value is a pose of 7 numbers.
    """

    def __init__(
        self, names: Sequence[str], parents: Sequence[str], clock: Clock, log: ReadLog, *, frames: bool
    ) -> None:
        self._columns = {name: index for index, name in enumerate(names)}
        self._parents = list(parents)
        self._clock = clock
        self._log = log
        self._frames = frames
        self._width = POSE if frames else 1
        self._static: dict[str, Array] = {}
        self._pieces: list[tuple[Array, Indices, Array]] = []
        self._rows = 0
        self._held: tuple[Array, Array] = (np.zeros(0), np.zeros((0, self._width)))
        self._end = -np.inf

    @property
    def full(self) -> bool:
        """Whether enough rows are collected for a block."""
        return self._rows >= BLOCK_ROWS

    def add(self, piece: Piece, *, static: bool = False) -> None:
        """Add a piece; a static one fills its columns in all rows from the next block on."""
        columns = np.array([self._column(*pair) for pair in self._pairs(piece)], np.intp)
        values = piece.values.reshape(len(piece.log), len(piece.names), self._width)
        if self._frames:
            # A quaternion of zeros is not a rotation.
            with np.errstate(invalid="ignore"):
                values[(values[..., 3:] == 0).all(axis=-1)] = np.nan
        if (columns < 0).any():
            values, columns = values[:, columns >= 0], columns[columns >= 0]
        if static:
            names = list(self._columns)
            self._static |= {names[column]: values[-1, at] for at, column in enumerate(columns)}
        elif len(columns):
            self._pieces.append((self._clock.seconds(piece, self._log), columns, values))
            self._rows += len(values)

    @staticmethod
    def _pairs(piece: Piece) -> list[tuple[str, str]]:
        return list(zip(piece.names, piece.parents or ("",) * len(piece.names), strict=True))

    def _column(self, name: str, parent: str) -> int:
        """Return the column of a name, a new one if needed; -1 beyond `MOST_SIGNALS` and for a second parent."""
        if name not in self._columns and len(self._columns) >= MOST_SIGNALS:
            self._log.warn(f"more than {MOST_SIGNALS} signals; later ones are left out")
            return -1
        column = self._columns.setdefault(name, len(self._columns))
        if self._frames:
            if column == len(self._parents):
                self._parents.append(parent)
            elif self._parents[column] != parent:
                self._log.warn(
                    f"frame {name!r} has the parents {self._parents[column]!r} and {parent!r}; only the first is used"
                )
                return -1
        return column

    def flush(self, *, last: bool = False) -> Block | None:
        """Return the collected rows as a block, None without rows.

        The newest row is kept for the next block unless this is the `last` call: more of it may follow.
        """
        if not self._pieces:
            return None
        time, values = self._complete() or self._merged(last)
        if not last:
            self._keep(time[-1])
            time, values = time[:-1], values[:-1]
        else:
            self._pieces, self._rows = [], 0
        if not len(time):
            return None
        if time[0] < self._end:
            self._log.warn("messages are out of the order of time by more than a block; sort the complete table")
        self._end = max(self._end, float(time[-1]))
        names = tuple(self._columns)
        for name, pose in self._static.items():
            values[:, self._columns[name]] = pose
        return Block(
            time, names, values if self._frames else values[:, :, 0], tuple(self._parents) if self._frames else ()
        )

    def newest_whole(self) -> bool:
        """Return whether the newest row has every signal, so that further messages can only repeat it."""
        if not self._pieces:
            return False
        newest = max(float(times[-1]) for times, _, _ in self._pieces)
        since = newest - (TOGETHER if self._frames else 0.0)
        there = {self._columns[name] for name in self._static}
        for times, columns, _ in self._pieces:
            if times[-1] >= since:
                there.update(columns.tolist())
        return len(there) == len(self._columns)

    def _keep(self, time: float) -> None:
        """Keep the samples from this time [s] on for the next block: of each set of columns the last."""
        newest: dict[bytes, tuple[Array, Indices, Array]] = {}
        for times, columns, values in self._pieces:
            late = np.flatnonzero(times >= time)
            if len(late):
                newest.pop(columns.tobytes(), None)
                newest[columns.tobytes()] = (times[late[-1:]], columns, values[late[-1:]])
        self._pieces, self._rows = list(newest.values()), len(newest)

    def _complete(self) -> tuple[Array, Array] | None:
        """Return time and values if every piece has every column and time increases, so that no merge is needed."""
        wanted = np.arange(len(self._columns))
        if not all(np.array_equal(columns, wanted) for _, columns, _ in self._pieces):
            return None
        time = np.concatenate([times for times, _, _ in self._pieces])
        if not (np.diff(time) > 0).all():
            return None
        values = np.concatenate([values for _, _, values in self._pieces])
        self._held = (np.full(len(wanted), time[-1]), values[-1].copy())
        return time, values

    def _merged(self, last: bool) -> tuple[Array, Array]:
        """Return time and values with one row for each distinct time, last values held."""
        every = np.unique(np.concatenate([times for times, _, _ in self._pieces]))
        near = np.diff(every) < TOGETHER if self._frames else np.zeros(len(every) - 1, bool)
        row_of = np.concatenate([[0], np.cumsum(~near)])
        time = every[np.concatenate([[True], ~near])]
        count = len(self._columns)
        values = np.full((len(time), count, self._width), np.nan)
        present = np.zeros((len(time), count), bool)
        for times, columns, piece in self._pieces:
            order = np.argsort(times, kind="stable")
            at = row_of[np.searchsorted(every, times[order])]
            values[at[:, None], columns] = piece[order]
            present[at[:, None], columns] = True
        if sum(piece.shape[0] * piece.shape[1] for *_, piece in self._pieces) > np.count_nonzero(present):
            self._log.warn("messages repeat the time of another; of those with one time the last is used")
        self._hold(time, values, present, last)
        return time, values

    def _hold(self, time: Array, values: Array, present: Flags, last: bool) -> None:
        """Fill absent values with the last value not older than `HOLD`; store the newest of each column.

        The newest row is not complete yet unless this is the `last` block.
        """
        count = present.shape[1]
        last_time, last_value = self._last(count)
        constant = [self._columns[name] for name in self._static]
        moving = np.setdiff1d(np.arange(count), constant)
        newest = np.where(present, np.arange(len(time))[:, None], -1)
        np.maximum.accumulate(newest, axis=0, out=newest)
        if not present[: len(time) - (not last), moving].all():
            self._log.warn(f"messages have a part of the signals; the last value of each is held for {HOLD} s")
            since = np.where(newest >= 0, time[newest], last_time)
            source = np.where((newest >= 0)[..., None], values[newest, np.arange(count)], last_value)
            age = time[:, None] - since
            fill = ~present & (age >= 0) & (age <= HOLD)
            values[fill] = source[fill]
        seen = newest[-1] >= 0
        last_time[seen] = time[newest[-1][seen]]
        last_value[seen] = values[newest[-1], np.arange(count)][seen]
        self._held = (last_time, last_value)

    def _last(self, count: int) -> tuple[Array, Array]:
        times, values = self._held
        new = count - len(times)
        return (
            np.concatenate([times, np.full(new, -np.inf)]),
            np.concatenate([values, np.full((new, self._width), np.nan)]),
        )
