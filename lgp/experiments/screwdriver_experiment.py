"""The screwdriver experiment (section III of the paper) from planning to report."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from lgp.defaults import COST
from lgp.errors import LgpError
from lgp.experiments.cost_model import cost_model
from lgp.experiments.report import write_results
from lgp.experiments.runs import STARTS, RunStore
from lgp.experiments.screwdriver import DEPTH, SCENE, plan_runs
from lgp.experiments.sensitivity import sensitivity_table
from lgp.files import EXPERIMENT_FILES
from lgp.kinematics.reachability import reachability
from lgp.kinematics.world import World
from lgp.scene.scene_file import load_scene
from lgp.statistics.paired_tests import require_statsmodels
from reba.checks import PATH, YES_NO, accepts, shown
from reba.outputs import FolderOutput, check_outputs


@accepts(LgpError, folder=PATH, cost=PATH, collisions=YES_NO)
def experiment_screwdriver(
    folder: str | Path,
    *,
    runs: int = 100,
    seed: int = 0,
    initial: str = "rest",
    cost: str = COST,
    jobs: int = 1,
    scheduler: str | None = None,
    collisions: bool = False,
    sensitivity: int = 0,
    progress: Callable[[int, int], None] | None = None,
    on_event: Callable[[str], None] | None = None,
    command: str = "",
) -> dict[str, Any]:
    """Reproduce the screwdriver experiment: plan its runs, write tables, figures and report, and return the summary.

    Each run draws the heights of three tables and plans the conditions non-ergonomic, ergonomic and re-optimized.
    Written are `runs.parquet`, `paths.parquet`, `summary.json`, `figure_5.svg` to `figure_7.svg` and `report.html`.

    Args:
        folder: of the results. Finished runs in it are kept, so that an interrupted experiment continues.
        runs: number of runs in total.
        seed: of all random draws.
        initial: initial posture of the human: "rest" or "random".
        cost: dREBA model of the conditions with ergonomics: a file or a shipped name.
        jobs: processes on this computer.
        scheduler: address of a Dask scheduler, which then replaces `jobs`.
        collisions: whether paths are collision-free; takes several times as long.
        sensitivity: runs of each variation of a free choice of the scene, 0 for no variations.
        progress: called after each run with the number of finished runs and `runs`.
        on_event: called with one line for each variation that is planned.
        command: command line that reproduces the results, shown in the report.

    Returns:
        The content of `summary.json`.

    Raises:
        LgpError: an option is wrong, the folder holds runs of other settings, a run cannot be planned, or statsmodels
            is not installed.
        RebaError: a file cannot be written, or the cluster cannot be used.
    """
    if not isinstance(runs, int) or isinstance(runs, bool) or runs < 1:
        raise LgpError(f"runs is {shown(runs)}; expected a whole number of 1 or more")
    if initial not in STARTS:
        raise LgpError(f"initial is {shown(initial)}; expected one of {', '.join(STARTS)}")
    require_statsmodels()
    check_outputs(FolderOutput(folder, EXPERIMENT_FILES), inputs=[cost], error=LgpError)
    model = cost_model(cost)
    settings = {
        "experiment": SCENE,
        "scene": SCENE,
        "seed": seed,
        **model.settings(),
        "depth": DEPTH,
        "collisions": collisions,
    }
    store = RunStore(folder, settings)
    plan = partial(plan_runs, seed=seed, cost=model, jobs=jobs, scheduler=scheduler, collisions=collisions)
    tables = store.complete(runs, initial, partial(plan, initial=initial), progress)
    varied = sensitivity_table(folder, sensitivity, settings, plan, on_event=on_event) if sensitivity else None
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
