"""Other ways around what is in the way: more starts for a path whose bodies, once kept apart, make it cost much more.

A path that was found without regard to bodies leads through some of them, and the nearest path around these may be far
from the best, which passes on the other side of a table or with a tucked elbow. Small steps do not lead there; starts
may in which the limbs of robots swing out in every phase, towards postures drawn inside their limits, and back. They
are tried with little accuracy; the best of them goes on like any path.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lgp.path.apart import apart
from lgp.path.collision_rows import CollisionRows
from lgp.path.feasible import CLOSE
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.sqp import Options, Result
from lgp.world.model import World

Array = NDArray[np.float64]

SUSPICIOUS = 1.2
"""Times the cost of the path that need not keep bodies apart; what costs more is worth other starts."""
ENOUGH = 1.5
"""Times that cost; once something better is found that costs less than this, the search for more ends."""
BETTER = 0.97
"""Times the cost known; a trial that costs more than this is not worth going on with."""
SHARES = (0.3, 0.5)
"""How far starts swing out towards the postures drawn, in turn."""
DRAWN = 24
"""Starts drawn, of which those are tried that lead least through bodies,"""
TRIED = 4
"""and as many others that these make this many."""
ROUGH = Options(violation=1e-6, kkt=1e-2, decrease=1e-3, iterations=16)
"""Of trials: good enough to be compared."""
ROUNDS = 5
"""Choices of rows of a trial."""


@dataclass(frozen=True)
class Trial:
    """A path that keeps bodies apart, roughly solved: its rows, its problem and what the solver said."""

    rows: CollisionRows
    problem: PathProblem
    result: Result


def detour(
    make: Callable[[CollisionRows], PathProblem],
    problem: PathProblem,
    free: Result,
    least: float,
    like: Array | None = None,
) -> Trial | None:
    """Return the best trial that costs clearly less than the path known, None where there is none.

    Args:
        make: the path problem with given rows.
        problem: the one without rows.
        free: its result.
        least: cost of the path known, inf without one.
        like: (T, nq) path of the same actions under another cost; its robots move as in the first start.
    """
    path, variables = problem.split(free.x)
    best: Trial | None = None
    for start in (*_like(problem.world, path, like), *_chosen(problem, path, variables)):
        rows = CollisionRows(problem.world, problem.phases, problem.start)
        begin = replace(free, x=problem.join(start, variables))
        found = Trial(rows, *apart(make, rows, begin, ROUGH, solved=False, rounds=ROUNDS, worth=BETTER * least))
        if found.result.violation <= CLOSE and found.result.cost < BETTER * least:
            best, least = found, found.result.cost
            if least <= ENOUGH * free.cost:
                break
    return best


def _like(world: World, path: Array, like: Array | None) -> list[Array]:
    """Return a start (T, nq) that follows a path but for robots, who move as in another one."""
    if like is None:
        return []
    start = path.copy()
    for name in world.scene.robots:
        columns = world.columns(name)
        start[:, columns] = like[:, columns]
    return [start]


def _chosen(problem: PathProblem, path: Array, variables: Array) -> list[Array]:
    """Return the starts (T, nq) to try: those that lead least through bodies and the first ones drawn, in turn."""
    rows = CollisionRows(problem.world, problem.phases, problem.start)
    drawn = list(swings(problem.world, problem.phases, path, DRAWN))
    deep = np.argsort([rows.overlap(start, variables) for start in drawn], kind="stable").tolist()
    order = dict.fromkeys(number for pair in zip(deep, range(DRAWN), strict=True) for number in pair)
    return [drawn[number] for number in list(order)[:TRIED]]


def swings(world: World, phases: Phases, path: Array, count: int) -> Iterator[Array]:
    """Yield starts (T, nq) that agree with a path (T, nq) at its switches, the same ones each time.

    Args:
        world: the kinematics.
        phases: the sequence.
        path: configurations of all slices.
        count: how many starts.
    """
    limbs = _limbs(world, phases)
    rng = np.random.default_rng(0)
    out = (np.sin(np.pi * (np.arange(phases.total) + 1.0) / phases.slices) ** 2).reshape(phases.count, -1, 1)
    for number in range(count):
        anywhere = rng.uniform(world.lower[limbs], world.upper[limbs], (phases.count, 1, len(limbs)))
        start = path.reshape(phases.count, phases.slices, -1).copy()
        start[..., limbs] += SHARES[number % len(SHARES)] * out * (anywhere - start[..., limbs])
        yield start.reshape(path.shape)


def _limbs(world: World, phases: Phases) -> NDArray[np.intp]:
    """Return the joints that move the hands of robots in a sequence, or of everybody where no robot works in it."""
    hands = {hand for switch in phases.switches for hand in switch.hands}
    robots = {hand for hand in hands if world.scene.hands[hand].agent != "human"}
    return np.flatnonzero(np.max([world.support(hand) for hand in sorted(robots or hands)], axis=0))
