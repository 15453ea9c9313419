"""Orders of the toolbox sequence: is a part put down before the robot takes the next one, and what does that cost?"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, Final

import numpy as np

from dreba.surrogates.task_factors import OMEGA_LOAD
from lgp.logic.task import Action, Task
from lgp.path.bounds import PathBounds
from lgp.path.costs import quadratic
from lgp.plan_record import Plan
from lgp.planner import parse_sequence, plan_within
from lgp.search.tree_search import Skeleton

PLACE_FIRST: Final = "place, then grasp"
GRASP_FIRST: Final = "grasp, then place"
ORDERS: Final = (PLACE_FIRST, GRASP_FIRST)
"""What happens to the first part before the second is on its way: the paper's ergonomic and non-ergonomic order."""


def order_of(actions: Sequence[Action]) -> str:
    """Return one of `ORDERS`; the robot's second grasp and the first place count."""
    taken = [step for step, action in enumerate(actions) if action.name == "grasp"]
    placed = [step for step, action in enumerate(actions) if action.name == "place"]
    if len(taken) < 2 or not placed:
        return ""
    return PLACE_FIRST if placed[0] < taken[1] else GRASP_FIRST


def sequences(found: Plan) -> list[dict[str, Any]]:
    """Return the whole sequences that a search met: actions, order, costs of levels (None if not solved), verdict."""
    rows = [
        {
            "actions": [action.at(step + 1) for step, action in enumerate(node.skeleton)],
            "order": order_of(node.skeleton),
            "sequence": node.costs.get("sequence"),
            "path": node.costs.get("path"),
            "verdict": node.verdict or "solved",
            "reason": node.reason,
        }
        for node in found.tree
        if node.goal and (node.costs or node.verdict == "infeasible")
    ]
    return sorted(rows, key=lambda row: (row["path"] is None, row["path"] or row["sequence"] or np.inf))


def best_of(bounds: PathBounds, task: Task, rows: Iterable[dict[str, Any]], order: str) -> Plan | None:
    """Return the plan of least cost of an order, None if no sequence of it is feasible.

    Args:
        bounds: that searched; what it solved is not solved again.
        task: of the scene.
        rows: as `sequences` returns them.
        order: one of `ORDERS`.
    """
    best: Plan | None = None
    open_ = [row for row in rows if row["order"] == order and row["sequence"] is not None]
    for row in sorted(open_, key=lambda row: row["path"] or row["sequence"]):
        lowest = row["path"] or row["sequence"]
        if best is not None and lowest >= best.costs["total"]:
            break
        found = plan_within(bounds, task, parse_sequence(task, row["actions"]))
        if found.feasible and (best is None or found.costs["total"] < best.costs["total"]):
            best = found
    return best


def parts_of(found: Plan, weight: float = 1.0) -> dict[str, float]:
    """Return what a plan's cost is made of, and how much is carried.

    Keys: total, acceleration, one `acceleration of NAME` for each agent, posture and load (parts of the ergonomic cost,
    load by equation 4), and carried [kg s].

    Args:
        found: a feasible plan.
        weight: of the ergonomic cost, 0 without it.
    """
    tau = float(found.time[0])
    away = found.path - found.start
    each = np.einsum("tj,ts,sj->j", away, quadratic(len(away), tau, stop=True), away)
    agents = dict.fromkeys(name.partition(".")[0] for name in found.joints)
    carried = tau * float(found.carried.sum())
    load = weight * carried / OMEGA_LOAD
    return {
        "total": found.costs["total"],
        "acceleration": found.costs["acceleration"],
        **{
            f"acceleration of {agent}": float(sum(each[[name.startswith(f"{agent}.") for name in found.joints]]))
            for agent in agents
        },
        "posture": found.costs["ergonomics"] - load,
        "load": load,
        "carried": carried,
    }


def heaviest(place: dict[str, float], grasp: dict[str, float], mass: float, weight: float) -> float | None:
    """Return the mass [kg] of the first part from which on it pays to put it down first, None if no mass does that.

    Exact: loads add to the cost and move nothing. The orders differ in how long the first part is held, not the others.

    Args:
        place, grasp: parts of the cost of the two orders.
        mass: of the first part [kg].
        weight: of the ergonomic cost.
    """
    longer = (grasp["carried"] - place["carried"]) / mass
    if longer < 1e-9:
        return None
    missing = (place["total"] - place["load"]) - (grasp["total"] - grasp["load"])
    return max(0.0, missing * OMEGA_LOAD / (weight * longer))


def skeleton_of(task: Task, found: Plan) -> Skeleton:
    """Return the actions of a plan."""
    return parse_sequence(task, found.actions)
