"""The acceleration cost: squared second differences, and its exact restriction to knots."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.path.costs import acceleration_quadratic, acceleration_quadratic_of, eliminate_slices, slope_by_steps


@settings(max_examples=30, deadline=None)
@given(st.integers(3, 12), st.booleans(), st.integers(0, 1000))
def test_acceleration_is_the_sum_of_squared_second_differences(slices: int, stop: bool, seed: int) -> None:
    path = np.random.default_rng(seed).normal(size=slices)
    extended = np.concatenate([[0.0, 0.0], path, [path[-1]] * stop])
    assert path @ acceleration_quadratic(slices, 0.2, stop) @ path == pytest.approx(
        0.2 * np.sum((np.diff(extended, 2) / 0.04) ** 2)
    )


@settings(max_examples=30, deadline=None)
@given(st.integers(6, 14), st.integers(0, 1000))
def test_eliminated_slices_are_at_their_minimum(slices: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    matrix = acceleration_quadratic(slices, 0.2, stop=True)
    knots = np.array([2, slices - 1])
    condensed = eliminate_slices(matrix, knots, [(2, 3)])
    values = rng.normal(size=2)
    best = condensed.expand @ values
    assert best[knots] == pytest.approx(values)
    assert best[3] == pytest.approx(best[2])
    assert best @ matrix @ best == pytest.approx(values @ condensed.cost @ values)
    away = rng.normal(size=slices)
    away[[2, 3, slices - 1]] = 0.0
    assert (best + away) @ matrix @ (best + away) >= best @ matrix @ best - 1e-9


@settings(max_examples=20, deadline=None)
@given(st.integers(2, 9), st.booleans(), st.integers(0, 1000))
def test_unequal_steps(slices: int, stop: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    even = acceleration_quadratic_of(np.full(slices, 0.3), stop)
    assert even == pytest.approx(acceleration_quadratic(slices, 0.3, stop), abs=1e-9)
    steps, path = rng.uniform(0.1, 0.4, slices), rng.normal(size=(slices, 2))

    def cost(logs: np.ndarray) -> float:
        matrix = acceleration_quadratic_of(np.exp(logs), stop)
        return float(np.einsum("tj,ts,sj->", path, matrix, path))

    logs = np.log(steps)
    slope = slope_by_steps(path, steps, stop)
    for number in range(slices):
        step = 1e-6 * np.eye(slices)[number]
        assert slope[number] == pytest.approx((cost(logs + step) - cost(logs - step)) / 2e-6, rel=1e-5, abs=1e-4)
    assert slope.sum() == pytest.approx(-3.0 * cost(logs))
