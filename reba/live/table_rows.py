"""Rows of a posture table as they come -> postures and factors."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from reba.errors import PostureError
from reba.live.frames import Frames, NotYet, Reading, neutral_until
from reba.live.sources import GrowingStore, followed
from reba.posture.columns import COLUMNS, INDEX
from reba.posture.factors import BOTH_SIDES, FACTORS, Factors, checked, expand_sides
from reba.posture.named_angles import RAISED, read_angles, refuse_infinite
from reba.posture.table import table_of
from reba.readers.mcap.container import ChunkRef
from reba.readers.quality_control import apply_neutral, neutral_offsets, parse_neutral, subtract
from reba.readers.recognise import Match
from reba.readers.recording.stream import ReadLog

Row = dict[str, Any]
KNOWN = frozenset((*COLUMNS, *RAISED, *FACTORS, *BOTH_SIDES))
"""Columns that count."""


class TableFollower:
    """Turns segments into frames of posture.

    Args:
        source: its first segments.
        match: the stream of the table.
        reading: what the caller chose.
        factors: by name, as the caller gave them; they replace columns.
        activity: each kind, for where no column tells it.
        final: whether no more is going to come.
        tell: takes a warning.

    Raises:
        NotYet: the neutral posture is not over yet.
        PostureError: the first row cannot be used.
    """

    profile = "table"

    def __init__(
        self,
        source: GrowingStore,
        match: Match,
        reading: Reading,
        factors: Mapping[str, Any],
        activity: Mapping[str, bool],
        final: bool,
        tell: Callable[[str], None],
    ) -> None:
        self.log = ReadLog()
        self.late = 0
        self._intake = followed(match.stream, None, self.log)
        self._given, self._activity = factors, activity
        self._tell = tell
        self._constant = self._factors({}, 1)
        self._last = -np.inf
        self._offsets: dict[int, float] = {}
        first = [row for segment in source.segments for row in self._intake.rows(source, segment)]
        found = dict.fromkeys(name for row in first[:1] for name in row if name in KNOWN)
        self._columns = ["time", *found]
        self._ignored: set[str] = set()
        if first:
            for warning in table_of(pd.DataFrame(first[:1])).quality.warnings:
                tell(warning)
            self._convert(first[:1])
        self._settle(first, reading, final)
        self._last = -np.inf
        self.unmeasured = [column for column in COLUMNS if column not in found]
        self.late = self.log.skipped = 0

    def _settle(self, first: list[Row], reading: Reading, final: bool) -> None:
        """Find the neutral posture."""
        self.assumed: list[str] = []
        window = parse_neutral(reading.neutral)
        parts = list(self._frames(first))
        if window is None:
            return
        time = np.concatenate([part.time for part in parts]) if parts else np.zeros(0)
        if not final and (not len(time) or time[-1] <= neutral_until(reading.neutral, float(time[0]))):
            raise NotYet
        angles = np.concatenate([part.angles for part in parts]) if parts else np.zeros((0, len(COLUMNS)))
        self.assumed.append(apply_neutral(time, angles.copy(), reading.neutral))
        self._offsets = neutral_offsets(angles[window(time)])

    def take(self, source: GrowingStore, segment: ChunkRef) -> Iterator[Frames]:
        """Yield the frames of a segment."""
        rows = self._intake.rows(source, segment)
        self.log.messages += len(rows)
        yield from self._frames(rows)

    def end(self) -> Iterator[Frames]:
        """Yield nothing: no row waits."""
        return iter(())

    def _frames(self, rows: list[Row]) -> Iterator[Frames]:
        """Yield frames of rows, those that cannot be used left out and counted."""
        fresh: list[Row] = []
        for row in rows:
            self._add_columns(row)
            time = row.get("time")
            if not isinstance(time, int | float) or not np.isfinite(time):
                self.log.skip(1, f"time is {str(time)[:40]!r}, expected seconds")
            elif time <= self._last:
                if not self.late:
                    self._tell(f"time runs backwards or stands still at {time:.3f} s; such frames are left out "
                               "and counted")  # fmt: skip
                self.late += 1
            else:
                self._last = float(time)
                fresh.append(row)
        if fresh:
            yield from self._converted(fresh)

    def _converted(self, rows: list[Row]) -> Iterator[Frames]:
        """Yield the frames of rows at once, or one by one where one of them is wrong."""
        try:
            yield self._convert(rows)
        except PostureError as error:
            if len(rows) == 1:
                self.log.skip(1, str(error))
                return
            for row in rows:
                yield from self._converted([row])

    def _convert(self, rows: list[Row]) -> Frames:
        """Return the frames of rows.

        Raises:
            PostureError: one of them cannot be used.
        """
        columns = {name: [row.get(name) for row in rows] for name in self._columns if name != "time"}
        posture = {name: columns.pop(name) for name in self._columns if name in INDEX or name in RAISED}
        angles = read_angles(posture, COLUMNS)[0] if posture else np.full((len(rows), len(COLUMNS)), np.nan)
        refuse_infinite(angles)
        used = self._constant
        if columns:
            used = self._factors(columns, len(rows))
        subtract(angles, self._offsets)
        return Frames(np.array([row["time"] for row in rows], np.float64), angles, used)

    def _factors(self, columns: Mapping[str, Any], count: int) -> Factors:
        return checked(Factors.of({**self._activity, **expand_sides(columns), **self._given}), count)

    def _add_columns(self, row: Row) -> None:
        """Take up angles that come later; a factor has to be there from the first row on."""
        new = [name for name in row if name in KNOWN and name not in self._columns]
        self._columns += [name for name in new if name in COLUMNS]
        for name in new:
            if name not in COLUMNS and name not in self._ignored:
                self._ignored.add(name)
                self._tell(f"{name} comes after the first row and is not used; give it in every row")
