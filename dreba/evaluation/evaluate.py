"""Evaluation of models: error on poses, fits with provenance, comparison of errors and times."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from dreba.errors import ModelError
from dreba.evaluation.parallel import in_parallel
from dreba.sampling.poses import Poses
from dreba.surrogates.base import Surrogate
from dreba.surrogates.metrics import Evaluation, evaluation_of
from dreba.surrogates.registry import ModelInfo
from dreba.surrogates.task_factors import seated_angles
from reba.arrays import Array
from reba.checks import COUNT, TEXT, Allowed, accepts, instance
from reba.posture.columns import INDEX

MODEL: Final = instance("a fitted surrogate, such as dreba.load returns", Surrogate)
POSES: Final = instance("poses, as dreba.sample or dreba.read_poses return", Poses)
MODELS: Final = Allowed(
    "fitted surrogates by name",
    lambda value: isinstance(value, dict) and len(value) > 0 and all(map(MODEL.fits, value.values())),
)


@accepts(ModelError, model=MODEL, poses=POSES)
def evaluate(model: Surrogate, poses: Poses, temperature: float | None = None) -> Evaluation:
    """Return the error of a model on poses with their true scores.

    Args:
        model: fitted.
        poses: evaluation poses; their factors, if any, are arguments of the model.
        temperature: [deg] of models with temperatures; None for their default.

    Raises:
        ModelError: there are no poses, the model has a column that is not in the posture table, or a temperature is
            given for a kind without.

    Warns:
        RadiansWarning: all angles are so small that they look like radians.

    Example:
        >>> import dreba
        >>> error = evaluate(dreba.load("quadratic"), dreba.sample(500, rng=1))
        >>> error.n, sorted(error.classes) == list(range(1, 11))
        (500, True)
    """
    check_temperature(model, temperature)
    return evaluation_of(model.kind, values_on(model, poses, temperature), poses.reba)


def values_on(model: Surrogate, poses: Poses, temperature: float | None) -> Array:
    """Return the values (n,) of a model on poses with their load, coupling and activity."""
    load, coupling, activity, _ = poses.task_factors
    values: Array = model.value(
        angles_for(model, poses), load=load, coupling=coupling, activity=activity, temperature=temperature
    )
    return values


def check_temperature(model: Surrogate, temperature: float | None) -> None:
    """Refuse a temperature for a model without temperatures (ModelError)."""
    if temperature is not None and not model.temperatures_:
        raise ModelError(
            f"kind {model.kind!r} has no temperature; leave it out (soft and graduated models have temperatures)"
        )


def angles_for(model: Surrogate, poses: Poses) -> Array:
    """Return the angles (n, d) [deg] of poses in the order of a model's joints; all must be in the posture table."""
    unknown = [joint for joint in model.joints_ if joint not in INDEX]
    if unknown:
        raise ModelError(
            f"the model has the column {unknown[0]!r}; expected columns of reba.COLUMNS, so evaluate it by predict()"
        )
    angles = poses.angles[:, [INDEX[joint] for joint in model.joints_]]
    return seated_angles(angles, model.joints_, poses.factors)


@accepts(ModelError, model=MODEL, train=POSES, held_out=POSES)
def fit_to(model: Surrogate, train: Poses, held_out: Poses, sample_weight: Array | None = None, **notes: Any) -> None:
    """Fit a model to poses and record its provenance and its error on held-out poses in `about_`.

    Args:
        model: any kind, fitted in place on the columns of its parameter `joints`, all 22 by default.
        train: training poses.
        held_out: poses of the error per class.
        sample_weight: (n,) weights of the training poses.
        notes: further entries of the provenance, such as command="dreba fit".

    Raises:
        ModelError: the model cannot be fitted to these poses.

    Example:
        >>> import dreba
        >>> model = dreba.QuadraticModel()
        >>> fit_to(model, dreba.sample(1000, rng=1), dreba.sample(500, rng=2))
        >>> model.about_.domain["name"], model.about_.provenance["rmse_on"]
        ('human', 'held-out poses')
    """
    model.fit(train, train.reba, sample_weight=sample_weight, factors=train.factors)
    evaluation = evaluate(model, held_out)
    provenance = {**model.about_.provenance, "train": _origin(train), "held_out": _origin(held_out)}
    provenance = {**provenance, "rmse_on": "held-out poses", **notes}
    rmse = {str(score): round(error.rmse, 4) for score, error in evaluation.classes.items()}
    model.about_ = ModelInfo(train.provenance.get("domain", {}), rmse, provenance)


def _origin(poses: Poses) -> dict[str, Any]:
    """Return the number and the provenance of poses without their domain, which `about_` holds once."""
    return {"poses": len(poses), **{key: value for key, value in poses.provenance.items() if key != "domain"}}


@accepts(ModelError, models=MODELS, poses=POSES, jobs=COUNT, scheduler=TEXT.or_none())
def compare(
    models: Mapping[str, Surrogate], poses: Poses, *, jobs: int = 1, scheduler: str | None = None
) -> list[dict[str, Any]]:
    """Return the errors and times of models on the same poses, one row for each.

    Args:
        models: fitted models by name.
        poses: evaluation poses.
        jobs: number of processes.
        scheduler: address of a Dask scheduler instead of local processes; times are those of its workers.

    Returns:
        Rows of "model", "domain" (of its fit), the keys of `Evaluation.to_dict` and "seconds_per_pose" (value and
        gradient; "single" pose and "batch").

    Raises:
        ModelError: a model cannot be evaluated, or its process died.

    Example:
        >>> import dreba
        >>> rows = compare({name: dreba.load(name) for name in ("quadratic", "convex")}, dreba.sample(300, rng=1))
        >>> [(row["model"], row["overall"]["n"]) for row in rows]
        [('quadratic', 300), ('convex', 300)]
    """
    return list(in_parallel(partial(_row, poses=poses), models, jobs, scheduler).values())


def _row(task: tuple[str, Surrogate], poses: Poses) -> dict[str, Any]:
    name, model = task
    return {
        "model": name,
        "domain": str(model.about_.domain.get("name", "")),
        **evaluate(model, poses).to_dict(),
        "seconds_per_pose": time_per_pose(model, poses),
    }


TIMED_ROUNDS: Final = 5
"""The shortest of these is reported: other processes only add time."""
BATCH: Final = 100_000
"""Poses of the batch, so many that the cost of a call is negligible."""
SINGLE_POSES: Final = 200
"""Poses evaluated one by one."""


def time_per_pose(model: Surrogate, poses: Poses) -> dict[str, float]:
    """Return the time of value and gradient per pose [s]: `single` (one call for each pose) and `batch`."""
    angles = angles_for(model, poses)
    repeats = -(-BATCH // len(angles))
    batch = angles.repeat(repeats, axis=0)[:BATCH] if repeats > 1 else angles[:BATCH]
    singles = list(angles[:SINGLE_POSES])

    def one_by_one() -> None:
        for pose in singles:
            model.value_and_gradient(pose)

    return {
        "single": _shortest(one_by_one) / len(singles),
        "batch": _shortest(lambda: model.value_and_gradient(batch)) / len(batch),
    }


def _shortest(work: Callable[[], object]) -> float:
    """Return the shortest time [s] of `TIMED_ROUNDS` runs."""
    shortest = float("inf")
    for _ in range(TIMED_ROUNDS):
        start = time.perf_counter()
        work()
        shortest = min(shortest, time.perf_counter() - start)
    return shortest
