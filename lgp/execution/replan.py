"""The whole rest planned anew from the world as it is, beginning with what the plan in force says about it.

What is left of that plan, with the last actions before it where the world asks for them again, is the first sequence
looked at, and starts from its motion: most often that is a plan at once, and its cost prunes the search.
"""

from __future__ import annotations

import re

import numpy as np

from lgp.errors import LogicError
from lgp.execution.fixed_path import FixedPathBounds
from lgp.logic.task import Action, Task
from lgp.motion import Motion
from lgp.plan_record import Plan
from lgp.planner import parse_sequence, plan_within
from lgp.search.tree_search import Budget
from reba.arrays import Array

FURTHER = (1, 3)
"""A new plan may have so many actions more than were left; the second only if there is none with the first."""
BETTER = 3.0
"""[s] Time that is spent on looking for something better than what was left of the plan in force."""
REASONS = 3
"""So many reasons why there is no plan are told."""


def plan_rest(
    motion: Motion, task: Task, number: int, bounds: FixedPathBounds, seconds: float, thorough: bool = False
) -> Plan:
    """Return a new plan; `feasible` says whether there is one.

    Args:
        motion: of the plan in force.
        task: of the world as it is.
        number: of its action that could not be done.
        bounds: of the world as it is.
        seconds: wall-clock time of the search.
        thorough: whether all of that time is used where what is left of the plan can be done; otherwise a better plan
            is looked for during `BETTER` only.
    """
    left = len(motion.phases.actions) - number
    first = again(motion, task, number, bounds)
    known = plan_within(bounds, task, first) if first else None
    if known is not None and known.feasible and not thorough:
        seconds = min(BETTER, seconds)
    for more in FURTHER:
        budget = Budget(depth=max(left + more, len(first)), seconds=seconds)
        found = plan_within(bounds, task, None, budget, first)
        if found.feasible or found.status == "exhausted":
            break
    return found if found.feasible or known is None or not known.feasible else known


def again(motion: Motion, task: Task, number: int, bounds: FixedPathBounds) -> tuple[Action, ...]:
    """Return the last actions of a plan that lead to the goal from the world as it is, () if none do.

    The bounds are told how they were planned.

    Args:
        motion: of the plan.
        task: of the world as it is.
        number: of the action that could not be done; as few as possible of those before it are done again.
        bounds: of the world as it is.
    """
    phases = motion.phases
    for first in range(number, -1, -1):
        try:
            actions = parse_sequence(task, map(str, phases.actions[first:]))
        except LogicError:
            continue
        path, variables = motion.path[first * phases.slices :], brought(motion, first)
        bounds.set_initial_guess(actions, path[phases.slices :: phases.slices], variables)
        bounds.planned_motions[actions] = path, variables
        return actions
    return ()


def shortened(reason: str) -> str:
    """Return the first reasons why there is no plan, each once, without the steps they were met at.

    >>> shortened("phase 1, grasp(1, baxter.left, box): too far; phase 2, grasp(2, baxter.left, box): too far")
    'too far'
    """
    parts = dict.fromkeys(re.sub(r"^(\w+: )?phase \d+(, [^:]*)?: ", "", part) for part in reason.split("; "))
    more = len(parts) - REASONS
    return "; ".join(list(parts)[:REASONS]) + (f"; and {more} more" if more > 0 else "")


def brought(motion: Motion, first: int, last: int | None = None) -> Array:
    """Return the variables that the actions of a plan from one to before another bring, by default to its end."""
    end = motion.phases.count if last is None else last
    own = [first <= int(name.partition(".")[0]) < end for name in motion.modes.names]
    return motion.variables[np.array(own, dtype=bool)]
