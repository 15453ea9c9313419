"""Collision-free polylines between configurations: two random trees that grow towards each other.

RRT-Connect (Kuffner & LaValle, ICRA 2000), with several goals as roots of one tree; then shortcuts between random
points of the polyline, which leave out what the trees went around for nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from reba.arrays import Array, Flags

STEP: Final = 0.25
"""[rad, m] Largest change of a joint along one edge of a tree (a choice, as are the others here)."""
RESOLUTION: Final = 0.05
"""[rad, m] Largest change of a joint between two configurations that are checked along an edge."""
EXTENSIONS: Final = 2000
"""Steps towards random configurations after which the search ends."""
SHORTCUTS: Final = 60
"""Shortcuts that are tried."""

IsFree = Callable[[Array], Flags]
"""Configurations (n, k) -> whether each is collision-free (n,)."""


class _Tree:
    def __init__(self, roots: Array) -> None:
        self.nodes, self.parents = [*roots], [-1] * len(roots)

    def add(self, node: Array, parent: int) -> int:
        self.nodes.append(node)
        self.parents.append(parent)
        return len(self.nodes) - 1

    def nearest(self, to: Array) -> int:
        return int(np.abs(np.array(self.nodes) - to).max(axis=1).argmin())

    def branch(self, node: int) -> list[Array]:
        """Return the nodes from a root to one."""
        nodes: list[Array] = []
        while node >= 0:
            nodes.append(self.nodes[node])
            node = self.parents[node]
        return nodes[::-1]


def connect(
    start: Array, goals: Array, lower: Array, upper: Array, is_free: IsFree, rng: np.random.Generator
) -> Array | None:
    """Return a collision-free polyline (m, k) from a start (k,) to one of the goals (g, k), None where none was found.

    Args:
        lower, upper: (k,) limits of joints.
        is_free: the start and the goals have to be.

    >>> def beside_wall(q):
    ...     return ~((np.abs(q[:, 0]) < 0.1) & (q[:, 1] < 0.5))
    >>> ends = np.array([[-0.5, 0.0], [0.5, 0.0]])
    >>> limits = -np.ones(2), np.ones(2)
    >>> line = connect(ends[0], ends[1:], *limits, beside_wall, np.random.default_rng(0))
    >>> line[[0, -1]].tolist() == ends.tolist(), bool(line[:, 1].max() > 0.5)
    (True, True)
    """
    forward, backward = _Tree(start[None]), _Tree(goals)
    growing, other = forward, backward
    target: Array = goals[0]
    for _ in range(EXTENSIONS):
        reached = _grow(growing, target, is_free, once=True)
        if reached >= 0:
            met = _grow(other, growing.nodes[reached], is_free, once=False)
            if met >= 0 and np.array_equal(other.nodes[met], growing.nodes[reached]):
                first, last = (reached, met) if growing is forward else (met, reached)
                line = [*forward.branch(first), *backward.branch(last)[-2::-1]]
                return _shortened(np.array(line), is_free, rng)
        growing, other = other, growing
        target = rng.uniform(lower, upper)
    return None


def _grow(tree: _Tree, target: Array, is_free: IsFree, *, once: bool) -> int:
    """Return the last node added on the way to a target, one step or all; -1 where none is."""
    at, last = tree.nearest(target), -1
    while True:
        away = target - tree.nodes[at]
        far = float(np.abs(away).max())
        new = target if far <= STEP else tree.nodes[at] + STEP / far * away
        if far == 0.0 or not is_free(_between(tree.nodes[at], new)).all():
            return at if far == 0.0 else last
        at = last = tree.add(new, at)
        if once or new is target:
            return last


def _between(first: Array, last: Array) -> Array:
    """Return the configurations after the first up to the last one, no farther apart than `RESOLUTION`."""
    count = max(int(np.ceil(np.abs(last - first).max() / RESOLUTION)), 1)
    return np.asarray(first + (np.arange(count) + 1.0)[:, None] / count * (last - first))


def _shortened(line: Array, is_free: IsFree, rng: np.random.Generator) -> Array:
    """Return a polyline without what straight lines between two of its points leave out."""
    for _ in range(SHORTCUTS):
        if len(line) < 3:
            break
        first, last = np.sort(rng.choice(len(line), 2, replace=False))
        if last - first > 1 and is_free(_between(line[first], line[last])).all():
            line = np.concatenate([line[: first + 1], line[last:]])
    return line


def along(line: Array, count: int) -> Array:
    """Return configurations (count, k) along a polyline (m, k), from rest to rest; the last one is its end.

    >>> along(np.array([[0.0], [1.0], [2.0]]), 4)[:, 0].round(2).tolist()
    [0.31, 1.0, 1.69, 2.0]
    """
    lengths = np.abs(np.diff(line, axis=0)).max(axis=1, initial=0.0)
    reached = np.concatenate([[0.0], np.cumsum(lengths)])
    share = (np.arange(count) + 1.0) / count
    lengths_at = reached[-1] * share**2 * (3.0 - 2.0 * share)
    return np.stack([np.interp(lengths_at, reached, column) for column in line.T], axis=1)
