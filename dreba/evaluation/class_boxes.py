"""Boxes of angles on which a part of REBA has at most a known score, for the figure of the reach tasks.

REBA is a function of angle classes, and the classes of an angle are nested intervals. Every posture whose Score A is
at most a lies in one of a few boxes, and so does every arm whose Score B is at most b. Tables A, B and C never fall
where a part score rises: the least score that a task allows is found by looking through pairs of boxes.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Final, NamedTuple

import numpy as np

import reba
from dreba.evaluation.reach_figure import DOF_INDEX, limits, neutral, posture
from reba.arrays import Array
from reba.method.classes import AngleClasses, angle_classes
from reba.method.rules import rules_of
from reba.posture.columns import GROUP_A, GROUP_B

RULES: Final = rules_of("measured")
"""Rules of the true scores of reach tasks."""


class Box(NamedTuple):
    """Angles from low to high (22,) [deg], between which the score of a group of parts is `score` or less.

    Degrees of freedom of other parts span their limits.
    """

    score: int
    low: Array
    high: Array

    def holds(self, other: Box) -> bool:
        """Return whether every posture of another box lies in this one."""
        return bool((self.low <= other.low).all() and (self.high >= other.high).all())


@cache
def boxes(group: str) -> tuple[Box, ...]:
    """Return the boxes of a group: "a" by Score A, "left" and "right" by the Score B of that arm.

    The neck, which no reach task moves, stays in its lowest class.

    Example:
        >>> sorted({box.score for box in boxes("left")})
        [1, 2, 3, 4, 5, 6, 7, 8]
    """
    parts = GROUP_A if group == "a" else tuple(f"{part}_{group}" for part in GROUP_B)
    angles = [own for own in angle_classes(RULES) if own.part in parts and own.columns[0] in DOF_INDEX]
    ends = [_ends(own)[:1] if own.part == "neck" else _ends(own) for own in angles]
    chosen = list(product(*ends))
    corners = np.tile(neutral(), (len(chosen), 1))
    low, high = (np.tile(limit, (len(chosen), 1)) for limit in limits())
    for row, classes in enumerate(chosen):
        for own, (least, most, corner) in zip(angles, classes, strict=True):
            places = [DOF_INDEX[column] for column in own.columns]
            low[row, places], high[row, places], corners[row, places] = least, most, corner
    scored = reba.score_array(np.array([posture(corner) for corner in corners]), rules=RULES)
    scores = scored["score_a" if group == "a" else f"score_b_{group}"]
    return tuple(Box(int(score), *ends) for score, *ends in zip(scores, low, high, strict=True))


@cache
def levels(score: int) -> tuple[tuple[int, int], ...]:
    """Return the highest pairs of Score A and Score B with at most a REBA score (Table C).

    Example:
        >>> levels(1)
        ((1, 3), (2, 1))
    """
    pairs = [(a, int(np.count_nonzero(row <= score))) for a, row in enumerate(reba.TABLE_C, start=1)]
    return tuple((a, b) for a, b in pairs if b and not any(a < x and b <= y for x, y in pairs))


@cache
def widest(group: str, score: int) -> tuple[Box, ...]:
    """Return the boxes of a group up to a score that no other one of them holds."""
    within = [box for box in boxes(group) if box.score <= score]
    return tuple(box for place, box in enumerate(within) if not _held(box, place, within))


def _ends(own: AngleClasses) -> list[tuple[float, float, float]]:
    """Return of every class of an angle its lowest and highest angle and one in no class before it [deg]."""
    place = DOF_INDEX[own.columns[0]]
    least, most = (float(limit[place]) for limit in limits())
    ends: list[tuple[float, float, float]] = []
    for one in own.classes:
        low, high = max(one.low, least), min(one.high, most)
        corner = high if ends and high > ends[-1][1] else low if ends else float(np.clip(neutral()[place], low, high))
        ends.append((low, high, corner))
    return ends


def _held(box: Box, place: int, every: list[Box]) -> bool:
    """Return whether another box holds this one; of equal boxes the first is kept."""
    return any(
        other.holds(box) and (index < place or not box.holds(other))
        for index, other in enumerate(every)
        if index != place
    )
