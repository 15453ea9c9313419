"""The toolbox experiment (section IV of the paper): which order of actions, with and without the ergonomic cost.

Both conditions search the same tree, each with its own cost. The initial guess of a sequence is the best known motion
of the same actions, and the search is repeated until its cost no longer improves, so that orders are compared by their
best motions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from lgp.errors import LgpError
from lgp.experiments import published
from lgp.experiments.cost_model import cost_model
from lgp.experiments.folders import check_folder
from lgp.experiments.summary import finished_summary, write_summary
from lgp.experiments.toolbox_mass import held_seconds, mass_sweep
from lgp.experiments.toolbox_orders import (
    GRASP_FIRST,
    ORDERS,
    PLACE_FIRST,
    best_of,
    break_even_mass,
    cost_terms,
    first_part,
    order_of,
    sequences,
    skeleton_of,
)
from lgp.experiments.toolbox_report import write_page
from lgp.experiments.variants import VARIANT, setting, settings_of
from lgp.files import EXPERIMENT_FILES, SUMMARY
from lgp.kinematics.world import World
from lgp.logic.task import Task
from lgp.path.bounds import PathBounds
from lgp.path.costs import Weights
from lgp.path.ergonomics import Ergonomics
from lgp.plan_record import Plan
from lgp.planner import plan_within, task_of
from lgp.scene.model import Scene
from lgp.search.records import Budget
from reba.checks import NOT_NEGATIVE, PATH, YES_NO, accepts
from reba.files import plain_data, write_atomic, write_folder
from reba.outputs import FolderOutput, check_outputs
from reba.provenance import with_provenance, write_parquet

SCENE: Final = "toolbox"
NEEDS: Final = ("table.center", "toolbox/handle", "toolbox/side.left")
"""Tables and objects that a scene of the experiment has."""
CONDITIONS: Final = ("non-ergonomic", "ergonomic")
ROUNDS: Final = 3
"""Most repetitions of a search; the last ones confirm the best plan."""
IMPROVEMENT: Final = 1e-3
"""Relative decrease of the cost from which on a search is repeated."""
ERGONOMIC_WEIGHTS: Final = (2.0, 4.0)
"""Weights of the ergonomic cost, besides 1, for which both orders are planned."""
PARTS: Final = ("trunk", "neck", "legs", "load_force", "upper_arm_right", "lower_arm_right", "wrist_right",
                "upper_arm_left", "lower_arm_left", "wrist_left")  # fmt: skip
"""Part scores that are reported; the right arm is the working one."""


@dataclass(frozen=True)
class Condition:
    """Results of one condition.

    Attributes:
        plan: of lowest cost.
        sequences: complete sequences that the search visited, see `lgp.experiments.toolbox_orders.sequences`.
        orders: order -> its plan of lowest cost, of those that begin with the same part as `plan`.
        rounds: cost of each repetition of the search.
        infeasible_orders: order -> reason why no collision-free path was obtained.
    """

    plan: Plan
    sequences: list[dict[str, Any]]
    orders: dict[str, Plan]
    rounds: list[float]
    infeasible_orders: dict[str, str] = field(default_factory=dict)


@accepts(
    LgpError,
    folder=PATH,
    scene=PATH.or_none(),
    cost=PATH.or_none(),
    weight=NOT_NEGATIVE.or_none(),
    phase_seconds=NOT_NEGATIVE.or_none(),
    collisions=YES_NO.or_none(),
)
def experiment_toolbox(
    folder: str | Path,
    *,
    variant: str = VARIANT,
    scene: str | Path | None = None,
    cost: str | Path | None = None,
    weight: float | None = None,
    phase_seconds: float | None = None,
    ergonomic_weights: tuple[float, ...] = ERGONOMIC_WEIGHTS,
    slices: int | None = None,
    collisions: bool | None = None,
    on_event: Callable[[str], None] | None = None,
    command: str = "",
) -> dict[str, Any]:
    """Reproduce the toolbox experiment: plan both conditions, write plans, tables and report, and return the summary.

    Written are the plans (folders `ergonomic` and `non-ergonomic`), `summary.json`, `runs.parquet` and `report.html`.
    A folder in which the same experiment is finished is left as it is.

    Args:
        folder: of the results.
        variant: what is taken for what the paper leaves open, see `lgp.experiments.variants.variants`.
        scene: the shipped scene by default, or the path of a TOML file with the same parts.
        cost: dREBA model of the ergonomic condition, a file or a shipped name; the variant's by default.
        weight: of a score point for a second, the variant's by default.
        phase_seconds: duration of each phase [s], the variant's by default.
        ergonomic_weights: factors on the weight of the ergonomic cost for which both orders are planned too.
        slices: per phase, the scene's by default.
        collisions: whether the best plan of each order is collision-free, as the variant says by default; the search
            itself ignores collisions.
        on_event: called with one line for each step of the computation.
        command: command line that reproduces the results, shown in the report.

    Returns:
        The content of `summary.json`.

    Raises:
        LgpError: an option is wrong, the folder cannot be written or holds other runs, or a condition has no feasible
            plan.
        RebaError: a file cannot be written.
    """
    if not isinstance(folder, str | Path):
        raise LgpError(f"folder is {folder!r}; expected the path of a folder for the results")
    chosen, base = setting(variant, SCENE if scene is None else scene, cost, weight, phase_seconds, needs=NEEDS)
    free = chosen.collisions if collisions is None else collisions
    check_outputs(FolderOutput(folder, EXPERIMENT_FILES), inputs=[base.cost.model], error=LgpError)
    check_folder(folder, SCENE)
    report = on_event or (lambda message: None)
    model = cost_model(base.cost.model)
    settings = {
        **settings_of(SCENE, chosen, base, free),
        **model.settings(),
        "depth": base.depth,
        "slices": slices or base.slices,
        "ergonomic_weights": list(ergonomic_weights),
    }
    done = finished_summary(folder, settings)
    if done is not None:
        report("finished before with the same settings; give another folder to plan it again")
        return done
    task, world = task_of(base), World(base)
    ergonomics = Ergonomics(world, model.model())
    conditions: dict[str, Condition] = {}
    for name in CONDITIONS:
        # Both orders are compared, so that the sequences of the dearer one are solved as well.
        bounds = PathBounds(world, ergonomics if name == "ergonomic" else None, slices=slices, prefixes=False)
        report(f"{name}: searching")
        conditions[name] = _plan_condition(bounds, task, base.depth, free, report)

    def weighted(factor: float) -> PathBounds:
        own = Weights.of(base, slices)
        weights = replace(own, ergonomics=factor * own.ergonomics)
        return PathBounds(world, ergonomics, weights, slices=slices, collisions=free)

    rows = _vary_weight(weighted, task, conditions["ergonomic"].orders, ergonomic_weights, report)
    summary = summarise_toolbox(conditions, base, settings, rows)
    plans = {name: one.plan for name, one in conditions.items()}

    def write(part: Path) -> None:
        for name, plan in plans.items():
            plan.save(part / name)
        write_tables(part, summary, conditions, base)
        write_page(part, summary, plans, base, chosen, command)

    write_folder(folder, write, last=SUMMARY)
    return summary


def _plan_condition(
    bounds: PathBounds, task: Task, depth: int, collisions: bool, report: Callable[[str], None]
) -> Condition:
    """Repeat the search until its cost no longer improves, then plan the best sequence of each order, collision-free.

    Every repetition starts from the best known motions of the same actions: the path problems are not convex.
    """
    costs: list[float] = []
    best: Plan | None = None
    visited: list[dict[str, Any]] = []
    for _ in range(ROUNDS):
        first = () if best is None else skeleton_of(task, best)
        searched = plan_within(bounds, task, None, Budget(depth=depth), first)
        if not searched.feasible:
            raise LgpError(f"{searched.scene.name}: no plan: {searched.reason}")
        costs.append(searched.costs["total"])
        report(f"round {len(costs)}: cost {costs[-1]:.4f}, {searched.search['seconds']:.0f} s")
        if best is None or costs[-1] < best.costs["total"]:
            best, visited = searched, sequences(searched)
        if len(costs) > 1 and costs[-2] - costs[-1] < IMPROVEMENT * costs[-2]:
            break
        bounds.forget_paths()
    best = best or searched
    part = first_part(best.actions)
    first_of_order = {order: best_of(bounds, task, visited, order, part) for order in ORDERS}
    orders = {order: plan for order, plan in first_of_order.items() if plan is not None}
    infeasible: dict[str, str] = {}
    if collisions:
        bounds.collisions = True
        bounds.forget_paths()
        free = {order: plan_within(bounds, task, skeleton_of(task, plan)) for order, plan in orders.items()}
        orders = {order: plan for order, plan in free.items() if plan.feasible}
        infeasible = {order: plan.reason for order, plan in free.items() if not plan.feasible}
        if not orders:
            raise LgpError(f"{best.scene.name}: no plan: {next(iter(free.values())).reason}")
        cheapest = min(orders.values(), key=lambda plan: plan.costs["total"])
        report(f"collision-free: cost {cheapest.costs['total']:.4f}")
        best = replace(cheapest, status=best.status, search=best.search, tree=best.tree)
    return Condition(best, visited, orders, costs, infeasible)


def _vary_weight(
    bounds_of: Callable[[float], PathBounds],
    task: Task,
    orders: dict[str, Plan],
    weights: tuple[float, ...],
    report: Callable[[str], None],
) -> list[dict[str, Any]]:
    """Cost terms of both orders for further factors on the weight of the ergonomic cost, one row each."""
    rows = []
    for weight in (1.0, *weights):
        bounds = bounds_of(weight)
        for order, plan in orders.items():
            keyframes = plan.path[np.flatnonzero(np.diff(plan.phase, append=plan.phase[-1] + 1))]
            skeleton = skeleton_of(task, plan)
            bounds.set_initial_guess(skeleton, keyframes, np.array(list(plan.variables.values())))
            weighted = plan_within(bounds, task, skeleton)
            if weighted.feasible:
                rows.append({"weight": weight, "order": order, **cost_terms(weighted, bounds.weights.ergonomics)})
                report(f"weight {weight:g}, {order}: cost {weighted.costs['total']:.4f}")
    return rows


def summarise_toolbox(
    conditions: Mapping[str, Condition], scene: Scene, settings: Mapping[str, Any], weights: list[dict[str, Any]]
) -> dict[str, Any]:
    """Content of `summary.json`: results of both conditions beside the paper's, and costs by ergonomic weight."""
    summary: dict[str, Any] = {
        "experiment": SCENE,
        "published": published.TOOLBOX_SOURCE,
        "settings": dict(settings),
        "conditions": {name: summarise_condition(name, one, scene) for name, one in conditions.items()},
        "weights": weights,
    }
    summary["paper_order_found"] = {
        name: None if summary["conditions"][name]["orders_lost"] else summary["conditions"][name]["order"] == expected
        for name, expected in zip(CONDITIONS, (GRASP_FIRST, PLACE_FIRST), strict=True)
    }
    return with_provenance(summary)


