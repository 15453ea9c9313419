"""Concurrent actions: the sequence of a plan once more, with independent actions of different agents at the same time.

The phases follow from the partial order of the actions (`lgp.path.partial_order`), the path from the solver of every
plan, and the same audit looks at it. The order knows nothing of room for two hands beside each other: what is
infeasible, has more faults or does not cost less is dropped.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, Final

from lgp.path.partial_order import Layout, earliest_phases, joined_phases
from lgp.plan_record import Plan
from lgp.search.records import Skeleton
from lgp.search.time_limit import TimeIsUp

MOST_PATHS: Final = 8
"""Paths that are solved for the actions of one plan, at most."""

Follow = Callable[[Skeleton], Plan]
"""A sequence -> its plan with the audit, infeasible where it has no path."""


def with_concurrent_actions(plan: Plan, skeleton: Skeleton, follow: Follow) -> Plan:
    """Return the plan of the same actions that costs least: one at a time, or independent ones at the same time.

    First each action is put into the earliest phase that the partial order allows. Where that is not better, actions
    are moved ahead one after another, in the order of the plan, each kept if it lowers the cost.

    Args:
        plan: feasible, of the actions of `skeleton` one at a time, with its audit.
    """
    everyone = set(range(len(skeleton)))
    every, alone = earliest_phases(skeleton), earliest_phases(skeleton, everyone)
    if every == alone:
        return replace(plan, concurrent=_record(plan, None, 0, "every action depends on the one before it"))
    tried: dict[Layout, Plan] = {}
    best, separate, reason = plan, everyone, ""
    try:
        tried[every] = follow(joined_phases(skeleton, every))
        reason = _not_better(tried[every], plan)
        best, separate = (plan, everyone) if reason else (tried[every], set())
        for number in sorted(separate):
            layout = earliest_phases(skeleton, separate - {number})
            if layout == alone or layout in tried:
                continue
            if len(tried) == MOST_PATHS:
                break
            tried[layout] = follow(joined_phases(skeleton, layout))
            if not _not_better(tried[layout], best):
                best, separate = tried[layout], separate - {number}
    except TimeIsUp:
        reason = "; ".join([*([reason] if reason else []), "the time limit was reached, allow more"])
    feasible = [one for one in tried.values() if one.feasible]
    other = min(feasible, key=lambda one: one.costs["total"], default=None) if best is plan else best
    record = _record(plan, other, len(tried), reason, kept=best is not plan)
    seconds = plan.search["seconds"] + sum(one.search["seconds"] for one in tried.values())
    search = {**plan.search, "seconds": seconds}
    if best is not plan:
        # Nothing is known of other plans with concurrent actions.
        search |= {"bound": best.search["bound"], "gap": best.search["gap"]}
    return replace(best, concurrent=record, search=search, tree=plan.tree)


def _not_better(trial: Plan, best: Plan) -> str:
    """Return why a plan is not kept instead of the best one, "" if it is."""
    if not trial.feasible:
        return trial.reason
    faults, cost = len(trial.audit["faults"]), trial.costs["total"]
    if faults > len(best.audit["faults"]):
        return f"the audit found {faults} fault{'s' * (faults > 1)}: {trial.audit['faults'][0]['what']}"
    return "" if cost < best.costs["total"] else f"it costs {cost:.4g}, not less than {best.costs['total']:.4g}"


def _record(plan: Plan, other: Plan | None, tried: int, reason: str, *, kept: bool = False) -> dict[str, Any]:
    """Return what a plan says about its concurrent actions, see `Plan.concurrent`."""
    search = {name: plan.search[name] for name in ("bound", "gap")}
    return {
        "kept": kept,
        "reason": reason,
        "tried": tried,
        "one_at_a_time": {**_costs(plan), "status": plan.status, **search},
        "at_the_same_time": None if other is None else _costs(other),
    }


def _costs(plan: Plan) -> dict[str, Any]:
    return {"actions": list(plan.actions), "cost": plan.costs["total"], "seconds": float(plan.time[-1])}
