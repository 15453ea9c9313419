"""The least true REBA that a reach task allows: a proved lower bound, and a posture that reaches it.

Best first over pairs of Scores A and B in the order of Table C. Of each pair, branch and bound over pelvis height and
trunk angles shows that no posture reaches the targets: a box of them is out if one hand, seen from its shoulder, is
further from everything that the arm reaches (`hand_sets`) than the box can move it. Where this fails, or a posture is
found, the search ends. What is proved holds for hands within `TOLERANCE` of their targets.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from dreba.evaluation.class_boxes import Box, levels, widest
from dreba.evaluation.hand_sets import CAP, ROUNDING, DistanceField
from dreba.evaluation.polish import polish
from dreba.evaluation.reach_figure import CHAINS, DOF_INDEX, neutral, pelvis, true_score
from dreba.evaluation.reach_tasks import INFEASIBLE, ReachTask, StoredTask
from dreba.evaluation.staged_minimiser import TOLERANCE
from reba.arrays import Array

MOST_BOXES: Final = 300_000
"""Boxes of trunk postures examined for one pair of scores, before the bound is left open."""
SEARCHES: Final = 12
"""Postures from which one of a lower score is looked for."""
BUDGET: Final = 400
"""Evaluations of the hand positions in each of these searches."""
_TRUNK: Final = [joint.dof for joint in CHAINS["left"][:3]]
_KNEES: Final = [DOF_INDEX[f"knee_flexion_{side}"] for side in ("left", "right")]
_REACH: Final = float(sum(np.linalg.norm(joint.offset) for joint in CHAINS["left"][3:]))
_OFF: Final = float(np.sqrt(3.0) * TOLERANCE + ROUNDING)
"""[m] Largest distance of a hand from its target where every coordinate is within `TOLERANCE`."""


def least_score(task: ReachTask, fields: Mapping[int, DistanceField], seed: int = 0) -> StoredTask:
    """Return a task with the proved bound and the lowest score reached; the search ends where they meet.

    Args:
        fields: of `hand_sets.hand_fields`; Scores B above the highest of them are not excluded.
        seed: of the postures from which lower scores are looked for.

    Example:
        >>> from dreba.evaluation.reach_tasks import tasks
        >>> found = least_score(tasks(3)[2], {})
        >>> found.proved, found.reached, found.certified
        (1, 1, True)
    """
    rng = np.random.default_rng(seed)
    dofs, reached, proved, stopped = neutral(), INFEASIBLE, 1, False
    for search in range(SEARCHES):
        start = neutral() if search == 0 else neutral() + rng.uniform(-60.0, 60.0, len(dofs))
        polished = np.round(polish(start, task, BUDGET, seed=search).dofs, 4)  # as it is stored
        solved = float(np.max(np.abs(task.constraint(polished)[0]))) <= TOLERANCE
        if solved and true_score(polished) < reached:
            dofs, reached = polished, true_score(polished)
        while proved < reached and not stopped:
            stopped = not all(excluded(task, a, b, fields) for a, b in levels(proved))
            proved += not stopped
        if proved == reached:
            break
    return StoredTask(task, proved, reached, tuple(float(angle) for angle in dofs))


class _Poses(NamedTuple):
    """Boxes (n, 4) of pelvis height [m] and trunk flexion, side bend and twist [rad]."""

    low: Array
    high: Array


def excluded(task: ReachTask, score_a: int, score_b: int, fields: Mapping[int, DistanceField]) -> bool:
    """Return whether it is proved that no posture of at most these scores solves a task.

    Args:
        fields: by Score B; a pair whose Score B is not among them is not excluded.
    """
    if score_b not in fields:
        return False
    boxes = _poses(widest("a", score_a))
    examined = 0
    while len(boxes.low):
        examined += len(boxes.low)
        if examined > MOST_BOXES:
            return False
        middle, half = (boxes.low + boxes.high) / 2.0, (boxes.high - boxes.low) / 2.0
        out, near, moves = np.zeros(len(middle), bool), np.ones(len(middle), bool), np.zeros_like(middle)
        for side, target in task.targets.items():
            bound, by_each = _bounds(np.array(target), side, middle, half, fields[score_b])
            out |= bound > by_each.sum(axis=1) + _OFF
            near &= bound <= _OFF
            moves = np.maximum(moves, by_each)
        if near.any():
            return False  # not even this single posture can be excluded, so that smaller boxes would not help
        boxes = _halves(boxes.low[~out], boxes.high[~out], moves[~out].argmax(axis=1))
    return True


def _poses(group_a: tuple[Box, ...]) -> _Poses:
    """Return the boxes of pelvis height and trunk of boxes of Group A."""
    low, high = [], []
    for box in group_a:
        bent, straight = neutral(), neutral()
        bent[_KNEES], straight[_KNEES] = box.high[_KNEES], box.low[_KNEES]
        low.append([pelvis(bent)[0], *np.radians(box.low[_TRUNK])])
        high.append([pelvis(straight)[0], *np.radians(box.high[_TRUNK])])
    return _Poses(np.array(low), np.array(high))


def _halves(low: Array, high: Array, along: Array) -> _Poses:
    """Return both halves of every box, cut in the middle of one variable."""
    rows = np.arange(len(low))
    middle = (low[rows, along] + high[rows, along]) / 2.0
    lower_end, upper_start = high.copy(), low.copy()
    lower_end[rows, along], upper_start[rows, along] = middle, middle
    return _Poses(np.concatenate([low, upper_start]), np.concatenate([lower_end, high]))


def _bounds(target: Array, side: str, middle: Array, half: Array, field: DistanceField) -> tuple[Array, Array]:
    """Return of every box the least distance (n,) [m] of a target from what the arm reaches, for the middle of the box,
    and how far each variable (n, 4) can move the target as seen from the shoulder.

    A rotation by an angle moves a point by at most the angle times its distance from the axis. The trunk turns about
    its flexion axis first, so that this distance is known; of the others the distance from the pelvis is a bound.
    """
    x, y = (np.full(len(middle), target[place]) for place in (0, 1))
    z = target[2] - middle[:, 0]
    highest = np.abs(z) + half[:, 0]
    from_axis, from_pelvis = np.hypot(x, highest), np.sqrt(x**2 + y**2 + highest**2)
    moves = half * np.stack([np.ones(len(middle)), from_axis, from_pelvis, from_pelvis], axis=1)
    flexion, bend, twist = middle[:, 1:].T
    x, z = np.cos(flexion) * x - np.sin(flexion) * z, np.sin(flexion) * x + np.cos(flexion) * z
    y, z = np.cos(bend) * y + np.sin(bend) * z, -np.sin(bend) * y + np.cos(bend) * z
    x, y = np.cos(twist) * x + np.sin(twist) * y, -np.sin(twist) * x + np.cos(twist) * y
    seen = np.stack([x, y, z], axis=1) - np.array(CHAINS[side][2].offset)
    beyond = np.linalg.norm(seen, axis=1) - _REACH
    if side == "right":
        seen[:, 1] *= -1.0  # the fields are those of the left arm
    near = np.sqrt(np.minimum(field.at(seen), CAP**2))
    return np.maximum(near, beyond), moves