def summarise_condition(name: str, condition: Condition, scene: Scene) -> dict[str, Any]:
    """Results of one condition as plain data: actions, orders, cost terms, true scores and search statistics."""
    plan = condition.plan
    weight = scene.ergonomic_weight(int(np.sum(plan.phase == 0))) if name == "ergonomic" else 0.0
    orders = {order: cost_terms(best, weight) for order, best in condition.orders.items()}
    first = first_part(plan.actions)
    mass, sweep, own = None, [], scene.objects[first].mass
    if weight and len(orders) == len(ORDERS):
        totals = {order: terms["total"] for order, terms in orders.items()}
        task = task_of(scene)
        seconds = {order: held_seconds(task, best, first) for order, best in condition.orders.items()}
        mass = break_even_mass(totals, seconds, own, weight)
        sweep = mass_sweep(totals, seconds, own, weight, mass)
    return {
        "actions": list(plan.actions),
        "published_actions": list(published.TOOLBOX_SEQUENCES[name]),
        "order": order_of(skeleton_of(task_of(scene), plan)),
        "cost": cost_terms(plan, weight),
        "orders": orders,
        "orders_lost": condition.infeasible_orders,
        "first_part": {"name": first, "mass": own, "mass_for_place_first": mass, "sweep": sweep},
        "rounds": condition.rounds,
        "sequences": condition.sequences,
        **scores_of(plan),
        "residuals": plan.residuals,
        "audit": plan.audit,
        "status": plan.status,
        "search": plan.search,
        "solver": plan.solver,
    }


