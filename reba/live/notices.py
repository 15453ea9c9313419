"""What happens to the signal that is followed, as notices between the frames: silence, restarts, other bodies."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, replace
from statistics import median
from typing import Any, Final

import numpy as np

from reba.arrays import Array
from reba.errors import join_names
from reba.posture.columns import COLUMNS
from reba.readers.mapping.joints import MOST_NAMES
from reba.readers.quality_control import GAP, PERIODS

SILENT_SECONDS: Final = 1.5
"""[s] Without a frame after which a notice says so; a choice, within two seconds."""
SILENT_PERIODS: Final = 3.0
"""Sample periods that this takes at least: a source of one frame a second is not silent between two of them."""
STEPS: Final = 51
"""Latest sample periods whose median counts."""


@dataclass(frozen=True)
class Notice:
    """A change of the signal between two frames.

    Attributes:
        kind: one of `KINDS`.
        text: for the user.
        time: of the last frame before it [s], None before the first one.
        followed: whether frames follow now; if not, score and alert are out of date.
        segment: whether a new segment begins: window and alert do not cross it.
        missing: time without frames since `time` [s].
    """

    kind: str
    text: str
    time: float | None = None
    followed: bool = True
    segment: bool = False
    missing: float = 0.0

    def after(self, time: float | None) -> Notice:
        """Return the notice behind the frame at a time [s]."""
        return replace(self, time=time)

    def to_dict(self) -> dict[str, Any]:
        """Return the member `notice` of a line."""
        return {"kind": self.kind, "text": self.text, "followed": self.followed, "missing": self.missing}


KINDS: Final = {
    "waiting": "no profile fits what arrives so far",
    "silent": "the source sends nothing",
    "left": "the source sends, but nothing of this body",
    "resumed": "frames go on",
    "restarted": "the clock of the source jumped",
    "new_id": "the body has another id",
    "second_body": "another body is there at once, and not followed",
    "appeared": "names that were not there before are used from here on",
    "not_used": "names that were not there before are not used",
    "columns": "angles that were measured are not any more, or are again",
    "new_file": "the file was replaced, removed or cut",
}
"""Kind of a notice -> meaning."""


class FrameWatch:
    """Watches the times of frames for interruptions.

    Attributes:
        last: time of the newest frame [s], None before the first one.
        lost: kind of the notice that said that frames no longer follow, "" if they do.
    """

    def __init__(self) -> None:
        self.last: float | None = None
        self.lost = ""
        self._arrived = 0.0
        self._steps: deque[float] = deque(maxlen=STEPS)
        self._delivery = 0.0
        self._seen = np.full(len(COLUMNS), np.nan)
        self._unseen = np.zeros(len(COLUMNS), bool)

    @property
    def limit(self) -> float:
        """Longest time without a frame that is no interruption [s]."""
        return max(SILENT_SECONDS, SILENT_PERIODS * median(self._steps) if self._steps else 0.0)

    def gaps(self, time: Array, now: float, *, chunked: bool) -> Iterator[tuple[float, Notice]]:
        """Yield the time [s] and notice of each frame with which an interruption ends.

        Args:
            time: (n,) times of new frames [s].
            now: monotonic time [s].
            chunked: the frames arrive in parts that a recorder collects.
        """
        before = time[0] if self.last is None else self.last
        steps = np.diff(time, prepend=before)
        limit = self.limit
        period = median(self._steps) if self._steps else 0.0
        gaps = steps > limit
        gaps[0] |= bool(self.lost) and steps[0] > max(GAP, PERIODS * period)
        for at in np.flatnonzero(gaps).tolist():
            missing = max(float(steps[at]) - period, 0.0)
            start = float(time[at] - steps[at])
            text = f"frames go on at {time[at]:.2f} s: {missing:.1f} s after {start:.2f} s are missing"
            yield float(time[at]), Notice("resumed", text, start, missing=missing)
        if self.lost and not gaps[0]:
            yield float(time[0]), Notice("resumed", f"frames go on at {time[0]:.2f} s: none is missing", self.last)
            if self.lost == "silent" and chunked:
                # A recorder that collects chunks is silent between two of them.
                self._delivery = max(self._delivery, now - self._arrived)
        usual = steps[(steps > 0) & (steps <= limit)]
        self._steps.extend(usual[-STEPS:].tolist())
        self.last, self.lost, self._arrived = float(time[-1]), "", now

    def columns(self, time: Array, angles: Array) -> Iterator[tuple[float, Notice]]:
        """Yield notices of columns of (n, 22) angles [deg] without a value beyond the limit, and of their return."""
        # At most one part for each frame: a damaged time may be years from the others.
        parts = min(len(time), max(1, math.ceil((time[-1] - time[0]) / SILENT_SECONDS)))
        for rows in np.array_split(np.arange(len(time)), parts):
            if not len(rows):
                continue
            there = np.isfinite(angles[rows])
            seen = np.where(there.any(axis=0), time[rows[-1] - np.argmax(there[::-1], axis=0)], self._seen)
            now = float(time[rows[-1]])
            with np.errstate(invalid="ignore"):
                lost = now - seen > self.limit
            self._seen = seen
            for flags, text in (
                (lost & ~self._unseen, "not measured since"),
                (self._unseen & ~lost, "measured again at"),
            ):
                if flags.any():
                    names = join_names([COLUMNS[at] for at in np.flatnonzero(flags)], MOST_NAMES)
                    moment = float(seen[flags].max()) if text.startswith("not") else now
                    yield now, Notice("columns", f"{text} {moment:.2f} s: {names}")
            self._unseen = lost

    def silent_for(self, now: float) -> float:
        """Return how long no frame has arrived [s], 0.0 if that is no interruption."""
        if self.last is None:
            return 0.0
        silence = now - self._arrived
        return silence if self.lost or silence > max(self.limit, 2 * self._delivery) else 0.0

    def lose(self, kind: str, text: str, missing: float) -> Notice:
        """Return the notice that frames no longer follow."""
        self.lost = kind
        return Notice(kind, text, self.last, followed=False, segment=False, missing=missing)
