"""Rows of a posture table as they arrive -> postures and factors."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from reba.errors import PostureError
from reba.live.frames import Frames, NotEnoughData, ReadingOptions, neutral_until
from reba.live.sources import GrowingStore, block_decoder
from reba.posture.columns import COLUMNS, INDEX
from reba.posture.factors import BOTH_SIDES, FACTORS, Factors, checked, expand_sides
from reba.posture.named_angles import RAISED, read_angles, refuse_infinite
from reba.posture.table import table_of
from reba.readers.mcap.store import ChunkRef, Store
from reba.readers.quality_control import apply_neutral, neutral_offsets, parse_neutral, subtract
from reba.readers.recognise import Match
from reba.readers.recording.stream import ReadLog

Row = dict[str, Any]
KNOWN = frozenset((*COLUMNS, *RAISED, *FACTORS, *BOTH_SIDES))
"""Columns that are read."""


class TableFollower:
    """Converts segments of table rows to frames.

    Args:
        source: with the first segments.
        match: the stream of the table.
        factors: by name; they replace columns.
        activity: value of each kind of activity without a column.
        final: no more segments will arrive.

    Raises:
        NotEnoughData: the interval of the neutral posture has not ended.
        PostureError: the first row cannot be used.
    """

    profile = "table"

    def __init__(
        self,
        source: GrowingStore,
        match: Match,
        reading: ReadingOptions,
        factors: Mapping[str, Any],
        activity: Mapping[str, bool],
        final: bool,
        on_warning: Callable[[str], None],
    ) -> None:
        self.log = ReadLog()
        self.late = 0
        self.decoder = block_decoder(match.stream, None, self.log)
        self._fixed_factors, self._activity = factors, activity
        self._on_warning = on_warning
        self._constant = self._factors({}, 1)
        self._last = -np.inf
        self._offsets: dict[int, float] = {}
        first = [row for segment in source.segments for row in self.decoder.rows(source, segment)]
        # Rows leave out what is missing: the first one with an angle shows which columns there are.
        shown = [row for row in first if any(name in COLUMNS or name in RAISED for name in row)][:1] or first[:1]
        present = dict.fromkeys(name for row in shown for name in row if name in KNOWN)
        self._columns = ["time", *present]
        self._ignored: set[str] = set()
        self.unmeasured: list[str] = []
        if shown:
            for warning in table_of(pd.DataFrame(shown)).quality.warnings:
                on_warning(warning)
            self._convert(shown)
        self._set_neutral(first, reading, final)
        self._last = -np.inf
        self.unmeasured = [column for column in COLUMNS if column not in present]
        self.late = self.log.skipped = 0

    def _set_neutral(self, first: list[Row], reading: ReadingOptions, final: bool) -> None:
        """Set the offsets of the neutral posture from the first rows."""
        self.assumed: list[str] = []
        window = parse_neutral(reading.neutral)
        parts = list(self._frames(first))
        if window is None:
            return
        time = np.concatenate([part.time for part in parts]) if parts else np.zeros(0)
        if not final and (not len(time) or time[-1] <= neutral_until(reading.neutral, float(time[0]))):
            raise NotEnoughData
        angles = np.concatenate([part.angles for part in parts]) if parts else np.zeros((0, len(COLUMNS)))
        self.assumed.append(apply_neutral(time, angles.copy(), reading.neutral))
        self._offsets = neutral_offsets(angles[window(time)])

    def frames_of(self, source: Store, segment: ChunkRef) -> Iterator[Frames]:
        """Yield the frames of a segment."""
        rows = self.decoder.rows(source, segment)
        self.log.messages += len(rows)
        yield from self._frames(rows)

    def remaining_frames(self) -> Iterator[Frames]:
        """Return no frames: rows are converted at once."""
        return iter(())

    def _frames(self, rows: list[Row]) -> Iterator[Frames]:
        """Yield frames of rows; rows that cannot be used are counted."""
        usable: list[Row] = []
        for row in rows:
            self._add_columns(row)
            time = row.get("time")
            if not isinstance(time, int | float) or not np.isfinite(time):
                self.log.skip(1, f"time is {str(time)[:40]!r}, expected seconds")
            elif time <= self._last:
                if not self.late:
                    self._on_warning(
                        f"time does not increase at {time:.3f} s (last {self._last:.3f} s); such frames are skipped "
                        "and counted"
                    )
                self.late += 1
            else:
                self._last = float(time)
                usable.append(row)
        if usable:
            yield from self._converted(usable)

    def _converted(self, rows: list[Row]) -> Iterator[Frames]:
        """Yield the frames of rows together, or one by one if one of them is invalid."""
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
            PostureError: a row is invalid.
        """
        columns = {name: [row.get(name) for row in rows] for name in self._columns if name != "time"}
        posture = {name: columns.pop(name) for name in self._columns if name in INDEX or name in RAISED}
        angles = read_angles(posture, COLUMNS)[0] if posture else np.full((len(rows), len(COLUMNS)), np.nan)
        refuse_infinite(angles)
        factors = self._constant
        if columns:
            factors = self._factors(columns, len(rows))
        subtract(angles, self._offsets)
        return Frames(np.array([row["time"] for row in rows], np.float64), angles, factors)

    def _factors(self, columns: Mapping[str, Any], count: int) -> Factors:
        return checked(Factors.of({**self._activity, **expand_sides(columns), **self._fixed_factors}), count)

    def _add_columns(self, row: Row) -> None:
        """Add angle columns that appear later; a factor must be in every row from the first one on."""
        new = [name for name in row if name in KNOWN and name not in self._columns]
        self._columns += [name for name in new if name in COLUMNS]
        self.unmeasured = [column for column in self.unmeasured if column not in new]
        for name in new:
            if name not in COLUMNS and name not in self._ignored:
                self._ignored.add(name)
                self._on_warning(f"{name} is not in the first row and is not used; give it in every row")
