"""The polish: it can lower the true score and nothing else, within its budget."""

from __future__ import annotations

import numpy as np
import pytest

from dreba.evaluation.polish import polish
from dreba.evaluation.reach_figure import limits, neutral, true_score
from dreba.evaluation.reach_tasks import stored_tasks
from dreba.evaluation.staged_minimiser import TOLERANCE

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("budget", [0, 1, 7, 60])
def test_polish_never_raises_the_score_and_keeps_its_budget(budget: int) -> None:
    low, high = limits()
    for stored in stored_tasks("wide")[:6]:
        for start in (np.array(stored.dofs), np.clip(neutral() + 25.0, low, high)):
            found = polish(start, stored.task, budget)
            assert found.evaluations <= budget
            if np.abs(stored.task.constraint(start)[0]).max() <= TOLERANCE:
                assert true_score(found.dofs) <= true_score(start)
                assert np.abs(stored.task.constraint(found.dofs)[0]).max() <= TOLERANCE
            else:
                unchanged = np.array_equal(found.dofs, start)
                assert unchanged or np.abs(stored.task.constraint(found.dofs)[0]).max() <= TOLERANCE
            assert ((found.dofs >= low) & (found.dofs <= high)).all()


def test_polish_finds_the_least_score_of_easy_tasks_from_rest() -> None:
    easy = [stored for stored in stored_tasks("bench")[:12] if stored.reached == 1]
    assert len(easy) > 4
    for stored in easy:
        assert true_score(polish(neutral(), stored.task, 60).dofs) == 1
