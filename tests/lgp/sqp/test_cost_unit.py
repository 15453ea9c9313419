"""A problem with its cost in other units has the same iterations."""

import copy

import numpy as np
import pytest

from lgp.sqp.problem import FunctionProblem, ProblemError
from lgp.sqp.solver import solve
from tests.support.hock_schittkowski import CASES
from tests.support.says import says


def in_units(problem, factor):
    """The same problem with costs that count `factor` times as much."""
    other = copy.copy(problem)
    other._cost = lambda x: factor * problem._cost(x)
    other._gradient = lambda x: factor * np.asarray(problem._gradient(x))
    other.cost_unit = factor * problem.cost_unit
    return other


@pytest.mark.parametrize("factor", [2.0**-20, 8.0, 2.0**20])
@pytest.mark.parametrize("case", CASES, ids=lambda case: f"hs{case.number}")
def test_costs_in_another_unit_have_the_same_iterations(case, factor):
    start = np.array(case.start, dtype=float)
    one, other = solve(case.problem, start), solve(in_units(case.problem, factor), start)
    assert other.status is one.status
    assert other.iterations == one.iterations
    assert other.cost == factor * one.cost
    for name in ("x", "y_eq", "y_in", "y_box"):
        np.testing.assert_array_equal(getattr(other, name), getattr(one, name))


@pytest.mark.parametrize("unit", [0.0, -1.0, np.nan, np.inf])
def test_a_unit_is_a_positive_number(unit):
    bowl = FunctionProblem(1, cost=lambda x: float(x @ x), gradient=lambda x: 2 * x, cost_unit=unit)
    with pytest.raises(ProblemError) as error:
        solve(bowl, np.ones(1))
    says(error, "cost_unit", "expected a positive number")
