"""Frames of a recording while they are read: time and angles in the order of time, in memory or in a temporary file.

`MemoryFrames` becomes the posture table itself. `FileFrames` keeps its rows on disk, so that memory does not grow with
the recording; changes of rows are applied whenever they are read.
"""

from __future__ import annotations

import tempfile
import weakref
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final, Protocol

import numpy as np

from reba.arrays import Array
from reba.errors import ReadError
from reba.posture.columns import COLUMNS, INDEX
from reba.readers.recording.stream import ReadLog

WIDTH: Final = 1 + len(COLUMNS)
"""Columns of a row: time [s] and the angles [deg]."""
ROWS: Final = 20_000
"""Rows that are looked at together."""
Change = Callable[[Array], None]
"""Alters rows (n, 23) in place."""


@dataclass
class Order:
    """What keeps rows from being in the order of time: rows without a time, of a repeated time, and disorder."""

    timeless: int = 0
    repeated: int = 0
    sorted: bool = False

    def apply(self, rows: Array) -> Array:
        """Return rows (n, 23) sorted by time, each time once, and count what was left out."""
        finite = np.isfinite(rows[:, 0])
        if not finite.all():
            self.timeless += int(np.count_nonzero(~finite))
            rows = rows[finite]
        if len(rows) and np.any(np.diff(rows[:, 0]) < 0):
            self.sorted = True
            rows = rows[np.argsort(rows[:, 0], kind="stable")]
        again = np.flatnonzero(np.diff(rows[:, 0]) == 0) + 1
        if len(again):
            self.repeated += len(again)
            rows = np.delete(rows, again, axis=0)
        return rows

    def note(self, log: ReadLog) -> None:
        """Count and warn of it in the log of the reading."""
        if self.timeless:
            log.unused["no_time"] += self.timeless
            log.warn(f"{self.timeless} samples without a time were left out")
        if self.sorted:
            log.warn("samples were not in the order of time; they were sorted")
        if self.repeated:
            log.unused["repeated_time"] += self.repeated
            log.warn(f"{self.repeated} samples repeat the time of the one before and were left out")


def sorted_by_time(table: Array, log: ReadLog) -> Array:
    """Return rows sorted by time, their first column; repeated and non-finite times are left out and noted."""
    order = Order()
    table = order.apply(table)
    order.note(log)
    return table


class Disorder(Exception):
    """Rows of a later block belong before those of an earlier one."""


class Frames(Protocol):
    """Rows of time [s] and 22 angles [deg] of a recording."""

    def __len__(self) -> int:
        """Return the number of rows."""

    def begin(self, expected: int) -> None:
        """Forget all rows; about so many are to come."""

    def append(self, time: Array, angles: Array) -> None:
        """Add (n,) times and (n, 22) angles."""

    def end(self, log: ReadLog) -> None:
        """Bring the rows into the order of time, and note what was left out."""

    def change(self, change: Change) -> None:
        """Alter all rows."""

    def drop_first(self) -> None:
        """Leave out the first row."""

    def rows(self, start: int, stop: int) -> Array:
        """Return some rows (n, 23)."""

    def column(self, index: int) -> Array:
        """Return one column (n,)."""


def blocks(frames: Frames) -> Iterator[Array]:
    """Iterate over all rows, `ROWS` at a time."""
    for start in range(0, len(frames), ROWS):
        yield frames.rows(start, min(start + ROWS, len(frames)))


