"""The screwdriver experiment (section III of the paper): which table, at what height, in which posture.

One run draws the heights of the tables and plans three times: without ergonomics, with, and with ergonomics but the
actions of the plan without ("re-optimized"). Heights depend on seed and run alone, so conditions and starts are paired.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from lgp.experiments.report import write_results
from lgp.experiments.runs import RunStore
from lgp.experiments.screwdriver import DEPTH, SCENE, plan_runs
from lgp.experiments.sensitivity import sensitivity as vary
from lgp.kinematics.reachability import reachability
from lgp.kinematics.world import World
from lgp.planner import COST
from lgp.scene.scene_file import load_scene
from lgp.statistics.paired_tests import require


def experiment(
    folder: str | Path,
    runs: int = 100,
    *,
    seed: int = 0,
    initial: str = "rest",
    cost: str = COST,
    jobs: int = 1,
    scheduler: str | None = None,
    collisions: bool = False,
    sensitivity: int = 0,
    progress: Callable[[int, int], None] | None = None,
    tell: Callable[[str], None] | None = None,
    command: str = "",
) -> dict[str, Any]:
    """Make the runs that a folder lacks, write its tables, figures and page, and return the summary.

    Args:
        folder: of the results; runs that are in it stay, so a stopped experiment goes on.
        runs: how many there shall be.
        seed, initial, cost, jobs, scheduler, collisions: as for `plan_runs`.
        sensitivity: runs of each variation of a free choice, 0 for no variations.
        progress: told how many runs there are and how many there shall be, after each.
        tell: told which variation is made.
        command: that made the results, for the page.

    Raises:
        LgpError: the folder holds runs of other settings, or something that is needed is missing.
    """

    require()
    settings = {"experiment": SCENE, "scene": SCENE, "seed": seed, "cost": cost, "depth": DEPTH}
    settings["collisions"] = collisions
    store = RunStore(folder, settings)
    missing = sorted(set(range(runs)) - store.done(initial))
    planned = plan_runs(missing, seed, initial, cost, jobs, scheduler=scheduler, collisions=collisions)
    for number, made in enumerate(planned, 1):
        store.append(*made)
        if progress is not None:
            progress(runs - len(missing) + number, runs)
    tables = store.finish()
    varied = vary(folder, sensitivity, settings, jobs, tell, scheduler) if sensitivity else None
    world = World(load_scene(SCENE))
    return write_results(
        folder,
        *tables,
        world.scene,
        settings=settings,
        command=command,
        reach=reachability(world),
        sensitivity=varied,
    )
