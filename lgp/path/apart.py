"""Solve a path so that no bodies touch: rows where bodies are near, a few steps, rows where they have come near since.

Between two choices of rows the pattern is fixed. What was learnt about the rows so far, multipliers and active set,
goes on to the next round. A path may stay in contact where its surroundings leave no way out that small steps find;
the caller sees it in the rows that are left violated.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lgp.path.collision_rows import TOLERATED, CollisionRows
from lgp.path.problem import PathProblem
from lgp.sqp import Options, Result, Solver, Status

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


def apart(
    make: Callable[[CollisionRows], PathProblem],
    rows: CollisionRows,
    first: Result,
    options: Options,
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
        fine = fine or result.status is Status.INFEASIBLE
    return problem, result


def rough(options: Options) -> Options:
    """Return settings that stop as soon as a path shows which rows are missing."""
    near = replace(options, decrease=max(options.decrease, ROUGH), kkt=max(options.kkt, 10.0 * ROUGH))
    return replace(near, violation=TOLERATED, iterations=STEPS)


def settled(options: Options) -> Options:
    """Return settings that stop where costs of paths with rows for collisions no longer change visibly."""
    return replace(options, decrease=max(options.decrease, SETTLED), kkt=max(options.kkt, 10.0 * SETTLED))


def _longer(warm: Result, problem: PathProblem) -> Result:
    """Return a result with multipliers 0 for rows that are new; new rows come last."""
    new = len(problem.rows.in_rows) - len(warm.y_in)
    return replace(warm, y_in=np.concatenate([warm.y_in, np.zeros(new)]))
