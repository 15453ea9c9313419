"""Angles from named data or arrays: the common entry of scores, models, pose files and live rows.

Data with names are read by name, in whatever order their columns stand; arrays by position. Every entry then makes the
same checks: numbers, finite, within the reach of a joint, and a warning where degrees look like radians.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final, Literal, get_args

import numpy as np
import pandas as pd

from reba.arrays import Array
from reba.checks import items_of, shown
from reba.errors import PostureError, RadiansWarning, did_you_mean, join_names, warn_user
from reba.posture.columns import ANGLES, COLUMNS, COLUMNS_OF, INDEX, SIDES
from reba.posture.factors import flag
from reba.posture.named_data import named_columns, refuse_doubtful_order

Absent = Literal["nan", "refuse"]
LARGEST: Final = 360.0
"""[deg] No angle of a posture is larger."""
RADIANS_BELOW: Final = 3.2
"""[deg] Angles that all lie below this are taken for radians: 3.2 rad is half a turn, and work in 3.2 deg is rare."""
RADIANS_ABOVE: Final = 0.01
"""[deg] Angles that all lie below this are a body at rest with rounding errors, not radians."""
RADIANS_POSES: Final = 10
"""Fewer poses may well be close to rest, all of them."""
RADIANS_OUTLIERS: Final = 0.02
"""Share of poses with larger angles that does not decide: damaged or coded values among thousands; a choice."""


def outliers_among(poses: int) -> int:
    """Return how many of some poses may have larger angles and still look like radians: a share, or one alone.

    >>> outliers_among(5), outliers_among(20), outliers_among(1000)
    (0, 1, 20)
    """
    return max(int(poses * RADIANS_OUTLIERS), int(poses >= RADIANS_POSES))


RADIANS_TEXT: Final = (
    f"nearly every angle lies within +-{RADIANS_BELOW}: these look like radians; expected degrees, "
    "convert with numpy.degrees"
)
RAISED: Final = tuple(f"shoulder_raised_{side}" for side in SIDES)
"""Boolean columns that may stand in for `shoulder_elevation_*`."""
_RAISED_OF: Final = dict(zip(COLUMNS_OF["shoulder_elevation"], RAISED, strict=True))
_ELEVATION: Final = next(angle for angle in ANGLES if angle.name == "shoulder_elevation")
_TILE: Final = 1000  # rows looked at together
_PLAIN: Final = (float, int, type(None))
_FLOAT: Final = np.dtype(np.float64)
_NO_NUMBERS: Final = {"b": "truth values", "c": "complex numbers", "m": "dates", "M": "dates"}


def angle_table(
    data: Any,
    columns: Sequence[str] = COLUMNS,
    *,
    absent: Absent = "nan",
    error: type[ValueError] = PostureError,
) -> Array:
    """Return angles as (n, d) float64 degrees, in the order of `columns`.

    Args:
        data: by name: a DataFrame, a Series, a mapping, a structured array, a table of Arrow or Polars, a list of
            mappings, a `PostureTable`, `Scores` or `dreba.Poses`; other columns are ignored, and a name without a side
            ("knee_flexion") stands for both. By position: anything else that NumPy reads as (n, d), or (d,) for one
            pose.
        columns: (d,) names.
        absent: "nan": a column that the data lack is not measured; "refuse": it is an error, and so is NaN.
        error: class of the errors.

    Raises:
        PostureError: values that are no numbers, another shape, infinite or beyond 360 deg, a misspelt name, a name
            that stands twice, or labels in doubtful order.

    Warns:
        RadiansWarning: ten poses or more of angles so small that they look like radians.

    Example:
        >>> angle_table({"knee_flexion": [30.0, 90.0]}, ("knee_flexion_left", "knee_flexion_right")).tolist()
        [[30.0, 30.0], [90.0, 90.0]]
    """
    names = items_of(columns)
    if names is None or not all(isinstance(name, str) for name in names):
        raise PostureError(f"columns are {shown(columns)}; expected names, such as reba.COLUMNS")
    if not (isinstance(absent, str) and absent in get_args(Absent)):
        raise PostureError(f"absent is {shown(absent)}; expected one of {', '.join(get_args(Absent))}")
    if not (isinstance(error, type) and issubclass(error, ValueError)):
        raise PostureError(f"error is {shown(error)}; expected a class of errors, such as reba.PostureError")
    return checked_poses(data, names, absent=absent, error=error)[0]


def checked_poses(
    data: Any,
    columns: Sequence[str] = COLUMNS,
    *,
    absent: Absent = "nan",
    error: type[ValueError] = PostureError,
) -> tuple[Array, bool]:
    """Return checked angles (n, d) and whether the data are a single pose; otherwise as `angle_table`."""
    angles, single = read_angles(data, columns, absent=absent, error=error)
    check_angles(angles, columns, complete=absent == "refuse", error=error)
    warn_if_radians(angles, columns)
    return angles, single


def flag_columns(data: Any) -> tuple[str, ...]:
    """Return the angle columns for which a yes-or-no column of the data stands in, such as `shoulder_raised_left`.

    >>> flag_columns({"trunk_flexion": [0.0], "shoulder_raised_left": [True]})
    ('shoulder_elevation_left',)
    """
    named = named_columns(data) or {}
    return tuple(
        column for column, flags in _RAISED_OF.items() if flags in named and not {column, _both(column)} & named.keys()
    )


def read_angles(
    data: Any, columns: Sequence[str], *, absent: Absent = "nan", error: type[ValueError] = PostureError
) -> tuple[Array, bool]:
    """Return angles (n, d) before the checks of their size, and whether the data are a single pose; as `checked_poses`.

    An array of the right type and shape is not copied.
    """
    if type(data) is np.ndarray and data.dtype == np.float64:  # called 1e5 times by optimisers
        if data.ndim == 2 and data.shape[1] == len(columns):
            return data, False
        if data.ndim == 1 and len(data) == len(columns):
            return data[None], True
    if isinstance(data, pd.DataFrame) and tuple(data.columns) == tuple(columns) and set(data.dtypes) == {_FLOAT}:
        return np.ascontiguousarray(data.to_numpy()), False
    named = named_columns(data)
    if named is None:
        return _by_position(data, columns, error)
    return _by_name(named, columns, absent, error)


def _by_position(data: Any, columns: Sequence[str], error: type[ValueError]) -> tuple[Array, bool]:
    refuse_doubtful_order(data, error)
    try:
        angles = np.asarray(_numeric(_unmasked(data)), np.float64)
    except (TypeError, ValueError, OverflowError) as cause:
        raise error(f"angles hold a value that is not a number ({cause}); expected degrees") from cause
    single = angles.ndim == 1
    if single:
        angles = angles[None]
    if angles.ndim != 2 or angles.shape[1] != len(columns):
        order = "reba.COLUMNS" if tuple(columns) == COLUMNS else join_names(list(columns), 3)
        raise error(
            f"angles have shape {np.shape(data)}; expected (n, {len(columns)}) or ({len(columns)},) degrees in the "
            f"order of {order}, or data with column names"
        )
    return angles, single


def _by_name(
    named: dict[str, Any], columns: Sequence[str], absent: Absent, error: type[ValueError]
) -> tuple[Array, bool]:
    sources = {column: column if column in named else _both(column) for column in columns}
    values = {column: named[name] for column, name in sources.items() if name in named}
    raised = {column: named[name] for column, name in _RAISED_OF.items() if column in columns and name in named}
    missing = [column for column in columns if column not in values and column not in raised]
    check_spelling(named, missing, error)
    if not values and not raised:
        listed = ", ".join(list(named)[:6]) or "none"
        raise error(f"no angle column among: {listed}; expected some of {', '.join(columns[:3])}, ...")
    if missing and absent == "refuse":
        raise error(f"the table has no column {missing[0]!r}; expected {', '.join(columns)}")
    lengths = {column: len(value) for column, value in (values | raised).items() if _has_rows(value)}
    numbers = {column: column_numbers(column, value, error) for column, value in values.items()}
    n = max(lengths.values(), default=1)
    angles = np.full((n, len(columns)), np.nan)
    for index, column in enumerate(columns):
        if column in numbers:
            if len(numbers[column]) not in (1, n):
                raise error(f"column {column} has {len(numbers[column])} values; expected one or {n}")
            angles[:, index] = numbers[column]
        if column in raised:
            flags = flag(_RAISED_OF[column], raised[column], n)
            elevation = np.where(flags, _ELEVATION.worst, _ELEVATION.best)
            angles[:, index] = np.where(np.isnan(angles[:, index]), elevation, angles[:, index])
    return angles, not lengths


def _has_rows(value: Any) -> bool:
    return isinstance(value, list | tuple | pd.Series) or np.ndim(value) > 0


def _both(column: str) -> str:
    """Return the name without a side that stands for a column of either side."""
    name, _, side = column.rpartition("_")
    return name if side in SIDES else column


def angle_columns(named: Mapping[str, Any], error: type[ValueError] = PostureError) -> tuple[str, ...]:
    """Return the columns that named data give, in the order of `COLUMNS`; none where no name is one of a posture.

    Raises:
        PostureError: a misspelt name.
    """
    given = tuple(c for c in COLUMNS if c in named or _both(c) in named or _RAISED_OF.get(c) in named)
    if given:
        check_spelling(named, [column for column in COLUMNS if column not in given], error)
    return given


def check_spelling(names: Iterable[str], missing: Sequence[str], error: type[ValueError]) -> None:
    """Refuse a name that no column has and that is nearly the name of a missing one."""
    known = {*COLUMNS, *COLUMNS_OF, *RAISED}
    for name in names if missing else ():
        if name not in known and (hint := did_you_mean(name, missing)):
            raise error(f"column {name!r} is unknown{hint}")


def column_numbers(name: str, values: Any, error: type[ValueError] = PostureError) -> Array:
    """Return one column as (n,) floats: texts as numbers, missing values as NaN; dates and complex numbers fail."""
    expected = "seconds" if name == "time" else "degrees"
    if isinstance(values, pd.DataFrame):
        raise error(f"column {name} stands {values.shape[1]} times; keep one of them")
    try:
        if isinstance(values, list) and all(type(value) in _PLAIN for value in values):
            return np.array(values, np.float64)
        series = values if isinstance(values, pd.Series) else pd.Series(np.atleast_1d(np.asarray(_unmasked(values))))
        return pd.to_numeric(_numeric(series)).to_numpy(np.float64, na_value=np.nan)
    except (TypeError, ValueError, OverflowError) as cause:
        raise error(f"column {name} holds a value that is not a number ({cause}); expected {expected}") from cause


def _unmasked(data: Any) -> Any:
    """Return data with NaN in masked places."""
    if isinstance(data, np.ma.MaskedArray):
        return np.where(np.ma.getmaskarray(data), np.nan, np.ma.getdata(data))
    return data


def _numeric(data: Any) -> Any:
    """Return data as an array or a Series; TypeError for what NumPy would turn into numbers that are no angles."""
    array = data if isinstance(data, pd.Series) else np.asarray(data)
    if array.dtype.kind in _NO_NUMBERS:
        raise TypeError(_NO_NUMBERS[array.dtype.kind])
    return array


def check_angles(
    angles: Array, columns: Sequence[str] = COLUMNS, *, complete: bool = False, error: type[ValueError] = PostureError
) -> None:
    """Check that angles (n, d) are finite and, of postures, at most `LARGEST`; NaN only unless they are `complete`.

    Raises:
        PostureError: infinity, an angle that no body has, or NaN where every angle is needed.
    """
    # One comparison serves all: NaN and infinity fail it as well.
    if not angles.size or abs(angles).max() <= LARGEST:
        return
    if complete and not np.isfinite(angles).all():
        raise error("angles hold NaN or infinity; a surrogate needs every angle, leave such poses out")
    refuse_infinite(angles, columns=columns, error=error)
    if all(column in INDEX for column in columns):  # other columns may hold anything
        refuse_large(angles, columns=columns, what="in pose" if complete else "at frame", error=error)


def refuse_infinite(
    angles: Array,
    start: int = 0,
    columns: Sequence[str] = COLUMNS,
    error: type[ValueError] = PostureError,
) -> None:
    """Raise an error where angles (n, d) are infinite; `start` is the number of their first frame."""
    infinite = np.isinf(angles)
    if infinite.any():
        frame, column = np.argwhere(infinite)[0]
        raise error(f"{columns[column]} is infinite at frame {start + frame}; expected degrees, or NaN if not measured")


def refuse_large(
    angles: Array,
    start: int = 0,
    columns: Sequence[str] = COLUMNS,
    what: str = "at frame",
    error: type[ValueError] = PostureError,
) -> None:
    """Raise an error where angles (n, d) are larger than `LARGEST`."""
    large = abs(angles) > LARGEST
    if large.any():
        frame, column = np.argwhere(large)[0]
        raise error(
            f"{columns[column]} is {angles[frame, column]:.6g} {what} {start + frame}; expected degrees from "
            f"-{LARGEST:g} to {LARGEST:g}, so check the unit or leave it out"
        )


def look_like_radians(angles: Array | Iterable[Array], poses: int | None = None) -> bool:
    """Return whether angles (n, d) of postures look like radians.

    At least `RADIANS_POSES` poses, all but `outliers_among` them within `RADIANS_BELOW`, one beyond `RADIANS_ABOVE`.
    The angle that stands for a raised shoulder, given as yes or no, tells no unit.

    Args:
        angles: (n, d), or blocks of them.
        poses: n, of blocks.

    >>> look_like_radians(np.full((50, 22), 0.4)), look_like_radians(np.full((50, 22), 20.0))
    (True, False)
    """
    n = len(angles) if isinstance(angles, np.ndarray) else poses or 0
    if n < RADIANS_POSES:
        return False
    allowed, beyond, largest = outliers_among(n), 0, 0.0
    for block in [angles] if isinstance(angles, np.ndarray) else angles:
        for start in range(0, len(block), _TILE):
            tile = abs(block[start : start + _TILE])
            of_pose = np.fmax.reduce(tile, axis=1, initial=0.0)
            if (large := of_pose >= RADIANS_BELOW).any():
                without_flags = np.where(tile[large] == _ELEVATION.worst, 0.0, tile[large])
                of_pose[large] = np.fmax.reduce(without_flags, axis=1, initial=0.0)
                large = of_pose >= RADIANS_BELOW
            beyond += int(np.count_nonzero(large))
            if beyond > allowed:
                return False
            largest = max(largest, float(np.max(of_pose[~large], initial=0.0)))
    return largest > RADIANS_ABOVE


def warn_if_radians(angles: Array, columns: Sequence[str] = COLUMNS) -> None:
    """Warn if the angles (n, d) of posture columns look like radians.

    Warns:
        RadiansWarning: they do.
    """
    if look_like_radians(angles) and all(column in INDEX for column in columns):
        warn_user(RADIANS_TEXT, RadiansWarning)
