"""`polish`: the last step of a minimisation, into a class box of a lower true score.

The minimum of a surrogate lies as often beside the best class as inside it. From there, `polish` looks for boxes of
angle classes with a lower exact REBA score, lowest first. In each it begins with the posture whose hands are nearest to
their targets, looked up in a table of what an arm reaches, and solves the constraint by a few bounded least-squares
steps. It takes a posture only if it satisfies the constraint: the true score can fall and never rise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Final, NamedTuple

import numpy as np

from dreba.evaluation.class_boxes import Box, levels, widest
from dreba.evaluation.reach_figure import ARMS, from_shoulder, hand, neutral, true_score
from dreba.evaluation.reach_tasks import INFEASIBLE, ReachTask
from dreba.evaluation.staged_minimiser import SCALE, TOLERANCE
from reba.arrays import Array, Indices
from reba.posture.columns import SIDES

STEPS: Final = 8
"""Most evaluations of the constraint inside one box."""
DAMPING: Final = 1e-3
"""Weight of the squared change of scaled angles beside that of the residual [m]."""
LONGEST: Final = 1.5
"""Longest change of a scaled angle in one step."""
FARTHEST: Final = 0.25
"""[m] Boxes in which no posture of the table comes nearer to the targets are not tried."""
POSTURES: Final = 200
"""Arm postures of each box in the table."""
TRUNKS: Final = 64
"""Postures of trunk and knees looked at in each box, beside the nearest one."""
TRIES: Final = 2
"""Of these, postures from which the task is solved."""
STALLED: Final = 0.7
"""A step that leaves more than this share of the residual ends the search in a box."""


class Polished(NamedTuple):
    """Result: degrees of freedom (22,) [deg], and the number of evaluations of the hand positions."""

    dofs: Array
    evaluations: int


def polish(dofs: Array, task: ReachTask, budget: int, seed: int = 0) -> Polished:
    """Return a posture of a lower true score that solves a reach task, or the given one if none is found.

    Args:
        dofs: (22,) [deg], the end of a minimisation, whether it solves the task or not.
        budget: most evaluations of the hand positions.
        seed: of the trunk postures that are looked up.

    Example:
        >>> from dreba.evaluation.reach_tasks import tasks
        >>> task = tasks(1, space="bench")[0]
        >>> found = polish(neutral(), task, budget=60)
        >>> bool(abs(task.constraint(found.dofs)[0]).max() < 1e-3), true_score(found.dofs)
        (True, 2)
    """
    if budget < 1:
        return Polished(dofs, 0)
    score = true_score(dofs) if _largest(task.constraint(dofs)[0]) <= TOLERANCE else INFEASIBLE
    used = 1
    for lower in range(1, score):
        for one in sorted(_tries(dofs, task, lower, seed), key=lambda one: one.distance):
            if one.distance > FARTHEST or used >= budget:
                break
            moved, evaluations = _solve(one, task, min(STEPS, budget - used))
            used += evaluations
            if moved is not None and true_score(moved) <= lower:
                return Polished(moved, used)
    return Polished(dofs, used)


class _Try(NamedTuple):
    """A box, the posture in it to begin with, and its largest distance [m] between hands and targets."""

    distance: float
    start: Array
    low: Array
    high: Array


def _tries(dofs: Array, task: ReachTask, score: int, seed: int) -> Iterator[_Try]:
    """Yield tries for each widest box of Group A that allows a REBA score, with the best boxes of the arms."""
    rng = np.random.default_rng(seed)
    for score_a, score_b in levels(score):
        table = _arm_table(score_b)
        for a in widest("a", score_a):
            starts = np.vstack([np.clip(dofs, a.low, a.high), rng.uniform(a.low, a.high, (TRUNKS, len(dofs)))])
            distances, nearest = np.zeros(len(starts)), {}
            for side, target in task.targets.items():
                distance, nearest[side] = table.nearest(from_shoulder(starts, side, target) * _MIRROR[side])
                distances = np.maximum(distances, distance)
            for best in np.argsort(distances)[:TRIES]:
                start, low, high = starts[best], a.low.copy(), a.high.copy()
                for side in SIDES:
                    place = int(nearest[side][best]) if side in nearest else 0
                    box = table.boxes[place]
                    start[ARMS[side]] = table.postures[place]
                    low[ARMS[side]], high[ARMS[side]] = box.low[ARMS["left"]], box.high[ARMS["left"]]
                yield _Try(float(distances[best]), start, low, high)


_MIRROR: Final = {"left": np.array([1.0, 1.0, 1.0]), "right": np.array([1.0, -1.0, 1.0])}
"""Both arms are alike: what the left one reaches, mirrored."""


class _ArmTable(NamedTuple):
    """Postures (n, 7) [deg] of the left arm with a Score B up to a limit, neutral first; their boxes.

    `nearest` is `query` of a tree of their grips [m]: points (n, 3) -> distances to the nearest grip, its number.
    """

    postures: Array
    boxes: list[Box]
    nearest: Callable[[Array], tuple[Array, Indices]]


@cache
def _arm_table(score_b: int) -> _ArmTable:
    """Return random postures of every box of a Score B, and the neutral arm, which is free of cost."""
    from scipy.spatial import KDTree

    rng, places = np.random.default_rng(score_b), ARMS["left"]
    boxes = widest("left", score_b)
    rest = neutral()
    postures = [
        rest[places],
        *(row for box in boxes for row in rng.uniform(box.low, box.high, (POSTURES, 22))[:, places]),
    ]
    home = next(box for box in widest("left", 1) if (box.low <= rest).all() and (rest <= box.high).all())
    upright = np.zeros(len(rest))
    shoulder = -from_shoulder(upright[None], "left", (0.0, 0.0, 0.0))[0]
    grips = []
    for posture in postures:
        upright[places] = posture
        grips.append(hand(upright, "left")[0] - shoulder)
    every = [home, *(box for box in boxes for _ in range(POSTURES))]
    return _ArmTable(np.array(postures), every, KDTree(np.array(grips)).query)


def _solve(one: _Try, task: ReachTask, most: int) -> tuple[Array | None, int]:
    """Return a posture of a box that solves the task, None if none was found, and the number of evaluations.

    Damped Gauss-Newton steps; the search ends early where they stall, as many boxes are out of reach.
    """
    dofs, least = one.start, np.inf
    for number in range(most):
        residuals, jacobian = task.constraint(dofs)
        now = _largest(residuals)
        if now <= TOLERANCE / 2:
            return dofs, number + 1
        if number > 1 and now > STALLED * least:
            return None, number + 1
        least = min(least, now)
        low, high = (one.low - dofs) / SCALE, (one.high - dofs) / SCALE
        dofs = np.clip(dofs + _bounded_step(jacobian * SCALE, residuals, low, high) * SCALE, one.low, one.high)
    return None, most


def _bounded_step(jacobian: Array, residuals: Array, low: Array, high: Array) -> Array:
    """Return the damped least-squares step within bounds (scaled): variables that reach a bound stay there."""
    low, high = np.maximum(low, -LONGEST), np.minimum(high, LONGEST)
    step = np.zeros(len(low))
    free = np.ones(len(low), bool)
    damping = DAMPING * np.eye(len(residuals))
    while free.any():
        own = jacobian[:, free]
        rest = residuals + jacobian[:, ~free] @ step[~free]
        step[free] = -own.T @ np.linalg.solve(own @ own.T + damping, rest)
        bounded = np.clip(step, low, high)
        reached = free & (bounded != step)
        step = bounded
        if not reached.any():
            break
        free &= ~reached
    return step


def _largest(residuals: Array) -> float:
    return float(np.max(np.abs(residuals), initial=0.0))
