"""Models side by side on the same poses and the same tasks: error, time, and what they lead an optimiser to."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, Final, TypeVar

from dreba.errors import ModelError
from dreba.evaluate import evaluate
from dreba.poses import Poses
from dreba.timing import time_per_pose
from reba.fan_out import Lost, fan_out
from reba.posture import COLUMNS

if TYPE_CHECKING:
    from dreba.model import Surrogate
    from dreba.reach import Starts

Name = TypeVar("Name", bound=Hashable)
Given = TypeVar("Given")
Result = TypeVar("Result")

STARTS: Final[tuple[Starts, ...]] = ("random", "neutral")
"""Where an optimiser starts: anywhere in the limits, or near standing upright."""


def compare(
    models: Mapping[str, Surrogate], poses: Poses, *, jobs: int = 1, scheduler: str | None = None
) -> list[dict[str, Any]]:
    """Return one row a model: `domain` of its fit, errors as `Evaluation.to_dict`, `seconds_per_pose` single, batch.

    Args:
        models: by name.
        poses: the same for all.
        jobs, scheduler: where models are evaluated, see `reba.fan_out.fan_out`; times are those of that place, with
            whatever else runs there.
    """
    return list(_each(partial(_row, poses=poses), models, jobs, scheduler).values())


def enable(
    models: Mapping[str, Surrogate],
    tasks: int,
    repeats: int = 3,
    seed: int = 0,
    *,
    jobs: int = 1,
    scheduler: str | None = None,
) -> list[dict[str, Any]]:
    """Return what each model leads to when it is minimised under reach constraints, one row a model and kind of start.

    Args:
        models: by name; those on other columns than the 22 of the posture table are left out.
        tasks: number of reach tasks, the same for all.
        repeats: starts per task.
        seed: of tasks and starts.
        jobs, scheduler: where, see `reba.fan_out.fan_out`.

    Returns:
        Rows of "model", "start", "mean_reba" (infeasible runs count 12), "share_best" of runs that reach the best
        score that any of the models reached on their task, "share_best_of_starts", "infeasible", "evaluations".
    """
    from dreba import reach

    usable = {name: model for name, model in models.items() if model.joints_ == COLUMNS}
    given = {(start, name): (start, model) for start in STARTS for name, model in usable.items()}
    work = partial(_reached, tasks=tasks, repeats=repeats, seed=seed)
    outcomes = _each(work, given, jobs, scheduler)
    best = {start: reach.best_known([outcomes[start, name] for name in usable]) for start in STARTS if usable}
    return [
        {
            "model": name,
            "start": start,
            "mean_reba": outcome.mean,
            "share_best": outcome.share_best(best[start]),
            "share_best_of_starts": outcome.share_best_of_starts(best[start]),
            "infeasible": outcome.infeasible,
            "evaluations": outcome.evaluations,
            "seconds": outcome.seconds,
        }
        for (start, name), outcome in outcomes.items()
    ]


def _row(task: tuple[str, Surrogate], poses: Poses) -> dict[str, Any]:
    name, model = task
    return {
        "model": name,
        "domain": str(model.about_.domain.get("name", "")),
        **evaluate(model, poses).to_dict(),
        "seconds_per_pose": time_per_pose(model, poses),
    }


def _reached(task: tuple[Any, tuple[Starts, Surrogate]], tasks: int, repeats: int, seed: int) -> Any:
    from dreba import reach

    _, (start, model) = task
    beginnings = reach.starts(start, tasks * repeats, seed).reshape(tasks, repeats, -1)
    return reach.run(reach.method_of(model), reach.tasks(tasks, seed), beginnings)


def _each(
    work: Callable[[tuple[Name, Given]], Result], given: Mapping[Name, Given], jobs: int, scheduler: str | None
) -> dict[Name, Result]:
    """Return what `work` makes of every item, in their order.

    Raises:
        ModelError: the process of one of them died.
    """
    found: dict[Name, Result] = {}
    for (name, _), result in fan_out(work, given.items(), jobs=min(jobs, len(given) or 1), scheduler=scheduler):
        if isinstance(result, Lost):
            raise ModelError(f"{name}: {result.reason}; compare it by itself")
        found[name] = result
    return {name: found[name] for name in given}
