"""The sum of squared accelerations: a constant quadratic, and its exact restriction to some slices.

For one joint the cost of a path d (T,), relative to its initial value, is d'Ad: all agents rest before the first slice
and stop after the last one. Slices on which no other cost or constraint acts are eliminated (Schur complement): d'Ad
minimised over them is a smaller quadratic on the knots that never exceeds the cost of any path through them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lgp.scene.model import Scene
from reba.arrays import Array, Indices


@dataclass(frozen=True)
class CondensedQuadratic:
    """The acceleration cost on P knots, minimised over all other slices.

    Attributes:
        cost: C (P, P): d'Cd is the least cost of a path through d (P,).
        expand: (T, P) maps d to that path.
    """

    cost: Array
    expand: Array


def acceleration_quadratic(slices: int, tau: float, stop: bool) -> Array:
    """Return A (T, T) with d'Ad = sum of tau * acceleration^2 [rad^2 / s^3] over a path d that starts from rest.

    Args:
        slices: T.
        tau: time between slices [s].
        stop: whether the path ends at rest: then stopping after the last slice counts as well.

    >>> acceleration_quadratic(1, 1.0, stop=False).tolist()
    [[1.0]]
    """
    differences = np.eye(slices + stop, slices) - 2.0 * np.eye(slices + stop, slices, -1)
    differences += np.eye(slices + stop, slices, -2)
    if stop:
        # The slice after the last is a copy of the last: its second difference is d[T-2] - d[T-1].
        differences[slices, slices - 1] += 1.0
    return differences.T @ differences / tau**3


def eliminate_slices(matrix: Array, knots: Indices, joined: Sequence[tuple[int, int]] = ()) -> CondensedQuadratic:
    """Return the quadratic of a matrix A (T, T) on the knots (P,), rising, minimised over all other slices.

    Both slices of a pair in `joined` are equal; the second is no knot.
    """
    total = len(matrix)
    spread = np.eye(total)
    for first, second in joined:
        spread[second] = spread[first]
    dropped = {second for _, second in joined}
    free = np.setdiff1d(np.arange(total), [*knots, *dropped])
    merged = spread.T @ matrix @ spread
    expand = spread[:, knots].copy()
    cost = merged[np.ix_(knots, knots)].copy()
    if len(free):
        across = merged[np.ix_(free, knots)]
        follow = np.linalg.solve(merged[np.ix_(free, free)], across)
        cost -= across.T @ follow
        expand -= spread[:, free] @ follow
        cost = 0.5 * (cost + cost.T)
    return CondensedQuadratic(cost, expand)


@dataclass(frozen=True)
class Weights:
    """Weights of the terms of the cost.

    Attributes:
        acceleration: per rad^2/s^3 (m^2/s^3 for slides).
        ergonomics: per score point and second.
    """

    acceleration: float = 1.0
    ergonomics: float = 1.0

    @classmethod
    def of(cls, scene: Scene, slices: int | None = None) -> Weights:
        """Return those that a scene states, with these slices per phase, its own by default."""
        return cls(ergonomics=scene.ergonomic_weight(slices))


@dataclass(frozen=True)
class Costs:
    """The weighted terms of a cost."""

    acceleration: float
    ergonomics: float

    @property
    def total(self) -> float:
        """Their sum."""
        return self.acceleration + self.ergonomics
