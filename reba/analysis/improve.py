"""The smallest changes that bring frames to a lower action level, by exact search over classes.

REBA only changes where an angle passes from one class to the next, so a change is a limit on an angle ("trunk flexion
up to 20"), a lighter load, a better grip or another factor, and its size is how far the frames lie outside the limit.
All combinations of limits are searched: the part scores under each combination of group A and of each arm are
tabulated, dominated combinations dropped, and the cheapest chosen whose total stays at or under the target in every
frame. For several frames (a worst minute) one set of limits must serve them all.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from reba.analysis.changes import Modifiable, Objective, Points, PostureChange, choices, objectives
from reba.analysis.modified_scores import part_score, parts_of, sides_of, table_score, total
from reba.analysis.score_table import ScoreTable
from reba.errors import PostureError
from reba.method.tables import ACTION_LEVEL_FROM, ACTION_LEVELS, LEVEL_OF, TABLE_C

WORST_SECONDS: Final = 60.0
"""[s] Length of the worst interval, which one set of changes improves."""


@dataclass(frozen=True)
class Improvement:
    """One set of changes that lowers the action level.

    Attributes:
        goal: what was made smallest: "least movement", "fewest changes", "load only" ...
        changes: the changes, largest first.
        degrees: sum of the angle changes, averaged over the frames [deg].
        reba_before, reba_after: highest REBA of the frames (unmeasured angles taken as neutral).
        level_before, level_after: their action levels.
    """

    goal: str
    changes: tuple[PostureChange, ...]
    degrees: float
    reba_before: int
    reba_after: int
    level_before: int
    level_after: int

    def text(self) -> str:
        """Return the improvement as one line."""
        what = "; ".join(change.text() for change in self.changes)
        risk = ACTION_LEVELS[self.level_after][0]
        return f"{what}: REBA {self.reba_before} -> {self.reba_after} ({risk})"

    def to_dict(self) -> dict[str, Any]:
        """Return plain data for JSON."""
        return {**asdict(self), "text": self.text()}


def improve_frame(scores: ScoreTable, frame: int, to_level: int | None = None) -> list[Improvement]:
    """Return the smallest changes for one frame, one for each goal that can be reached; see `improve_frames`."""
    return improve_frames(scores, np.array([frame]), to_level)


def worst_minute(scores: ScoreTable, seconds: float = WORST_SECONDS) -> NDArray[np.int64]:
    """Return the frames of the interval of `seconds` with the highest mean REBA (low end of the range)."""
    time = scores.time
    if not len(time):
        raise PostureError("the recording has no frames to improve; choose a longer part of it")
    reba = scores.data["reba_low"].to_numpy(np.float64)
    total = np.concatenate([[0.0], np.cumsum(reba)])
    stop = np.searchsorted(time, time + seconds, side="left")
    complete = stop < len(time) if time[-1] - time[0] > seconds else np.arange(len(time)) == 0
    means = np.where(complete, (total[stop] - total[:-1]) / np.maximum(stop - np.arange(len(time)), 1), -1.0)
    first = int(np.argmax(means))
    return np.arange(first, stop[first])


def improve_frames(scores: ScoreTable, frames: NDArray[np.int64], to_level: int | None = None) -> list[Improvement]:
    """Return the smallest common changes that bring every given frame to a lower action level, one per reachable goal.

    The list is empty if the frames are at or below the level. Unmeasured angles are taken as neutral and not changed.

    Args:
        frames: rows of the score table.
        to_level: highest action level (0 to 3) that may remain; by default one below the highest among the frames.
    """
    available = choices(scores, frames)
    before = int(total(available, {}).max())
    level = int(LEVEL_OF[before])
    goal_level = level - 1 if to_level is None else to_level
    if level <= goal_level or goal_level < 0:
        return []
    target = ACTION_LEVEL_FROM[goal_level + 1] - 1
    improvements: list[Improvement] = []
    for objective in objectives():
        best = _search(available, objective, target)
        if best is None or any({c.what for c in best} == {c.what for c in other.changes} for other in improvements):
            continue
        chosen = {change.choice: change.option for change in best}
        after = int(total(available, chosen).max())
        improvements.append(
            Improvement(
                goal=objective.name,
                changes=tuple(sorted(best, key=lambda change: -change.degrees)),
                degrees=float(sum(change.degrees for change in best)),
                reba_before=before,
                reba_after=after,
                level_before=level,
                level_after=int(LEVEL_OF[after]),
            )
        )
    return improvements


@dataclass(frozen=True)
class _Combination:
    """Options of one group and what they cost; `options` are (choice index, option index), others unchanged."""

    options: tuple[tuple[int, int], ...]
    cost: float


Ranked = list[tuple[Points, _Combination]]
"""Points (F,) under combinations of options."""


def _search(available: tuple[Modifiable, ...], objective: Objective, target: int) -> list[PostureChange] | None:
    """Return the cheapest changes under an objective that keep every frame at or under the target, or None."""
    a = _combinations(available, objective, "a")
    arms = [_combinations(available, objective, side) for side in sides_of(available)]
    active = _combinations(available, objective, "activity")
    best: tuple[float, tuple[tuple[int, int], ...]] | None = None
    limits: dict[bytes, tuple[float, tuple[tuple[int, int], ...]] | None] = {}
    for activity, combination in active:
        for score_a, chosen_a in a:
            so_far = combination.cost + chosen_a.cost
            if best is not None and so_far >= best[0]:
                break
            # The highest Score B that Table C allows in each frame.
            allowed = (TABLE_C[score_a - 1].astype(np.int16) + activity[:, None] <= target).sum(axis=1).astype(np.int16)
            key = allowed.tobytes()
            if key not in limits:
                limits[key] = _cheapest_arms(arms, allowed)
            rest = limits[key]
            if rest is not None and (best is None or so_far + rest[0] < best[0]):
                best = (so_far + rest[0], (*combination.options, *chosen_a.options, *rest[1]))
    if best is None or not best[1]:
        return None
    return [available[choice].change(choice, option) for choice, option in best[1]]


def _cheapest_arms(arms: list[Ranked], allowed: Points) -> tuple[float, tuple[tuple[int, int], ...]] | None:
    cost = 0.0
    options: tuple[tuple[int, int], ...] = ()
    for combinations in arms:
        fitting = next((c for score_b, c in combinations if bool((score_b <= allowed).all())), None)
        if fitting is None:
            return None
        cost += fitting.cost
        options += fitting.options
    return cost, options


def _combinations(available: tuple[Modifiable, ...], objective: Objective, group: str) -> Ranked:
    """Return the scores of a group (F,) under every useful combination of options, cheapest first, none dominated.

    Each part is searched by itself first: no table falls along an index, so that a combination which is dominated
    within its part is dominated within the group.
    """
    parts = parts_of(available, group)
    ranked = [_undominated(_part_combinations(available, objective, members)) for members in parts.values()]
    combinations = []
    for picked in itertools.product(*ranked):
        points = dict(zip(parts, (points for points, _ in picked), strict=True))
        options = tuple(option for _, combination in picked for option in combination.options)
        cost = sum(combination.cost for _, combination in picked)
        combinations.append((table_score(points, group), _Combination(options, cost)))
    return _undominated(combinations)


def _part_combinations(available: tuple[Modifiable, ...], objective: Objective, members: list[int]) -> Ranked:
    useful = [index for index in members if objective.allows(available[index])]
    combinations = []
    for picked in itertools.product(*(_options(available[index]) for index in useful)):
        chosen = {index: option for index, option in zip(useful, picked, strict=True) if option is not None}
        cost = sum(objective.cost(available[index], option) for index, option in chosen.items())
        combinations.append((part_score(available, members, chosen), _Combination(tuple(chosen.items()), cost)))
    return combinations


def _undominated(combinations: Ranked) -> Ranked:
    """Return the combinations that no other one undercuts in cost and in the points of every frame, cheapest first."""
    cheapest: dict[bytes, tuple[Points, _Combination]] = {}
    for points, combination in combinations:
        key = points.tobytes()
        if key not in cheapest or combination.cost < cheapest[key][1].cost:
            cheapest[key] = (points, combination)
    undominated: Ranked = []
    for points, combination in sorted(cheapest.values(), key=lambda item: item[1].cost):
        if not any(bool((other <= points).all()) for other, _ in undominated):
            undominated.append((points, combination))
    return undominated


def _options(choice: Modifiable) -> Iterator[int | None]:
    yield None
    yield from range(len(choice.options))
