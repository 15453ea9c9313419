"""The staged minimiser: constraint, limits, counts, the budget that stages share."""

from __future__ import annotations

import numpy as np
import pytest

from dreba.evaluation.staged_minimiser import minimise


def test_minimise_meets_constraint_and_limits_and_counts() -> None:
    def bowl(x: np.ndarray) -> tuple[float, np.ndarray]:
        return float(x @ x) / 100.0, x / 50.0

    def line(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.array([x.sum() - 30.0]), np.ones((1, 3))

    low, high = np.full(3, -5.0), np.array([5.0, 90.0, 90.0])
    found = minimise([bowl, bowl], np.full(3, 80.0), low, high, line, free_start=True)
    assert found.x == pytest.approx([5.0, 12.5, 12.5], abs=0.1)
    assert found.residual < 1e-3
    assert len(found.stages) == 3
    assert found.stages[0] == pytest.approx(np.zeros(3), abs=1.0)
    assert found.evaluations >= found.constraint_evaluations > 0


@pytest.mark.parametrize("stages", [1, 3])
@pytest.mark.parametrize("budget", [3, 10, 40])
def test_stages_share_one_budget(stages: int, budget: int) -> None:
    calls = 0

    def steep(x: np.ndarray) -> tuple[float, np.ndarray]:
        nonlocal calls
        calls += 1
        return float(np.sum(np.abs(x) ** 1.5)), 1.5 * np.sign(x) * np.sqrt(np.abs(x))

    def line(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.array([x.sum() - 30.0]), np.ones((1, 5))

    limit = np.full(5, 90.0)
    start = np.array([80.0, -70.0, 60.0, -50.0, 40.0])
    found = minimise([steep] * stages, start, -limit, limit, line, budget=budget)
    assert calls == found.evaluations <= budget
    assert found.residual < 1e-3
    assert len(found.stages) == stages