def scores_of(plan: Plan) -> dict[str, Any]:
    """True REBA scores of the human path, time-weighted: total, per phase and by part; and the load of equation 4."""
    scores = plan.reba()
    if scores is None:
        raise LgpError(f"{plan.scene.name}: the plan has no human to score; plan a scene with a human")
    total = np.asarray(scores.reba, dtype=float)
    reba: dict[str, Any] = {"mean": float(total.mean()), "max": float(total.max()), "last": float(total[-1])}
    reba |= {"per_phase": [float(total[plan.phase == phase].mean()) for phase in range(len(plan.actions))]}
    parts = {part: float(np.mean(scores[part])) for part in PARTS}
    return {"reba": reba, "parts": parts, "load_points": float(np.mean(plan.carried)) / 5.0}


def write_tables(folder: Path, summary: dict[str, Any], conditions: dict[str, Condition], scene: Scene) -> None:
    """Write `summary.json`, and `runs.parquet` with one row per condition and the columns of the other experiment."""
    import pandas as pd

    write_summary(folder / SUMMARY, plain_data(summary))
    height = scene.tables["table.center"].height
    rows = []
    for name, one in conditions.items():
        handovers = [step for step, action in enumerate(one.plan.actions) if action.startswith("handover(")]
        scores = summary["conditions"][name]["reba"]
        ends = [np.flatnonzero(one.plan.phase == step)[-1] for step in handovers]
        exact = one.plan.reba()
        rows.append({
            "run": 0, "seed": 0, "condition": name, "table": "center", "height_left": np.nan, "height_center": height,
            "height_right": np.nan, "chosen_height": height,
            "reba_grasp": float(np.mean(np.asarray(exact.reba, float)[ends])) if exact is not None else np.nan,
            "reba_mean": scores["mean"], "cost": one.plan.costs["total"], "feasible": True,
            "seconds": one.plan.search["seconds"], "actions": "; ".join(one.plan.actions),
            "faults": len(one.plan.audit["faults"]),
        })  # fmt: skip
    frame = pd.DataFrame(rows)
    write_atomic(folder / "runs.parquet", lambda part: write_parquet(frame, part))
