"""Times of all messages of a channel, thinned to those that say something about its clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Flags

Nanoseconds = NDArray[np.int64]
NO_STAMP: Final = np.iinfo(np.int64).min
"""Stamp of a message without one."""
JITTER: Final = 500_000_000
"""[ns] By which stamps may run back, or differ from those of both neighbours, without a restart; a choice."""
MESSAGES_PER_PASS: Final = 10
"""Stamps that run back more often than once in so many messages are no clock; a choice."""
UNCHANGED: Final = 0.6
"""Share of the log time in which the stamp stays the same, from which on stamps are too coarse; a choice."""
MOST_POINTS: Final = 2048
"""Points of a recording that is being written beyond which those of even advance are thinned."""


@dataclass(frozen=True)
class Points:
    """Messages of a channel by number: (m,) log times and stamps [ns]; `jump`: uneven since the message before."""

    number: NDArray[np.int64]
    log: Nanoseconds
    stamp: Nanoseconds
    jump: Flags

    def __getitem__(self, chosen: NDArray[np.intp] | Flags | slice) -> Points:
        return Points(self.number[chosen], self.log[chosen], self.stamp[chosen], self.jump[chosen])


def joined(parts: Sequence[Points]) -> Points:
    """Return the points of one or more parts."""
    fields = ("number", "log", "stamp", "jump")
    return Points(*(np.concatenate([getattr(part, name) for part in parts]) for name in fields))


class Trace:
    """Times of all messages of one channel in the order of the file, without those that advance evenly.

    Attributes:
        count: messages.
        stamped: of these, those with a stamp.
        jumped: number of the newest message that may be a restart or damaged, -1 without one.
    """

    def __init__(self) -> None:
        self.count = 0
        self.stamped = 0
        self.jumped = -1
        self._jumps = 0
        self._parts: list[Points] = []
        self._stored = 0
        self._most = MOST_POINTS
        self._last: tuple[int, int] | None = None
        self._last_is_zero = False
        self._stamp, self._same = NO_STAMP, False
        self._unchanged = self._passed = self._changes = self._late = 0

    def add(self, log: Nanoseconds, stamp: Nanoseconds) -> None:
        """Add (n,) log times and stamps [ns] of the next messages."""
        if not len(log):
            return
        if self._is_even(log, stamp):
            self._add_even(log, stamp)
            return
        stamp = self._without_zeros(stamp)
        there = stamp != NO_STAMP
        lag = np.where(there, stamp - log, 0)
        latest = np.maximum.accumulate(np.where(there, np.arange(len(log)), -1))
        lag_before, log_before = self._last or (int(lag[there][0]) if there.any() else 0, int(log[0]))
        filled = np.where(latest >= 0, lag[latest], lag_before)
        steps = np.abs(np.diff(filled, prepend=lag_before))
        passed = np.diff(log, prepend=log_before)
        self._note_repeats(stamp, there, passed)
        jump = (steps > JITTER // 2) | (passed < -JITTER)
        keep = jump.copy()
        keep[:-1] |= jump[1:]
        # The earliest stamp is time 0 of the recording.
        keep[[0, -1, int(np.argmin(np.where(there, stamp, np.iinfo(np.int64).max)))]] = True
        keep[np.flatnonzero(there)[[0, -1]] if there.any() else 0] = True
        stamped_before = latest[np.flatnonzero(jump[1:])]
        keep[stamped_before[stamped_before >= 0]] = True
        self._parts.append(Points(self.count + np.flatnonzero(keep), log[keep], stamp[keep], jump[keep]))
        self._stored += len(self._parts[-1].number)
        self._last = int(filled[-1]), int(log[-1])
        uneven = np.flatnonzero((steps > JITTER) | (passed < -JITTER))
        if len(uneven) and not self.erratic:
            self._jumps += len(uneven)
            self.jumped = self.count + int(uneven[-1])
        self.count += len(log)
        self.stamped += int(np.count_nonzero(there))

    def _without_zeros(self, stamp: Nanoseconds) -> Nanoseconds:
        """Return stamps without repeated zeros: one may be the time at which a simulator starts, more were not set."""
        zero = np.concatenate([[self._last_is_zero], stamp == 0])
        self._last_is_zero = bool(zero[-1])
        if not zero.any():
            return stamp
        alike = zero[1:] & zero[:-1]
        if alike[0] and self._parts[-1].stamp[-1] == 0:
            self._parts[-1].stamp[-1] = NO_STAMP
            self.stamped -= 1
        return np.where(np.append(alike[1:], False) | alike, NO_STAMP, stamp)

    def _is_even(self, log: Nanoseconds, stamp: Nanoseconds) -> bool:
        """Return whether all messages have a stamp, and advance with it from the one before; most do."""
        if self._last is None or stamp[0] <= max(self._stamp, 0) or log[0] < self._last[1] - JITTER:
            return False
        lag = stamp - log
        most, least = int(lag.max()), int(lag.min())
        near = most - self._last[0] <= JITTER // 2 and self._last[0] - least <= JITTER // 2
        return bool(
            near and most - least <= JITTER // 2 and (stamp[1:] > stamp[:-1]).all() and (log[1:] >= log[:-1]).all()
        )

    def _add_even(self, log: Nanoseconds, stamp: Nanoseconds) -> None:
        """Add messages of even advance: the first and the last are enough."""
        last = len(log) - 1
        at = np.array([0, last] if last else [0])
        self._parts.append(Points(self.count + at, log[at], stamp[at], np.zeros(len(at), bool)))
        self._stored += len(at)
        self._late += self._same
        self._changes += last + 1
        self._passed += int(log[-1]) - (self._last[1] if self._last else 0)
        self._last = int(stamp[-1] - log[-1]), int(log[-1])
        self._stamp, self._same, self._last_is_zero = int(stamp[-1]), False, False
        self.count += last + 1
        self.stamped += last + 1

    def _note_repeats(self, stamp: Nanoseconds, there: Flags, passed: Nanoseconds) -> None:
        """Note the log time that passes while the stamp stays the same."""
        same = np.equal(stamp[:-1], stamp[1:])
        same = np.concatenate([[stamp[0] == self._stamp], same]) & there
        self._unchanged += int(passed[same].sum())
        self._passed += int(passed.sum())
        self._changes += len(same) - int(np.count_nonzero(same))
        self._late += int(np.count_nonzero(np.concatenate([[self._same], same[:-1]]) & ~same))
        self._stamp, self._same = int(stamp[-1]), bool(same[-1])

    @property
    def coarse(self) -> bool:
        """Whether stamps go on in steps of many messages each, such as whole seconds.

        Transforms that are sent one by one have equal stamps too, but at about the same log time.
        """
        return self._changes > 2 and 2 * self._late > self._changes and self._unchanged > UNCHANGED * self._passed

    @property
    def erratic(self) -> bool:
        """Whether so many messages are uneven that none of them is news."""
        return self._jumps > MOST_POINTS and self._jumps * MESSAGES_PER_PASS > self.count

    def points(self) -> Points:
        """Return the points of all messages so far."""
        none = np.zeros(0, np.int64)
        return joined(self._parts or [Points(none, none, none, none.astype(bool))])

    def thin(self) -> None:
        """Keep every second of many points of even advance: the memory of an endless recording stays flat."""
        if self._stored <= self._most:
            return
        points = self.points()
        keep = points.jump & (not self.erratic)
        keep[:-1] |= keep[1:]
        keep[::2] = True
        there = np.where(points.stamp != NO_STAMP, points.stamp, np.iinfo(np.int64).max)
        keep[[0, -1, int(np.argmin(there))]] = True
        self._parts = [points[keep]]
        self._stored = len(self._parts[0].number)
        self._most = max(MOST_POINTS, 2 * self._stored)
