"""The screwdriver experiment (section III of the paper) from planning to report."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final

from lgp.errors import LgpError
from lgp.experiments.cost_model import cost_model
from lgp.experiments.family_runs import family_summary
from lgp.experiments.folders import check_folder
from lgp.experiments.pareto import pareto_fronts
from lgp.experiments.report import write_results
from lgp.experiments.runs import STARTS, RunStore
from lgp.experiments.screwdriver import DEPTH, NEEDS, SCENE, plan_runs
from lgp.experiments.sensitivity import sensitivity_table
from lgp.experiments.summary import finished_summary
from lgp.experiments.variants import VARIANT, setting, settings_of
from lgp.files import EXPERIMENT_FILES, PLANS
from lgp.kinematics.reachability import reachability
from lgp.kinematics.world import World
from lgp.statistics.paired_tests import require_statsmodels
from reba.checks import NOT_NEGATIVE, PATH, YES_NO, Allowed, accepts, shown
from reba.outputs import FolderOutput, check_outputs

EXTRA_RUNS: Final = Allowed(
    "a whole number, 0 or more", lambda value: isinstance(value, int) and not isinstance(value, bool) and value >= 0
)


@accepts(
    LgpError,
    folder=PATH,
    scene=PATH.or_none(),
    cost=PATH.or_none(),
    weight=NOT_NEGATIVE.or_none(),
    phase_seconds=NOT_NEGATIVE.or_none(),
    collisions=YES_NO.or_none(),
    sensitivity=EXTRA_RUNS,
    family=EXTRA_RUNS,
    pareto=EXTRA_RUNS,
    plans=YES_NO,
)
def experiment_screwdriver(
    folder: str | Path,
    *,
    variant: str = VARIANT,
    scene: str | Path | None = None,
    runs: int = 100,
    seed: int = 0,
    initial: str = "rest",
    cost: str | Path | None = None,
    weight: float | None = None,
    phase_seconds: float | None = None,
    jobs: int = 1,
    scheduler: str | None = None,
    collisions: bool | None = None,
    sensitivity: int = 0,
    family: int = 0,
    pareto: int = 0,
    plans: bool = False,
    progress: Callable[[int, int], None] | None = None,
    on_event: Callable[[str], None] | None = None,
    command: str = "",
) -> dict[str, Any]:
    """Reproduce the screwdriver experiment: plan its runs, write tables, figures and report, and return the summary.

    Each run draws the heights of three tables and plans the conditions non-ergonomic, ergonomic and re-optimized.
    Written are `runs.parquet`, `paths.parquet`, `summary.json`, `figure_5.svg` to `figure_7.svg` and `report.html`.
    Variations, family and fronts of an earlier call stay in them where they are not asked for again.

    Args:
        folder: of the results. Finished runs in it are kept, so that an interrupted experiment continues.
        variant: what is taken for what the paper leaves open, see `lgp.experiments.variants.variants`.
        scene: the shipped scene by default, or the path of a TOML file with the same tables.
        runs: number of runs in total.
        seed: of all random draws.
        initial: initial posture of the human: "rest" or "random".
        cost: dREBA model of the conditions with ergonomics, a file or a shipped name; the variant's by default.
        weight: of a score point for a second, the variant's by default.
        phase_seconds: duration of each phase [s], the variant's by default.
        jobs: processes on this computer.
        scheduler: address of a Dask scheduler, which then replaces `jobs`.
        collisions: whether paths are collision-free, as the variant says by default; takes several times as long.
        sensitivity: runs of each variation of the scene, the cost and the person, 0 for no variations.
        family: runs that are planned for a family of manikins at once, 0 for none.
        pareto: runs of each point of the Pareto fronts of REBA against time and against the robot's effort, 0 for none.
        plans: keep each plan in a folder of its own in `plans`, with `jobs` only.
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
    if plans and scheduler is not None:
        raise LgpError("plans are kept by the processes of this computer; leave out the scheduler or the plans")
    require_statsmodels()
    chosen, base = setting(variant, SCENE if scene is None else scene, cost, weight, phase_seconds, needs=NEEDS)
    free = chosen.collisions if collisions is None else collisions
    check_outputs(FolderOutput(folder, EXPERIMENT_FILES), inputs=[base.cost.model], error=LgpError)
    check_folder(folder, SCENE)
    model = cost_model(base.cost.model)
    settings = {**settings_of(SCENE, chosen, base, free), **model.settings(), "seed": seed, "depth": DEPTH}
    store = RunStore(folder, settings)
    kept = Path(folder) / PLANS if plans else None
    plan = partial(plan_runs, seed=seed, jobs=jobs, scheduler=scheduler, collisions=free)
    runs_of = partial(plan, scene=base, initial=initial, cost=model, plans=kept)
    tables = store.complete(runs, initial, runs_of, progress)
    earlier = finished_summary(folder, settings) or {}
    varied, people, traced = (earlier.get(name) for name in ("sensitivity", "family", "pareto"))
    if sensitivity:
        varied = sensitivity_table(folder, base, sensitivity, settings, plan, on_event=on_event).to_dict("records")
    if family:
        if on_event is not None:
            on_event(f"a family of manikins: {family} runs")
        people = family_summary(
            folder, base, family, settings, model, seed=seed, collisions=free, jobs=jobs, scheduler=scheduler
        )
    if pareto:
        traced = pareto_fronts(folder, base, pareto, settings, partial(plan, cost=model), on_event=on_event)
    return write_results(
        folder,
        *tables,
        base,
        family=people,
        fronts=traced,
        variant=chosen,
        settings=settings,
        command=command,
        reach=reachability(World(base)),
        sensitivity=varied,
    )
