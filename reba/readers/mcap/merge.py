"""Pieces of many messages -> blocks: one row for each time, one column for each name.

A message may have a part of the signals (two publishers, one transform per message). A row joins the values of one
time; an absent signal has its last value if that is not older than `HOLD`, else NaN.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from reba.arrays import Array, Flags, Indices
from reba.readers.mcap.decode import Piece
from reba.readers.mcap.extract import POSE
from reba.readers.recording.stream import Block, Kind, ReadLog

HOLD: Final = 0.5
"""[s] How long the last value of a signal is used for rows without it."""
TOGETHER: Final = 0.0004
"""[s] Transforms sent one by one with closer stamps belong to one frame (drivers that stamp each one)."""
MOST_SIGNALS: Final = 2000
"""Largest number of names of a stream: protects memory from names that change with every message."""
BLOCK_ROWS: Final = 4096
"""Messages in a block."""


MOST_WAITING: Final = 64 * BLOCK_ROWS
"""Messages that wait for those of a slower channel; more are not joined with them."""


Steps = list[tuple[float, Array]]
"""Values of a static column, each with the time [s] from which on it holds; the first holds before it too."""


class Merger:
    """Collects pieces and returns them as blocks.

    Args:
        signals: names and parents of the first columns; others are added as they appear.
        kind: of the stream: a value of frames is a pose of 7 numbers, of points x y z, else one number. Absent values
            are held, but not in a row of a posture table, which leaves out what was not measured.
    """

    def __init__(self, signals: Sequence[tuple[str, str]], log: ReadLog, kind: Kind) -> None:
        self._columns = {signal: index for index, signal in enumerate(signals)}
        self._log = log
        self._frames = kind == "frames"
        self._holds = kind != "angles"
        self._width = {"frames": POSE, "points": 3}.get(kind, 1)
        self._static: dict[int, Steps] = {}
        self._pieces: list[tuple[Array, Indices, Array]] = []
        self._rows = 0
        self._wait_for = BLOCK_ROWS
        self._held: tuple[Array, Array] = (np.zeros(0), np.zeros((0, self._width)))
        self._end = -np.inf

    @property
    def full(self) -> bool:
        """Whether enough rows are collected for a block."""
        return self._rows >= self._wait_for

    def include(self, signals: Sequence[tuple[str, str]], static: Merger, later: float) -> None:
        """Add columns of signals, also of known names with another parent, and the values of a `static` merger.

        Args:
            later: time 0 of that one, in the time [s] of this one.
        """
        for signal in signals:
            if len(self._columns) < MOST_SIGNALS:
                self._columns.setdefault(signal, len(self._columns))
        for signal, column in static._columns.items():
            if column in static._static and signal in self._columns:
                steps = static._static[column]
                self._static[self._columns[signal]] = [(time + later, value) for time, value in steps]

    def add(self, time: Array, piece: Piece) -> None:
        """Add a piece with its (n,) times [s]."""
        columns, values = self._placed(piece)
        if len(columns):
            self._pieces.append((time, columns, values))
            self._rows += len(values)

    def add_static(self, pieces: Sequence[tuple[Array, Piece]]) -> None:
        """Add all pieces of static transforms with their times [s]: a value holds until another one comes."""
        for time, piece in pieces:
            columns, values = self._placed(piece)
            for at, column in enumerate(columns.tolist()):
                there = np.isfinite(values[:, at]).all(axis=1)
                if there.any():
                    steps = zip(time[there].tolist(), values[there, at], strict=True)
                    self._static.setdefault(column, []).extend(steps)
        names = list(self._columns)
        absent = np.full(self._width, np.nan)
        given = {column: [time for time, _ in poses] for column, poses in self._static.items()}
        for column, poses in self._static.items():
            # A frame that is fixed to another parent is no longer in this one.
            others = [
                time
                for other in given
                if other != column and names[other][0] == names[column][0]
                for time in given[other]
            ]
            before = [-np.inf] if others and min(others) < min(given[column]) else []
            poses += [(time, absent) for time in (*before, *others)]
            poses.sort(key=lambda pose: pose[0])
            repeats = [
                at > 0 and np.array_equal(poses[at - 1][1], pose, equal_nan=True) for at, (_, pose) in enumerate(poses)
            ]
            poses[:] = [pose for pose, repeat in zip(poses, repeats, strict=True) if not repeat]
            if len(poses) > 1:
                times = ", ".join(f"{time:.2f} s" for time, _ in poses[1:4]) + (" ..." if len(poses) > 4 else "")
                name = repr(names[column][0])
                self._log.warn(f"static transform of {name} changes at {times}; each holds until the next")

    def _placed(self, piece: Piece) -> tuple[Indices, Array]:
        """Return the columns (k,) of a piece and its values (n, k, width), without signals that are left out."""
        pairs = zip(piece.names, piece.parents or ("",) * len(piece.names), strict=True)
        columns = np.array([self._column(*pair) for pair in pairs], np.intp)
        values = piece.values.reshape(len(piece.log), len(piece.names), self._width)
        if self._frames:
            # A quaternion of zeros is not a rotation.
            with np.errstate(invalid="ignore"):
                values[(values[..., 3:] == 0).all(axis=-1)] = np.nan
        kept = columns >= 0
        return (columns, values) if kept.all() else (columns[kept], values[:, kept])

    def _column(self, name: str, parent: str) -> int:
        """Return the column of a signal, a new one if needed; -1 for those that are left out."""
        column = self._columns.get((name, parent))
        if column is not None:
            return column
        if len(self._columns) >= MOST_SIGNALS or any(known == name for known, _ in self._columns):
            return -1
        self._columns[name, parent] = len(self._columns)
        return len(self._columns) - 1

    def flush(self, *, until: float | None = None, last: bool = False) -> Block | None:
        """Return collected rows as a block, None without rows.

        Rows before the time `until` [s] are complete; without it all but the newest, of which more may follow, and all
        if this is the `last` call. Later rows are kept for the next block.
        """
        if not self._pieces:
            return None
        if until is not None and self._rows >= MOST_WAITING:
            self._log.warn(f"one channel is more than {MOST_WAITING} messages behind another")
            until = None
        time, values = self._complete(until, last) or self._merged(until, last)
        if last:
            self._pieces, self._rows = [], 0
        self._wait_for = self._rows + BLOCK_ROWS
        if not len(time):
            return None
        if time[0] < self._end:
            self._log.warn("messages are out of the order of time by more than a block; sort the complete table")
        self._end = max(self._end, float(time[-1]))
        for column, steps in self._static.items():
            since = np.array([since for since, _ in steps[1:]])
            values[:, column] = np.stack([pose for _, pose in steps])[np.searchsorted(since, time, side="right")]
        names, parents = (tuple(texts) for texts in zip(*self._columns, strict=True))
        return Block(time, names, values[:, :, 0] if self._width == 1 else values, parents if self._frames else ())

    def newest_whole(self) -> bool:
        """Return whether the newest row has every signal, so that further messages can only repeat it."""
        if not self._pieces:
            return False
        newest = max(float(times[-1]) for times, _, _ in self._pieces)
        since = newest - (TOGETHER if self._frames else 0.0)
        there = set(self._static)
        for times, columns, _ in self._pieces:
            if times[-1] >= since:
                there.update(columns.tolist())
        return len(there) == len(self._columns)

    def _keep(self, time: float, *, newest: bool) -> None:
        """Keep the samples from this time [s] on for the next block; of the `newest` row of each column the last."""
        kept: dict[bytes | int, tuple[Array, Indices, Array]] = {}
        for number, (times, columns, values) in enumerate(self._pieces):
            late = np.flatnonzero(times >= time)
            if len(late):
                key: bytes | int = columns.tobytes() if newest else number
                late = late[-1:] if newest else late
                kept.pop(key, None)
                kept[key] = (times[late], columns, values[late])
        self._pieces = list(kept.values())
        self._rows = sum(len(times) for times, _, _ in self._pieces)

    def _complete(self, until: float | None, last: bool) -> tuple[Array, Array] | None:
        """Return time and values if every piece has every column and time increases, so that no merge is needed."""
        wanted = np.arange(len(self._columns))
        if not all(np.array_equal(columns, wanted) for _, columns, _ in self._pieces):
            return None
        time = np.concatenate([times for times, _, _ in self._pieces])
        if not (np.diff(time) > 0).all():
            return None
        values = np.concatenate([values for _, _, values in self._pieces])
        count = len(time) if last else len(time) - 1 if until is None else int(np.searchsorted(time, until))
        if not last:
            self._keep(time[count] if count < len(time) else np.inf, newest=until is None)
        if count:
            self._held = (np.full(len(wanted), time[count - 1]), values[count - 1].copy())
        return time[:count], values[:count]

    def _merged(self, until: float | None, last: bool) -> tuple[Array, Array]:
        """Return time and values with one row for each distinct time, last values held."""
        every = np.unique(np.concatenate([times for times, _, _ in self._pieces]))
        near = np.diff(every) < TOGETHER if self._frames else np.zeros(len(every) - 1, bool)
        row_of = np.concatenate([[0], np.cumsum(~near)])
        time = every[np.concatenate([[True], ~near])]
        ends = every[np.concatenate([~near, [True]])]
        rows = len(time) if last else len(time) - 1 if until is None else int(np.searchsorted(ends, until))
        count = len(self._columns)
        values = np.full((rows, count, self._width), np.nan)
        present = np.zeros((rows, count), bool)
        samples = 0
        for times, columns, piece in self._pieces:
            order = np.argsort(times, kind="stable")
            at = row_of[np.searchsorted(every, times[order])]
            order, at = order[at < rows], at[at < rows]
            values[at[:, None], columns] = piece[order]
            present[at[:, None], columns] = True
            samples += len(at) * len(columns)
        if samples > np.count_nonzero(present):
            self._count_repeated(row_of, every, rows)
        if rows and self._holds:
            self._hold(time[:rows], values, present)
        if not last:
            self._keep(time[rows] if rows < len(time) else np.inf, newest=until is None)
        return time[:rows], values

    def _count_repeated(self, row_of: Indices, every: Array, rows: int) -> None:
        """Count the messages of which nothing is used: each of their signals has a later message of the same time."""
        owner = np.full((rows, len(self._columns)), -1)
        first = 0
        for times, columns, _ in self._pieces:
            order = np.argsort(times, kind="stable")
            at = row_of[np.searchsorted(every, times[order])]
            owner[at[at < rows, None], columns] = first + order[at < rows, None]
            first += len(times)
        owned = np.zeros(first + 1, bool)
        owned[owner] = True
        here = np.concatenate([row_of[np.searchsorted(every, times)] < rows for times, _, _ in self._pieces])
        repeated = int(np.count_nonzero(here & ~owned[:-1]))
        self._log.unused["repeated_time"] += repeated
        self._log.warn("messages repeat the time of another; of those with one time the last is used")

    def _hold(self, time: Array, values: Array, present: Flags) -> None:
        """Fill absent values with the last value not older than `HOLD`; store the newest of each column."""
        count = present.shape[1]
        last_time, last_value = self._last(count)
        moving = np.setdiff1d(np.arange(count), list(self._static))
        newest = np.where(present, np.arange(len(time))[:, None], -1)
        np.maximum.accumulate(newest, axis=0, out=newest)
        if not present[:, moving].all():
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