class MemoryFrames:
    """Rows in one array, the `table`; see `Frames`."""

    def __init__(self) -> None:
        self.table: Array = np.empty((0, WIDTH))
        self._count = 0

    @staticmethod
    def of(table: Array) -> MemoryFrames:
        """Return the frames of an (n, 23) array."""
        frames = MemoryFrames()
        frames.table, frames._count = table, len(table)
        return frames

    def __len__(self) -> int:
        return self._count

    def begin(self, expected: int) -> None:
        """See `Frames`; the table grows in place by halves, so at most a third is spare."""
        self.table = np.empty((max(expected, 1024), WIDTH))
        self._count = 0

    def append(self, time: Array, angles: Array) -> None:
        """See `Frames`."""
        stop = self._count + len(time)
        if stop > len(self.table):
            self.table.resize((max(stop, len(self.table) * 3 // 2), WIDTH), refcheck=False)
        self.table[self._count : stop, 0] = time
        self.table[self._count : stop, 1:] = angles
        self._count = stop

    def end(self, log: ReadLog) -> None:
        """See `Frames`."""
        self.table.resize((self._count, WIDTH), refcheck=False)
        self.table = sorted_by_time(self.table, log)
        self._count = len(self.table)

    def change(self, change: Change) -> None:
        """See `Frames`."""
        for start in range(0, self._count, ROWS):
            change(self.table[start : start + ROWS])

    def drop_first(self) -> None:
        """See `Frames`."""
        self.table = self.table[1:]
        self._count -= 1

    def rows(self, start: int, stop: int) -> Array:
        """See `Frames`; a view."""
        return self.table[start:stop]

    def column(self, index: int) -> Array:
        """See `Frames`; a view."""
        return self.table[:, index]


@dataclass
class FileFrames:
    """Rows in a temporary file without a name, which ends with this object; see `Frames`.

    Raises:
        ReadError: the temporary folder is full.
        Disorder: rows would have to be sorted, for which all must be in memory.
    """

    path: str
    _file: Any = None
    _count: int = 0
    _skip: int = 0
    _last: float = -np.inf
    _changes: list[Change] = field(default_factory=list)
    _order: Order = field(default_factory=Order)

    def __post_init__(self) -> None:
        self.begin(0)

    def __len__(self) -> int:
        return self._count - self._skip

    def begin(self, expected: int) -> None:
        """See `Frames`."""
        if self._file is not None:
            self._file.close()
        try:
            self._file = tempfile.TemporaryFile()  # noqa: SIM115
        except OSError as error:
            raise self._no_space(error) from error
        weakref.finalize(self, self._file.close)
        self._count, self._skip, self._last, self._changes, self._order = 0, 0, -np.inf, [], Order()

    def append(self, time: Array, angles: Array) -> None:
        """See `Frames`."""
        rows = self._order.apply(np.column_stack([time, angles]))
        if not len(rows):
            return
        if rows[0, 0] == self._last:
            self._order.repeated += 1
            rows = rows[1:]
        elif rows[0, 0] < self._last:
            raise Disorder
        if len(rows):
            self._last = float(rows[-1, 0])
            self._count += len(rows)
            try:
                self._file.write(rows.tobytes())
                self._file.flush()
            except OSError as error:
                raise self._no_space(error) from error

    def _no_space(self, error: OSError) -> ReadError:
        what = f"its frames cannot be written to a temporary file ({error.strerror or error})"
        return ReadError(self.path, what, hint="set TMPDIR to a folder with more space")

    def end(self, log: ReadLog) -> None:
        """See `Frames`."""
        self._order.note(log)

    def change(self, change: Change) -> None:
        """See `Frames`."""
        self._changes.append(change)

    def drop_first(self) -> None:
        """See `Frames`."""
        self._skip += 1

    def rows(self, start: int, stop: int) -> Array:
        """See `Frames`; new for every call."""
        self._file.seek((start + self._skip) * WIDTH * 8)
        rows = np.frombuffer(self._file.read((stop - start) * WIDTH * 8)).reshape(-1, WIDTH).copy()
        for change in self._changes:
            change(rows)
        return rows

    def column(self, index: int) -> Array:
        """See `Frames`."""
        column = np.empty(len(self))
        for start in range(0, len(self), ROWS):
            rows = self.rows(start, min(start + ROWS, len(self)))
            column[start : start + len(rows)] = rows[:, index]
        return column


def angles_column(frames: Frames, name: str) -> Array:
    """Return the (n,) angles [deg] of a column by name."""
    return frames.column(1 + INDEX[name])
