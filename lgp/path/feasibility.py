"""How far a hand gets at most, whatever its joints do: a bound that needs no search.

Joint origins are a constant distance apart, or, across one joint, a distance that its limits bound in closed form. The
shortest sum of such distances along the chain is a length that the hand cannot exceed, counted from where the agent
stands: the slides of its base and the shift along its first joint's axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from lgp.world.model import World
from lgp.world.robot import slides
from lgp.world.scene import Hand

Array = NDArray[np.float64]

ROUNDS = 20
"""Alternating projections in search of the direction that separates best; any direction gives a true bound."""


@dataclass(frozen=True)
class Top:
    """A level rectangle: centre (3,), half sides (2,) [m] along the directions (2, 3); a point has half sides of 0."""

    centre: Array
    halves: Array
    sides: Array

    def nearest(self, point: Array) -> Array:
        """Return the point (3,) of the rectangle that is nearest."""
        along = np.clip(self.sides @ (point - self.centre), -self.halves, self.halves)
        return np.asarray(self.centre + along @ self.sides)

    def least(self, direction: Array) -> float:
        """Return the least d'p of its points p for a direction d (3,)."""
        return float(self.centre @ direction - self.halves @ np.abs(self.sides @ direction))


@dataclass(frozen=True)
class Span:
    """Where a hand can be at most: within `length` of a point that slides.

    Attributes:
        root: (3,) the point with every slide at 0 [m].
        slides: (s, 3) directions of the slides, `lower` and `upper` (s,) their ends [m].
        length: [m].
    """

    root: Array
    slides: Array
    lower: Array
    upper: Array
    length: float

    def beyond(self, top: Top) -> float:
        """Return by how much [m] the hand stays away from a table top at least; not above 0 if it may reach it."""
        at = 0.5 * (self.lower + self.upper)
        best = -np.inf
        for _ in range(ROUNDS):
            root = self.root + at @ self.slides
            away = top.nearest(root) - root
            distance = float(np.linalg.norm(away))
            if distance < 1e-9:
                break
            direction = away / distance
            along = self.slides @ direction
            far = self.root @ direction + np.maximum(self.lower * along, self.upper * along).sum()
            best = max(best, top.least(direction) - float(far))
            moved = np.clip(self.slides @ (root + away - self.root), self.lower, self.upper)
            if np.abs(moved - at).max(initial=0.0) < 1e-6:
                break
            at = moved
        return max(best, 0.0) - self.length


def span(world: World, hand: Hand) -> Span:
    """Return the span of a hand.

    Example:
        >>> span(world, world.scene.hands["baxter.left"]).length         # doctest: +SKIP
        1.21
    """
    model = world.model
    data = model.createData()
    frame = world.frame(hand.full)
    pin.framesForwardKinematics(model, data, world.start)
    chain = list(model.supports[model.frames[frame].parentJoint])[1:]
    at = [data.oMi[joint].translation.copy() for joint in chain] + [data.oMf[frame].translation.copy()]
    axes = pin.computeJointJacobians(model, data, world.start)
    columns = np.array([model.joints[joint].idx_q for joint in chain], dtype=np.intp)
    sliding = 0
    while sliding < len(chain) and slides(model.joints[chain[sliding]]):
        sliding += 1
    own = columns[:sliding]
    moves = axes[:3, own].T
    root = at[sliding] - world.start[own] @ moves
    low, high = (limit - world.start for limit in (world.lower, world.upper))
    turns = axes[3:, columns[sliding:]].T
    free = np.array([slides(model.joints[joint]) for joint in chain[sliding:]], dtype=bool)
    if free.any():
        # A slide behind a turning joint stretches the arm: nothing is claimed about it.
        return Span(root, moves, world.lower[own], world.upper[own], np.inf)
    points = np.array(at[sliding:])
    shift = turns[0] * float(turns[0] @ (points[1] - points[0])) if len(turns) else np.zeros(3)
    # Along its own axis the first joint moves nothing.
    points[0] += shift
    length = _length(points, turns, low[columns[sliding:]], high[columns[sliding:]])
    return Span(root + shift, moves, world.lower[own], world.upper[own], length)


def _length(points: Array, axes: Array, low: Array, high: Array) -> float:
    """Return the greatest distance of the last point from the first as a shortest sum of bounds.

    Args:
        points: (m + 1, 3) joint origins, and the hand.
        axes: (m, 3) of the joints.
        low, high: (m,) turns [rad] that are left to each joint from where the points are.
    """
    last = len(points) - 1
    links = np.diff(points, axis=0)
    rest = np.zeros(last + 1)
    for first in range(last - 1, -1, -1):
        rest[first] = np.linalg.norm(links[first]) + rest[first + 1]
        if first + 2 <= last:
            joint = first + 1
            pair = _across(links[first], links[joint], axes[joint], low[joint], high[joint])
            rest[first] = min(rest[first], pair + rest[first + 2])
    return float(rest[0])


def _across(first: Array, second: Array, axis: Array, low: float, high: float) -> float:
    """Return the greatest length of first + second while second turns about an axis from low to high [rad]."""
    constant = float(first @ axis) * float(second @ axis)
    cosine = float(first @ second) - constant
    sine = float(first @ np.cross(axis, second))
    best = np.arctan2(sine, cosine)
    angles = [low, high, *(turn for turn in best + 2.0 * np.pi * np.arange(-2, 3) if low <= turn <= high)]
    most = max(constant + cosine * np.cos(angle) + sine * np.sin(angle) for angle in angles)
    return float(np.sqrt(max(first @ first + second @ second + 2.0 * most, 0.0)))
