"""The screwdriver experiment (section III of the paper): which table, at what height, in which posture.

One run draws the heights of the tables and plans three times: without ergonomics, with, and with ergonomics but the
actions of the plan without ("re-optimized"). Heights depend on seed and run alone, so conditions and starts are paired.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

import dreba
from dreba.surrogates.library import models
from lgp.collision.random_start import random_start
from lgp.errors import LgpError
from lgp.experiments.runs import CONDITIONS, PATH_COLUMNS, RUN_COLUMNS, TABLES
from lgp.experiments.variations import BASELINE, SceneVariation
from lgp.kinematics.world import World
from lgp.logic.task import Task
from lgp.path.bounds import PathBounds
from lgp.path.costs import Weights
from lgp.path.ergonomics import Ergonomics
from lgp.plan_record import Plan
from lgp.planner import COST, parse_sequence, plan_within, task_of
from lgp.scene.model import Scene
from lgp.search.tree_search import Budget
from reba.batch.parallel import run_parallel
from reba.batch.worker_pool import WorkerDied
from reba.posture.columns import COLUMNS

if TYPE_CHECKING:
    import pandas as pd

SCENE: Final = "screwdriver"
GOAL_THING: Final = "screwdriver"
"""What the human is to take."""
DEPTH: Final = 4
"""Longest sequence; the shortest has three actions and the next five."""


def plan_run(
    run: int,
    seed: int = 0,
    initial: str = "rest",
    cost: str = COST,
    slices: int | None = None,
    variation: SceneVariation | None = None,
    collisions: bool = False,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Return the rows of one run: every condition (3, columns of `RUN_COLUMNS`), and their paths (`PATH_COLUMNS`).

    Args:
        run: its number.
        seed: of the experiment.
        initial: "rest" starts in the posture of lowest REBA score, "random" in one drawn inside the joint limits.
        cost: dREBA model of the conditions with ergonomics: a file or a shipped name.
        slices: per phase, the scene's by default.
        variation: of the scene and the weights, none by default.
        collisions: whether bodies are kept apart.

    Example:
        >>> runs, paths = plan_run(0)                                     # doctest: +SKIP
        >>> runs[["condition", "table", "reba_grasp"]]                    # doctest: +SKIP
    """
    import pandas as pd

    changed = BASELINE if variation is None else variation
    world, ergonomics = _prepared(cost, changed)
    scene = world.scene.draw_heights(np.random.default_rng([seed, run]))
    world = world.with_scene(scene)
    start = world.start if initial == "rest" else random_start(world, np.random.default_rng([seed, run, 1]))
    rows, paths = [], []
    weights = Weights(ergonomics=changed.weight)
    given: dict[str, Any] = {
        "weights": weights,
        "initial_configuration": start,
        "slices": slices,
        "collisions": collisions,
    }
    for condition, found in _conditions(task_of(scene), world, ergonomics, given):
        common = {"run": run, "condition": condition, "initial": initial}
        rows.append(_row(scene, found) | common | {"seed": seed})
        if found.feasible:
            paths.append(_path(found, common))
    runs = pd.DataFrame(rows)[list(RUN_COLUMNS)].astype(RUN_COLUMNS)
    if not paths:
        return runs, pd.DataFrame({name: pd.Series(dtype=kind) for name, kind in PATH_COLUMNS.items()})
    return runs, pd.concat(paths, ignore_index=True)[list(PATH_COLUMNS)].astype(PATH_COLUMNS)


