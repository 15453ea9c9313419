"""Tables with rows of several people or recordings: a column of ids says whose each row is."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array
from reba.errors import ReadError, join_names
from reba.readers.formats.long_points import point_column
from reba.readers.mcap.presence import TOGETHER
from reba.readers.recording.stream import ReadLog, clip

if TYPE_CHECKING:
    import pandas as pd

IDS: Final = (
    *("person", "subject", "participant", "worker", "operator", "user", "human", "actor", "body", "skeleton", "track"),
    *("tracking", "id", "trial", "take", "session", "recording"),
)
"""Names of columns of ids in lower case; `_id`, `_name` and the like may follow."""
_NAME: Final = re.compile(rf"^({'|'.join(IDS)})(_?(id|ids|no|nr|number|name|index|idx))?$")
PAUSE: Final = 1.0
"""[s] Longest time without a row in which an id counts as present throughout, or three steps; a choice."""
MOST_PEOPLE: Final = 50
"""Streams of one table; more ids at once are no people."""


def is_id(column: object) -> bool:
    """Return whether a column is called as one that says whose a row is.

    >>> [is_id(name) for name in ("person_id", "Track ID", "id", "subjectName", "identity", "body_weight")]
    [True, True, True, True, False, False]
    """
    return bool(_NAME.match(re.sub(r"[ .-]+", "_", str(column).strip()).lower()))


def rows_of_people(
    path: Path, frame: pd.DataFrame, time: Array | None, log: ReadLog
) -> dict[str, NDArray[np.intp]] | None:
    """Return id -> its rows, None where all rows are of one person.

    Ids that are never there at once are one person, whose id a tracker renewed, which is noted.

    Args:
        time: (n,) of the rows [s], NaN where there is none; None for a table without times.
        log: gets the note.

    Raises:
        ReadError: more than `MOST_PEOPLE` ids are there at once.
    """
    columns = [column for column in frame.columns if is_id(column) and 2 <= _count(frame, column) <= len(frame) / 2]
    if (point := point_column(frame)) is not None:
        # A number of the points themselves says nothing of people.
        columns = [column for column in columns if frame.groupby(point)[column].nunique(dropna=False).max() > 1]
    if not columns:
        return None
    labels = np.array(["/".join(map(_label, row)) for row in frame[columns].itertuples(index=False)], dtype=object)
    names = list(dict.fromkeys(labels.tolist()))
    rows = {name: np.flatnonzero(labels == name) for name in names[: len(frame)]}
    where = f"column{'s' * (len(columns) > 1)} {join_names([clip(str(column)) for column in columns], 3)}"
    if time is None or _at_once(rows, time):
        if len(rows) > MOST_PEOPLE:
            hint = "give the rows of one person, or rename the column if it does not say whose a row is"
            raise ReadError(path, f"{len(rows)} ids in {where} are there at once", hint=hint)
        return rows
    seen = [f"{name} ({np.nanmin(time[at]):.1f} to {np.nanmax(time[at]):.1f} s)" for name, at in rows.items()]
    log.warn(f"ids in {where} that follow each other are one person: {join_names(seen, 4)}")
    return None


def _count(frame: pd.DataFrame, column: str) -> int:
    return int(frame[column].nunique(dropna=False))


def _label(value: object) -> str:
    if isinstance(value, float):
        return "none" if np.isnan(value) else f"{value:g}"
    return "none" if value is None else str(value)


def _at_once(rows: dict[str, NDArray[np.intp]], time: Array) -> bool:
    """Return whether two ids are there at once for longer than a hand-over takes."""
    known = np.unique(time[np.isfinite(time)])
    pause = max(PAUSE, 3 * float(np.median(np.diff(known)))) if len(known) > 1 else PAUSE
    spans: list[tuple[float, float, str]] = []
    for name, at in rows.items():
        mine = np.sort(time[at][np.isfinite(time[at])])
        cuts = np.flatnonzero(np.diff(mine) > pause)
        if len(mine):
            spans += zip(mine[np.r_[0, cuts + 1]], mine[np.r_[cuts, -1]], [name] * (len(cuts) + 1), strict=True)
    both: dict[tuple[str, str], float] = {}
    there: list[tuple[float, float, str]] = []
    for first, last, name in sorted(spans):
        there = [span for span in there if span[1] > first]
        for _, end, other in there:
            if other != name:
                pair = (min(name, other), max(name, other))
                both[pair] = both.get(pair, 0.0) + min(end, last) - first
                if both[pair] > TOGETHER * 1e-9:
                    return True
        there.append((first, last, name))
    return False
