"""Runs of the screwdriver experiment (section III of the paper): which table, at what height, in which posture.

A run draws the heights of the tables and plans three conditions: without ergonomics, with ergonomics, and with
ergonomics for the actions of the plan without ("re-optimized"). Heights depend on seed and run only, so that conditions
and initial postures are paired.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from lgp.collision.random_start import random_start
from lgp.errors import LgpError
from lgp.experiments.cost_model import CostModel, cost_model
from lgp.experiments.effort import effort_by_agent
from lgp.experiments.runs import CONDITIONS, NUMBERS, PATH_COLUMNS, RUN_COLUMNS, TABLES, empty
from lgp.kinematics.world import World
from lgp.logic.task import Task
from lgp.path.bounds import PathBounds
from lgp.path.ergonomics import Ergonomics
from lgp.plan_record import Plan
from lgp.planner import parse_sequence, plan_within, task_of
from lgp.scene.model import Scene
from lgp.scene.scene_file import load_scene, read_scene
from lgp.search.records import Budget
from reba.batch.parallel import run_parallel
from reba.batch.worker_pool import WorkerDied
from reba.posture.columns import COLUMNS

if TYPE_CHECKING:
    import pandas as pd

SCENE: Final = "screwdriver"
GOAL_OBJECT: Final = "screwdriver"
"""Object that the human takes."""
NEEDS: Final = (*(f"table.{name}" for name in TABLES), GOAL_OBJECT)
"""Tables and objects that a scene of the experiment has."""
DEPTH: Final = 4
"""Most actions of a sequence: the shortest that reach the goal have three, the next five."""


def plan_run(
    run: int,
    *,
    seed: int = 0,
    scene: Scene | None = None,
    initial: str = "rest",
    cost: CostModel | None = None,
    slices: int | None = None,
    collisions: bool = False,
    plans: str | Path | None = None,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Plan one run: a row per condition (columns `RUN_COLUMNS`), and the paths of the feasible ones (`PATH_COLUMNS`).

    Args:
        scene: of which the heights are drawn, the shipped one by default.
        initial: "rest" starts from the posture of lowest REBA score, "random" from one drawn within the joint limits.
        cost: dREBA model of the conditions with ergonomics, that of the scene by default.
        slices: per phase, the scene's by default.
        collisions: whether paths are collision-free.
        plans: folder in which each feasible plan is kept in one of its own, which `lgp page` and `lgp run` take.
    """
    base = load_scene(SCENE) if scene is None else scene
    model = cost_model(base.cost.model) if cost is None else cost
    world, ergonomics = _world_and_cost(model, base.name, json.dumps(base.values, sort_keys=True))
    scene = base.draw_heights(np.random.default_rng([seed, run]))
    world = world.with_scene(scene)
    start = (
        world.initial_configuration if initial == "rest" else random_start(world, np.random.default_rng([seed, run, 1]))
    )
    options: dict[str, Any] = {
        "initial_configuration": start,
        "slices": slices,
        "collisions": collisions,
    }
    planned = []
    for condition, plan in _conditions(task_of(scene), world, ergonomics, options):
        planned.append((condition, plan))
        if plan.feasible and plans is not None:
            plan.save(Path(plans) / f"{initial}-{run}-{condition}")
    return tables_of(planned, run, seed, initial)


