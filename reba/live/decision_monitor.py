"""Later frames against the decisions of the first seconds: unit, vertical, unmeasured columns, signs."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Final

import numpy as np

from reba.arrays import Array
from reba.posture.columns import COLUMNS
from reba.readers.mapping import Mapper, Samples
from reba.readers.quality_control import Corrections, quality_control
from reba.readers.recording.profile import Profile
from reba.readers.recording.stream import Kind, ReadLog

CHECK_SECONDS: Final = 10.0
"""[s] Of the recording between two checks."""
MAX_FRAMES: Final = 1024
"""Frames of the history: all at first, later every second, fourth, ... frame of the recording."""


class DecisionMonitor:
    """Repeats the decisions of the first seconds on a thinned history of angles, and warns once of a different one.

    Args:
        mapper: from samples to angles; it stores the ranges of its joints.
        profile, kind, neutral: as for `reba.readers.quality_control.quality_control`.
        decided: corrections decided from the first seconds.
    """

    def __init__(
        self,
        mapper: Mapper,
        profile: Profile,
        kind: Kind,
        neutral: str,
        decided: Corrections,
        on_warning: Callable[[str], None],
    ) -> None:
        self._mapper, self._profile, self._kind, self._neutral = mapper, profile, kind, neutral
        self._decided = decided
        self._on_warning = on_warning
        self._table = np.empty((MAX_FRAMES, 1 + len(COLUMNS)))
        self._stored = self._added = 0
        self._step = 1
        self._next_check: float | None = None
        self.reported = False

    def add(self, time: Array, angles: Array) -> None:
        """Add (n,) times [s] and (n, 22) uncorrected angles [deg]."""
        if self.reported:
            return
        first = -self._added % self._step
        for at in range(first, len(time), self._step):
            if self._stored == MAX_FRAMES:
                self._table[: MAX_FRAMES // 2] = self._table[::2]
                self._stored, self._step = MAX_FRAMES // 2, self._step * 2
            self._table[self._stored, 0] = time[at]
            self._table[self._stored, 1:] = angles[at]
            self._stored += 1
        self._added += len(time)
        if self._next_check is None:
            self._next_check = float(time[0]) + CHECK_SECONDS
        if time[-1] >= self._next_check:
            self._next_check = float(time[-1]) + CHECK_SECONDS
            self.check()

    def go_on(self, decided: Corrections) -> None:
        """Compare with other corrections from here on."""
        self._decided = decided

    def check(self) -> None:
        """Decide again from the history, and report a different decision once."""
        if self.reported or not self._stored:
            return
        mapper = self._mapper_copy()
        before = len(mapper.warnings)
        consistent = mapper.is_consistent()
        corrections = quality_control(
            Samples(self._table[: self._stored].copy(), ReadLog()), mapper, self._profile, self._kind, self._neutral
        )
        if not consistent:
            contradiction = "; ".join(mapper.warnings[before:][:1]) or "the unit or the vertical differs"
        elif shown := set(self._decided.hidden) - set(corrections.hidden):
            name = COLUMNS[min(shown)]
            contradiction = f"{name} counted as not measured ({self._decided.reasons[name]}), but it moves"
        elif hidden := set(corrections.hidden) - set(self._decided.hidden):
            name = COLUMNS[min(hidden)]
            contradiction = f"{name} counted as measured, but it is not ({corrections.reasons[name]})"
        elif corrections.turned != self._decided.turned:
            names = ", ".join(COLUMNS[at] for at in corrections.turned or self._decided.turned)
            contradiction = f"the sign of {names} is the opposite"
        else:
            return
        self.reported = True
        self._on_warning(
            f"later frames contradict the first seconds: {contradiction}; give a longer --settle, or use `reba score`, "
            "which decides from the complete recording"
        )

    def _mapper_copy(self) -> Mapper:
        """Return a copy of the mapper: a decision changes its state. Profile, stream and root are shared."""
        shared = [getattr(self._mapper, name, None) for name in ("profile", "stream", "root")]
        return copy.deepcopy(self._mapper, {id(value): value for value in shared if value is not None})
