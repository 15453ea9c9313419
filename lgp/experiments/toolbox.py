"""The toolbox experiment (section IV of the paper): which order of actions, with and without the ergonomic cost.

Both conditions search the same tree, each by its own cost. A search starts every sequence from the best motion known of
its actions and is repeated until no better plan turns up, so that orders are compared by their best motions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

import dreba
from lgp.errors import LgpError
from lgp.experiments import published
from lgp.experiments.summary import write_summary
from lgp.experiments.toolbox_orders import (
    GRASP_FIRST,
    ORDERS,
    PLACE_FIRST,
    best_of,
    heaviest,
    parts_of,
    sequences,
    skeleton_of,
)
from lgp.experiments.toolbox_report import write_page
from lgp.kinematics.world import World
from lgp.logic.task import Task
from lgp.path.bounds import PathBounds
from lgp.path.costs import Weights
from lgp.path.ergonomics import Ergonomics
from lgp.plan_record import Plan
from lgp.planner import COST, plan_within, task_of
from lgp.scene.model import Scene
from lgp.scene.scene_file import load_scene
from lgp.search.tree_search import Budget
from reba.files import plain_data, write_atomic

SCENE: Final = "toolbox"
CONDITIONS: Final = ("non-ergonomic", "ergonomic")
ROUNDS: Final = 3
"""Searches at most; the last ones confirm the best plan."""
BETTER: Final = 1e-3
"""Relative fall of the cost that asks for another round."""
FACTORS: Final = (2.0, 4.0)
"""Weights of the ergonomic cost, besides 1, for which both orders are planned."""
PARTS: Final = ("trunk", "neck", "legs", "load_force", "upper_arm_right", "lower_arm_right", "wrist_right",
                "upper_arm_left", "lower_arm_left", "wrist_left")  # fmt: skip
"""Part scores that are shown; the right arm is the one that works."""


@dataclass(frozen=True)
class Condition:
    """What was found in one condition: the plan, the sequences its search met, the best plan of each order, rounds, and
    orders for which no path with bodies apart was found, with the reason."""

    plan: Plan
    met: list[dict[str, Any]]
    orders: dict[str, Plan]
    rounds: list[float]
    lost: dict[str, str] = field(default_factory=dict)


def experiment(
    folder: str | Path,
    *,
    scene: Scene | None = None,
    cost: str = COST,
    factors: tuple[float, ...] = FACTORS,
    slices: int | None = None,
    collisions: bool = True,
    tell: Callable[[str], None] | None = None,
    command: str = "",
) -> dict[str, Any]:
    """Plan both conditions, write their plans, `summary.json`, `runs.parquet` and `report.html`; return the summary.

    Args:
        folder: of the results; the plans go to `ergonomic` and `non-ergonomic` in it.
        scene: another scene than the shipped one.
        cost: dREBA model of the ergonomic condition: a file or a shipped name.
        factors: further weights of the ergonomic cost.
        slices: per phase, the scene's by default.
        collisions: whether bodies are kept apart in the best plan of each order; searches let them pass.
        tell: told what is done.
        command: that made the results, for the page.

    Raises:
        LgpError: a condition has no plan, or something cannot be written.

    Example:
        >>> experiment("results")["conditions"]["ergonomic"]["actions"]         # doctest: +SKIP
    """

    say = tell or (lambda words: None)
    chosen = load_scene(SCENE) if scene is None else scene
    task, world = task_of(chosen), World(chosen)
    ergonomics = Ergonomics(world, dreba.load(Path(cost) if Path(cost).is_file() else cost))
    found: dict[str, Condition] = {}
    for name in CONDITIONS:
        bounds = PathBounds(world, ergonomics if name == "ergonomic" else None, slices=slices)
        say(f"{name}: searching")
        found[name] = _condition(bounds, task, chosen.depth, collisions, say)
        found[name].plan.save(Path(folder) / name)
    summary: dict[str, Any] = {
        "experiment": SCENE,
        "published": published.TOOLBOX_SOURCE,
        "settings": {
            "scene": chosen.name,
            "cost": cost,
            "depth": chosen.depth,
            "slices": slices or chosen.slices,
            "collisions": collisions,
        },
        "conditions": {name: _summary(name, one, chosen) for name, one in found.items()},
        "weights": _weights(
            lambda weights: PathBounds(world, ergonomics, weights, slices=slices, collisions=collisions),
            task,
            found["ergonomic"].orders,
            factors,
            say,
        ),
    }
    summary["paper_order_found"] = {
        name: None if summary["conditions"][name]["orders_lost"] else summary["conditions"][name]["order"] == expected
        for name, expected in zip(CONDITIONS, (GRASP_FIRST, PLACE_FIRST), strict=True)
    }
    _write(Path(folder), summary, found, chosen)
    write_page(folder, summary, {name: one.plan for name, one in found.items()}, chosen, command)
    return summary


def _condition(bounds: PathBounds, task: Task, depth: int, collisions: bool, tell: Callable[[str], None]) -> Condition:
    """Search until no better plan turns up, then plan the best sequence of each order with bodies kept apart."""
    costs: list[float] = []
    best: Plan | None = None
    met: list[dict[str, Any]] = []
    for _ in range(ROUNDS):
        first = () if best is None else skeleton_of(task, best)
        again = plan_within(bounds, task, None, Budget(depth=depth), first)
        if not again.feasible:
            raise LgpError(f"{again.scene.name}: no plan: {again.reason}")
        costs.append(again.costs["total"])
        tell(f"round {len(costs)}: cost {costs[-1]:.4f}, {again.search['seconds']:.0f} s")
        if best is None or costs[-1] < best.costs["total"]:
            best, met = again, sequences(again)
        if len(costs) > 1 and costs[-2] - costs[-1] < BETTER * costs[-2]:
            break
        bounds.reconsider()
    found = best or again
    orders = {order: plan for order in ORDERS if (plan := best_of(bounds, task, met, order)) is not None}
    lost: dict[str, str] = {}
    if collisions:
        bounds.collisions = True
        bounds.reconsider()
        apart = {order: plan_within(bounds, task, skeleton_of(task, plan)) for order, plan in orders.items()}
        orders = {order: plan for order, plan in apart.items() if plan.feasible}
        lost = {order: plan.reason for order, plan in apart.items() if not plan.feasible}
        if not orders:
            raise LgpError(f"{found.scene.name}: no plan: {next(iter(apart.values())).reason}")
        kept = min(orders.values(), key=lambda plan: plan.costs["total"])
        tell(f"bodies apart: cost {kept.costs['total']:.4f}")
        found = replace(kept, status=found.status, search=found.search, tree=found.tree)
    return Condition(found, met, orders, costs, lost)


def _weights(
    bounds_of: Callable[[Weights], PathBounds],
    task: Task,
    orders: dict[str, Plan],
    factors: tuple[float, ...],
    tell: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Plan the two orders with other weights of the ergonomic cost: one row each."""

    rows = [{"weight": 1.0, "order": order, **parts_of(plan)} for order, plan in orders.items()]
    for factor in factors:
        bounds = bounds_of(Weights(ergonomics=factor))
        for order, plan in orders.items():
            keys = plan.path[np.flatnonzero(np.diff(plan.phase, append=plan.phase[-1] + 1))]
            skeleton = skeleton_of(task, plan)
            bounds.suggest(skeleton, keys, np.array(list(plan.variables.values())))
            again = plan_within(bounds, task, skeleton)
            if again.feasible:
                rows.append({"weight": factor, "order": order, **parts_of(again, factor)})
                tell(f"weight {factor:g}, {order}: cost {again.costs['total']:.4f}")
    return rows


