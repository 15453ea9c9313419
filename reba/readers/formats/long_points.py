"""Tables with a row for each point in each frame, as the `_by_frame` files of FreeMoCap, with a row for each frame.

Columns: a time or a frame, the name of the point, its x, y and z; further ones tell several sets of points apart.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from reba.readers.formats.table_columns import LEAST_POINTS
from reba.readers.recording.stream import ReadLog

if TYPE_CHECKING:
    import pandas as pd

_KINDS: Final = ("keypoint", "marker", "landmark", "joint", "point", "body_part", "bodypart")
NAMES: Final = (*_KINDS, *(f"{kind}_name" for kind in _KINDS), *(f"{kind}name" for kind in _KINDS), "name", "label")
"""Names of the column of points, in lower case."""
FRAMES: Final = ("timestamp", "time", "t", "frame", "frame_number", "frame_index")
"""Names of the column that all points of one frame have in common, in lower case; one without gaps is used."""
SETS: Final = ("model", "trajectory")
"""Names of columns that tell sets of points apart where a name is in several, in lower case."""
MOST_POINTS: Final = 2000


def point_column(frame: pd.DataFrame) -> str | None:
    """Return the column of the names of points, None for a table without."""
    from pandas.api.types import is_numeric_dtype

    known = {str(column).lower(): column for column in reversed(frame.columns.tolist())}
    return next((known[word] for word in NAMES if word in known and not is_numeric_dtype(frame[known[word]])), None)


def wide_points(frame: pd.DataFrame, log: ReadLog | None = None) -> pd.DataFrame | None:
    """Return a table with a row for each frame and columns `NAME_x`, `NAME_y`, `NAME_z`; None for other tables.

    A name that is in several sets of points at once is called `SET/NAME` in each. Of several rows of a point in one
    frame the first is used, which the log notes.

    >>> import pandas as pd
    >>> rows = [(at, name, 0.1, 0.2, 0.3) for at in (0, 1) for name in ("hip", "knee", "ankle", "toe")]
    >>> wide_points(pd.DataFrame(rows, columns=["frame", "keypoint", "x", "y", "z"])).columns.tolist()[:5]
    ['frame', 'ankle_x', 'ankle_y', 'ankle_z', 'hip_x']
    """
    known = {str(column).lower(): column for column in reversed(frame.columns.tolist())}
    name = point_column(frame)
    common = next((known[word] for word in FRAMES if word in known and frame[known[word]].notna().all()), None)
    if name is None or common is None or not {"x", "y", "z"} <= known.keys():
        return None
    points = frame[name].astype(str)
    if frame.assign(point=points).duplicated([common, "point"]).any():
        for column in [known[word] for word in reversed(SETS) if word in known]:
            points = frame[column].astype(str) + "/" + points
    if not LEAST_POINTS <= points.nunique() <= MOST_POINTS:
        return None
    columns = [known[axis] for axis in "xyz"]
    rows = frame.assign(point=points).drop_duplicates([common, "point"])
    if log is not None and len(rows) < len(frame):
        what = f"{len(frame) - len(rows)} of {len(frame)} rows repeat a point of their frame"
        log.warn(f"{what}; the first of each was used: add a column 'person' if they are of several people")
    wide = rows.pivot(index=common, columns="point", values=columns)
    order = [(column, point) for point in sorted(points.unique()) for column in columns]
    wide = wide.reindex(columns=order)
    wide.columns = [f"{point}_{'xyz'[columns.index(column)]}" for column, point in order]
    return wide.reset_index()
