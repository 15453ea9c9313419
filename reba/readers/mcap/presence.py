"""When the signals of a stream were there: names and parents -> messages and log times, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

PAUSE: Final = 1_000_000_000
"""[ns] Longest time without a name for which it counts as present throughout; a choice."""
TOGETHER: Final = 500_000_000
"""[ns] Presence of two names at once that may be a hand-over from one to the other; a choice."""
MOST_NAMES: Final = 20_000
"""Names of a stream that are counted; protects memory from names that change with every message."""
Signal = tuple[str, str]
"""Name and parent, "" for signals without parents."""
Interval = list[int]
"""First and last log time [ns]."""


@dataclass
class Presence:
    """When signals that share their messages were there: `messages`, and the log times in `intervals`."""

    messages: int = 0
    intervals: list[Interval] = field(default_factory=list)

    def add(self, log: np.ndarray) -> None:
        """Add messages at (n,) log times [ns]."""
        self.messages += len(log)
        if len(log) == 1:
            self._extend(int(log[0]), int(log[0]))
        elif len(log):
            cuts = np.flatnonzero(np.abs(np.diff(log)) > PAUSE)
            starts = np.concatenate([[0], cuts + 1])
            firsts = np.minimum.reduceat(log, starts)
            lasts = np.maximum.reduceat(log, starts)
            for first, last in zip(firsts.tolist(), lasts.tolist(), strict=True):
                self._extend(first, last)

    def _extend(self, first: int, last: int) -> None:
        if self.intervals and self.intervals[-1][0] <= first <= self.intervals[-1][1] + PAUSE:
            self.intervals[-1][1] = max(self.intervals[-1][1], last)
        else:
            self.intervals.append([first, last])


class Presences:
    """When the signals of one stream were there.

    Signals that share their messages are counted together. Where these sets are so many that they hold `MOST_NAMES`
    names, each signal is counted by itself; where even these are too many, the half with the fewest messages is
    forgotten: an id that was there for one message hides no one who stays.

    Attributes:
        sets: names and parents that share messages -> when they are there.
        named: how often a set was new.
    """

    def __init__(self) -> None:
        self.named = 0
        self.sets: dict[tuple[Signal, ...], Presence] = {}
        self._alike: dict[frozenset[Signal], tuple[Signal, ...]] = {}
        self._names = 0
        self._single = False

    def add(self, signals: tuple[Signal, ...], log: np.ndarray) -> None:
        """Add messages of some signals at (n,) log times [ns]."""
        if not self._single:
            known = self.sets.get(signals) or self.sets.get(self._alike.get(frozenset(signals), signals))
            if known is None and self._names + len(signals) > MOST_NAMES:
                self._count_singly()
            else:
                (known or self._new(signals)).add(log)
                return
        for signal in signals:
            (self.sets.get((signal,)) or self._new((signal,))).add(log)

    def _new(self, signals: tuple[Signal, ...]) -> Presence:
        if self._names + len(signals) > MOST_NAMES:
            self._forget_rare()
        self.named += 1
        self._names += len(signals)
        self.sets[signals] = presence = Presence()
        if not self._single:
            self._alike[frozenset(signals)] = signals
        return presence

    def _count_singly(self) -> None:
        """Count each signal by itself from here on."""
        single: dict[tuple[Signal, ...], Presence] = {}
        for signals, one in self.sets.items():
            for signal in signals:
                total = single.setdefault((signal,), Presence())
                total.messages += one.messages
                total.intervals += [[*interval] for interval in one.intervals]
        for total in single.values():
            total.intervals = united(total.intervals)
        self.sets, self._names, self._single = single, len(single), True
        self._alike.clear()

    def _forget_rare(self) -> None:
        frequent = sorted(self.sets, key=lambda signals: -self.sets[signals].messages)[: MOST_NAMES // 2]
        keep = set(frequent)
        self.sets = {signals: one for signals, one in self.sets.items() if signals in keep}
        self._names = len(self.sets)


def united(intervals: Iterable[Interval]) -> list[Interval]:
    """Return intervals joined where they meet or lie within `PAUSE`.

    >>> united([[5, 6], [0, 1]])
    [[0, 6]]
    """
    result: list[Interval] = []
    for first, last in sorted(map(tuple, intervals)):
        if result and first <= result[-1][1] + PAUSE:
            result[-1][1] = max(result[-1][1], last)
        else:
            result.append([first, last])
    return result


def at_once(one: Sequence[Interval], other: Sequence[Interval]) -> int:
    """Return the time [ns] that lies in intervals of both, which are joined by `united`.

    >>> at_once([[0, 10]], [[8, 20], [30, 40]])
    2
    """
    return sum(max(0, min(a[1], b[1]) - max(a[0], b[0])) for a in one for b in other)
