"""Replanning of the remaining actions from the tracked world, warm-started by the plan in force.

The first candidate sequence is what remains of that plan, with earlier actions that have to be repeated; its motion is
the initial guess. It is feasible most often, and its cost is an upper bound that prunes the search.
"""

from __future__ import annotations

import re

import numpy as np

from lgp.errors import LogicError
from lgp.execution.fixed_path import FixedPathBounds
from lgp.logic.task import Action, Task
from lgp.motion import Motion
from lgp.plan_record import Plan
from lgp.planner import at_the_same_time, parse_sequence, plan_within, with_time_left
from lgp.search.records import Budget
from reba.arrays import Array

EXTRA_ACTIONS = (1, 3)
"""Largest number of actions of a new plan beyond the remaining ones; the second if there is no plan with the first."""
IMPROVEMENT_SECONDS = 3.0
"""[s] Wall-clock time of the search for a better plan if the remaining actions are feasible."""
SHOWN_REASONS = 3
"""Number of reasons of infeasibility in a message."""


def replan_remaining(
    motion: Motion, task: Task, number: int, bounds: FixedPathBounds, seconds: float, thorough: bool = False
) -> Plan:
    """Return a new plan from the tracked world, given by `task` and `bounds`; it may be infeasible.

    It has no actions where the goal holds already.

    Args:
        motion: of the plan in force.
        number: of the action of that plan that failed.
        seconds: wall-clock time of the search.
        thorough: search for all of that time even if the remaining actions are feasible; otherwise for
            `IMPROVEMENT_SECONDS` then.
    """
    if task.is_goal(task.initial):
        return plan_within(bounds, task, ())
    remaining, limit = len(motion.phases.actions) - number, seconds
    first = remaining_actions(motion, task, number, bounds)
    continued = plan_within(bounds, task, first) if first else None
    if continued is not None and continued.feasible and not thorough:
        seconds = min(IMPROVEMENT_SECONDS, seconds)
    for extra in EXTRA_ACTIONS:
        budget = Budget(depth=max(remaining + extra, len(first)), seconds=seconds)
        plan = plan_within(bounds, task, None, with_time_left(budget, bounds.world.scene), first)
        if plan.feasible or plan.status == "exhausted":
            break
    best = plan if plan.feasible or continued is None or not continued.feasible else continued
    return at_the_same_time(bounds, task, best, max(0.0, limit - plan.search["seconds"]))


def remaining_actions(motion: Motion, task: Task, number: int, bounds: FixedPathBounds) -> tuple[Action, ...]:
    """Return the last actions of a plan that lead to the goal from the tracked world, () if none do.

    As few as possible of the actions before `number`, the failed one, are repeated. Their planned motion becomes the
    initial guess of the bounds.
    """
    phases = motion.phases
    for first in range(number, -1, -1):
        try:
            actions = parse_sequence(task, map(str, phases.actions[first:]))
        except LogicError:
            continue
        variables, ends = phase_variables(motion, first), phases.keyframes[first:] + 1
        bounds.set_initial_guess(actions, motion.path[ends], variables)
        if len(set(ends.tolist())) == len(actions):
            bounds.planned_motions[actions] = motion.path[ends[0] - phases.slices :], variables
        return actions
    return ()


def first_reasons(reason: str) -> str:
    """Return the first `SHOWN_REASONS` reasons of infeasibility, each once, without phase and action.

    >>> first_reasons("phase 1, grasp(1, baxter.left, box): too far; phase 2, grasp(2, baxter.left, box): too far")
    'too far'
    """
    parts = dict.fromkeys(re.sub(r"^(\w+: )?phase \d+(, [^:]*)?: ", "", part) for part in reason.split("; "))
    more = len(parts) - SHOWN_REASONS
    return "; ".join(list(parts)[:SHOWN_REASONS]) + (f"; and {more} more" if more > 0 else "")


def phase_variables(motion: Motion, first: int, last: int | None = None) -> Array:
    """Return the variables (k,) of the actions `first` to `last` - 1 of a plan, by default to its end [m, rad]."""
    end = len(motion.phases.switches) if last is None else last
    own = [first <= int(name.partition(".")[0]) < end for name in motion.modes.names]
    return motion.variables[np.array(own, dtype=bool)]
