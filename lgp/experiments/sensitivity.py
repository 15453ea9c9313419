"""The sensitivity of the screwdriver experiment: how the choice of table moves when a free choice of the scene does.

Each variation is a folder of runs of its own, on the same heights as the experiment's first runs, so a stopped one goes
on. Where a variation takes the task its meaning - the human reaches the screwdriver without help, no hand of a robot
does - the table says so.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from lgp.experiments.runs import CONDITIONS, TABLES, RunStore
from lgp.experiments.screwdriver import GOAL_THING, SCENE, plan_runs
from lgp.experiments.variations import BASELINE, SceneVariation, variations
from lgp.kinematics.reachability import CLOSE, reach, reachability
from lgp.kinematics.world import World
from lgp.scene.scene_file import load_scene

if TYPE_CHECKING:
    import pandas as pd

FOLDER: Final = "sensitivity"
"""Folder of the variations, below that of the experiment."""
STARTS: Final = 6
"""Of the inverse kinematics behind a remark."""
FULL: Final = 0.995


def sensitivity(
    folder: str | Path,
    runs: int,
    settings: Mapping[str, Any],
    jobs: int = 1,
    progress: Callable[[str], None] | None = None,
    scheduler: str | None = None,
) -> pd.DataFrame:
    """Make the runs that the variations lack; return one row per variation and condition.

    Args:
        folder: of the experiment.
        runs: of every variation.
        settings: of the experiment, with its `seed`, `cost` and `collisions`; all runs start at rest.
        jobs, scheduler: where they are made, see `reba.batch.parallel.run_parallel`.
        progress: told what is made next.

    Returns:
        Columns `choice factor condition left center right n of remark`: shares of the tables [%] of the n feasible of
        all runs. They add to less than 100 where the human takes the screwdriver from where it lies at first.

    Raises:
        LgpError: a folder holds runs of other settings.
    """
    rows = []
    for variation in variations(load_scene(SCENE)):
        own = {**settings, "choice": variation.choice, "factor": variation.factor}
        store = RunStore(Path(folder) / FOLDER / variation.name, own)
        missing = sorted(set(range(runs)) - store.done("rest"))
        if missing and progress is not None:
            progress(f"{variation.choice} x {variation.factor:g}: {len(missing)} runs")
        common = settings["seed"], "rest", settings["cost"], jobs
        for made in plan_runs(missing, *common, variation, scheduler, settings["collisions"]):
            store.append(*made)
        found, _ = store.finish()
        rows += _rows(variation, found[found["run"] < runs])
    return _table(rows)


def _rows(variation: SceneVariation, runs: pd.DataFrame) -> list[dict[str, Any]]:
    """Return a row per condition; the re-optimized one has the tables of the one without ergonomics."""

    changed = variation.changes != BASELINE.changes
    remark = "; ".join(remarks(World(variation.scene(SCENE)))) if changed else ""
    rows = []
    for condition in CONDITIONS[:2]:
        here = runs[runs["condition"] == condition]
        tables = here.loc[here["feasible"], "table"]
        shares = {table: 100.0 * float((tables == table).mean()) if len(tables) else np.nan for table in TABLES}
        first = {"choice": variation.choice, "factor": variation.factor, "condition": condition}
        rows.append({**first, **shares, "n": len(tables), "of": len(here), "remark": remark})
    return rows


def _table(rows: list[dict[str, Any]]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(rows, columns=["choice", "factor", "condition", *TABLES, "n", "of", "remark"])


def remarks(world: World) -> list[str]:
    """Return what takes the task its meaning, or part of it, in words; nothing where all is as it should be."""

    scene = world.scene
    item = scene.objects[GOAL_THING]
    lies = scene.tables[item.on]
    spot = np.array([[*lies.position, lies.height + item.size[2] / 2.0]])
    near = {
        hand.full: float(reach(world, hand, spot, STARTS, np.random.default_rng(0))[0]) < CLOSE
        for hand in scene.hands.values()
    }
    human = {hand.full for hand in scene.hands.values() if hand.agent == "human"}
    found = []
    if any(near[hand] for hand in human):
        found.append(f"the human reaches the {GOAL_THING} without help")
    if not any(reached for hand, reached in near.items() if hand not in human):
        found.append(f"no robot hand reaches the {GOAL_THING}")
    tops = [scene.tables[f"table.{name}"] for name in TABLES]
    for first, second in pairwise(tops):
        gap = np.abs(np.subtract(first.position, second.position)) - np.add(first.size, second.size) / 2.0
        if gap.max() < 0.0:
            found.append(f"the tables {first.name} and {second.name} overlap where they are of one height")
    for robot in scene.robots.values():
        for top in tops:
            if (np.abs(np.subtract(robot.position[:2], top.position)) < np.array(top.size) / 2.0).all():
                found.append(f"{robot.name} stands in the table {top.name}")
    somewhere = reachability(world, attempts=STARTS).any_reached().dropna(axis=1).astype(float)
    for who, hands in (("the human", human), ("the robot", set(near) - human)):
        for top in tops:
            rows = [key for key in somewhere.index if key[0] in hands and key[1] == top.full]
            part = float(somewhere.loc[rows].max().mean())
            if part < FULL:
                found.append(f"{who} reaches the table {top.name} at {100 * part:.0f} % of its heights")
    return found
