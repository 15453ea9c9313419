"""Changes of the workplace ranked over a whole recording, by the time that they take out of high and very high risk.

Every angle that can be kept within a class and every factor that can be changed is one bound, for both sides together.
Each bound, each pair and each triple of them is scored exactly: frames with equal points are one combination with a
duration, and every combination is scored again with the points that the bounds leave. Activity stays as recorded.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from reba.analysis.changes import MEASUREMENT_ERROR, Alternative, Modifiable, Points, choices, seen_angles
from reba.analysis.controls import controls
from reba.analysis.exposure import column, durations
from reba.analysis.modified_scores import group_score, sides_of
from reba.analysis.score_table import ScoreTable
from reba.analysis.wording import both, seconds
from reba.arrays import Array
from reba.method.classes import angle_classes
from reba.method.tables import ACTION_LEVEL_FROM, ACTION_LEVELS, TABLE_C
from reba.posture.columns import INDEX, SIDES

HIGH: Final = ACTION_LEVEL_FROM[3]
"""REBA from which the risk is high."""
MEDIUM: Final = ACTION_LEVEL_FROM[2]
"""REBA from which the risk is medium."""
SHOWN: Final = 3
"""Changes that are shown unasked: more would not be read."""
MOST_TOGETHER: Final = 3
"""Changes that are tried together."""


@dataclass(frozen=True)
class Change:
    """One bound on an angle or a factor, for both sides.

    Attributes:
        what: "trunk flexion", "load", "coupling" ...
        quantities: the angles and factors themselves: "left upper arm flexion", "right upper arm flexion".
        kind: "angle", "load", "coupling", "support" or "activity".
        target: the limit: "up to 20 deg", "under 5 kg".
        aim: [deg] the nearest ends that leave a margin to the edges of the class; None where the class has no such end.
        text: the change of the workplace in words.
        control: its step in the hierarchy of controls; `source`: the documents that ask for it.
    """

    what: str
    quantities: tuple[str, ...]
    kind: str
    target: str
    aim: tuple[float | None, float | None]
    text: str
    control: str
    source: str


@dataclass(frozen=True)
class Action:
    """One change, or several together, and the time at risk that is left [s].

    Attributes:
        changes: what is changed.
        seconds: (low, high) time at or above the score of the advice; two ends where angles were not measured.
        medium: the same at medium risk or above.
    """

    changes: tuple[Change, ...]
    seconds: tuple[float, float]
    medium: tuple[float, float]

    @property
    def text(self) -> str:
        """The changes as one sentence."""
        first, *others = (change.text for change in self.changes)
        return "; and ".join([first, *(other[:1].lower() + other[1:] for other in others)])


@dataclass(frozen=True)
class Advice:
    """The changes that take most time out of a level of risk.

    Attributes:
        at_least: REBA from which time counts: 8, or lower where no time reaches it.
        total: scored time [s].
        seconds, medium: (low, high) time at `at_least` or above, and at medium risk or above, as recorded [s].
        single: every change by itself that takes some of it away, best first.
        pair, triple: the best two and three together, None where they are no better than fewer, as figures are printed.
    """

    at_least: int
    total: float
    seconds: tuple[float, float]
    medium: tuple[float, float]
    single: tuple[Action, ...] = ()
    pair: Action | None = None
    triple: Action | None = None

    @property
    def risk(self) -> str:
        """The level whose time counts, in words: "high risk or above"."""
        level = ACTION_LEVEL_FROM.index(self.at_least)
        return f"{ACTION_LEVELS[level][0]} risk{' or above' if level < len(ACTION_LEVELS) - 1 else ''}"

    def effect(self, action: Action) -> str:
        """Return the effect of an action as text: "33.9 s -> 17.2 s"."""
        return f"{time_text(self.seconds)} -> {time_text(action.seconds)}"

    def is_seen(self, action: Action) -> bool:
        """Return whether the effect of an action shows in the figures as they are printed."""
        return time_text(action.seconds) != time_text(self.seconds)

    @property
    def tied(self) -> int:
        """How many of the changes that are not shown take as much time away as the last one that is."""
        last = self.single[:SHOWN][-1:]
        return sum(time_text(one.seconds) == time_text(last[0].seconds) for one in self.single[SHOWN:])

    def text(self, action: Action) -> str:
        """Return an action as one line."""
        level = ACTION_LEVELS[ACTION_LEVEL_FROM.index(self.at_least)][0]
        return f"{action.text}: {level}-risk time {self.effect(action)}"

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""

        def plain(action: Action | None) -> dict[str, Any] | None:
            if action is None:
                return None
            changes = [
                {
                    "what": what,
                    **{key: value for key, value in asdict(change).items() if key not in ("what", "quantities")},
                }
                for change in action.changes
                for what in change.quantities
            ]
            return {**asdict(action), "changes": changes, "text": self.text(action)}

        together = {"pair": plain(self.pair), "triple": plain(self.triple)}
        return {**asdict(self), "single": [plain(action) for action in self.single], **together}


def time_text(ends: tuple[float, float]) -> str:
    """Return a time, or both ends of its range, as text.

    >>> time_text((3.0, 3.0)), time_text((3.0, 61.5))
    ('3.0 s', '3.0 s to 1 min 01 s')
    """
    return both(*(seconds(end) for end in ends))


def advise(scores: ScoreTable, frames: NDArray[np.int64] | None = None, at_least: int | None = None) -> Advice:
    """Return the changes that take most time out of high and very high risk, ties decided by medium risk.

    Unmeasured angles are neutral at the low end and at their worst at the high end; they are never changed. The ends
    rank in this order. Left out are limits that leave no margin of `MEASUREMENT_ERROR` inside their class, those
    that the frames at risk exceed by less than it on average, and changes whose effect is not seen in the figures.

    Args:
        frames: rows of the score table; all by default.
        at_least: REBA from which time counts; by default 8, and where no time reaches it, or no change takes any of it
            away, 4, else 2.
    """
    rows = np.arange(len(scores.data)) if frames is None else frames
    weights = durations(scores.time)[rows]
    low, high = column(scores, "reba_low")[rows], column(scores, "reba_high")[rows]
    levels = [at_least] if at_least is not None else [HIGH, MEDIUM, ACTION_LEVEL_FROM[1]]
    levels = [one for one in levels if (high >= one).any()] or levels[-1:]
    every = (_advise_from(scores, rows, weights, (low, high), level) for level in levels)
    first = next(every)
    return first if first.single else next((one for one in every if one.single), first)


def _advise_from(
    scores: ScoreTable, rows: NDArray[np.int64], weights: Array, range_: tuple[Array, Array], level: int
) -> Advice:
    """Return the advice on the time from one score on."""
    low, high = range_

    def time_from(score: int) -> tuple[float, float]:
        return float(weights[low >= score].sum()), float(weights[high >= score].sum())

    advice = Advice(level, float(weights.sum()), time_from(level), time_from(MEDIUM))
    counted = high >= min(level, MEDIUM)
    if not (high >= level).any():
        return advice
    ends = _Ends(scores, rows[counted], weights[counted], bool((low < high).any()))
    bounds = _bounds(scores, ends.available, rows[high >= level])
    ranked = {n: _best(ends, bounds, level, n) for n in range(1, MOST_TOGETHER + 1)}
    before = _key(ends.left(level, ()), ends.left(MEDIUM, ()), ())
    best: dict[int, _Ranked] = {}
    for n, sets in ranked.items():
        reached = min((best[m][:2] for m in best), default=before[:2])
        if sets and sets[0][:2] < reached:
            best[n] = sets[0]
    single = [_action(ends, level, steps) for key, *_, steps in ranked[1] if key < before[0]]
    several = {n: _action(ends, level, best[n][-1]) for n in best if n > 1}
    single = [one for one in single if advice.is_seen(one)]
    seen: dict[int, Action] = {}
    shown = [advice.seconds, *(one.seconds for one in single[:1])]
    for n, one in several.items():
        if time_text(one.seconds) not in map(time_text, shown):
            seen[n] = one
            shown.append(one.seconds)
    return replace(advice, single=tuple(single), pair=seen.get(2), triple=seen.get(3))


@dataclass(frozen=True)
class _Bound:
    """A limit on one quantity: the options (index of the modifiable, index of its option) of every side."""

    change: Change
    group: str
    options: tuple[tuple[int, int], ...]
    place: int


_Steps = tuple[_Bound, ...]
_Ranked = tuple[tuple[float, float], tuple[float, float], tuple[int, ...], _Steps]
"""Time left at the level, time left at medium risk, how strict the bounds are, and the bounds."""


@dataclass
class _Ends:
    """The occurring combinations of points at both ends of the range, with their durations."""

    scores: ScoreTable
    rows: NDArray[np.int64]
    weights: Array
    open: bool
    available: tuple[Modifiable, ...] = ()
    ends: list[tuple[tuple[Modifiable, ...], Array]] = field(default_factory=list)
    _known: dict[tuple[int, str, tuple[tuple[int, int], ...]], Points] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.available = choices(self.scores, self.rows)
        for worst in (False, True) if self.open else (False,):
            every = choices(self.scores, self.rows, worst=True) if worst else self.available
            # An angle that exceeds a limit only where it is unmeasured has no option; the low end has fewest.
            options = [{option.target for option in one.options} for one in self.available]
            same = tuple(
                replace(one, options=tuple(option for option in one.options if option.target in names))
                for one, names in zip(every, options, strict=True)
            )
            self.ends.append(_combinations(same, self.weights))

    def left(self, level: int, steps: _Steps) -> tuple[float, float]:
        """Return the time that is left at or above a score at both ends [s]."""
        chosen = tuple(sorted(option for step in steps for option in step.options))
        times = []
        for end, (available, weights) in enumerate(self.ends):
            score_b = np.maximum.reduce([self._group(end, side, chosen) for side in sides_of(available)])
            reba = TABLE_C[self._group(end, "a", chosen) - 1, score_b - 1] + self._group(end, "activity", chosen)
            times.append(float(weights[reba >= level].sum()))
        return times[0], times[-1]

    def _group(self, end: int, group: str, chosen: tuple[tuple[int, int], ...]) -> Points:
        available = self.ends[end][0]
        own = tuple(option for option in chosen if available[option[0]].group == group)
        key = end, group, own
        if key not in self._known:
            self._known[key] = group_score(available, group, dict(own))
        return self._known[key]


def _combinations(available: tuple[Modifiable, ...], weights: Array) -> tuple[tuple[Modifiable, ...], Array]:
    """Return the frames with different points only, and the duration of each of them [s]."""
    points = [one.points for one in available] + [option.points for one in available for option in one.options]
    key = np.zeros(len(weights), np.int64)
    size = 1
    for values in points:
        first = int(values.min(initial=0))
        radix = int(values.max(initial=0)) - first + 1
        if size * radix > 2**62:
            key = np.unique(key, return_inverse=True)[1]
            size = len(weights)
        key = key * radix + (values - first)
        size *= radix
    _, places, inverse = np.unique(key, return_index=True, return_inverse=True)

    def of(option: Alternative) -> Alternative:
        return replace(option, points=option.points[places])

    kept = tuple(
        replace(one, points=one.points[places], options=tuple(of(option) for option in one.options))
        for one in available
    )
    return kept, np.bincount(inverse, weights, minlength=len(places)).astype(np.float64)


def _bounds(scores: ScoreTable, available: Sequence[Modifiable], at_risk: NDArray[np.int64]) -> list[_Bound]:
    """Return the bounds that leave a margin and are exceeded by more than the measurement error, mildest first."""
    grouped: dict[str, dict[str, list[tuple[int, int]]]] = {}
    for index, one in enumerate(available):
        for number, option in enumerate(one.options):
            grouped.setdefault(bound_name(one), {}).setdefault(option.target, []).append((index, number))
    angles = seen_angles(scores, at_risk)
    columns = {quantity.name: quantity.columns for quantity in angle_classes(scores.rules)}
    bounds: list[_Bound] = []
    for what, targets in grouped.items():
        for options in targets.values():
            first = available[options[0][0]].options[options[0][1]]
            if first.limits is not None:
                limits = first.limits
                rows = [INDEX[name] for index, _ in options for name in columns[available[index].what]]
                if _aim(limits) is None or _excess(angles[rows], limits) < MEASUREMENT_ERROR:
                    continue
            kind = available[options[0][0]].kind
            quantities = tuple(available[index].what for index, _ in options)
            change = _change(scores, what, quantities, kind, first)
            bounds.append(_Bound(change, available[options[0][0]].group, tuple(options), len(bounds)))
    return bounds


def bound_name(one: Modifiable) -> str:
    """Return the name of an angle or factor without a side; that of an arm is its support."""
    name = next((one.what.removeprefix(f"{side} ") for side in SIDES if one.what.startswith(f"{side} ")), one.what)
    return "arm support" if name == "arm" else name


def _aim(limits: tuple[float, float]) -> tuple[float | None, float | None] | None:
    """Return the ends of a class with a margin inside [deg], None where nothing is left between them."""
    low, high = (limits[0] + MEASUREMENT_ERROR, limits[1] - MEASUREMENT_ERROR)
    if round(high - low, 6) <= 0:
        return None
    return (round(low, 3) if np.isfinite(low) else None), (round(high, 3) if np.isfinite(high) else None)


def _excess(rows: Array, limits: tuple[float, float]) -> float:
    """Return how far the angles that lie outside the limits exceed them on average [deg]."""
    beyond = np.abs(rows - np.clip(rows, *limits))
    beyond = beyond[beyond > 0]
    return float(beyond.mean()) if len(beyond) else 0.0


def _change(scores: ScoreTable, what: str, quantities: tuple[str, ...], kind: str, option: Alternative) -> Change:
    control = controls()[what]
    low, high = option.limits or (0.0, 0.0)
    fields: Mapping[str, Any] = {
        "low": f"{round(low, 3) + 0.0:g}",
        "high": f"{round(high, 3):g}",
        "target": option.target,
        "per_minute": f"{scores.rules.repeated_per_minute:g}",
    }
    aim = (_aim(option.limits) or (None, None)) if option.limits else (None, None)
    text = control.text.format(**fields)
    return Change(what, quantities, kind, option.target, aim, text, control.control, control.source)


def _best(ends: _Ends, bounds: Sequence[_Bound], level: int, n: int) -> list[_Ranked]:
    """Return sets of n bounds, best first: for n of 1 the best limit of every quantity, else the best set alone."""
    ranked = [_key(ends.left(level, steps), ends.left(MEDIUM, steps), steps) for steps in _sets(bounds, n)]
    ranked.sort(key=lambda one: one[:3])
    if n > 1:
        return ranked[:1]
    best: dict[str, _Ranked] = {}
    for one in ranked:
        best.setdefault(one[-1][0].change.what, one)
    return list(best.values())


def _sets(bounds: Sequence[_Bound], n: int) -> Iterator[_Steps]:
    for steps in itertools.combinations(bounds, n):
        if len({step.change.what for step in steps}) == n:
            yield steps


def _key(left: tuple[float, float], medium: tuple[float, float], steps: _Steps) -> _Ranked:
    # Sums in another order differ in their last digits: such times are equal.
    rounded = [(round(low, 6), round(high, 6)) for low, high in (left, medium)]
    return rounded[0], rounded[1], tuple(step.place for step in steps), steps


def _action(ends: _Ends, level: int, steps: _Steps) -> Action:
    return Action(tuple(step.change for step in steps), ends.left(level, steps), ends.left(MEDIUM, steps))
