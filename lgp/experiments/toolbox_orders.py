"""Orders of the toolbox sequence and their costs: is a part placed before or after the robot grasps the next one?"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

import numpy as np

from dreba.surrogates.task_factors import OMEGA_LOAD
from lgp.experiments.effort import effort_by_agent
from lgp.logic.task import Action, Task
from lgp.path.bounds import PathBounds
from lgp.plan_record import Plan
from lgp.planner import parse_sequence, plan_within
from lgp.search.records import Skeleton

PLACE_FIRST: Final = "place, then grasp"
GRASP_FIRST: Final = "grasp, then place"
ORDERS: Final = (PLACE_FIRST, GRASP_FIRST)
"""The ergonomic order of the paper, in which the first part is placed before the second is grasped, and the other."""


def order_of(actions: Sequence[Action]) -> str:
    """Order of a sequence, one of `ORDERS`, by the second grasp and the first place; "" for shorter sequences."""
    grasped = [step for step, action in enumerate(actions) if action.name == "grasp"]
    placed = [step for step, action in enumerate(actions) if action.name == "place"]
    if len(grasped) < 2 or not placed:
        return ""
    return PLACE_FIRST if placed[0] < grasped[1] else GRASP_FIRST


def exchanged(actions: Skeleton) -> Skeleton:
    """Return a sequence in the other order: first place and second grasp exchanged; () where they are no neighbours."""
    grasped = [step for step, action in enumerate(actions) if action.name == "grasp"]
    placed = [step for step, action in enumerate(actions) if action.name == "place"]
    if len(grasped) < 2 or not placed or abs(grasped[1] - placed[0]) != 1:
        return ()
    first, second = sorted((grasped[1], placed[0]))
    return (*actions[:first], actions[second], actions[first], *actions[second + 1 :])


def first_part(actions: Sequence[str]) -> str:
    """Return the part that a sequence begins with, given as the actions of a plan.

    >>> first_part(["grasp(1, baxter.left, toolbox/handle)"])
    'toolbox/handle'
    """
    return actions[0].rpartition(", ")[2].rstrip(")")


def sequences(plan: Plan) -> list[dict[str, Any]]:
    """Complete sequences visited by the search, cheapest first: actions, order, costs (None if not solved), reason."""
    rows = [
        {
            "actions": [action.at(step + 1) for step, action in enumerate(node.skeleton)],
            "order": order_of(node.skeleton),
            "sequence": node.costs.get("sequence"),
            "path": node.costs.get("path"),
            "verdict": node.verdict or "solved",
            "reason": node.reason,
        }
        for node in plan.tree
        if node.goal and (node.costs or node.verdict == "infeasible")
    ]
    return sorted(rows, key=lambda row: (row["path"] is None, row["path"] or row["sequence"] or np.inf))


def best_of(bounds: PathBounds, task: Task, rows: Iterable[dict[str, Any]], order: str, first: str) -> Plan | None:
    """Plan of lowest cost of an order, one of `ORDERS`, None if no sequence of it is feasible.

    Args:
        bounds: of the search, with its table of solved problems.
        rows: from `sequences`.
        first: part that the sequence begins with: of another one, the orders would also differ in what is held.
    """
    solved = [row for row in rows if row["sequence"] is not None and first_part(row["actions"]) == first]
    known = {parse_sequence(task, row["actions"]): row for row in solved}
    lower_bounds = {key: row["path"] or row["sequence"] for key, row in known.items() if row["order"] == order}
    for sequence, row in known.items():
        # The search leaves out what cannot be the best, so the other order may be unknown to it.
        if row["order"] != order and (other := exchanged(sequence)):
            lower_bounds.setdefault(other, 0.0)
    best: Plan | None = None
    for sequence, lower_bound in sorted(lower_bounds.items(), key=lambda item: item[1]):
        if best is not None and lower_bound >= best.costs["total"]:
            break
        plan = plan_within(bounds, task, sequence)
        if plan.feasible and (best is None or plan.costs["total"] < best.costs["total"]):
            best = plan
    return best


def cost_terms(plan: Plan, weight: float = 1.0) -> dict[str, float]:
    """Terms of a feasible plan's cost, and the carried load; `weight` is that of the ergonomic cost, 0 without it.

    Keys: total, acceleration, `acceleration of NAME` for each agent, posture and load (terms of the ergonomic cost,
    load by equation 4 of the paper), and carried [kg s].
    """
    carried = float(np.diff(plan.time, prepend=0.0) @ plan.carried)
    load = weight * carried / OMEGA_LOAD
    return {
        "total": plan.costs["total"],
        "acceleration": plan.costs["acceleration"],
        **{f"acceleration of {agent}": effort for agent, effort in effort_by_agent(plan).items()},
        "posture": plan.costs["ergonomics"] - load,
        "load": load,
        "time": plan.costs.get("time", 0.0),
        "carried": carried,
    }


def break_even_mass(
    totals: Mapping[str, float], seconds: Mapping[str, float], mass: float, weight: float
) -> float | None:
    """Return the mass of the first part [kg] from which on placing it first costs less; None if no mass does.

    Exact for two plans, because the load term does not depend on the path.

    Args:
        totals: order -> cost with the part's `mass` [kg].
        seconds: order -> how long the part is held [s].
        weight: of a score point for a second.
    """
    place, grasp = (totals[order] - weight * mass * seconds[order] / OMEGA_LOAD for order in ORDERS)
    longer = seconds[GRASP_FIRST] - seconds[PLACE_FIRST]
    if longer < 1e-9:
        return 0.0 if place < grasp else None
    return max(0.0, (place - grasp) * OMEGA_LOAD / (weight * longer))


def skeleton_of(task: Task, plan: Plan) -> Skeleton:
    """Ground actions of a plan."""
    return parse_sequence(task, plan.actions)
