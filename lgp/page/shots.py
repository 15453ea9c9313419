"""From where each action is looked at: near enough, and from a side where nothing stands before the hands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AROUND = np.radians([-150, -130, -110, -90, -70, -50, -30, 30, 50, 70, 90, 110, 130, 150])
"""Directions of the eye that are tried, from the line human - robot, counter-clockwise seen from above."""
ABOVE = np.radians([16, 28, 42])
"""Elevations of the eye that are tried."""
BEST = np.radians([75, 22])
"""What is tried first: from the side, a little in front of the human, and a little from above."""
CLEAR = 0.06
"""[m] What is nearer than this to the line of sight may hide what lies behind."""
NEAR = 0.15
"""[m] What is nearer than this to what is looked at belongs to it."""
HIDDEN, ODD, TURN = 3.0, 0.6, 0.5
"""Prices of a hidden spot, of each radian away from `BEST`, and of each radian away from the former shot."""


@dataclass(frozen=True, eq=False)
class Shot:
    """What is in the picture, (n, 3) points [m], and the unit vector (3,) from there to the eye."""

    points: Array
    towards: Array


@dataclass(frozen=True, eq=False)
class Subject:
    """What a shot is of.

    Attributes:
        points: (n, 3) that must be in the picture.
        spots: (m, 3) that should not be hidden.
        solid: (k, 3) points all over what may hide them.
    """

    points: Array
    spots: Array
    solid: Array


def shots(subjects: Sequence[Subject], ahead: float) -> tuple[Shot, ...]:
    """Return a shot of each subject; a later one keeps its direction as long as that shows enough.

    Args:
        subjects: in the order in which they are seen.
        ahead: direction of the line human - robot [rad].
    """
    found: list[Shot] = []
    for subject in subjects:
        former = found[-1].towards if found else None
        prices = [
            (_price(subject, _unit(ahead + around, above), around, above, former), around, above)
            for around in AROUND.tolist()
            for above in ABOVE.tolist()
        ]
        _, around, above = min(prices)
        found.append(Shot(subject.points, _unit(ahead + around, above)))
    return tuple(found)


def _price(subject: Subject, towards: Array, around: float, above: float, former: Array | None) -> float:
    odd = abs(abs(around) - BEST[0]) + 2.0 * abs(above - BEST[1])
    turned = 0.0 if former is None else float(np.arccos(np.clip(former @ towards, -1.0, 1.0)))
    return HIDDEN * hidden(subject.spots, subject.solid, towards) + ODD * odd + TURN * turned


def hidden(spots: Array, solid: Array, towards: Array) -> float:
    """Return the share of (m, 3) spots that (k, 3) points hide from an eye far away in a direction (3,).

    >>> hidden(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.01]]), np.array([1.0, 0.0, 0.0]))
    1.0
    """
    if not len(spots):
        return 0.0
    covered = 0
    for spot in spots:
        away = solid - spot
        depth = away @ towards
        aside = np.linalg.norm(away - depth[:, None] * towards, axis=1)
        covered += bool(((depth > NEAR) & (aside < CLEAR)).any())
    return covered / len(spots)


def _unit(around: float, above: float) -> Array:
    return np.array([np.cos(around) * np.cos(above), np.sin(around) * np.cos(above), np.sin(above)])
