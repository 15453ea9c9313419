"""Ways to solve reach tasks: costs with and without REBA in them, in one stage or in stages, and what they reach.

Every method has the same solver, starts, tolerance and budget. What a method adds to the minimisation of its cost (a
free start, stages, the polish) is part of its name.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from time import process_time
from typing import Final

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from dreba.domain import domain_of
from dreba.evaluation import reach_figure as figure
from dreba.evaluation.polish import polish
from dreba.evaluation.reach_tasks import INFEASIBLE, ReachTask
from dreba.evaluation.staged_minimiser import BUDGET, TOLERANCE, Objective, minimise
from dreba.surrogates.base import Surrogate
from dreba.surrogates.graduated import GraduatedModel
from reba.arrays import Array
from reba.posture.columns import BEST, COLUMNS, INDEX

RESERVED: Final = 50
"""Evaluations of the budget kept for the polish."""
BLUNTEST: Final = 8.0
"""[deg] Stages start with the first temperature up to this one; a blunter one adds nothing after the distance."""
FIRST_WEIGHT: Final = 10.0
"""Weight of the distance in the first stage, with which its values are of the size of REBA scores."""
_HUMAN: Final = domain_of("human")
_REST: Final = np.array([BEST[column] for column in COLUMNS])
_RANGE: Final = np.asarray(_HUMAN.high - _HUMAN.low)


def distance_to_rest(angles: Array, weight: float = FIRST_WEIGHT) -> tuple[float, Array]:
    """Return the squared distance of angles (22,) [deg] to rest, each over its range, and its gradient: no REBA in it.

    Rest is the neutral posture; ranges are those of the domain `human`.
    """
    away = (angles - _REST) / _RANGE
    return weight * float(away @ away), 2.0 * weight * away / _RANGE


def comfort(angles: Array) -> tuple[float, Array]:
    """Return the squared distance to rest [rad^2], every joint alike, and its gradient: the homing cost of planners."""
    away = np.radians(angles - _REST)
    return float(away @ away), 2.0 * np.radians(away)


@dataclass(frozen=True)
class Method:
    """A way to solve reach tasks: objectives of the 22 angles, one per stage, and what is added.

    Attributes:
        name: row of tables; the additions follow it.
        model: name of the model in it, empty for a cost without REBA.
        free_start: see `staged_minimiser.minimise`.
        polished: whether `polish` is the last step, within the same budget.
    """

    name: str
    objectives: Sequence[Objective]
    free_start: bool = False
    polished: bool = False
    model: str = ""

    @property
    def full_name(self) -> str:
        """Name with the additions, such as "soft, graduated, free start, polish"."""
        added = {"free start": self.free_start, "polish": self.polished}
        return ", ".join([self.name, *(word for word, used in added.items() if used)])


DISTANCE: Final = Method("distance to rest", [distance_to_rest])
"""The null: a cost that knows no REBA."""
COMFORT: Final = Method("comfort (homing)", [comfort])


def one_stage(model: Surrogate, name: str = "", temperature: float | None = None) -> Method:
    """Return the minimisation of one model with all 22 columns.

    Args:
        name: row of tables, the kind by default.
        temperature: [deg] of a model with temperatures; None for its default.
    """
    label = name or model.kind
    return Method(label, [_objective(model, temperature)], model=label)


def graduated(model: Surrogate, name: str = "") -> Method:
    """Return the minimisation in stages of a model with temperatures: distance to rest, then ever sharper tables.

    The distance leads into the region of low scores from far away, where soft tables are flat, and stays in the later
    stages with a small weight: inside a class it keeps angles away from the edges.

    Args:
        name: of the model in tables, the kind by default.
    """

    def with_distance(objective: Objective) -> Objective:
        def evaluate(angles: Array) -> tuple[float, Array]:
            (value, slope), (near, towards) = objective(angles), distance_to_rest(angles, 1.0)
            return value + near, slope + towards

        return evaluate

    sharper = [t for t in model.temperatures_ if t <= BLUNTEST] or [min(model.temperatures_)]
    stages = [with_distance(_objective(model, temperature)) for temperature in sharper]
    label = name or model.kind
    full = label if label == "graduated" else f"{label}, graduated"
    return Method(full, [distance_to_rest, *stages], model=label)


def methods_of(models: dict[str, Surrogate]) -> list[Method]:
    """Return the rows of a comparison: both costs without REBA and each model, alone, with a free start, and with both
    a free start and the polish.

    Models with temperatures are minimised in one stage and in stages.
    """
    rows = [DISTANCE, COMFORT]
    for name, model in models.items():
        if isinstance(model, GraduatedModel):
            rows.append(graduated(model, name))
            continue
        rows.append(one_stage(model, name))
        if model.temperatures_:
            rows.append(graduated(model, name))
    added = ((False, False), (True, False), (True, True))
    return [replace(row, free_start=free, polished=polished) for row in rows for free, polished in added]


def _objective(model: Surrogate, temperature: float | None) -> Objective:
    """Return a model of all columns as an objective of the angles of `reba.COLUMNS`, whatever the order of its own."""
    places = [INDEX[joint] for joint in model.joints_]

    def evaluate(angles: Array) -> tuple[float, Array]:
        value, by_joints = model.value_and_gradient(angles[places], temperature=temperature)
        gradient = np.zeros(len(COLUMNS))
        gradient[places] = by_joints
        return float(value), gradient

    return evaluate


@dataclass(frozen=True)
class ReachResult:
    """Results of a method on tasks x starts: exact scores, and means per run of evaluations and processor time.

    Attributes:
        scores: (tasks, starts), `INFEASIBLE` where the targets were not reached.
        infeasible: share of runs that did not reach their targets.
        evaluations: of the objective, and of the hand positions in the polish.
        constraint_evaluations: of the hand positions, over all.
    """

    scores: NDArray[np.int64]
    infeasible: float
    evaluations: float
    constraint_evaluations: float
    seconds: float

    @property
    def by_task(self) -> Array:
        """Mean exact score of each task (tasks,) over its starts."""
        return np.asarray(self.scores.mean(axis=1), np.float64)


def mean_and_error(by_task: Array) -> tuple[float, float]:
    """Return the mean of values (tasks,) and its standard error over tasks, NaN for one task.

    The starts of one task are not independent: tasks are the clusters. Of differences of two methods on the same tasks
    this is the paired error.

    Example:
        >>> mean_and_error(np.array([1.0, 2.0, 3.0]))
        (2.0, 0.5773502691896258)
    """
    spread = float(by_task.std(ddof=1)) if len(by_task) > 1 else float("nan")
    return float(by_task.mean()), spread / float(np.sqrt(len(by_task)))


def run(method: Method, reach_tasks: Sequence[ReachTask], initial: Array, budget: int = BUDGET) -> ReachResult:
    """Return the results of every task from every initial posture, `initial` (tasks, starts, 22) [deg]."""
    # The matrices are tiny: synchronising threads of the linear algebra takes longer than the arithmetic.
    with threadpool_limits(1):
        return _run(method, reach_tasks, initial, budget)


def _run(method: Method, reach_tasks: Sequence[ReachTask], initial: Array, budget: int) -> ReachResult:
    objectives = [_on_figure(objective) for objective in method.objectives]
    scores = np.empty(initial.shape[:2], np.int64)
    counts = []
    start_time = process_time()
    for row, task in enumerate(reach_tasks):
        for column, start in enumerate(initial[row]):
            scores[row, column], *count = _solve(method, objectives, task, start, budget)
            counts.append((scores[row, column] == INFEASIBLE, *count))
    seconds = (process_time() - start_time) / len(counts)
    infeasible, evaluations, constraint_evaluations = (float(mean) for mean in np.mean(counts, axis=0))
    return ReachResult(scores, infeasible, evaluations, constraint_evaluations, seconds)


def _solve(
    method: Method, objectives: Sequence[Objective], task: ReachTask, start: Array, budget: int
) -> tuple[int, int, int]:
    """Return the exact score reached from one start, and the numbers of evaluations of objective and hands."""
    low, high = figure.limits()
    minimum = minimise(
        objectives, start, low, high, task.constraint, free_start=method.free_start,
        budget=budget - RESERVED if method.polished else budget,
    )  # fmt: skip
    dofs, residual = minimum.x, minimum.residual
    evaluations, of_hands = minimum.evaluations, minimum.constraint_evaluations
    if method.polished:
        dofs, more = polish(dofs, task, budget - evaluations)
        residual = float(np.abs(task.constraint(dofs)[0]).max())
        evaluations, of_hands = evaluations + more, of_hands + more
    return figure.true_score(dofs) if residual <= TOLERANCE else INFEASIBLE, evaluations, of_hands


def _on_figure(objective: Objective) -> Callable[[Array], tuple[float, Array]]:
    """Return an objective of the posture angles as one of the degrees of freedom of the figure."""

    def evaluate(dofs: Array) -> tuple[float, Array]:
        value, gradient = objective(figure.posture(dofs))
        return value, figure.pull_back(gradient)

    return evaluate