def plan_runs(
    runs: Iterable[int],
    seed: int = 0,
    initial: str = "rest",
    cost: str = COST,
    jobs: int = 1,
    variation: SceneVariation | None = None,
    scheduler: str | None = None,
    collisions: bool = False,
) -> Iterator[tuple[pd.DataFrame, pd.DataFrame]]:
    """Yield `plan_run` of every run, as they finish.

    Args:
        runs: their numbers.
        seed, initial, cost, variation, collisions: as for `plan_run`.
        jobs, scheduler: where they are planned, see `reba.batch.parallel.run_parallel`.

    Raises:
        LgpError: the process of a run died each time.
        RebaError: the cluster cannot be used.
    """
    cost = str(Path(cost).resolve()) if Path(cost).is_file() else cost  # workers may be in another folder
    work = partial(plan_run, seed=seed, initial=initial, cost=cost, variation=variation, collisions=collisions)
    for run, made in run_parallel(work, runs, jobs=jobs, scheduler=scheduler, probe=partial(_lacks, cost)):
        if isinstance(made, WorkerDied):
            raise LgpError(f"run {run}: {made.reason}; what is done is safe, run the same command with fewer --jobs")
        yield made


def _lacks(cost: str) -> str:
    """Return what this process lacks to plan, "" if nothing."""

    known = cost in models() or Path(cost).is_file()
    return "" if known else f"cannot read {cost}; keep the model where every worker finds it under the same path"


@lru_cache(maxsize=1)
def _prepared(cost: str, variation: SceneVariation) -> tuple[World, Ergonomics]:
    """Return kinematics and cost; those of the last variation are kept in each process."""

    world = World(variation.scene(SCENE))
    return world, Ergonomics(world, dreba.load(Path(cost) if Path(cost).is_file() else cost))


def _conditions(
    task: Task, world: World, ergonomics: Ergonomics, given: Mapping[str, Any]
) -> Iterator[tuple[str, Plan]]:
    """Yield each condition with its plan.

    The two conditions with ergonomics ask the same problems, each of which is solved once: the search starts with the
    re-optimized path as the cost to beat. Robots start from their motions without ergonomics.
    """

    budget = Budget(depth=DEPTH)
    without, with_, again = CONDITIONS
    before = PathBounds(world, None, **given)
    plain = plan_within(before, task, budget=budget)
    yield without, plain
    bounds = PathBounds(world, ergonomics, **given, reference=before)
    sequence = parse_sequence(task, plain.actions) if plain.feasible else ()
    second = plan_within(bounds, task, sequence) if plain.feasible else plain
    yield with_, plan_within(bounds, task, None, budget, sequence)
    yield again, second


def _row(scene: Scene, found: Plan) -> dict[str, Any]:
    heights = {f"height_{table}": scene.tables[f"table.{table}"].height for table in TABLES}
    row: dict[str, Any] = {
        **heights,
        "feasible": found.feasible,
        "seconds": found.search["seconds"],
        "actions": "; ".join(found.actions),
        "reason": found.reason,
    }
    scores = found.reba()
    if scores is None:
        return row | dict.fromkeys(("chosen_height", "reba_grasp", "reba_mean", "cost"), np.nan) | {"table": None}
    table = _table(scene, found)
    reba = np.asarray(scores.reba, dtype=float)
    return row | {
        "table": table,
        "chosen_height": scene.tables[f"table.{table}"].height,
        "reba_grasp": reba[-1],
        "reba_mean": reba.mean(),
        "cost": found.costs["total"],
    }


def _table(scene: Scene, found: Plan) -> str:
    """Return the table from which the human takes the screwdriver: where it was put last, or lies at first."""
    placed = [action.rstrip(")").split(", ")[-1] for action in found.actions if action.startswith("place(")]
    first = scene.things[GOAL_THING].on
    return (placed[-1] if placed else first).removeprefix("table.")


def _path(found: Plan, common: dict[str, Any]) -> pd.DataFrame:
    import pandas as pd

    scores = found.reba()
    total = np.zeros(len(found.time)) if scores is None else np.asarray(scores.reba, dtype=float)
    frame = common | {"slice": np.arange(len(found.time)), "phase": found.phase, "time": found.time}
    angles = dict(zip(COLUMNS, found.posture.T, strict=True))
    return pd.DataFrame({**frame, "reba": total, "load": found.carried, **angles})
