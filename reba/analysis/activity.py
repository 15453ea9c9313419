"""Activity from the movement itself: static, repeated, and rapid large changes of posture.

The paper gives three points (Hignett & McAtamney 2000): "1 or more body parts are static, e.g. held for longer than
1 min"; "repeated small range actions, e.g. repeated more than 4 times per minute (not including walking)"; "action
causes rapid large range changes in postures or an unstable base". What these mean for a signal is defined here, with
every threshold a field of `Rules`:

- static: all measured angles of one part stay within a band of `static_range` degrees for longer than
  `static_seconds`; every frame of such an interval counts.
- repeated: an angle of one part turns back by at least `repeated_min` degrees again and again, by movements of at most
  `repeated_max` degrees, and completes more than `repeated_per_minute` back-and-forth movements (two each)
  within one minute; every frame from the first to the last of them counts. Walking is left out: intervals in
  which the difference of the knees alternates with at least `gait_per_minute` strides a minute.
- unstable: an angle of trunk, neck, upper arm or (not walking) legs changes by more than `rapid_range` degrees within
  `rapid_seconds`; every frame of such a window counts. An unstable base cannot be seen in angles: the caller gives it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise

import numpy as np

from reba.arrays import Array, Flags
from reba.method.rules import Rules
from reba.posture.columns import INDEX, PART_COLUMNS, SIDES

RAPID_PARTS = ("trunk", "neck", "legs", "upper_arm_left", "upper_arm_right")
"""Parts whose rapid change is a change of posture; hands and forearms move fast in ordinary work."""
GRID_HZ = 20.0
"""[Hz] Signals are resampled to a regular grid of at most this rate: work movements end below 5 Hz."""
MAX_GAP = 0.5
"""[s] Samples further apart than this are not joined."""
GAIT_CHANGE = 20.0
"""[deg] The difference of the knees changes at least this far in a step."""
GAIT_MIN_STEPS = 3
"""Alternations of the knees in a row that make an interval walking."""


@dataclass(frozen=True)
class Activity:
    """Activity of n frames, each kind as (n,) booleans.

    `causes` has for each kind the parts that caused it and the share of frames in which they did.
    """

    static: Flags
    repeated: Flags
    unstable: Flags
    causes: dict[str, dict[str, float]] = field(default_factory=dict)


def detect(
    time: Array,
    angles: Array | Callable[[str], Array],
    rules: Rules,
    walking: Flags | None = None,
    seams: Sequence[float] = (),
) -> Activity:
    """Return the activity of a recording at (n,) increasing times [s].

    Args:
        angles: (n, 22) [deg], NaN = not measured; or a function from the name of a column to its (n,) angles.
        walking: (n,) frames known to be walking; gait seen in the knees is added to them.
        seams: times [s] across which no posture is held and no movement repeated: the clock restarted there.

    Example:
        >>> import numpy as np
        >>> time = np.arange(0.0, 90.0, 0.1)
        >>> bool(detect(time, np.zeros((900, 22)), Rules()).static.all())
        True
        >>> bool(detect(time, np.zeros((900, 22)), Rules(), seams=[45.0]).static.any())
        False
    """
    column = angles if callable(angles) else lambda name: angles[:, INDEX[name]]
    cuts = [0, *np.searchsorted(time, np.asarray(seams, np.float64)).tolist(), len(time)]
    parts = [slice(start, stop) for start, stop in pairwise(cuts) if stop > start]
    if len(parts) <= 1:
        return _detect(time, column, rules, walking)
    activities = [
        _detect(time[at], partial(_cut, column, at), rules, None if walking is None else walking[at]) for at in parts
    ]
    causes: dict[str, dict[str, float]] = {}
    for one in activities:
        for kind, shares in one.causes.items():
            total = causes.setdefault(kind, {})
            for name, share in shares.items():
                total[name] = total.get(name, 0.0) + share * len(one.static) / len(time)
    static, repeated, unstable = (
        np.concatenate([getattr(one, kind) for one in activities]) for kind in ("static", "repeated", "unstable")
    )
    return Activity(static, repeated, unstable, causes)


def _cut(column: Callable[[str], Array], part: slice, name: str) -> Array:
    return column(name)[part]


def _detect(time: Array, column: Callable[[str], Array], rules: Rules, walking: Flags | None) -> Activity:
    n = len(time)
    none = Activity(np.zeros(n, bool), np.zeros(n, bool), np.zeros(n, bool))
    if n < 2 or not time[-1] > time[0]:
        return none
    grid = _Grid(time)
    left, right = (grid.sample(column(f"knee_flexion_{side}")) for side in SIDES)
    gait = _gait(left - right, rules, grid)
    if walking is not None:
        gait |= grid.flags(walking)
    kinds: dict[str, dict[str, Flags]] = {"static": {}, "repeated": {}, "unstable": {}}
    for part, names in PART_COLUMNS.items():
        # One part at a time is in memory.
        signals = [grid.sample(column(name)) for name in names]
        measured = [signal for signal in signals if not np.isnan(signal).all()]
        if not measured:
            continue
        kinds["static"][part] = _static(measured, rules, grid.hz)
        kinds["repeated"][part] = np.logical_or.reduce([_repeated(s, rules, grid.hz) for s in measured]) & ~gait
        if part in RAPID_PARTS:
            rapid = np.logical_or.reduce([_rapid(s, rules, grid.hz) for s in measured])
            kinds["unstable"][part] = rapid & ~gait if part == "legs" else rapid
    at_frames = {kind: {part: grid.frames(flags) for part, flags in parts.items()} for kind, parts in kinds.items()}
    any_part = {kind: np.logical_or.reduce([none.static, *parts.values()]) for kind, parts in at_frames.items()}
    causes = {
        kind: {part: float(flags.mean()) for part, flags in parts.items() if flags.any()}
        for kind, parts in at_frames.items()
    }
    return Activity(any_part["static"], any_part["repeated"], any_part["unstable"], causes)


class _Grid:
    """A regular time grid over a recording, with resampling to it and back."""

    def __init__(self, time: Array) -> None:
        step = float(np.median(np.diff(time), overwrite_input=True))
        self.hz = GRID_HZ if step <= 0 else min(GRID_HZ, 1.0 / step)
        # A clock that jumps far ahead must not make a huge grid: time is counted without its long gaps.
        longest = max(10 * MAX_GAP, 2 * step)
        gaps = np.maximum(np.diff(time) - longest, 0.0)
        self.time = time - np.concatenate([[0.0], np.cumsum(gaps)]) if gaps.any() else time
        size = int(np.floor((self.time[-1] - self.time[0]) * self.hz)) + 1
        self.points = self.time[0] + np.arange(size) / self.hz
        nearest = np.rint((self.time - self.time[0]) * self.hz).astype(np.int32)
        self.nearest = np.clip(nearest, 0, size - 1, out=nearest)

    def sample(self, column: Array) -> Array:
        """Return the column on the grid, NaN where no sample is near."""
        known = ~np.isnan(column)
        if not known.any():
            return np.full(len(self.points), np.nan)
        time, column = (self.time, column) if known.all() else (self.time[known], column[known])
        values = np.interp(self.points, time, column)
        after = np.clip(np.searchsorted(time, self.points), 1, max(len(time) - 1, 1))
        before = time[np.minimum(after - 1, len(time) - 1)]
        after_time = time[np.minimum(after, len(time) - 1)]
        limit = max(MAX_GAP, 1.5 / self.hz)
        in_gap = (after_time - before > limit) & (self.points > before + 1e-9) & (self.points < after_time - 1e-9)
        outside = (self.points < time[0] - limit) | (self.points > time[-1] + limit)
        values[in_gap | outside] = np.nan
        return values

    def frames(self, flags: Flags) -> Flags:
        """Return grid flags at the frames."""
        return flags[self.nearest]

    def flags(self, frames: Flags) -> Flags:
        """Return frame flags on the grid."""
        grid = np.zeros(len(self.points), bool)
        grid[self.nearest[frames]] = True
        return grid


def _static(signals: list[Array], rules: Rules, hz: float) -> Flags:
    window = int(np.floor(rules.static_seconds * hz + 1e-6)) + 2
    if window > len(signals[0]):
        return np.zeros(len(signals[0]), bool)
    # NaN makes the range of a window NaN, and NaN <= band is False: an interval with a gap is not static.
    held = np.logical_and.reduce([_range(signal, window) <= rules.static_range for signal in signals])
    return _cover(held, window)


def _rapid(signal: Array, rules: Rules, hz: float) -> Flags:
    window = int(np.floor(rules.rapid_seconds * hz + 1e-9)) + 1
    if not 2 <= window <= len(signal):
        return np.zeros(len(signal), bool)
    return _cover(_range(signal, window) > rules.rapid_range, window)


def _repeated(signal: Array, rules: Rules, hz: float) -> Flags:
    flags = np.zeros(len(signal), bool)
    movements = [
        s
        for s in turning_movements(signal, rules.repeated_min)
        if abs(signal[s[1]] - signal[s[0]]) <= rules.repeated_max
    ]
    if not movements:
        return flags
    starts, ends = np.array(movements).T
    last = np.searchsorted(ends, starts + 60.0 * hz, side="right")
    for first in np.flatnonzero((last - np.arange(len(starts))) / 2 > rules.repeated_per_minute):
        flags[starts[first] : ends[last[first] - 1] + 1] = True
    return flags


def _gait(difference: Array, rules: Rules, grid: _Grid) -> Flags:
    """Return the walking in the difference of the knees, left minus right, on the grid."""
    flags = np.zeros(len(difference), bool)
    longest = 30.0 * grid.hz / rules.gait_per_minute if rules.gait_per_minute > 0 else 0.0
    run: list[tuple[int, int]] = []
    for start, end in [*turning_movements(difference, GAIT_CHANGE), (-1, -1)]:
        joined = end - start <= longest and (not run or start == run[-1][1])
        if start < 0 or not joined:
            if len(run) >= GAIT_MIN_STEPS:
                flags[run[0][0] : run[-1][1] + 1] = True
            run = []
        if start >= 0 and end - start <= longest:
            run.append((start, end))
    return flags


def turning_movements(signal: Array, least: float) -> Iterator[tuple[int, int]]:
    """Yield (start, end) of movements between turning points that turn back by at least `least`.

    The last movement counts once it is at least as large, whether or not it has turned back. NaN is passed over.
    """
    known = np.flatnonzero(~np.isnan(signal))
    if len(known) < 2:
        return
    # Only local extremes can be turning points.
    slope = np.sign(np.diff(signal[known]))
    turning = np.concatenate([[True], slope[1:] != slope[:-1], [True]])
    places = known[turning].tolist()
    values = signal[known[turning]].tolist()
    low = high = pivot = 0
    direction = 0
    for i in range(1, len(values)):
        if direction >= 0 and values[i] > values[high]:
            high = i
        if direction <= 0 and values[i] < values[low]:
            low = i
        if direction >= 0 and values[high] - values[i] >= least:
            if direction > 0 or values[high] - values[pivot] >= least:
                yield places[pivot], places[high]
            pivot, low, direction = high, i, -1
        elif direction <= 0 and values[i] - values[low] >= least:
            if direction < 0 or values[pivot] - values[low] >= least:
                yield places[pivot], places[low]
            pivot, high, direction = low, i, 1
    end = high if direction > 0 else low
    if direction != 0 and abs(values[end] - values[pivot]) >= least:
        yield places[pivot], places[end]


def _range(signal: Array, window: int) -> Array:
    """Return max - min of every window, (len - window + 1,); windows are built by doubling."""
    return _rolling(signal, window, np.maximum) - _rolling(signal, window, np.minimum)


def _rolling(signal: Array, window: int, pick: np.ufunc) -> Array:
    size, level = 1, signal
    while size * 2 <= window:
        level = pick(level[:-size], level[size:])
        size *= 2
    rest = window - size
    result: Array = level if rest == 0 else pick(level[: len(level) - rest], level[rest:])
    return result


def _cover(windows: Flags, window: int) -> Flags:
    """Return which samples lie in any flagged window; flag i stands for samples i to i + window - 1."""
    edges = np.zeros(len(windows) + window, np.int64)
    edges[: len(windows)] += windows
    edges[window:] -= windows
    return np.cumsum(edges[:-1]) > 0
