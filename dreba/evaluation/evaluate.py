"""How far a model is from the true score: per REBA class, overall, in rank, rounded."""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Mapping
from functools import partial
from typing import Any, Final, TypeVar

from dreba.errors import ModelError
from dreba.evaluation import reach_tasks as reach
from dreba.evaluation.reach_tasks import Starts
from dreba.sampling.poses import Poses
from dreba.surrogates.base import Surrogate
from dreba.surrogates.metrics import Evaluation, evaluation_of
from dreba.surrogates.registry import ModelInfo
from reba.arrays import Array
from reba.batch.parallel import run_parallel
from reba.batch.worker_pool import WorkerDied
from reba.posture.columns import COLUMNS, INDEX


def evaluate(model: Surrogate, poses: Poses, temperature: float | None = None) -> Evaluation:
    """Return the error of a model on poses with their true scores.

    Args:
        model: fitted.
        poses: with factors, if they have any, which the model is given.
        temperature: [deg] for kinds that have one; None for their default.

    Raises:
        ModelError: there is no pose, the model works on a column that is not in the posture table, or a temperature
            is given for a kind that has none.

    Warns:
        RadiansWarning: all angles are so small that they look like radians.
    """
    given = poses.given
    check_temperature(model, temperature)
    values = model.value(
        angles_for(model, poses),
        load=given.load,
        coupling=given.coupling,
        activity=given.activity,
        temperature=temperature,
    )
    return evaluation_of(model.kind, values, poses.reba)


def check_temperature(model: Surrogate, temperature: float | None) -> None:
    """Check that a model has temperatures if one is asked for.

    Raises:
        ModelError: it has none.
    """
    if temperature is not None and not model.temperatures_:
        raise ModelError(f"kind {model.kind!r} has no temperature; leave it out (soft and graduated models have some)")


def angles_for(model: Surrogate, poses: Poses) -> Array:
    """Return the angles (n, d) of poses in the order of a model's joints.

    Raises:
        ModelError: a joint of the model is no column of the posture table.
    """
    unknown = [joint for joint in model.joints_ if joint not in INDEX]
    if unknown:
        raise ModelError(f"the model works on {unknown[0]!r}, which posture tables do not hold; evaluate it in Python")
    return poses.angles[:, [INDEX[joint] for joint in model.joints_]]


def fit_to(model: Surrogate, train: Poses, held_out: Poses, sample_weight: Array | None = None, **notes: Any) -> None:
    """Fit a model to poses and note in `about_` where it comes from and its error on held-out poses.

    Args:
        model: any kind, fitted in place; on the columns of its parameter `joints`, if it names some.
        train: what it learns from.
        held_out: what its error per class is measured on.
        sample_weight: (n,) weights of the training poses.
        notes: further provenance (a command line, say).
    """

    chosen = model.get_params(deep=False).get("joints")
    angles = train.angles if chosen is None else train.angles[:, [INDEX[joint] for joint in chosen]]
    model.fit(angles, train.reba, sample_weight=sample_weight, factors=train.factors)
    found = evaluate(model, held_out)
    provenance = {**model.about_.provenance, "train": _brief(train), "held_out": _brief(held_out)}
    provenance = {**provenance, "rmse_on": "held-out poses", **notes}
    rmse = {str(score): round(error.rmse, 4) for score, error in found.classes.items()}
    model.about_ = ModelInfo(train.provenance.get("domain", {}), rmse, provenance)


def _brief(poses: Poses) -> dict[str, Any]:
    return {"poses": len(poses), **{key: value for key, value in poses.provenance.items() if key != "domain"}}


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
        jobs, scheduler: where models are evaluated, see `reba.batch.parallel.run_parallel`; times are those of that
            place, with whatever else runs there.
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
        jobs, scheduler: where, see `reba.batch.parallel.run_parallel`.

    Returns:
        Rows of "model", "start", "mean_reba" (infeasible runs count 12), "share_best" of runs that reach the best
        score that any of the models reached on their task, "share_best_of_starts", "infeasible", "evaluations".
    """

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
    for (name, _), result in run_parallel(work, given.items(), jobs=min(jobs, len(given) or 1), scheduler=scheduler):
        if isinstance(result, WorkerDied):
            raise ModelError(f"{name}: {result.reason}; compare it by itself")
        found[name] = result
    return {name: found[name] for name in given}


ROUNDS: Final = 5
"""Best of this many: other work on the machine only ever adds time."""
BATCH: Final = 100_000


def time_per_pose(model: Surrogate, poses: Poses) -> dict[str, float]:
    """Return seconds per pose for value and gradient together: `single` (one call per pose) and `batch`."""
    angles = angles_for(model, poses)
    repeats = -(-BATCH // len(angles))
    batch = angles.repeat(repeats, axis=0)[:BATCH] if repeats > 1 else angles[:BATCH]
    some = list(angles[:200])

    def one_by_one() -> None:
        for pose in some:
            model.value_and_gradient(pose)

    return {
        "single": _best(one_by_one) / len(some),
        "batch": _best(lambda: model.value_and_gradient(batch)) / len(batch),
    }


def _best(work: Callable[[], object]) -> float:
    best = float("inf")
    for _ in range(ROUNDS):
        start = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - start)
    return best
