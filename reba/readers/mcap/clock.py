"""The clock of a recording: one for all of its streams, also where time stamps restart, are missing or are damaged.

    times of every message -> Trace (thinned) -> passes between restarts -> RecordingClock -> seconds of each message

Header stamps are used if most messages have usable ones, else the log time, else the publish time. Where a clock runs
back (a player that loops, a simulator that is reset), a new pass begins: its time goes on from the message before by
the log time that passed between the two.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Flags
from reba.readers.mcap.records import LATEST
from reba.readers.mcap.trace import JITTER, MESSAGES_PER_PASS, NO_STAMP, Nanoseconds, Points, Trace, joined

LEAP: Final = 60_000_000_000
"""[ns] By which stamps may advance more than the log time: a larger step is a clock that was set; a choice."""
CLOCKS_DIFFER: Final = 5_000_000_000
"""[ns] Stamps of two channels that differ by more at one log time are of clocks that were not set alike; a choice."""
UNSTAMPED: Final = 0.1
"""Largest share of the messages of a channel without a usable stamp, for its stamps to be used; one always may be."""
ABOUT_MOST: Final = 0.9
"""Share of the messages of the largest channel from which on an earlier one decides in its place; a choice."""


@dataclass
class Pass:
    """Consecutive messages between two restarts of the clock.

    Attributes:
        start: number of its first message.
        log, stamp: (m,) log times and stamps [ns] of its points; for a channel read by log time both are log times.
        restarted: whether its clock does not go on from the pass before.
        offset: [ns] added to its stamps for the time of the recording.
    """

    start: int
    log: Nanoseconds
    stamp: Nanoseconds
    restarted: bool = False
    offset: int = 0


@dataclass
class ChannelClock:
    """Times of the messages of one channel; see `RecordingClock`.

    Attributes:
        passes: in the order of time.
        damaged: numbers of messages whose stamp is far from those of both neighbours.
        by_stamp: whether stamps are used, or log times.
        line: log times and times of the recording [ns] of another channel, which give the times of this one.
    """

    trace: Trace
    passes: list[Pass]
    damaged: NDArray[np.int64]
    by_stamp: bool
    line: tuple[Nanoseconds, Nanoseconds] | None = None

    @property
    def first(self) -> int:
        """Time of the recording [ns] of the earliest message."""
        if self.line is not None:
            return int(_interpolated(self.passes[0].log[:1], *self.line)[0])
        return min(int(one.stamp.min()) + one.offset for one in self.passes)

    @property
    def first_log(self) -> int:
        """Earliest log time [ns]."""
        return min(int(one.log.min()) for one in self.passes)

    @property
    def restarts(self) -> int:
        """How often the clock restarts."""
        return sum(one.restarted for one in self.passes)

    def times(self, number: NDArray[np.int64], log: Nanoseconds, stamp: Nanoseconds) -> tuple[Nanoseconds, int]:
        """Return (n,) times [ns] of messages by number, log time and stamp, and how many had no usable stamp."""
        if self.line is not None:
            return _interpolated(log, *self.line), 0
        by_start = sorted(self.passes, key=lambda one: one.start)
        starts = [one.start for one in by_start]
        which = np.maximum(np.searchsorted(starts, number, side="right") - 1, 0)
        offsets = np.array([one.offset for one in by_start], np.int64)[which]
        if not self.by_stamp:
            return log + offsets, 0
        usable = stamp != NO_STAMP
        if (stamp == 0).any():
            points = self.trace.points()
            usable &= (stamp != 0) | np.isin(number, points.number[points.stamp == 0])
        if len(self.damaged):
            usable &= ~np.isin(number, self.damaged)
        result = np.where(usable, stamp, 0) + offsets
        if not usable.all():
            for at, one in enumerate(by_start):
                mine = ~usable & (which == at)
                result[mine] = _interpolated(log[mine], one.log, one.stamp + one.offset)
        return result, int(np.count_nonzero(~usable))

    def pass_of(self, number: int) -> int:
        """Return the place of the pass of a message in the order of time."""
        return max(enumerate(self.passes), key=lambda at: (at[1].start <= number, at[1].start))[0]

    def as_line(self) -> tuple[Nanoseconds, Nanoseconds]:
        """Return log times and times of the recording [ns] of its points, by log time."""
        return _line(self.passes)


def channel_clock(trace: Trace, *, use_stamps: bool) -> ChannelClock:
    """Return the passes of a channel; by log time if its stamps are no clock, or are not to be used."""
    points = trace.points()
    mixed = bool(np.count_nonzero(np.diff(points.log) < -JITTER) * MESSAGES_PER_PASS > trace.count)
    if mixed:  # stored in no order at all
        points = points[np.argsort(points.log, kind="stable")]
        points = replace(points, jump=np.abs(np.diff(points.stamp - points.log, prepend=0)) > JITTER)
    there = points[points.stamp != NO_STAMP]
    wrong = _damaged(there)
    unusable = trace.count - trace.stamped + np.count_nonzero(wrong)
    if use_stamps and not trace.coarse and unusable <= max(1, UNSTAMPED * trace.count):
        good = _from_first(points, there[~wrong])
        clock = ChannelClock(trace, _passes(good), there.number[wrong], True)
        advances = trace.count == 1 or any(one.stamp[-1] > one.stamp[0] for one in clock.passes)
        few = len(clock.passes) == 1 or not mixed
        if len(good.number) and advances and few and clock.restarts * MESSAGES_PER_PASS <= trace.count:
            return clock
    by_log = Points(points.number, points.log, points.log, points.jump)
    return ChannelClock(trace, _passes(by_log), np.zeros(0, np.int64), False)


def _from_first(points: Points, good: Points) -> Points:
    """Return the points with a usable stamp, and the first message with the stamp that follows from its log time."""
    if not len(good.number) or good.number[0] <= points.number[0]:
        return good
    stamp = good.stamp[0] - (good.log[0] - points.log[0])
    return joined([Points(points.number[:1], points.log[:1], np.array([stamp]), np.array([False])), good])


def _damaged(points: Points) -> Flags:
    """Return which stamps are far from those of both neighbours, which are near each other."""
    count = len(points.number)
    if count < 3:
        return np.zeros(count, bool)
    lag = points.stamp - points.log
    far = np.concatenate([[True], points.jump[1:] & (np.abs(np.diff(lag)) > JITTER), [True]])
    beside = np.abs(lag[2:] - lag[:-2]) <= JITTER
    # The first and the last message have one neighbour; that one has to agree with the next.
    agree = np.concatenate([[not far[2]], beside, [not far[-3]]])
    return np.asarray(far[:-1] & far[1:] & agree)


def _passes(points: Points) -> list[Pass]:
    """Return the passes of the points of a channel in the order of time."""
    if not len(points.number):
        return []
    log_steps, steps = np.diff(points.log), np.diff(points.stamp)
    back = log_steps < -JITTER
    leaps = (steps - log_steps > LEAP) & (log_steps > 0)
    cuts = 1 + np.flatnonzero((back | (steps < -JITTER) | leaps) & points.jump[1:])
    parts = np.split(np.arange(len(points.number)), cuts)
    passes = [Pass(int(points.number[part[0]]), points.log[part], points.stamp[part]) for part in parts]
    passes[0].start = 0
    runs = np.cumsum([False, *back[cuts - 1].tolist()])
    again = _overlap(passes, runs)
    if not again:
        passes.sort(key=lambda one: int(one.log[0]))  # stored in another order, as by topic
    for before, after, first in zip(passes, passes[1:], np.diff(runs) > 0, strict=False):
        step = int(after.stamp[0] - before.stamp[-1])
        after.restarted = (again and bool(first)) or step < -JITTER or step - (after.log[0] - before.log[-1]) > LEAP
    return passes


def _overlap(passes: Sequence[Pass], runs: NDArray[np.int64]) -> bool:
    """Return whether log times repeat: messages that were stored in another order do not overlap."""
    spans = []
    for run in np.unique(runs).tolist():
        mine = [one for one, of in zip(passes, runs.tolist(), strict=True) if of == run]
        spans.append((int(mine[0].log[0]), int(mine[-1].log[-1])))
    spans.sort()
    return any(after[0] < before[1] - JITTER for before, after in pairwise(spans))


def _line(passes: Sequence[Pass]) -> tuple[Nanoseconds, Nanoseconds]:
    log = np.concatenate([one.log for one in passes])
    time = np.concatenate([one.stamp + one.offset for one in passes])
    order = np.argsort(log, kind="stable")
    return log[order], time[order]


def _interpolated(at: Nanoseconds, known: Nanoseconds, values: Nanoseconds) -> Nanoseconds:
    """Return values at log times: linear between the known ones, beyond them they advance as the log time does."""
    base, first = int(known[0]), int(values[0])
    inside = np.clip(at, known[0], known[-1])
    mixed = np.interp((inside - base) * 1.0, (known - base) * 1.0, (values - first) * 1.0)
    return np.asarray(np.rint(mixed).astype(np.int64) + first + (at - inside))


class RecordingClock:
    """The clock of all channels with postures of a recording.

    Attributes:
        source: "header.stamp", "log_time" or "publish_time".
        why: why the header stamps are not used, "" if they are.
        channels: the clock of each trace, in their order.
        seams: times of the recording [ns] of the first message after each restart.

    Args:
        published: the traces have publish times in the place of log times.
    """

    def __init__(self, traces: Sequence[Trace], *, published: bool = False) -> None:
        self.why = ""
        clocks = [channel_clock(trace, use_stamps=True) for trace in traces]
        total = sum(clock.trace.count for clock in clocks)
        stamped = [clock for clock in clocks if clock.by_stamp]
        self.seams, difference = _set_offsets(stamped)
        if 2 * sum(clock.trace.count for clock in stamped) < total:
            coarse = any(trace.coarse for trace in traces)
            self.why = "the time stamps repeat" if coarse else "most messages have no usable time stamp"
        elif difference > CLOCKS_DIFFER:
            self.why = f"the time stamps of two topics differ by {difference / 1e9:.1f} s at one log time"
        if self.why:
            clocks = [channel_clock(trace, use_stamps=False) for trace in traces]
            self.seams, _ = _set_offsets(clocks)
        self.source = ("publish_time" if published else "log_time") if self.why else "header.stamp"
        self.channels = clocks
        self._reference = reference = _largest([clock for clock in clocks if clock.by_stamp] or clocks)
        for clock in clocks:
            if clock.by_stamp == bool(self.why) and reference is not None:
                clock.line = reference.as_line()

    def at(self, log: Nanoseconds) -> Nanoseconds:
        """Return the times of the recording [ns] at (n,) log times [ns], as of messages without a stamp."""
        return log if self._reference is None else _interpolated(log, *self._reference.as_line())


def _largest(clocks: Sequence[ChannelClock]) -> ChannelClock | None:
    """Return the channel that decides: of those with about the most messages the first, whichever is ahead by a few."""
    most = max((clock.trace.count for clock in clocks), default=0)
    return next((clock for clock in clocks if clock.trace.count >= ABOUT_MOST * most), None)


def _set_offsets(clocks: Sequence[ChannelClock]) -> tuple[tuple[int, ...], int]:
    """Set the offsets of all passes; the largest channel decides.

    Returns:
        Times [ns] of the restarts, and by how much the times [ns] of two channels differ at one log time.
    """
    main = _largest(clocks)
    if main is None:
        return (), 0
    seams, differences = _chain(main.passes), [0]
    for clock in clocks:
        if clock is not main:
            _chain(clock.passes)
            differences.append(_align(clock.passes, main.passes))
            for one in clock.passes:
                start = int(one.stamp[0]) + one.offset
                at = bisect(seams, start)
                if one.restarted and all(abs(start - seam) > JITTER for seam in seams[max(at - 1, 0) : at + 1]):
                    seams.insert(at, start)
    return tuple(seams), max(differences)


def _align(passes: Sequence[Pass], main: Sequence[Pass]) -> int:
    """Set the offsets of the passes of a channel by those of the channel that decides.

    A pass has its own offset or that of the other's pass at its time, whichever is nearer to the time of the other.
    Where this moves it against the other, their clocks did not restart alike, and it goes on beside the other.

    Returns:
        By how much [ns] the two differ at one log time.
    """
    if len(passes) == len(main):
        pairs = list(zip(passes, main, strict=True))
    else:
        pairs = [(one, max(main, key=partial(_shared, one))) for one in passes]
    behind = []
    for one, other in pairs:
        if _shared(one, other) >= -JITTER:
            at = np.concatenate([one.log, other.log])
            at = np.clip(at, max(one.log.min(), other.log.min()), min(one.log.max(), other.log.max()))
            lag = int(np.median(_interpolated(at, *_line([other])) - _interpolated(at, *_line([one]))))
            step = min(0, other.offset - one.offset, key=lambda step: abs(lag - step))
            one.offset += step
            behind.append((one, lag - step))
    usual = min((lag for _, lag in behind), key=abs, default=0)
    for one, lag in behind:
        if abs(lag - usual) > JITTER:
            one.offset += lag - usual
    return abs(usual)


def _chain(passes: Sequence[Pass]) -> list[int]:
    """Let the time of each pass go on from the one before, and return the times [ns] at which passes restart."""
    seams = []
    for before, after in pairwise(passes):
        after.offset = before.offset
        if after.restarted:
            step = int(after.log[0] - before.log[-1])
            if step <= 0:  # the log time restarts too: one period of the messages
                step = int((before.log[-1] - before.log[0]) // max(after.start - before.start - 1, 1))
            seams.append(int(before.stamp[-1]) + before.offset + step)
            # Times of damaged recordings may be centuries apart.
            after.offset = max(-LATEST, min(LATEST, seams[-1] - int(after.stamp[0])))
    return seams


def _shared(one: Pass, other: Pass) -> int:
    """Return the log time [ns] that two passes share, negative for the gap between them."""
    return int(min(one.log[-1], other.log[-1]) - max(one.log[0], other.log[0]))
