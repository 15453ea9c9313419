"""Usefulness of models as costs: the true REBA that their minimisation reaches, beside costs without any REBA."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

import numpy as np

from dreba.errors import ModelError
from dreba.evaluation import reach_methods as reach
from dreba.evaluation.parallel import in_parallel
from dreba.evaluation.reach_methods import Method, ReachResult
from dreba.evaluation.reach_tasks import Space, Starts, StoredTask, starts, stored_tasks
from dreba.evaluation.staged_minimiser import BUDGET, SOLVER_TOLERANCE
from dreba.surrogates.base import Surrogate
from reba.arrays import Array
from reba.posture.columns import COLUMNS

STARTS: Final[tuple[Starts, ...]] = ("random", "neutral")
"""Initial postures of the optimiser: anywhere within the limits, or near standing upright."""
STARTS_PER_TASK: Final = 2
"""Initial postures of each kind for each reach task."""
SOLVER: Final = f"SLSQP, tolerance {SOLVER_TOLERANCE:g}, at most {BUDGET} evaluations"
"""Solver of all rows."""


def enable(
    models: Mapping[str, Surrogate],
    tasks: int,
    seed: int = 0,
    *,
    space: Space = "wide",
    task_seed: int = 0,
    jobs: int = 1,
    scheduler: str | None = None,
) -> dict[str, Any]:
    """Return the true REBA reached by minimising each model on stored reach tasks, with rows of costs without REBA.

    Every row has the same tasks, starts, solver and budget; what a method adds is in its name. Standard errors are
    over tasks, of differences paired by task.

    Args:
        models: fitted models by name; those that lack some of the 22 columns of the posture table are left out.
        tasks: number of tasks, the first ones of those stored.
        seed: of the starts.
        space, task_seed: which stored tasks.
        scheduler: address of a Dask scheduler instead of local processes.

    Returns:
        "space", "tasks", "solver", "certified" (tasks whose least true REBA is proved, and the means of what is proved
        and of what is known), "left_out" (models), "recommended" and "rows", one for each method and kind of start:
        "name", "model" (empty for a cost without REBA), "start", "solver", "reba" (mean; a run that misses its targets
        counts 12), "standard_error", "difference" (to the distance to rest with the same start and free start) and
        "difference_standard_error", "certified" (the mean proved minimum), "share_best" (runs with the lowest known
        score of the task), "infeasible", "evaluations" and "seconds" (processor time). "recommended" has the "name" of
        the row with the fewest evaluations among those that, over both kinds of start, are within a standard error of
        the lowest mean (the one-standard-error rule, paired by task; at least two tasks), else None.

    Raises:
        ModelError: more tasks than are stored, none stored for the seed, or the process of a row died.
    """
    stored = stored_tasks(space, task_seed)
    if tasks > len(stored):
        raise ModelError(f"{tasks} reach tasks; expected {len(stored)} or fewer, as many as are stored for {space}")
    chosen = stored[:tasks]
    usable = {name: model for name, model in models.items() if set(model.joints_) == set(COLUMNS)}
    methods = reach.methods_of(usable)
    work = {
        (start, method.full_name): (usable, place, start) for start in STARTS for place, method in enumerate(methods)
    }
    results = in_parallel(partial(_reach, tasks=chosen, seed=seed), work, jobs, scheduler)
    return {
        "space": space,
        "tasks": tasks,
        "solver": SOLVER,
        "certified": {
            "tasks": sum(task.certified for task in chosen),
            "proved": float(np.mean([task.proved for task in chosen])),
            "reached": float(np.mean([task.reached for task in chosen])),
        },
        "left_out": [name for name in models if name not in usable],
        "recommended": _recommended(methods, results) if tasks > 1 else None,
        "rows": [_row(start, method, results, chosen) for start in STARTS for method in methods],
    }


def _recommended(methods: Sequence[Method], results: Mapping[tuple[Starts, str], ReachResult]) -> dict[str, Any]:
    """Return the method of the fewest evaluations of those whose mean is within a standard error of the best."""
    scores = {
        method.full_name: np.mean([results[start, method.full_name].by_task for start in STARTS], axis=0)
        for method in methods
    }
    evaluations = {name: float(np.mean([results[start, name].evaluations for start in STARTS])) for name in scores}
    least = scores[min(scores, key=lambda name: (scores[name].mean(), evaluations[name]))]
    behind = {name: reach.mean_and_error(scores[name] - least) for name in scores}
    near = [name for name, (difference, error) in behind.items() if difference <= error]
    chosen = min(near, key=evaluations.__getitem__)
    return {"name": chosen, "reba": float(scores[chosen].mean()), "evaluations": evaluations[chosen]}


def _row(
    start: Starts, method: Method, results: Mapping[tuple[Starts, str], ReachResult], tasks: Sequence[StoredTask]
) -> dict[str, Any]:
    result = results[start, method.full_name]
    null = results[start, Method(reach.DISTANCE.name, [], method.free_start).full_name]
    mean, error = reach.mean_and_error(result.by_task)
    difference, paired = reach.mean_and_error(result.by_task - null.by_task)
    best = np.array([task.reached for task in tasks])
    return {
        "name": method.full_name,
        "model": method.model,
        "start": start,
        "solver": SOLVER,
        "reba": mean,
        "standard_error": error if len(tasks) > 1 else None,
        "difference": difference,
        "difference_standard_error": paired if len(tasks) > 1 else None,
        "certified": float(np.mean([task.proved for task in tasks])),
        "share_best": float((result.scores <= best[:, None]).mean()),
        "infeasible": result.infeasible,
        "evaluations": result.evaluations,
        "seconds": result.seconds,
    }


def _reach(
    case: tuple[Any, tuple[Mapping[str, Surrogate], int, Starts]], tasks: Sequence[StoredTask], seed: int
) -> ReachResult:
    _, (models, place, start) = case
    # A method holds functions, which do not travel between processes; models do.
    method = reach.methods_of(dict(models))[place]
    return reach.run(method, [stored.task for stored in tasks], initial_postures(start, len(tasks), seed))


def initial_postures(start: Starts, tasks: int, seed: int) -> Array:
    """Return the initial postures (tasks, `STARTS_PER_TASK`, 22) [deg] of a kind."""
    return starts(start, tasks * STARTS_PER_TASK, seed).reshape(tasks, STARTS_PER_TASK, -1)
