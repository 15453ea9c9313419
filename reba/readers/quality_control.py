"""Quality control of angles: gaps, frozen frames, outliers, constant and impossible columns, signs, neutral posture."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from reba.arrays import Array, Flags
from reba.checks import shown
from reba.errors import RebaError, join_names
from reba.posture.columns import COLUMNS, COLUMNS_OF, INDEX, SIDES
from reba.readers.column_statistics import ColumnStatistics
from reba.readers.mapping import Mapper, Samples
from reba.readers.mapping.joints import MOST_NAMES
from reba.readers.recording.profile import Profile
from reba.readers.recording.stream import Kind

GAP = 0.2
"""[s] An interval without samples is a gap if it is longer than this and than `PERIODS` sample periods."""
PERIODS = 5.0
FIRST_FRAME_JUMP = 20.0
"""[deg] A first frame that differs by more from the second is an outlier, if the next steps are smaller."""
FROZEN = 0.5
"""[s] Longer intervals of exactly equal frames are reported."""
LINKED: tuple[tuple[str, ...], ...] = (
    ("neck_flexion", "neck_side_bend", "neck_twist"),
    *((f"wrist_flexion_{side}", f"wrist_deviation_{side}", f"wrist_twist_{side}") for side in SIDES),
)
"""Columns of one segment frame: if one of them is impossible, the frame is wrong and with it the others."""
NEVER_BELOW = 60.0
STRAIGHT_BEYOND = 150.0
"""[deg] A knee or elbow that stays above the first and comes beyond the second is not bent but counts from 180."""
CONSTANT = 1e-6
"""[deg] Frames and markers always carry noise; a column with a smaller range was not measured."""


def median_rate(time: Array) -> float:
    """Return the median sampling rate [Hz] of (n,) times [s], NaN for fewer than two samples."""
    steps = np.diff(time)
    if not (steps > 0).all():
        steps = steps[steps > 0]
    # Times are decimal fractions: without rounding 25 Hz would read 25.000000000000533.
    return float(f"{1.0 / np.median(steps, overwrite_input=True):.9g}") if len(steps) else float("nan")


def find_gaps(time: Array) -> tuple[tuple[float, float], ...]:
    """Return (start, end) [s] of the gaps in (n,) times [s].

    >>> find_gaps(np.array([0.0, 0.01, 0.02, 0.5, 0.51]))
    ((0.02, 0.5),)
    """
    steps = np.diff(time)
    if not len(steps):
        return ()
    long = np.flatnonzero(steps > max(GAP, PERIODS / median_rate(time) if np.any(steps > 0) else GAP))
    return tuple((float(time[index]), float(time[index + 1])) for index in long)


def first_frame_is_outlier(angles: Array) -> bool:
    """Return whether the first of (n, 22) frames [deg] is an outlier (a T-pose, or zeros): only its step is large."""
    if len(angles) < 3:
        return False
    steps = np.abs(np.diff(angles[:12], axis=0))
    steps = np.minimum(steps, 360.0 - steps)
    with np.errstate(invalid="ignore"):
        first, later = np.nan_to_num(steps[0]), np.nan_to_num(steps[1:]).max(axis=0)
    return bool(np.any((first > FIRST_FRAME_JUMP) & (first > 3.0 * later)))


def constant_columns(seen: ColumnStatistics, seconds: float, kind: str, dummies: Mapping[str, float]) -> dict[str, str]:
    """Return the constant columns that count as not measured -> the reason; others must change.

    Args:
        seconds: duration; up to 1 s every column counts as measured.
        kind: of the stream; constant joints at another value than 0 may be real and stay.
        dummies: column -> the value [deg] of a joint that is not measured.
    """
    if seconds <= 1.0 or seen.frames < 3:
        return {}
    known, low, high = seen.known > 0, seen.low, seen.high
    with np.errstate(invalid="ignore"):
        constant = known & (high - low <= CONSTANT)
        near = 1.0 if kind == "frames" else CONSTANT
        unmeasured = constant & (np.abs(high) <= near)
    if kind == "frames":
        # A hand that bends in the wrist is measured, also where it bends in one direction only; a mere twist is not.
        for side in SIDES:
            at = [INDEX[f"wrist_{angle}_{side}"] for angle in ("flexion", "deviation")]
            unmeasured[at] &= not (known & ~constant)[at].any()
    for column, value in dummies.items():
        if column in INDEX:
            unmeasured[INDEX[column]] |= constant[INDEX[column]] and abs(high[INDEX[column]] - value) < 0.01
    if not np.any(known & ~constant):
        return {}
    return {COLUMNS[index]: f"constant {round(float(high[index]), 3) + 0.0:g}" for index in np.flatnonzero(unmeasured)}


def equal_frames(angles: Array) -> Flags:
    """Return (n - 1,) whether a frame of angles (n, 22) is exactly the one before; NaN equals anything before it.

    A frame without any value is none: that is a gap.
    """
    at = np.arange(len(angles) - 1)
    for column in angles.T:  # most frames differ from the one before in the first measured column
        later = column[at + 1]
        at = at[(later == column[at]) | np.isnan(later)]
    at = at[~np.isnan(angles[at + 1]).all(axis=1)]
    same = np.zeros(max(len(angles) - 1, 0), bool)
    same[at] = True
    return same


def frozen_warning(time: Array, same: Flags) -> str | None:
    """Return a warning about intervals of exactly equal frames, or None; without any movement none is frozen.

    Args:
        time: (n,) [s].
        same: (n - 1,) as from `equal_frames`.
    """
    if len(time) < 3 or same.all() or not same.any():
        return None
    edges = np.flatnonzero(np.diff(np.concatenate([[False], same, [False]]).astype(np.int8)))
    lengths = time[edges[1::2]] - time[edges[::2]]
    long = lengths > FROZEN
    if long.any():
        first = time[edges[::2][long][0]]
        return f"{int(long.sum())} intervals of exactly equal frames, the first at {first:.2f} s: frozen tracking?"
    if same.mean() > 0.05:
        return f"{int(same.sum())} of {len(time)} frames repeat the one before: its source is slower than its stamps"
    return None


def beyond_limits(seen: ColumnStatistics) -> dict[str, str]:
    """Return the columns with angles beyond `LIMITS` -> in how many of the frames."""
    return {column: seen.beyond_text(column) for column in COLUMNS if seen.beyond[INDEX[column]]}


def straight_at_180(seen: ColumnStatistics) -> list[str]:
    """Return a warning for hinges that are never near 0 and come near 180 deg: of many sources that is straight."""
    hinges = [column for name in ("knee_flexion", "lower_arm_flexion") for column in COLUMNS_OF[name]]
    ranges = {column: (seen.low[INDEX[column]], seen.high[INDEX[column]]) for column in hinges}
    counted = [column for column, (low, high) in ranges.items() if low > NEVER_BELOW and STRAIGHT_BEYOND < high <= 185]
    if not counted:
        return []
    low, high = (round(f(ranges[column][at] for column in counted)) for at, f in enumerate((min, max)))
    what = f"{join_names(counted)}: {low} to {high} deg throughout"
    return [f"{what}; where 180 is straight, give 180 minus the angle: here 0 is straight"]


def impossible_columns(seen: ColumnStatistics) -> dict[str, str]:
    """Return the columns beyond `LIMITS` in more than half of the frames, and those linked to them -> the reason."""
    wrong = {column: seen.beyond_text(column) for column in COLUMNS if 2 * seen.beyond[INDEX[column]] > seen.frames}
    for group in LINKED:
        worst = next((column for column in group if column in wrong), None)
        if worst is not None:
            reason = f"{worst}: {wrong[worst]}, so the axes of this segment are wrong"
            wrong |= dict.fromkeys(group, reason)
    return wrong


def intermittent_columns(seen: ColumnStatistics) -> list[str]:
    """Return a note for each column without value in more than 1 % of the frames, but not in all."""
    notes = []
    for column, index in INDEX.items():
        missing = 1.0 - seen.known[index] / seen.frames if seen.frames else 0.0
        if 0.01 < missing < 1.0:
            notes.append(f"{column}: no value in {100 * missing:.0f} % of the frames")
    return notes


NO_ZERO = "it has no zero without a neutral posture: give one (--neutral first:3s)"
UNCALIBRATED = (
    "not calibrated: no neutral posture is given, so angles have their zero where the points are on the body "
    "(neck_flexion by the line from neck to head: about 20 deg in an upright person); give one (--neutral first:3s)"
)
MAX_HYPEREXTENSION = 10.0
"""[deg] Largest hyperextension of a hinge; a larger negative flexion means that the sign is inverted."""


@dataclass(frozen=True)
class Corrections:
    """Corrections of the angles of a recording, as positions of columns.

    Attributes:
        turned: their sign was inverted.
        hidden: they were not measured and are NaN.
        reasons: column -> why it has no value.
    """

    turned: tuple[int, ...]
    hidden: tuple[int, ...]
    reasons: dict[str, str]

    def apply(self, angles: Array) -> None:
        """Apply the corrections to further (n, 22) angles [deg], in place."""
        angles[:, self.turned] = -angles[:, self.turned]
        angles[:, self.hidden] = np.nan


def quality_control(samples: Samples, mapper: Mapper, profile: Profile, kind: Kind, neutral: str) -> Corrections:
    """Set columns that were not measured to NaN and correct inverted signs, in place; return the corrections.

    Args:
        samples: of the complete recording, all read by `mapper`.
        neutral: neutral posture that will be subtracted.
    """
    seen = ColumnStatistics().add(samples.angles)
    corrections = corrections_of(seen, samples.seconds, mapper, profile, kind, neutral)
    corrections.apply(samples.angles)
    return corrections


def corrections_of(
    seen: ColumnStatistics, seconds: float, mapper: Mapper, profile: Profile, kind: Kind, neutral: str
) -> Corrections:
    """Return which columns were not measured and which have an inverted sign, by statistics of all frames."""
    reasons = {
        **constant_columns(seen, seconds, kind, profile.dummies),
        **mapper.unmeasured_columns(seconds),
    }
    if neutral == "none" and profile.needs_neutral:
        empty = seen.empty_columns()
        reasons |= {column: NO_ZERO for column in profile.needs_neutral if column not in empty}
        if kind == "points" and seen.known[INDEX["neck_flexion"]]:
            mapper.warnings.append(UNCALIBRATED)
    turned = _upright_sign(seen, profile.sign_from_range, mapper)
    seen = seen.turned(turned)
    if kind != "joints":
        reasons |= impossible_columns(seen)
    elif wrong := [column for column in impossible_columns(seen) if column not in reasons]:
        mapper.warnings.append(
            f"most frames are impossible in {join_names(wrong, MOST_NAMES)}: another convention than {profile.name}?"
        )
    reasons |= profile.cannot
    hidden = tuple(INDEX[column] for column in reasons)
    for column in seen.empty_columns():
        reasons.setdefault(column, "no value in any frame")
    return Corrections(turned, hidden, reasons)


def _upright_sign(seen: ColumnStatistics, columns: tuple[str, ...], mapper: Mapper) -> tuple[int, ...]:
    """Return the positions of hinges whose largest flexion is negative (a limb flexes one way): their sign is wrong."""
    at = tuple(INDEX[column] for column in columns)
    lowest, highest = min([0.0, *seen.low[list(at)]]), max([0.0, *seen.high[list(at)]])
    if not at or lowest >= -MAX_HYPEREXTENSION or -lowest <= highest:
        return ()
    span = f"{lowest:.0f} .. {highest:.0f}"
    mapper.assumed.append(f"{', '.join(columns)}: flexion is negative in this source ({span} deg); sign inverted")
    return at


OWN_ZERO = ("knee_flexion", "lower_arm_flexion")
"""Angles whose zero is anatomical (a straight limb), so that no neutral posture is subtracted."""
AROUND = 0.5
"""[s] Half width of the interval around T of which `at:T` takes the median."""
LATEST = 1e9
"""[s] Largest time of a neutral posture, above that of any recording."""
_FORM = re.compile(r"(first|at):\s*(\d+(?:\.\d*)?|\.\d+)\s*s?")
Window = Callable[[Array], Flags]


def parse_neutral(spec: str) -> Window | None:
    """Return the function that selects the neutral interval from (n,) times [s], or None for "none".

    Raises:
        RebaError: the text is not `none`, `first:3s` or `at:12.5`.
    """
    if spec == "none":
        return None
    form = _FORM.fullmatch(spec.strip()) if isinstance(spec, str) else None
    seconds = float(form[2]) if form else 0.0
    if form is None or seconds > LATEST or (form[1] == "first" and seconds <= 0):
        raise RebaError(f"neutral is {shown(spec)}, expected none, first:3s (seconds from the start) or at:12.5")
    if form[1] == "first":
        return lambda time: time <= time[0] + seconds
    return lambda time: np.abs(time - seconds) <= AROUND


def neutral_offsets(angles: Array) -> dict[int, float]:
    """Return the position of each column whose zero is not anatomical -> its median [deg] in (n, 22) angles."""
    known = {index: angles[np.isfinite(angles[:, index]), index] for index in range(len(COLUMNS))}
    return {
        index: float(np.median(values))
        for index, values in known.items()
        if len(values) and not COLUMNS[index].startswith(OWN_ZERO)
    }


def subtract(angles: Array, offsets: dict[int, float]) -> None:
    """Subtract the neutral posture from (n, 22) angles [deg] in place."""
    for index, offset in offsets.items():
        angles[:, index] = np.round(angles[:, index] - offset, 9) + 0.0


def neutral_posture(time: Array, frames: Callable[[Flags], Array], spec: str) -> tuple[dict[int, float], str]:
    """Return the offsets of the median posture of the neutral interval, as of `neutral_offsets`, and a note.

    Args:
        time: (n,) [s].
        frames: returns the (k, 22) angles [deg] of chosen frames.

    Raises:
        RebaError: the text is wrong, or no frame lies in the interval, or all do.
    """
    window = parse_neutral(spec)
    if window is None:
        return {}, ""
    chosen = window(time) if len(time) else np.zeros(0, dtype=bool)
    if not chosen.any():
        span = f"{time[0]:.2f} to {time[-1]:.2f} s" if len(time) else "no frames"
        raise RebaError(f"neutral {spec!r} contains no frame; the recording has {span}: choose a time within")
    if chosen.all():
        raise RebaError(
            f"neutral {spec!r} is all of the recording, {time[0]:.2f} to {time[-1]:.2f} s, and would make its usual "
            "posture the zero; name the part in which the person stands upright, like first:1s or at:0.5"
        )
    offsets = neutral_offsets(frames(chosen))
    parts = [f"{COLUMNS[index]} {offset:.1f}" for index, offset in offsets.items() if abs(offset) >= 5.0]
    shifts = f": {', '.join(parts)} deg" if parts else ""
    return offsets, f"neutral posture from {int(chosen.sum())} frames ({spec}) subtracted{shifts}"


def apply_neutral(time: Array, angles: Array, spec: str) -> str:
    """Subtract the median posture of the neutral interval from (n, 22) angles [deg] in place; return a note.

    Raises:
        RebaError: the text is wrong, or no frame lies in the interval, or all do.
    """
    offsets, note = neutral_posture(time, lambda chosen: angles[chosen], spec)
    subtract(angles, offsets)
    return note
