"""The sum of squared accelerations: a constant quadratic, and its exact restriction to some slices.

For one joint the cost of a path d (T,), relative to its initial value, is d'Ad: all agents rest before the first slice
and stop after the last one. Slices on which no other cost or constraint acts are eliminated (Schur complement): d'Ad
minimised over them is a smaller quadratic on the knots that never exceeds the cost of any path through them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lgp.defaults import TIME_WEIGHT
from lgp.errors import LgpError
from lgp.scene.model import SCENE, Scene
from reba.arrays import Array, Indices
from reba.checks import COUNT, NOT_NEGATIVE, accepts, shown


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


def acceleration_quadratic_of(steps: Array, stop: bool) -> Array:
    """Return A (T, T) as `acceleration_quadratic` does, for slices at unequal times.

    The acceleration at a slice is the change of velocity over half the steps before and after it; before the first and
    after the last slice there is one more step, as long as that beside it.

    Args:
        steps: time from the slice before to each slice [s], (T,).
        stop: whether the path ends at rest.

    >>> bool(np.allclose(acceleration_quadratic_of(np.full(4, 0.5), True), acceleration_quadratic(4, 0.5, True)))
    True
    """
    total = len(steps)
    velocity = (np.eye(total) - np.eye(total, k=-1)) / steps[:, None]
    velocity = np.concatenate([np.zeros((1, total)), velocity, np.zeros((int(stop), total))])
    around = np.concatenate([steps[:1], steps, steps[-1:]])[: total + 1 + stop]
    difference = np.diff(velocity, axis=0) / np.sqrt(0.5 * (around[:-1] + around[1:]))[:, None]
    return np.asarray(difference.T @ difference)


def slope_by_steps(path: Array, steps: Array, stop: bool) -> Array:
    """Return the derivative (T,) of the acceleration cost of a path (T, n) by the logarithm of each step.

    Scaling all of them by a factor scales the cost by its third power, so they sum to -3 times the cost.
    """
    total = len(steps)
    velocity = np.diff(path, axis=0, prepend=0.0) / steps[:, None]
    rest = np.zeros((1, path.shape[1]))
    velocity = np.concatenate([rest, velocity, rest[: int(stop)]])
    around = np.concatenate([steps[:1], steps, steps[-1:]])[: total + 1 + stop]
    middle = 0.5 * (around[:-1] + around[1:])
    change = np.diff(velocity, axis=0)
    cost = (change**2).sum(axis=1) / middle
    slope = np.zeros(total + 2)
    count = len(middle)
    # Of each pair of neighbouring steps: a velocity falls with its own step, and the change is divided by their mean.
    slope[:count] += 2.0 * (change * velocity[:count]).sum(axis=1) / middle - cost * around[:count] / (2.0 * middle)
    slope[1 : count + 1] -= 2.0 * (change * velocity[1 : count + 1]).sum(axis=1) / middle
    slope[1 : count + 1] -= cost * around[1 : count + 1] / (2.0 * middle)
    own = slope[1 : total + 1].copy()
    own[0] += slope[0]
    own[-1] += slope[total + 1]
    return own


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
        time: per second.

    Raises:
        LgpError: a weight is no number, or negative.
    """

    acceleration: float = 1.0
    ergonomics: float = 1.0
    time: float = TIME_WEIGHT

    def __post_init__(self) -> None:
        for name, weight in vars(self).items():
            if not NOT_NEGATIVE.fits(weight):
                raise LgpError(f"weight of {name} is {shown(weight)}; expected {NOT_NEGATIVE.expected}")

    @classmethod
    @accepts(LgpError, scene=SCENE, slices=COUNT.or_none())
    def of(cls, scene: Scene, slices: int | None = None) -> Weights:
        """Return those that a scene states, with these slices per phase, its own by default."""
        return cls(ergonomics=scene.ergonomic_weight(slices), time=scene.cost.time_weight)


@dataclass(frozen=True)
class Costs:
    """The weighted terms of a cost; `time` is the same for every motion of the same duration.

    Attributes:
        terms: cost terms of one's own.
        actions: what the actions cost in the PDDL domain.
    """

    acceleration: float
    ergonomics: float
    time: float = 0.0
    terms: float = 0.0
    actions: float = 0.0

    @property
    def motion(self) -> float:
        """The terms that depend on the motion."""
        return self.acceleration + self.ergonomics + self.terms

    @property
    def total(self) -> float:
        """The sum of all terms."""
        return self.motion + self.time + self.actions
