"""Whether what the first seconds decided still holds: the decision is made again from time to time."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Final

import numpy as np

from reba.live.frames import Array
from reba.posture import COLUMNS
from reba.readers.collect import Samples
from reba.readers.correct import Corrections, correct
from reba.readers.mapping import Mapper
from reba.readers.profile import Profile
from reba.readers.stream import Kind, ReadLog

EVERY: Final = 10.0
"""[s] Of the recording between two looks."""
MOST: Final = 1024
"""Frames kept for it: every second, fourth, ... of the recording."""


class Watch:
    """Keeps a thinned history of angles and says once where a decision would be another now.

    Args:
        mapper: what maps the recording; it keeps the ranges of its joints.
        profile, kind, neutral: as `reba.readers.correct.correct`.
        decided: what the first seconds gave.
        tell: takes the warning.
    """

    def __init__(
        self,
        mapper: Mapper,
        profile: Profile,
        kind: Kind,
        neutral: str,
        decided: Corrections,
        tell: Callable[[str], None],
    ) -> None:
        self._mapper, self._profile, self._kind, self._neutral = mapper, profile, kind, neutral
        self._decided = decided
        self._tell = tell
        self._table = np.empty((MOST, 1 + len(COLUMNS)))
        self._kept = self._seen = 0
        self._step = 1
        self._next: float | None = None
        self.told = False

    def add(self, time: Array, angles: Array) -> None:
        """Take up (n,) times [s] and (n, 22) angles [deg] before any correction."""
        if self.told:
            return
        first = -self._seen % self._step
        for at in range(first, len(time), self._step):
            if self._kept == MOST:
                self._table[: MOST // 2] = self._table[::2]
                self._kept, self._step = MOST // 2, self._step * 2
            self._table[self._kept, 0] = time[at]
            self._table[self._kept, 1:] = angles[at]
            self._kept += 1
        self._seen += len(time)
        if self._next is None:
            self._next = float(time[0]) + EVERY
        if time[-1] >= self._next:
            self._next = float(time[-1]) + EVERY
            self.look()

    def look(self) -> None:
        """Decide again, and say what would be otherwise, once."""
        if self.told or not self._kept:
            return
        mapper = self._copied()
        before = len(mapper.warnings)
        settled = mapper.settled()
        found = correct(
            Samples(self._table[: self._kept].copy(), ReadLog()), mapper, self._profile, self._kind, self._neutral
        )
        if not settled:
            what = "; ".join(mapper.warnings[before:][:1]) or "the unit or the vertical is another"
        elif shown := set(self._decided.hidden) - set(found.hidden):
            name = COLUMNS[min(shown)]
            what = f"{name} was taken as not measured ({self._decided.reasons[name]}), and moves"
        elif hidden := set(found.hidden) - set(self._decided.hidden):
            name = COLUMNS[min(hidden)]
            what = f"{name} was taken as measured, and counts as not measured ({found.reasons[name]})"
        elif found.turned != self._decided.turned:
            what = f"the sign of {', '.join(COLUMNS[at] for at in found.turned or self._decided.turned)} is the other"
        else:
            return
        self.told = True
        self._tell(
            f"what came later contradicts the first seconds: {what}; `reba score` decides from the whole recording, "
            "a longer --settle from more of it"
        )

    def _copied(self) -> Mapper:
        """Return a copy of the mapper to ask, which leaves the one at work as it is."""
        shared = [getattr(self._mapper, name, None) for name in ("profile", "stream", "root")]
        return copy.deepcopy(self._mapper, {id(thing): thing for thing in shared if thing is not None})
