"""Runs of the screwdriver experiment for a family of manikins at once: who is served how well by one workplace.

Each run plans every member alone, then one sequence of actions and one set of places for all: once for the least mean
cost of the members, once for the least cost of the one who is served worst. Heights are those of the other runs.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from lgp.errors import LgpError
from lgp.experiments.cost_model import CostModel
from lgp.experiments.family_bounds import FamilyBounds, MemberBounds
from lgp.experiments.manikins import family
from lgp.experiments.runs import TABLES, RunStore
from lgp.experiments.screwdriver import DEPTH, each_run, tables_of
from lgp.kinematics.world import World
from lgp.path.ergonomics import Ergonomics
from lgp.plan_record import Plan
from lgp.planner import plan_of, plan_within, task_of
from lgp.scene.model import Scene
from lgp.scene.scene_file import read_scene
from lgp.search.records import Budget, SearchResult
from lgp.search.tree_search import search
from lgp.statistics.paired_tests import compare, mean_of

if TYPE_CHECKING:
    import pandas as pd

FOLDER: Final = "family"
"""Folder of these runs, below that of the experiment."""
ALONE, MEAN, WORST = "alone", "mean cost", "largest cost"
PLANNED: Final = (ALONE, MEAN, WORST)
"""How a member is planned: for itself, or in common by what is least over the family."""
MEASURES: Final = ("reba_grasp", "reba_mean", "cost")
"""Columns of runs that are reported."""


def conditions() -> tuple[str, ...]:
    """Return the conditions of a run: every member, planned in every way."""
    return tuple(_condition(one.name, how) for how in PLANNED for one in family().members)


def plan_family_run(
    run: int, *, seed: int, scene: Scene, cost: CostModel, collisions: bool
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Plan one run for the family from the rest posture: tables as those of `lgp.experiments.screwdriver.plan_run`."""
    heights = {
        name: table.height for name, table in scene.draw_heights(np.random.default_rng([seed, run])).tables.items()
    }
    members = {
        name: MemberBounds(world.with_scene(world.scene.with_heights(heights)), ergonomics, collisions=collisions)
        for name, (world, ergonomics) in _worlds(cost, scene.name, json.dumps(scene.values, sort_keys=True)).items()
    }
    return tables_of(_planned(members), run, seed, "rest")


def _planned(members: Mapping[str, MemberBounds]) -> Iterator[tuple[str, Plan]]:
    """Yield each condition with its plan; what was solved for one way is known in the next."""
    budget = Budget(depth=DEPTH)
    task = task_of(next(iter(members.values())).world.scene)
    for name, bounds in members.items():
        yield _condition(name, ALONE), plan_within(bounds, task, None, budget)
    for how in (MEAN, WORST):
        result = search(task, FamilyBounds(members, worst=how == WORST), budget)
        for number, (name, bounds) in enumerate(members.items()):
            yield _condition(name, how), plan_of(bounds, _of_member(result, number))


def _of_member(result: SearchResult, number: int) -> SearchResult:
    """Return the result of a search for a family as that of one member."""
    if not result.skeleton:
        return result
    solution = result.payload[number]
    return replace(result, payload=solution, cost=solution.costs.total, nodes=())


@lru_cache(maxsize=1)
def _worlds(cost: CostModel, name: str, values: str) -> dict[str, tuple[World, Ergonomics]]:
    """Return kinematics and ergonomic cost of all members; each process keeps those of the last scene."""
    base, model = read_scene(json.loads(values), name), cost.model()
    worlds = {one.name: World(one.scene(base)) for one in family().members}
    return {name: (world, Ergonomics(world, model)) for name, world in worlds.items()}


def family_summary(
    folder: str | Path,
    scene: Scene,
    runs: int,
    settings: Mapping[str, Any],
    cost: CostModel,
    *,
    seed: int,
    collisions: bool,
    jobs: int = 1,
    scheduler: str | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Any]:
    """Plan the missing runs for the family in a folder of their own, and return their summary as plain data.

    Raises:
        LgpError: the folder holds runs of other settings, or durations are free: places in common need one clock.
    """
    if scene.durations == "free":
        raise LgpError(f"{scene.name}: durations are free, expected fixed ones for a family; leave out `durations`")
    statures = {one.name: one.stature for one in family().members}
    store = RunStore(Path(folder) / FOLDER, {**settings, "family": statures}, conditions())
    work = partial(plan_family_run, seed=seed, scene=scene, cost=cost, collisions=collisions)
    table, _ = store.complete(runs, "rest", lambda missing: each_run(work, missing, jobs, scheduler), progress)
    return summarise_family(table[table["run"] < runs])


def summarise_family(runs: pd.DataFrame) -> dict[str, Any]:
    """Return means of all members, of the member served worst in each run, and shares of the tables.

    Served worst is who has the highest mean REBA score over the plan, of equal ones who has the highest cost. Runs that
    are infeasible for a member, in any way of planning, are left out of all.
    """
    people = family()
    names = [one.name for one in people.members]
    feasible = runs.groupby("run")["feasible"].transform("all")
    used = runs[feasible]
    by_measure = {
        measure: used.pivot(index="run", columns="condition", values=measure).astype(float) for measure in MEASURES
    }
    ways = {how: _way(used, by_measure, names, how) for how in PLANNED}
    largest = {
        measure: table.T.groupby(lambda condition: condition.rpartition(", ")[2]).max().T
        for measure, table in by_measure.items()
    }
    pairs = [(WORST, MEAN), (MEAN, ALONE)]
    return {
        "title": people.title,
        "source": people.source,
        "members": [asdict(one) for one in people.members],
        "runs": int(runs["run"].nunique()),
        "n": int(used["run"].nunique()),
        "reasons": sorted({str(reason) for reason in runs["reason"] if reason}),
        "planned": ways,
        "largest": {
            measure: [asdict(one) for one in compare(table, pairs)] if len(table) else []
            for measure, table in largest.items()
        },
    }


def _way(used: pd.DataFrame, by_measure: Mapping[str, pd.DataFrame], names: list[str], how: str) -> dict[str, Any]:
    columns = [_condition(name, how) for name in names]
    values = {measure: table.reindex(columns=columns).to_numpy() for measure, table in by_measure.items()}
    # By REBA, then by cost: np.lexsort sorts by its last key first.
    order = np.lexsort((values["cost"], values["reba_mean"]), axis=1)
    last = order[:, -1] if len(order) else np.zeros(0, dtype=int)
    tables = used[used["condition"].isin(columns)]["table"]
    return {
        "members": {
            name: {measure: asdict(mean_of(values[measure][:, number])) for measure in MEASURES}
            | {"worst": int((last == number).sum())}
            for number, name in enumerate(names)
        },
        "worst": {measure: asdict(mean_of(values[measure].max(axis=1, initial=-np.inf))) for measure in MEASURES},
        "percent": {table: 100.0 * float((tables == table).mean()) if len(tables) else None for table in TABLES},
    }


def _condition(name: str, how: str) -> str:
    return f"{name}, {how}"
