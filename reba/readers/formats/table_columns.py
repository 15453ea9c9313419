"""Columns of tables: units behind their names or in a row below them, and names that are coordinates of points."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Final

from reba.arrays import Array
from reba.errors import join_names
from reba.posture.columns import COLUMNS, COLUMNS_OF, SIDES
from reba.readers.formats.lengths import METRES, metres_by_size
from reba.readers.recording.stream import ReadLog, clip

if TYPE_CHECKING:
    import pandas as pd

DEGREES: Final[Mapping[str, float]] = {
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "°"), 1.0),
    **dict.fromkeys(("rad", "rads", "radian", "radians"), math.degrees(1.0)),
}
"""Units of angles [deg]."""
KILOGRAMS: Final[Mapping[str, float]] = {
    **dict.fromkeys(("kg", "kgs", "kilogram", "kilograms", "kgf"), 1.0),
    **dict.fromkeys(("g", "gram", "grams"), 1e-3),
    **dict.fromkeys(("n", "newton", "newtons"), 1 / 9.80665),
    **dict.fromkeys(("lb", "lbs", "pound", "pounds", "lbf"), 0.45359237),
}
"""Units of loads [kg]; forces as the weight of a mass."""
TIMES: Final = frozenset({"s", "sec", "secs", "second", "seconds", "ms", "us", "ns", "min", "h"})
PLAIN: Final = frozenset({"-", "1", "bool"})
"""Units of columns that are neither angles nor lengths, times nor loads."""
_COLUMNS: Final = frozenset((*COLUMNS, *COLUMNS_OF))
LEAST_POINTS: Final = 4
"""Fewer names with three coordinates are no body."""
_AXIS = re.compile(r"(?P<name>.+?)(?P<gap>[_.:/ -]?[\[(]?)(?P<axis>[xyzXYZ])[\])]?")
_AXIS_FIRST = re.compile(r"(?P<axis>[xyzXYZ])(?P<gap>[_.:/ -]|(?=\d+$))(?P<name>.+)")
_NUMBERED = re.compile(r"(?P<stem>.*?)(?P<number>\d+)")


def is_unit(text: str) -> bool:
    """Return whether a text is a unit of a column.

    >>> [is_unit(text) for text in ("deg", " [m/s]", "(rad)", "12.5")]
    [True, False, True, False]
    """
    return text.strip(" ()[]").lower() in {*DEGREES, *METRES, *TIMES, *KILOGRAMS, *PLAIN}


def _split_unit(column: str) -> tuple[str, str]:
    """Return a name and the unit in brackets behind it, "" without one.

    >>> _split_unit("trunk flexion [deg]"), _split_unit("a (b)"), _split_unit("(deg)")
    (('trunk flexion', 'deg'), ('a (b)', ''), ('(deg)', ''))
    """
    text = column.rstrip()
    if not text.endswith((")", "]")):
        return column, ""
    name = text[: max(text.rfind("("), text.rfind("["))].rstrip()
    unit = text[len(name) :].strip(" ()[]").lower()
    return (name, unit) if name and is_unit(unit) else (column, "")


def is_column(text: str) -> bool:
    """Return whether a text names a column of a posture table, also with a unit or a name without a side.

    >>> is_column("Trunk Flexion (deg)"), is_column("knee_flexion"), is_column("Trunk")
    (True, True, False)
    """
    return _underscored(_split_unit(text)[0]) in _COLUMNS


def _underscored(name: str) -> str:
    return re.sub(r"[ -]+", "_", name.lower())


def named_units(frame: pd.DataFrame, known: Iterable[str]) -> tuple[pd.DataFrame, dict[str, str]]:
    """Return a table without units in its names or in a first row of units, and the unit of each column that has one.

    A name that is one of the `known` but for case and blanks gets their spelling.
    """
    spelling = {name.lower(): name for name in known}
    names, units = [], {}
    for column in map(str, frame.columns):
        name, unit = _split_unit(column)
        # A unit of time stays: the time column is recognised by it.
        name = column if unit in TIMES else spelling.get(_underscored(name), name)
        names.append(name)
        if unit:
            units[name] = unit
    if len(set(names)) < len(names):
        return frame, {}
    frame = frame.set_axis(names, axis=1)
    if len(frame) > 1:
        first = {name: str(frame[name].iloc[0]) for name in names if isinstance(frame[name].iloc[0], str)}
        if len(first) == len(names) and all(map(is_unit, first.values())):
            units |= {name: text.strip(" ()[]").lower() for name, text in first.items()}
            rows = frame.iloc[1:].reset_index(drop=True)
            # Names of times state their unit, see `time_column`.
            renamed = {name: f"{name}_{units[name]}" for name in names if units[name] in TIMES and "[" not in name}
            return rows.rename(columns=renamed), units
    return frame, units


LIKE: Final = 0.8
"""Similarity (`difflib`) from which a name is offered for another one; a choice."""
_SHORT: Final = {"l": "left", "r": "right", "lt": "left", "rt": "right", "flex": "flexion", "abd": "abduction"}


def _words(name: str) -> str:
    """Return the words of a name in alphabetical order, without units: `KneeFlexion_L (deg)` -> "flexion knee left"."""
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", name)
    words = (_SHORT.get(part.lower(), part.lower()) for part in parts)
    return " ".join(sorted(word for word in words if word not in {*DEGREES, "angle"}))


def near_names(columns: Iterable[str], known: Iterable[str]) -> str:
    """Return which columns have almost a known name, as a sentence, "" if none has.

    >>> near_names(["trunk_flex", "Left Knee Flexion", "heart_rate"], ["trunk_flexion", "knee_flexion_left"])
    "'trunk_flex' (did you mean 'trunk_flexion'?) and 'Left Knee Flexion' (did you mean 'knee_flexion_left'?)"
    """
    names = {_words(name): name for name in known}
    offers = []
    for column in columns:
        if near := difflib.get_close_matches(_words(column), names, n=1, cutoff=LIKE):
            offers.append(f"{clip(column)} (did you mean '{names[near[0]]}'?)")
    return join_names(offers, MOST_OFFERED)


MOST_OFFERED: Final = 6
"""Names that are offered in one line."""


def coordinates(names: Iterable[str]) -> dict[str, tuple[str, str, str]]:
    """Return point -> columns of its x, y and z, for names with all three, in the order of the columns.

    >>> coordinates(["hip_x", "hip_y", "hip_z", "Knee.X", "Knee.Y", "Knee.Z", "time"])
    {'hip': ('hip_x', 'hip_y', 'hip_z'), 'Knee': ('Knee.X', 'Knee.Y', 'Knee.Z')}
    """
    axes: dict[tuple[str, str], dict[str, str]] = {}
    for name in names:
        if match := _axis(name):
            axes.setdefault((match["name"], match["gap"]), {})[match["axis"].lower()] = name
    return {
        point: (columns["x"], columns["y"], columns["z"])
        for (point, _), columns in axes.items()
        if set(columns) == {"x", "y", "z"}
    }


LANDMARKS: Final = (
    *("nose", "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer"),
    *("left_ear", "right_ear", "mouth_left", "mouth_right"),
    *(f"{side}_{name}" for name in ("shoulder", "elbow", "wrist", "pinky", "index", "thumb") for side in SIDES),
    *(f"{side}_{name}" for name in ("hip", "knee", "ankle", "heel", "foot_index") for side in SIDES),
)
"""Points of MediaPipe's pose (BlazePose) in their order; no other set in use has 33."""


