"""Parts of a recording: an interval, or blocks one after the other, with all that was decided by the whole of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from reba.arrays import Array
from reba.errors import ReadError
from reba.posture.columns import COLUMNS
from reba.posture.table import Movement, PostureTable
from reba.readers.accounts import of_interval
from reba.readers.build_table import Reading, build_table, read_in_parts
from reba.readers.recognise import Match
from reba.readers.recording.stream import Recording


def table_of_match(
    recording: Recording,
    match: Match,
    start: float | None,
    end: float | None,
    *,
    neutral: str = "none",
    strict: bool = False,
) -> PostureTable:
    """Return the posture table of a recording, or of an interval [s] of it; arguments and errors as of `reba.read`."""
    if start is None and end is None:
        return build_table(recording, match, neutral=neutral, strict=strict)
    return interval_table(read_in_parts(recording, match, neutral=neutral, strict=strict), start, end)


def interval_of(reading: Reading, start: float | None, end: float | None) -> tuple[int, int]:
    """Return the positions of the first frame of an interval [s] and of that behind its last; both ends belong to it.

    Raises:
        ReadError: no frame lies in the interval.
    """
    time = reading.time
    first = 0 if start is None else int(np.searchsorted(time, start, side="left"))
    stop = len(time) if end is None else int(np.searchsorted(time, end, side="right"))
    if stop <= first:
        asked = f"{time[0] if start is None else start:g} to {time[-1] if end is None else end:g} s"
        spans = f"it has frames from {time[0]:.3f} to {time[-1]:.3f} s"
        raise ReadError(
            reading.whole.source, f"no frame lies in {asked}", hint=f"choose a start before the end; {spans}"
        )
    return first, stop


def interval_table(reading: Reading, start: float | None, end: float | None) -> PostureTable:
    """Return the posture table of an interval [s], the times of which are those of the recording.

    Raises:
        ReadError: no frame lies in the interval.
    """
    first, stop = interval_of(reading, start, end)
    table = _part(reading, first, stop)
    return replace(table, quality=replace(table.quality, accounts=_accounts(reading, first, stop)))


def block_tables(reading: Reading, start: float | None, end: float | None, seconds: float) -> Iterator[PostureTable]:
    """Return an iterator over the posture tables of consecutive blocks of at most `seconds`; empty ones are left out.

    Raises:
        ReadError: no frame lies in the interval.
    """
    return _blocks(reading, *interval_of(reading, start, end), seconds)


def _blocks(reading: Reading, first: int, stop: int, seconds: float) -> Iterator[PostureTable]:
    whole = first == 0 and stop == len(reading.time)
    accounts = reading.whole.quality.accounts if whole else _accounts(reading, first, stop)
    at = first
    movement = Movement(
        reading.time[first:stop],
        lambda name: reading.column(name)[first:stop],
        reading.whole.quality.seams,
        reading.column("support")[first:stop] if "support" in reading.whole.data else None,
    )
    origin = float(reading.time[first])
    while at < stop:
        number = math.floor((float(reading.time[at]) - origin) / seconds) + 1
        after = int(np.searchsorted(reading.time[:stop], origin + number * seconds, side="left"))
        after = max(after, at + 1)
        part = _part(reading, at, after)
        quality = replace(part.quality, accounts=accounts)
        yield replace(part, quality=quality, movement=movement, first_frame=at - first)
        at = after


def _part(reading: Reading, first: int, stop: int) -> PostureTable:
    """Return some frames as a posture table, with the gaps and seams among them."""
    data = reading.data(first, stop)
    start, end = float(reading.time[first]), float(reading.time[stop - 1])
    quality = reading.whole.quality
    gaps = tuple(gap for gap in quality.gaps if gap[0] >= start and gap[1] <= end)
    seams = tuple(seam for seam in quality.seams if start < seam <= end)
    empty = tuple(column for column in COLUMNS if not data[column].notna().any())
    why = {column: reading.whole.why_unmeasured.get(column, "no value in this part") for column in empty}
    return replace(
        reading.whole,
        data=data,
        unmeasured=empty,
        why_unmeasured=why,
        quality=replace(quality, gaps=gaps, seams=seams),
    )


def _accounts(reading: Reading, first: int, stop: int) -> tuple[dict[str, Any], ...]:
    """Return the accounts of an interval: that of the stream of the frames, then those of the others."""
    main, *others = reading.whole.quality.accounts
    start, end = float(reading.time[first]), float(reading.time[stop - 1])
    inside = stop - first
    if main["used"] != len(reading.time) and len(reading.times):  # several messages make one frame
        inside = min(sum(_inside(part, start, end) for part in reading.times), main["used"])
    beside = min(_inside(reading.pelvis, start, end), max((each["used"] for each in others), default=0))
    return (
        of_interval(main, inside, end - start),
        *(of_interval(each, beside, end - start) if each["used"] else each for each in others),
    )


def _inside(times: Array, start: float, end: float) -> int:
    return int(np.count_nonzero((times >= start - NEAR) & (times <= end + NEAR)))


NEAR = 0.0004
"""[s] Transforms of one frame lie so close together, see `reba.readers.mcap.merge`."""