def _summary(name: str, found: Condition, scene: Scene) -> dict[str, Any]:
    weight = float(name == "ergonomic")
    orders = {order: parts_of(plan, weight) for order, plan in found.orders.items()}
    first = found.plan.actions[0].rpartition(", ")[2].rstrip(")")
    mass = None
    if weight and len(orders) == len(ORDERS):
        mass = heaviest(orders[PLACE_FIRST], orders[GRASP_FIRST], scene.things[first].mass, weight)
    return {
        "actions": list(found.plan.actions),
        "published_actions": list(published.TOOLBOX_SEQUENCES[name]),
        "order": next(row["order"] for row in found.met if row["actions"] == list(found.plan.actions)),
        "cost": parts_of(found.plan, weight),
        "orders": orders,
        "orders_lost": found.lost,
        "first_part": {"name": first, "mass": scene.things[first].mass, "mass_for_place_first": mass},
        "rounds": found.rounds,
        "sequences": found.met,
        **scores_of(found.plan),
        "residuals": found.plan.residuals,
        "status": found.plan.status,
        "search": found.plan.search,
        "solver": found.plan.solver,
    }


def scores_of(found: Plan) -> dict[str, Any]:
    """Return true REBA scores of the human path, mean over time: total, by part, per phase, and equation 4's load."""
    scores = found.reba()
    if scores is None:
        raise LgpError(f"{found.scene.name}: no human is scored")
    total = np.asarray(scores.reba, dtype=float)
    reba: dict[str, Any] = {"mean": float(total.mean()), "max": float(total.max()), "last": float(total[-1])}
    reba |= {"per_phase": [float(total[found.phase == phase].mean()) for phase in range(len(found.actions))]}
    parts = {part: float(np.mean(scores[part])) for part in PARTS}
    return {"reba": reba, "parts": parts, "load_points": float(np.mean(found.carried)) / 5.0}


def _write(folder: Path, summary: dict[str, Any], found: dict[str, Condition], scene: Scene) -> None:
    """Write the summary and one row a condition; columns of the contract that say nothing here are empty."""
    import pandas as pd

    write_summary(folder / "summary.json", plain_data(summary))
    height = scene.tables["table.center"].height
    rows = []
    for name, one in found.items():
        taken = [step for step, action in enumerate(one.plan.actions) if action.startswith("handover(")]
        scores = summary["conditions"][name]["reba"]
        ends = [np.flatnonzero(one.plan.phase == step)[-1] for step in taken]
        true = one.plan.reba()
        rows.append({
            "run": 0, "seed": 0, "condition": name, "table": "center", "height_left": np.nan, "height_center": height,
            "height_right": np.nan, "chosen_height": height,
            "reba_grasp": float(np.mean(np.asarray(true.reba, float)[ends])) if true is not None else np.nan,
            "reba_mean": scores["mean"], "cost": one.plan.costs["total"], "feasible": True,
            "seconds": one.plan.search["seconds"], "actions": "; ".join(one.plan.actions),
        })  # fmt: skip
    frame = pd.DataFrame(rows)
    write_atomic(folder / "runs.parquet", lambda part: frame.to_parquet(part, index=False))