def numbered_landmarks(points: Iterable[str]) -> dict[str, str]:
    """Return point -> its name in MediaPipe's pose, where points are numbered from 0 to 32 or from 1 to 33.

    Of another count nothing says which is which.

    >>> numbered_landmarks(f"landmark_{number}" for number in range(33))["landmark_11"]
    'left_shoulder'
    >>> numbered_landmarks(f"{number}" for number in range(17))
    {}
    """
    matches = [(match["stem"], int(match["number"]), name) for name in points if (match := _NUMBERED.fullmatch(name))]
    numbers = sorted(number for _, number, _ in matches)
    first = numbers[0] if numbers else 0
    if len({stem for stem, _, _ in matches}) != 1 or first not in (0, 1):
        return {}
    if numbers != list(range(first, first + len(LANDMARKS))):
        return {}
    return {name: LANDMARKS[number - first] for _, number, name in matches}


def _axis(name: str) -> re.Match[str] | None:
    """Return the point and the axis in a name of a column, None without an axis."""
    return _AXIS.fullmatch(name) or _AXIS_FIRST.fullmatch(name)


def without_depth(names: Iterable[str]) -> int:
    """Return how many points have an x and a y and no z.

    >>> without_depth(["hip_x", "hip_y", "knee_x", "knee_y", "knee_z"])
    1
    """
    axes: dict[str, set[str]] = {}
    for name in names:
        if match := _axis(name):
            axes.setdefault(match["name"], set()).add(match["axis"].lower())
    return sum(letters == {"x", "y"} for letters in axes.values())


def metres_of(points: Array, units: set[str], log: ReadLog) -> float:
    """Return the unit of length [m] of points (n, k, 3): the one that is named, else by the extent of the body."""
    named = {METRES[unit] for unit in units if unit in METRES}
    return named.pop() if len(named) == 1 else metres_by_size(points, log, "m")
