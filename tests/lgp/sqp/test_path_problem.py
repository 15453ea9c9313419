"""The solver on a path problem of the planner's shape: fixed patterns, warm starts, infeasible places."""

import numpy as np
import pytest
import scipy.sparse as sp

from lgp.sqp.active_set import ActiveSet
from lgp.sqp.backends import Piqp
from lgp.sqp.problem import SolverOptions
from lgp.sqp.result import SolveStatus
from lgp.sqp.solver import Solver
from tests.support.sliced_paths import PathProblem

OPTIONS = SolverOptions(decrease=1e-5)


def test_the_derivatives_of_the_problem_match_differences():
    problem = PathProblem(12, spheres=True, margin=0.3)
    rng = np.random.default_rng(1)
    x, way = problem.start() + 0.1 * rng.normal(size=problem.n), rng.normal(size=problem.n)
    model = problem.linearise(x, np.zeros(76), np.zeros(96))
    high, low = problem.evaluate(x + 1e-6 * way), problem.evaluate(x - 1e-6 * way)
    assert model.gradient @ way == pytest.approx((high[0] - low[0]) / 2e-6, rel=1e-6)
    np.testing.assert_allclose(model.eq_jac @ way, (high[1] - low[1]) / 2e-6, atol=1e-7)
    np.testing.assert_allclose(model.in_jac @ way, (high[2] - low[2]) / 2e-6, atol=1e-7)
    full = model.hessian + sp.triu(model.hessian, 1).T
    before = model.gradient.copy()
    np.testing.assert_allclose(
        problem.linearise(x + way, np.zeros(76), np.zeros(96)).gradient - before, full @ way, atol=1e-9
    )


@pytest.fixture(scope="module")
def solved():
    problem, solver = PathProblem(20), Solver(OPTIONS)
    return problem, solver, solver.solve(problem, problem.start())


def test_a_path_meets_its_rows_in_few_iterations(solved):
    _, _, result = solved
    assert result, result.message
    assert result.violation <= 1e-6
    assert len(result.iterations) <= 15
    assert all(line.length == 1.0 for line in result.iterations[:-1])
    assert result.seconds["qp"] < result.seconds["total"]


def test_back_ends_find_the_same_path(solved):
    problem, _, result = solved
    other = Solver(OPTIONS, Piqp()).solve(problem, problem.start())
    assert other.cost == pytest.approx(result.cost, rel=1e-5)
    np.testing.assert_allclose(other.x, result.x, atol=1e-3)


def test_a_warm_start_beats_a_cold_one(solved):
    problem, solver, result = solved
    near = result.x + 1e-3 * np.random.default_rng(0).normal(size=problem.n)
    again = solver.solve(problem, near, warm=result)
    assert again.cost == pytest.approx(result.cost, rel=1e-4)
    assert len(again.iterations) <= len(result.iterations) // 2
    assert all(line.qp_solver == "active_set" for line in again.iterations[:-1])


def test_places_out_of_reach_are_infeasible_and_named():
    problem = PathProblem(12, shift=3.0)
    result = Solver(OPTIONS).solve(problem, problem.start())
    assert result.status is SolveStatus.INFEASIBLE
    assert result.violation > 0.5
    # The rows of the four places come first.
    assert all(row.block == "equality" and row.index < 16 for row in result.worst)
    assert len(result.iterations) <= 40


def test_spheres_keep_their_distance():
    problem = PathProblem(12, spheres=True, margin=0.45)
    free = PathProblem(12)
    touching = Solver(OPTIONS).solve(free, free.start())
    assert problem.evaluate(touching.x)[2].max() > 0.01  # without these rows the arms come nearer
    result = Solver(OPTIONS, ActiveSet()).solve(problem, problem.start())
    assert result, result.message
    assert result.inequality <= 1e-6
    assert result.cost > touching.cost
