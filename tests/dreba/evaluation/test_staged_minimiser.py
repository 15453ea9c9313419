"""The staged minimiser: constraint, limits, counts, choice of a stage."""

from __future__ import annotations

import numpy as np
import pytest

from dreba.evaluation.staged_minimiser import Effort, minimise


def test_minimise_meets_constraint_and_limits_and_counts() -> None:
    def bowl(x: np.ndarray) -> tuple[float, np.ndarray]:
        return float(x @ x) / 100.0, x / 50.0

    def line(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return np.array([x.sum() - 30.0]), np.ones((1, 3))

    low, high = np.full(3, -5.0), np.array([5.0, 90.0, 90.0])
    found = minimise([bowl, bowl], np.full(3, 80.0), low, high, line, effort=Effort(50, 1e-8), free_start=True)
    assert found.x == pytest.approx([5.0, 12.5, 12.5], abs=1e-3)
    assert found.residual < 1e-6
    assert len(found.stages) == 3
    assert found.stages[0] == pytest.approx(np.zeros(3), abs=1e-3)
    assert found.evaluations >= found.constraint_evaluations > 0


def test_minimise_takes_the_best_stage_that_meets_the_constraint() -> None:
    def towards(target: float):  # type: ignore[no-untyped-def]
        return lambda x: (float((x[0] - target) ** 2), np.array([2 * (x[0] - target), 0.0]))

    def second(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        return x[1:], np.array([[0.0, 1.0]])

    limit = np.full(2, 90.0)
    found = minimise(
        [towards(10.0), towards(40.0)], np.zeros(2), -limit, limit, second, effort=Effort(50, 1e-9),
        score=lambda x: abs(x[0] - 10.0),
    )  # fmt: skip
    assert found.x[0] == pytest.approx(10.0, abs=1e-2)
