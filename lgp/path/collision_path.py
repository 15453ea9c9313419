"""Solve a path so that no bodies touch: rows where bodies are near, a few steps, rows where they have come near since.

Between two choices of rows the pattern is fixed. What was learnt about the rows so far, multipliers and active set,
goes on to the next round. A path may stay in contact where its surroundings leave no way out that small steps find;
the caller sees it in the rows that are left violated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from lgp.kinematics.world import World
from lgp.path.collision_constraints import TOLERATED, CollisionRows
from lgp.path.feasibility import CLOSE
from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.sqp.problem import SolverOptions
from lgp.sqp.result import Result, SolveStatus
from lgp.sqp.solver import Solver
from reba.arrays import Array, Indices

ROUNDS = 8
"""Choices of rows."""
STEPS = 8
"""Iterations between them, at most."""
ROUGH = 1e-4
"""Promised decrease of the cost, relative to it, at which rows are chosen anew."""
SETTLED = 1e-5
"""Promised decrease of the cost, relative to it, that is not waited for: rows that come and go change it by more."""
LONGEST = 0.3
"""[rad, m] Distances bend too much to trust longer steps."""
NEAR = 1e-2
"""[m, rad] Violation up to which a cost is near that of the path it will become."""


def solve_collision_free(
    make: Callable[[CollisionRows], PathProblem],
    rows: CollisionRows,
    first: Result,
    options: SolverOptions,
    *,
    solved: bool = True,
    rounds: int = ROUNDS,
    worth: float = math.inf,
) -> tuple[PathProblem, Result]:
    """Return the last problem and its result.

    Args:
        make: the path problem with given rows.
        rows: none yet, or those of `first`.
        first: result of the problem with these rows. Without rows, found first, it leads to better paths than most
            cruder starts.
        options: of the solver; its budget holds for the last round.
        solved: whether `first` is at its minimum; otherwise it only says where to begin.
        rounds: choices of rows.
        worth: cost from which on a path is given up: more rows seldom make it cheaper.
    """
    problem, result = make(rows), first
    fine = solved
    for number in range(rounds):
        violated = rows.extend(*problem.split(result.x))
        if not violated and fine:
            break
        if violated:
            problem = make(rows)
        fine = not violated or number == rounds - 1
        chosen = settled(options) if fine else rough(options)
        limited = replace(chosen, longest_step=min(LONGEST, options.longest_step))
        result = Solver(limited).solve(problem, result.x, warm=_longer(result, problem))
        if result.cost >= worth and result.violation <= NEAR:
            break
        # Where no step lessens the violation of these rows, a finer solve would not either.
        fine = fine or result.status is SolveStatus.INFEASIBLE
    return problem, result


def rough(options: SolverOptions) -> SolverOptions:
    """Return settings that stop as soon as a path shows which rows are missing."""
    near = replace(options, decrease=max(options.decrease, ROUGH), kkt=max(options.kkt, 10.0 * ROUGH))
    return replace(near, violation=TOLERATED, iterations=STEPS)


def settled(options: SolverOptions) -> SolverOptions:
    """Return settings that stop where costs of paths with rows for collisions no longer change visibly."""
    return replace(options, decrease=max(options.decrease, SETTLED), kkt=max(options.kkt, 10.0 * SETTLED))


def _longer(warm: Result, problem: PathProblem) -> Result:
    """Return a result with multipliers 0 for rows that are new; new rows come last."""
    new = len(problem.rows.in_rows) - len(warm.y_in)
    return replace(warm, y_in=np.concatenate([warm.y_in, np.zeros(new)]))


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
COARSE = SolverOptions(violation=1e-6, kkt=1e-2, decrease=1e-3, iterations=16)
"""Of trials: good enough to be compared."""
START_ROUNDS = 5
"""Choices of rows of a trial."""


@dataclass(frozen=True)
class CandidatePath:
    """A path that keeps bodies apart, roughly solved: its rows, its problem and what the solver said."""

    rows: CollisionRows
    problem: PathProblem
    result: Result


def multi_start(
    make: Callable[[CollisionRows], PathProblem],
    problem: PathProblem,
    free: Result,
    least: float,
    like: Array | None = None,
) -> CandidatePath | None:
    """Return the best trial that costs clearly less than the path known, None where there is none.

    Args:
        make: the path problem with given rows.
        problem: the one without rows.
        free: its result.
        least: cost of the path known, inf without one.
        like: (T, nq) path of the same actions under another cost; its robots move as in the first start.
    """
    path, variables = problem.split(free.x)
    best: CandidatePath | None = None
    for start in (*_like(problem.world, path, like), *_chosen(problem, path, variables)):
        rows = CollisionRows(problem.world, problem.phases, problem.start)
        begin = replace(free, x=problem.join(start, variables))
        found = CandidatePath(
            rows,
            *solve_collision_free(make, rows, begin, COARSE, solved=False, rounds=START_ROUNDS, worth=BETTER * least),
        )
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
    drawn = list(initial_guesses(problem.world, problem.phases, path, DRAWN))
    deep = np.argsort([rows.overlap(start, variables) for start in drawn], kind="stable").tolist()
    order = dict.fromkeys(number for pair in zip(deep, range(DRAWN), strict=True) for number in pair)
    return [drawn[number] for number in list(order)[:TRIED]]


def initial_guesses(world: World, phases: Phases, path: Array, count: int) -> Iterator[Array]:
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


def _limbs(world: World, phases: Phases) -> Indices:
    """Return the joints that move the hands of robots in a sequence, or of everybody where no robot works in it."""
    hands = {hand for switch in phases.switches for hand in switch.hands}
    robots = {hand for hand in hands if world.scene.hands[hand].agent != "human"}
    return np.flatnonzero(np.max([world.support(hand) for hand in sorted(robots or hands)], axis=0))
