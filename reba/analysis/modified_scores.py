"""Scores of frames under chosen changes: the points of every part, combined by Tables A, B and C."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from reba.analysis.changes import Modifiable, Points
from reba.method.tables import PART_MAXIMA, TABLE_A, TABLE_B, TABLE_C
from reba.posture.columns import GROUP_A, GROUP_B, SIDES

Available = Sequence[Modifiable]
"""The angles and factors of the frames that can be changed."""
Chosen = Mapping[int, int]
"""Index of an angle or a factor -> index of the option that was chosen for it; others stay as they are."""


def members_of(available: Available, group: str) -> list[int]:
    """Return the indices of the angles and factors of a group."""
    return [index for index, one in enumerate(available) if one.group == group]


def parts_of(available: Available, group: str) -> dict[str, list[int]]:
    """Return the indices of each part of a group."""
    parts: dict[str, list[int]] = {}
    for index in members_of(available, group):
        parts.setdefault(available[index].part, []).append(index)
    return parts


def sides_of(available: Available) -> list[str]:
    """Return the sides that count for the total."""
    return [side for side in SIDES if members_of(available, side)]


def part_score(available: Available, members: Sequence[int], chosen: Chosen) -> Points:
    """Return the score of one part (F,) with some options chosen."""
    shared: dict[str, Points] = {}
    score = np.zeros_like(available[members[0]].points)
    for index in members:
        one = available[index]
        points = one.options[chosen[index]].points if index in chosen else one.points
        if one.shares:
            shared[one.shares] = np.maximum(shared.get(one.shares, np.zeros_like(points)), points)
        else:
            score = score + points
    part = available[members[0]].part
    lowest = 1 if part in GROUP_A + GROUP_B else 0
    return np.clip(sum(shared.values(), score), lowest, PART_MAXIMA[part])


def table_score(parts: Mapping[str, Points], group: str) -> Points:
    """Return Score A, Score B of a side or the activity points (F,) from the scores of the parts of a group."""
    if group == "activity":
        return parts["activity"]
    table, body, extra = (TABLE_A, GROUP_A, "load_force") if group == "a" else (TABLE_B, GROUP_B, "coupling")
    score: Points = table[tuple(parts[part] - 1 for part in body)].astype(np.int16) + parts[extra]
    return score


def group_score(available: Available, group: str, chosen: Chosen) -> Points:
    """Return the score of a group (F,) with some options chosen."""
    parts = parts_of(available, group)
    return table_score({part: part_score(available, members, chosen) for part, members in parts.items()}, group)


def total(available: Available, chosen: Chosen) -> Points:
    """Return REBA (F,) with some options chosen."""
    score_b = np.maximum.reduce([group_score(available, side, chosen) for side in sides_of(available)])
    score_a, activity = (group_score(available, group, chosen) for group in ("a", "activity"))
    reba: Points = TABLE_C[score_a - 1, score_b - 1].astype(np.int16) + activity
    return reba
