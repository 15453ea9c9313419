"""All experiments of the paper in all variants by one call that resumes, and the table that compares them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

from lgp.errors import LgpError
from lgp.experiments import screwdriver, toolbox
from lgp.experiments.comparison import comparison, write_comparison
from lgp.experiments.folders import check_folder
from lgp.experiments.runs import STARTS
from lgp.experiments.screwdriver_experiment import EXTRA_RUNS, experiment_screwdriver
from lgp.experiments.toolbox import experiment_toolbox
from lgp.experiments.variants import variants
from lgp.files import ALL_FILES
from reba.checks import COUNT, PATH, SEED, accepts
from reba.outputs import FolderOutput, check_outputs

KINDS: Final = (screwdriver.SCENE, toolbox.SCENE)


@dataclass(frozen=True)
class Part:
    """One experiment in one variant, in a folder `experiment/name`; `collisions` None leaves them to the variant."""

    experiment: str
    name: str
    variant: str
    collisions: bool | None = None

    @property
    def title(self) -> str:
        """What it is, in one line."""
        return variants()[self.variant].title + ("; collision-free" if self.collisions else "")


PARTS: Final = (
    *(Part(screwdriver.SCENE, name, name) for name in variants()),
    Part(screwdriver.SCENE, "paper-collision-free", "paper", collisions=True),
    *(Part(toolbox.SCENE, name, name) for name in variants() if name != "paper-left"),
    Part(toolbox.SCENE, "paper-collision-free", "paper", collisions=True),
)
"""Everything, in the order of planning; the toolbox has no other first table."""


@accepts(LgpError, folder=PATH, runs=COUNT, seed=SEED, sensitivity=EXTRA_RUNS, family=EXTRA_RUNS, pareto=EXTRA_RUNS)
def experiment_all(
    folder: str | Path,
    *,
    runs: int = 100,
    seed: int = 0,
    jobs: int = 1,
    scheduler: str | None = None,
    sensitivity: int = 0,
    family: int = 0,
    pareto: int = 0,
    progress: Callable[[int, int], None] | None = None,
    on_event: Callable[[str], None] | None = None,
    command: str = "",
) -> dict[str, Any]:
    """Plan both experiments in all variants, from both initial postures, and compare them with the paper.

    Each has its own folder, such as `screwdriver/paper`, with its page; `report.html` and `summary.json` beside them
    hold the comparison, which is written as soon as the runs are planned and before their sweeps are. What is finished
    is kept, so that the same call goes on where it was stopped.

    Args:
        folder: of all results.
        runs, seed, jobs, scheduler, sensitivity, family, pareto: as of `lgp.experiment_screwdriver`.
        progress: called after each run with the number of finished runs and `runs`.
        on_event: called with one line for each step.
        command: command line that reproduces the results, shown on the page.

    Returns:
        The content of `summary.json`.

    Raises:
        LgpError: an option is wrong, a folder holds runs of other settings, or something cannot be planned.
        RebaError: a file cannot be written, or the cluster cannot be used.
    """
    check_outputs(FolderOutput(folder, ALL_FILES), error=LgpError)
    check_folder(folder, "all")
    report = on_event or (lambda message: None)
    place = Path(folder)
    common: dict[str, Any] = {"runs": runs, "seed": seed, "jobs": jobs, "scheduler": scheduler, "command": command}
    own = [part for part in PARTS if part.experiment == screwdriver.SCENE]
    for part in own:
        for start in STARTS:
            report(f"{part.experiment} {part.name}, {start} posture")
            _screwdriver(place, part, initial=start, **common, progress=progress, on_event=on_event)
    for part in PARTS:
        if part.experiment == toolbox.SCENE:
            report(f"{part.experiment} {part.name}")
            of_part = partial(_report_of, report, part.name)
            experiment_toolbox(
                place / part.experiment / part.name,
                variant=part.variant,
                collisions=part.collisions,
                on_event=of_part,
                command=command,
            )
    names = {kind: [part.name for part in PARTS if part.experiment == kind] for kind in KINDS}
    summary = comparison(place, names)
    write_comparison(place, summary, {part.name: part.title for part in PARTS}, command)
    extras = {"sensitivity": sensitivity, "family": family, "pareto": pareto}
    if any(extras.values()):
        for part in own:
            report(f"{part.experiment} {part.name}: {', '.join(name for name, count in extras.items() if count)}")
            _screwdriver(place, part, initial=STARTS[-1], **common, **extras, progress=progress, on_event=on_event)
    return summary


def _report_of(report: Callable[[str], None], name: str, event: str) -> None:
    report(f"{toolbox.SCENE} {name}: {event}")


def _screwdriver(place: Path, part: Part, **options: Any) -> None:
    experiment_screwdriver(
        place / part.experiment / part.name, variant=part.variant, collisions=part.collisions, **options
    )