def tables_of(
    planned: Iterable[tuple[str, Plan]], run: int, seed: int, initial: str
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return a row for each condition with its plan (columns `RUN_COLUMNS`), and their paths (`PATH_COLUMNS`)."""
    import pandas as pd

    rows, paths = [], []
    for condition, plan in planned:
        key = {"run": run, "condition": condition, "initial": initial}
        rows.append(_row(plan.scene, plan) | key | {"seed": seed})
        if plan.feasible:
            paths.append(_path(plan, key))
    runs_table = pd.DataFrame(rows)[list(RUN_COLUMNS)].astype(RUN_COLUMNS)
    if not paths:
        return runs_table, empty(PATH_COLUMNS)
    return runs_table, pd.concat(paths, ignore_index=True)[list(PATH_COLUMNS)].astype(PATH_COLUMNS)


def plan_runs(
    runs: Iterable[int],
    *,
    seed: int = 0,
    scene: Scene | None = None,
    initial: str = "rest",
    cost: CostModel | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
    collisions: bool = False,
    plans: str | Path | None = None,
) -> Iterator[tuple[pd.DataFrame, pd.DataFrame]]:
    """Plan runs in parallel with the arguments of `plan_run`, and yield the tables of each as it finishes.

    Args:
        jobs: processes on this computer.
        scheduler: address of a Dask cluster, see `reba.batch.parallel.run_parallel`.

    Raises:
        LgpError: the process of a run died each time.
        RebaError: the cluster cannot be used.
    """
    base = load_scene(SCENE) if scene is None else scene
    model = cost_model(base.cost.model) if cost is None else cost
    work = partial(plan_run, seed=seed, scene=base, initial=initial, cost=model, collisions=collisions, plans=plans)
    yield from each_run(work, runs, jobs, scheduler)


def each_run(
    work: Callable[[int], tuple[pd.DataFrame, pd.DataFrame]], runs: Iterable[int], jobs: int, scheduler: str | None
) -> Iterator[tuple[pd.DataFrame, pd.DataFrame]]:
    """Do the work of runs in parallel, and yield the tables of each as it finishes; arguments as of `plan_runs`."""
    for run, tables in run_parallel(work, runs, jobs=jobs, scheduler=scheduler):
        if isinstance(tables, WorkerDied):
            raise LgpError(f"run {run}: {tables.reason}; finished runs are kept, repeat the command with fewer --jobs")
        yield tables


@lru_cache(maxsize=1)
def _world_and_cost(cost: CostModel, name: str, values: str) -> tuple[World, Ergonomics]:
    """Kinematics and ergonomic cost of a scene, given as JSON; each process keeps those of the last one."""
    world = World(read_scene(json.loads(values), name))
    return world, Ergonomics(world, cost.model())


def _conditions(
    task: Task, world: World, ergonomics: Ergonomics, options: Mapping[str, Any]
) -> Iterator[tuple[str, Plan]]:
    """Yield each condition with its plan.

    The two conditions with ergonomics share their solved problems: the search starts with the cost of the re-optimized
    path as incumbent. Initial guesses of the robots are their motions without ergonomics.
    """
    budget = Budget(depth=DEPTH)
    non_ergonomic, ergonomic, reoptimized = CONDITIONS
    reference = PathBounds(world, None, **options)
    plain = plan_within(reference, task, budget=budget)
    yield non_ergonomic, plain
    bounds = PathBounds(world, ergonomics, **options, reference=reference)
    sequence = parse_sequence(task, plain.actions) if plain.feasible else ()
    same_actions = plan_within(bounds, task, sequence) if plain.feasible else plain
    yield ergonomic, plan_within(bounds, task, None, budget, sequence)
    yield reoptimized, same_actions


def _row(scene: Scene, plan: Plan) -> dict[str, Any]:
    heights = {f"height_{table}": scene.tables[f"table.{table}"].height for table in TABLES}
    row: dict[str, Any] = {
        **heights,
        "feasible": plan.feasible,
        "seconds": plan.search["seconds"],
        "actions": "; ".join(plan.actions),
        "reason": plan.reason,
        "faults": len(plan.audit.get("faults", ())),
    }
    scores, effort = plan.reba(), effort_by_agent(plan)
    if scores is None:
        return row | dict.fromkeys(NUMBERS, np.nan) | {"table": None}
    table = _table(scene, plan)
    reba = np.asarray(scores.reba, dtype=float)
    return row | {
        "table": table,
        "chosen_height": scene.tables[f"table.{table}"].height,
        "reba_grasp": reba[-1],
        "reba_mean": np.average(reba, weights=np.diff(plan.time, prepend=0.0)),
        "cost": plan.costs["total"],
        "duration": plan.time[-1],
        "robot_effort": sum(effort[name] for name in scene.robots),
        "human_effort": effort["human"],
    }


def _table(scene: Scene, plan: Plan) -> str:
    """Table from which the human takes the screwdriver: the last it was placed on, else its initial one."""
    placed = [action.rstrip(")").split(", ")[-1] for action in plan.actions if action.startswith("place(")]
    first = scene.objects[GOAL_OBJECT].on
    return (placed[-1] if placed else first).removeprefix("table.")


def _path(plan: Plan, key: dict[str, Any]) -> pd.DataFrame:
    import pandas as pd

    scores = plan.reba()
    total = np.zeros(len(plan.time)) if scores is None else np.asarray(scores.reba, dtype=float)
    frame = key | {"slice": np.arange(len(plan.time)), "phase": plan.phase, "time": plan.time}
    angles = dict(zip(COLUMNS, plan.posture.T, strict=True))
    return pd.DataFrame({**frame, "reba": total, "load": plan.carried, **angles})
