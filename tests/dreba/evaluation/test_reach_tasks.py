"""Reach tasks: drawn ones repeat, stored ones are what they say."""

from __future__ import annotations

import numpy as np
import pytest

import dreba
from dreba.evaluation import reach_figure as figure
from dreba.evaluation import reach_tasks as reach
from dreba.evaluation.staged_minimiser import TOLERANCE
from tests.support.says import says


def test_tasks_and_starts_repeat_with_their_seed() -> None:
    assert reach.tasks(6, 3) == reach.tasks(6, 3)
    assert reach.tasks(6, 3) != reach.tasks(6, 4)
    box = reach.tasks(2, 3)[1].targets
    assert box["left"][1] - box["right"][1] == pytest.approx(reach.BOX)
    low, high = figure.limits()
    for kind in ("random", "neutral"):
        found = reach.starts(kind, 10, 1)
        assert ((found >= low) & (found <= high)).all()
        assert np.array_equal(found, reach.starts(kind, 10, 1))


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("space", ["wide", "bench"])
def test_every_stored_task_is_reached_with_the_score_that_is_stored(space: reach.Space, seed: int) -> None:
    stored = reach.stored_tasks(space, seed)
    assert [one.task for one in stored] == list(reach.tasks(len(stored), seed, space))
    low, high = figure.limits()
    for one in stored:
        dofs = np.array(one.dofs)
        assert ((dofs >= low) & (dofs <= high)).all()
        assert np.abs(one.task.constraint(dofs)[0]).max() <= TOLERANCE
        assert figure.true_score(dofs) == one.reached >= one.proved >= 1


def test_a_seed_without_stored_tasks_is_refused() -> None:
    with pytest.raises(dreba.ModelError) as error:
        reach.stored_tasks("wide", 99)
    says(error.value, "wide", "99", "stored")
