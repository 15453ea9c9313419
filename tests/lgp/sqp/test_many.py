"""Many problems at once have the minima that each has alone."""

import numpy as np
import pytest

from lgp.sqp import many
from lgp.sqp.many import ManyModels, solve_many
from lgp.sqp.problem import FunctionProblem, SolverOptions
from lgp.sqp.solver import solve


class Spring:
    """The least |x - a|^2 on the circle |x|^2 = 1 with x_0 at most 0.8 and x_1 + x_2 <= limit; a differs by start."""

    lower, upper = np.full(3, -2.0), np.array([0.8, 2.0, 2.0])

    def __init__(self, limit):
        self.limit, self.centre, self.row = limit, np.array([1.0, 0.5, -0.2]), np.array([0.0, 1.0, 1.0])

    def evaluate(self, x):
        away = x - self.centre
        return (away**2).sum(axis=1), (x**2).sum(axis=1)[:, None] - 1.0, (x @ self.row)[:, None] - self.limit

    def linearise(self, x, y_eq, y_in):
        count = len(x)
        hessian = (2.0 + 2.0 * np.maximum(y_eq, 0.0))[:, :, None] * np.eye(3)
        _, eq, ineq = self.evaluate(x)
        limits = np.broadcast_to(self.row, (count, 1, 3))
        return ManyModels(hessian, 2.0 * (x - self.centre), eq, 2.0 * x[:, None], ineq, limits)


def alone(problem, start):
    """The minimum by the solver for one problem."""
    single = FunctionProblem(
        3,
        cost=lambda x: problem.evaluate(x[None])[0][0],
        gradient=lambda x: 2.0 * (x - problem.centre),
        lower=problem.lower,
        upper=problem.upper,
        equality=lambda x: problem.evaluate(x[None])[1][0],
        equality_jacobian=lambda x: 2.0 * x[None],
        inequality=lambda x: problem.evaluate(x[None])[2][0],
        inequality_jacobian=lambda x: problem.row[None],
    )
    return solve(single, start, options=SolverOptions(kkt=1e-6))


@pytest.mark.parametrize("limit", [-0.5, 0.0, 5.0])
def test_every_start_ends_where_it_would_alone(limit):
    problem = Spring(limit)
    starts = np.random.default_rng(0).uniform(-1.5, 1.5, (40, 3))
    found = solve_many(problem, starts, violation=1e-7, decrease=1e-10, cost_ratio=np.inf)
    costs = [alone(problem, start).cost for start in starts]
    assert found.converged.mean() > 0.9
    best = found.converged & (found.cost < min(costs) + 1e-5)
    assert best.mean() > 0.5
    np.testing.assert_allclose(found.cost[found.converged].min(), min(costs), rtol=1e-6)
    assert (found.violation[found.converged] <= 1e-7).all()
    assert (found.x >= problem.lower).all()
    assert (found.x <= problem.upper).all()


def test_inconsistent_rows_do_not_converge_and_do_not_raise():
    problem = Spring(-5.0)
    found = solve_many(problem, np.random.default_rng(1).uniform(-1.0, 1.0, (5, 3)))
    assert not found.converged.any()
    assert (found.violation > 0.1).all()


def test_no_start_is_no_result():
    assert solve_many(Spring(0.0), np.zeros((0, 3))).x.shape == (0, 3)


def test_an_unknown_with_equal_bounds_is_a_parameter_of_its_problem():
    problem = Spring(limit=0.9)
    starts = np.array([[0.5, 0.5, 0.5], [0.2, 0.6, 0.1]])
    fixed = np.array([0.1, 0.4])
    problem.lower, problem.upper = (np.tile(end, (2, 1)) for end in (Spring.lower, Spring.upper))
    problem.lower[:, 0] = problem.upper[:, 0] = fixed
    found = solve_many(problem, starts, violation=1e-8, decrease=1e-10, iterations=60, cost_ratio=1e9)
    assert found.converged.all()
    assert found.x[:, 0].tolist() == fixed.tolist()
    for value, both in zip(fixed, found.x, strict=True):
        alone_problem = Spring(limit=0.9)
        alone_problem.lower, alone_problem.upper = Spring.lower.copy(), Spring.upper.copy()
        alone_problem.lower[0] = alone_problem.upper[0] = value
        single = solve_many(alone_problem, both[None] + 0.05, violation=1e-8, decrease=1e-10, iterations=60)
        assert both == pytest.approx(single.x[0], abs=1e-5)


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e300])
def test_a_start_whose_system_is_singular_spoils_no_other(monkeypatch, number):
    """Its multipliers overflow; a decomposition of all problems at once refuses such numbers."""
    solve, asked = many._solve_qps, []

    def first_one_fails(model, *rest):
        assert np.isfinite(model.hessian).all()
        step = solve(model, *rest)
        if not asked:
            step.step[0], step.y_eq[0] = number, number
        asked.append(1)
        return step

    starts = np.random.default_rng(0).uniform(-1.5, 1.5, (3, 3))
    whole = many.solve_many(Spring(2.0), starts)
    monkeypatch.setattr(many, "_solve_qps", first_one_fails)
    results = many.solve_many(Spring(2.0), starts)
    assert len(asked) > 1
    assert np.array_equal(results.x[1:], whole.x[1:])
    assert np.isfinite(results.x).all()
