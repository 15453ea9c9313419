"""Models side by side on the same poses and the same tasks: error, time, and what they lead an optimiser to."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

from dreba.evaluate import evaluate
from dreba.poses import Poses
from dreba.timing import time_per_pose
from reba.posture import COLUMNS

if TYPE_CHECKING:
    from dreba.model import Surrogate

STARTS: Final = ("random", "neutral")
"""Where an optimiser starts: anywhere in the limits, or near standing upright."""


def compare(models: Mapping[str, Surrogate], poses: Poses) -> list[dict[str, Any]]:
    """Return one row a model: `domain` of its fit, errors as `Evaluation.to_dict`, `seconds_per_pose` single, batch."""
    return [
        {
            "model": name,
            "domain": str(model.about_.domain.get("name", "")),
            **evaluate(model, poses).to_dict(),
            "seconds_per_pose": time_per_pose(model, poses),
        }
        for name, model in models.items()
    ]


def enable(models: Mapping[str, Surrogate], tasks: int, repeats: int = 3, seed: int = 0) -> list[dict[str, Any]]:
    """Return what each model leads to when it is minimised under reach constraints, one row a model and kind of start.

    Args:
        models: by name; those on other columns than the 22 of the posture table are left out.
        tasks: number of reach tasks, the same for all.
        repeats: starts per task.
        seed: of tasks and starts.

    Returns:
        Rows of "model", "start", "mean_reba" (infeasible runs count 12), "share_best" of runs that reach the best
        score that any of the models reached on their task, "share_best_of_starts", "infeasible", "evaluations".
    """
    from dreba import reach

    usable = {name: model for name, model in models.items() if model.joints_ == COLUMNS}
    given = reach.tasks(tasks, seed)
    rows = []
    for start in STARTS:
        beginnings = reach.starts(start, tasks * repeats, seed).reshape(tasks, repeats, -1)
        outcomes = {name: reach.run(reach.method_of(model), given, beginnings) for name, model in usable.items()}
        if not outcomes:
            return []
        best = reach.best_known(list(outcomes.values()))
        for name, outcome in outcomes.items():
            rows.append(
                {
                    "model": name,
                    "start": start,
                    "mean_reba": outcome.mean,
                    "share_best": outcome.share_best(best),
                    "share_best_of_starts": outcome.share_best_of_starts(best),
                    "infeasible": outcome.infeasible,
                    "evaluations": outcome.evaluations,
                    "seconds": outcome.seconds,
                }
            )
    return rows
