"""Neutral calibration: the posture of a known stretch counts as zero.

A line from neck to head leans about 20 degrees in an upright person, a sensor sits askew, a rest pose is not a
person's own: the median of a stretch of relaxed standing removes such offsets. Elbows and knees keep their own zero:
a straight limb is defined without a reference, and a person who stands with bent knees would be scored as straight.
"""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from reba.errors import RebaError
from reba.posture import COLUMNS

Array = NDArray[np.float64]

KEPT = ("knee_flexion", "lower_arm_flexion")
"""Angles with a zero of their own."""

AROUND = 0.5
"""[s] `at:T` takes the median of this much on either side."""

_FORM = re.compile(r"(first|at):\s*(\d+(?:\.\d*)?|\.\d+)\s*s?")
Window = Callable[[Array], NDArray[np.bool_]]


def parse_neutral(spec: str) -> Window | None:
    """Return which of (n,) times [s] belong to the neutral stretch, or None for "none".

    Raises:
        RebaError: the text is not `none`, `first:3s` or `at:12.5`.
    """
    if spec == "none":
        return None
    form = _FORM.fullmatch(spec.strip()) if isinstance(spec, str) else None
    seconds = float(form[2]) if form else 0.0
    if form is None or (form[1] == "first" and seconds <= 0):
        raise RebaError(f"neutral is {spec!r}, expected none, first:3s (seconds from the start) or at:12.5")
    if form[1] == "first":
        return lambda time: time <= time[0] + seconds
    return lambda time: np.abs(time - seconds) <= AROUND


def neutral_offsets(angles: Array) -> dict[int, float]:
    """Return the position of each column that has no zero of its own -> its median [deg] in (n, 22) angles."""
    known = {index: angles[np.isfinite(angles[:, index]), index] for index in range(len(COLUMNS))}
    return {
        index: float(np.median(values))
        for index, values in known.items()
        if len(values) and not COLUMNS[index].startswith(KEPT)
    }


def subtract(angles: Array, offsets: dict[int, float]) -> None:
    """Subtract the neutral posture from (n, 22) angles [deg] in place."""
    for index, offset in offsets.items():
        angles[:, index] = np.round(angles[:, index] - offset, 9) + 0.0


def apply_neutral(time: Array, angles: Array, spec: str) -> str:
    """Subtract the median posture of the stretch from (n, 22) angles [deg] in place; return what was done.

    Raises:
        RebaError: the text is wrong, or no frame lies in the stretch.
    """
    window = parse_neutral(spec)
    if window is None:
        return ""
    chosen = window(time) if len(time) else np.zeros(0, dtype=bool)
    if not chosen.any():
        span = f"{time[0]:.2f} to {time[-1]:.2f} s" if len(time) else "no frames"
        raise RebaError(f"neutral {spec!r} holds no frame; the recording has {span}: choose a time within")
    offsets = neutral_offsets(angles[chosen])
    subtract(angles, offsets)
    parts = [f"{COLUMNS[index]} {offset:.1f}" for index, offset in offsets.items() if abs(offset) >= 5.0]
    shifts = f": {', '.join(parts)} deg" if parts else ""
    return f"neutral posture from {int(chosen.sum())} frames ({spec}) subtracted{shifts}"
