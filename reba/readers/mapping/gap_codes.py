"""Numbers that writers put where they have no value: found before anything looks at ranges, and made NaN.

- a point at exactly (0, 0, 0), unless that is the origin of a body: there in every frame, with the others around it;
- a point with three equal coordinates of a code such as -9999 or -1, in any unit of length;
- a point with three equal coordinates that are farther away than any body;
- a point with a coordinate of such a code that is far from the other points, or one beyond a kilometre from them;
- a joint or an angle of exactly such a code. An angle of 0 is a value;
- an angle beyond 360 degrees: damaged. Joints have limits of their own, see `joints`.

Pose estimators, TRC files and C3D exports write zeros; spreadsheets and motion capture databases write -999 and -9999.
"""

from __future__ import annotations

import warnings
from collections import Counter
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array, Flags
from reba.posture.named_angles import LARGEST
from reba.posture.value_codes import CODES, coded
from reba.readers.recording.stream import Block, Kind, ReadLog, clip

SCALES: Final = (1.0, 0.1, 0.01, 0.001, 0.0254)
"""[m] Units of length in which a code may have been written; points are in metres here."""
_POINT_CODES: Final = np.unique([code * scale for code in CODES for scale in SCALES])
_MINUS_ONE: Final = [-scale for scale in SCALES]
"""[m] What some trackers write for a point that they do not see; a point at (1, 1, 1) is one."""
FARTHEST: Final = 1000.0
"""[m] From the origin along all three axes alike no body is: 1e6 mm, or the largest number of a type, is a code."""
REACH: Final = 3.0
"""[m] Along an axis, a point of a body is not farther than this from the middle of the others; a choice."""
MOST_NAMES: Final = 4
"""Names in a warning."""


def coded_points(points: Array) -> Flags:
    """Return which points (..., k, 3) [m] have coordinates of a code, or are far away.

    >>> coded_points(np.array([[-9.999, -9.999, -9.999], [-9.999, 1.0, 1.0], [0.5, 1, 1], [0.2, 1, 1.5]])).tolist()
    [True, True, False, False]
    """
    first = points[..., 0]
    equal = (points[..., 1] == first) & (points[..., 2] == first)
    if equal.any():
        value = first[equal]
        equal[equal] = _codes(value) | np.isin(value, _MINUS_ONE) | (np.abs(value) >= FARTHEST)
    return equal | _astray(points)


def _codes(values: Array) -> Flags:
    """Return which lengths [m] are codes in one of the units."""
    size = np.abs(values)
    at = np.clip(np.searchsorted(_POINT_CODES, size), 1, len(_POINT_CODES) - 1)
    nearest = np.minimum(np.abs(_POINT_CODES[at] - size), np.abs(_POINT_CODES[at - 1] - size))
    return np.asarray(nearest <= 1e-12 * np.maximum(size, 1.0))


def _astray(points: Array) -> Flags:
    """Return which points (..., k, 3) [m] have a coordinate of a code far from those of the others, or one very far."""
    result = np.zeros(points.shape[:-1], bool)
    if not points.size:
        return result
    # Only frames that are wider than a body, or whose first point may be a code as all others are, for speed.
    with np.errstate(invalid="ignore", over="ignore"):
        extent = np.fmax.reduce(points, axis=-2) - np.fmin.reduce(points, axis=-2)
    frames = ((extent > REACH) | _codes(points[..., 0, :])).any(axis=-1)
    if not frames.any():
        return result
    some = points[frames]
    code = _codes(some) & (np.abs(some) > REACH)
    with warnings.catch_warnings(), np.errstate(invalid="ignore"):
        warnings.simplefilter("ignore", RuntimeWarning)  # where every coordinate is a code, nothing is beside it
        beside = np.abs(some - np.nanmedian(np.where(code, np.nan, some), axis=-2, keepdims=True))
    result[frames] = ((code & ~(beside <= REACH)) | (beside >= FARTHEST)).any(axis=-1)
    return result


class GapCodes:
    """Makes the gap codes of a stream NaN, block by block, and counts them.

    The origin of a body is recognised in the first block; where it moves later, `is_consistent` asks for another pass.
    """

    def __init__(self, kind: Kind) -> None:
        self._kind = kind
        self._origins: set[str] | None = None
        self._moved: set[str] = set()
        self._counts: Counter[str] = Counter()
        self._damaged: Counter[str] = Counter()
        self._samples = 0

    def begin(self) -> None:
        """Start a pass over the recording."""
        self._counts.clear()
        self._damaged.clear()
        self._samples = 0

    def without(self, block: Block) -> Block:
        """Return a block with NaN for gap codes."""
        if self._kind == "frames":
            return block
        points = self._kind == "points"
        gaps = self._zeros(block) | coded_points(block.values) if points else coded(block.values)
        damaged = np.abs(block.values) > LARGEST if self._kind == "angles" else np.zeros_like(gaps)
        self._samples += len(block.time)
        if not (gaps.any() or damaged.any()):
            return block
        damaged &= ~gaps
        for counts, flags in ((self._counts, gaps), (self._damaged, damaged)):
            for at in np.flatnonzero(flags.any(axis=0)).tolist():
                counts[block.names[at]] += int(np.count_nonzero(flags[:, at]))
        gaps |= damaged
        values = block.values.copy()
        values[gaps] = np.nan
        return replace(block, values=values)

    def _zeros(self, block: Block) -> Flags:
        """Return the points (n, k) at zero that are not the origin of a body."""
        zeros = np.asarray((block.values == 0).all(axis=-1))
        if self._origins is None:
            self._origins = _origins(block, zeros)
        for at, name in enumerate(block.names):
            if name in self._origins:
                if zeros[:, at].all():
                    zeros[:, at] = False
                else:
                    self._moved.add(name)
        return zeros

    def is_consistent(self) -> bool:
        """Return whether every origin stayed where it is; the others are no origins in another pass."""
        moved, self._moved = self._moved, set()
        self._origins = (self._origins or set()) - moved
        return not moved

    def note(self, log: ReadLog) -> None:
        """Warn of the signals with gap codes, and of those with damaged angles."""
        if self._counts:
            kind = "(0, 0, 0) or a code such as -9999" if self._kind == "points" else "a code such as -999"
            log.warn(f"{kind} stands for no value: {self._named(self._counts)}")
        if self._damaged:
            log.warn(f"angles beyond {LARGEST:g} deg were left out as damaged: {self._named(self._damaged)}")

    def _named(self, counts: Counter[str]) -> str:
        names = [f"{clip(name)} {count}" for name, count in counts.most_common(MOST_NAMES)]
        more = f" and {len(counts) - MOST_NAMES} more" if len(counts) > MOST_NAMES else ""
        return f"{', '.join(names)}{more} of {self._samples} samples"


def _origins(block: Block, zeros: NDArray[np.bool_]) -> set[str]:
    """Return the points that are at zero in all samples, with other points on all sides of them."""
    always: Flags = np.logical_and.reduce(zeros, axis=0)
    if not len(zeros) or not always.any():
        return set()
    others = block.values[:, ~always]
    if not others.size or np.isnan(others).all():
        return set()
    low, high = np.nanmin(others, axis=(0, 1)), np.nanmax(others, axis=(0, 1))
    # The middle of the hips, about which a body is centred, has points above and below, before and behind it.
    return {name for name, at in zip(block.names, always, strict=True) if at and (low < 0).all() and (high > 0).all()}
