"""The solver on published problems, and on those that have no solution."""

import dataclasses

import numpy as np
import pytest
import scipy.sparse as sp

from lgp.sqp.active_set import ActiveSet
from lgp.sqp.backends import Piqp, QpSolvers
from lgp.sqp.problem import FunctionProblem, ProblemError, SolverOptions
from lgp.sqp.result import SolveStatus
from lgp.sqp.solver import Solver, solve
from tests.support.hock_schittkowski import CASES
from tests.support.says import says


def slope_by_differences(problem, x):
    """Central differences of cost and rows (1 + m_e + m_i, n)."""
    columns = []
    for step in np.eye(problem.n) * 1e-6:
        high, low = (np.concatenate([[v[0]], v[1], v[2]]) for v in map(problem.evaluate, (x + step, x - step)))
        columns.append((high - low) / 2e-6)
    return np.array(columns).T


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"hs{case.number}")
def test_the_derivatives_of_the_cases_match_differences(case):
    x = np.array(case.start) + 0.1
    m_e, m_i = (values.size for values in case.problem.evaluate(x)[1:])
    model = case.problem.linearise(x, np.zeros(m_e), np.zeros(m_i))
    given = np.vstack([model.gradient[None], model.eq_jac.toarray(), model.in_jac.toarray()])
    found = slope_by_differences(case.problem, x)
    # Differences of cubes around 10 carry 1e-7 of rounding.
    np.testing.assert_allclose(given, found, atol=1e-6 * max(1.0, np.abs(found).max()))


@pytest.mark.parametrize("backend", [ActiveSet, Piqp, QpSolvers])
@pytest.mark.parametrize("case", CASES, ids=lambda case: f"hs{case.number}")
def test_the_published_optimum_is_found(case, backend):
    result = solve(case.problem, np.array(case.start, dtype=float), backend=backend())
    assert result.status is SolveStatus.OPTIMAL, result.message
    # A violation of 1e-6 lets the cost fall by as much times the multipliers, which stay below 10 here.
    assert result.cost == pytest.approx(case.optimum, rel=1e-5, abs=1e-5)
    assert result.violation <= 1e-6
    assert result.kkt <= 1e-6
    assert (result.y_in >= 0).all()
    assert len(result.iterations) <= 40


@pytest.mark.parametrize("case", CASES, ids=lambda case: f"hs{case.number}")
def test_residuals_of_the_result_are_those_of_the_problem(case):
    result = solve(case.problem, np.array(case.start, dtype=float))
    cost, eq, ineq = case.problem.evaluate(result.x)
    assert cost == result.cost
    assert result.equality == np.abs(eq).max(initial=0.0)
    assert result.inequality == ineq.max(initial=0.0).clip(0.0)
    assert (case.problem.lower <= result.x).all()
    assert (result.x <= case.problem.upper).all()
    model = case.problem.linearise(result.x, result.y_eq, result.y_in)
    slope = model.gradient + model.eq_jac.T @ result.y_eq + model.in_jac.T @ result.y_in + result.y_box
    assert np.abs(slope).max() <= 1e-6 * max(1.0, np.abs(model.gradient).max(), np.abs(result.y_eq).max(initial=0)) * 10


def two_circles(distance):
    """Two discs of radius 1 whose centres are apart; a common point exists up to 2."""
    return FunctionProblem(
        2,
        cost=lambda x: x[1],
        gradient=lambda x: np.array([0.0, 1.0]),
        inequality=lambda x: np.array([x @ x - 1, (x[0] - distance) ** 2 + x[1] ** 2 - 1]),
        inequality_jacobian=lambda x: 2 * np.array([x, [x[0] - distance, x[1]]]),
    )


def test_discs_that_touch_not_are_infeasible_and_both_are_named():
    result = solve(two_circles(4.0), np.array([0.3, 0.4]))
    assert result.status is SolveStatus.INFEASIBLE
    assert not result
    assert {(row.block, row.index) for row in result.worst} == {("inequality", 0), ("inequality", 1)}
    # The least violation is half way between them: 2^2 - 1.
    assert result.violation == pytest.approx(3.0, abs=0.3)
    assert "inequality[" in result.message
    assert len(result.iterations) <= 40


def test_discs_that_overlap_are_feasible():
    result = solve(two_circles(1.5), np.array([0.3, 0.4]))
    assert result.status is SolveStatus.OPTIMAL
    assert result.cost == pytest.approx(-np.sqrt(1 - 0.75**2), abs=1e-5)


@pytest.mark.parametrize("backend", [ActiveSet, Piqp])
def test_inconsistent_rows_are_infeasible(backend):
    problem = FunctionProblem(
        2,
        cost=lambda x: x @ x,
        gradient=lambda x: 2 * x,
        equality=lambda x: np.array([x[0] + x[1] - 1, x[0] + x[1] - 2]),
        equality_jacobian=lambda x: np.ones((2, 2)),
    )
    result = solve(problem, np.zeros(2), backend=backend())
    assert result.status is SolveStatus.INFEASIBLE
    assert [row.block for row in result.worst] == ["equality", "equality"] or len(result.worst) == 1
    assert len(result.iterations) <= 5


@pytest.mark.parametrize("backend", [ActiveSet, Piqp])
def test_linearly_dependent_rows_are_solved(backend):
    problem = FunctionProblem(
        3,
        cost=lambda x: x @ x,
        gradient=lambda x: 2 * x,
        equality=lambda x: np.array([x.sum() - 3, 2 * x.sum() - 6, x.sum() - 3]),
        equality_jacobian=lambda x: np.array([[1.0] * 3, [2.0] * 3, [1.0] * 3]),
        inequality=lambda x: np.array([1 - x[0], 1 - x[0]]),
        inequality_jacobian=lambda x: np.array([[-1.0, 0, 0], [-1.0, 0, 0]]),
    )
    result = solve(problem, np.array([5.0, -1.0, 0.0]), backend=backend())
    assert result
    np.testing.assert_allclose(result.x, 1.0, atol=1e-5)


@pytest.mark.parametrize("backend", [ActiveSet, Piqp])
def test_a_row_that_no_unknown_moves_is_inconsistent_only_beyond_the_tolerance(backend):
    """Such as the tilt of a tool that only slides, from a robot file that writes half a turn as 3.14159265, and the
    distance of two flat links that turn above each other."""

    def problem(constant):
        return FunctionProblem(
            2,
            cost=lambda x: x @ x,
            gradient=lambda x: 2 * x,
            equality=lambda x: np.array([x[0] * x[1] - 1, constant]),
            equality_jacobian=lambda x: np.array([[x[1], x[0]], [0.0, 1e-17]]),
            inequality=lambda x: np.array([0.5 - x[0], abs(constant), -6e-10]),
            inequality_jacobian=lambda x: np.array([[-1.0, 0.0], [0.0, 0.0], [1e-17, 0.0]]),
        )

    result = solve(problem(-3.6e-9), np.array([2.0, 1.0]), backend=backend())
    assert result.status is SolveStatus.OPTIMAL
    assert not any(step.qp_solver.startswith("elastic") for step in result.iterations)
    np.testing.assert_allclose(result.x, 1.0, atol=1e-5)
    assert solve(problem(1e-3), np.array([2.0, 1.0]), backend=backend()).status is SolveStatus.INFEASIBLE


@pytest.mark.parametrize("slope", [lambda x: -1.0, lambda x: -2 * x])
def test_a_cost_without_lower_bound_is_unbounded(slope):
    cost = {True: lambda x: -float(x[0]), False: lambda x: -float(x @ x)}[slope(1.0) == -1.0]
    problem = FunctionProblem(1, cost=cost, gradient=lambda x: np.atleast_1d(slope(x)), lower=np.zeros(1))
    assert solve(problem, np.ones(1)).status is SolveStatus.UNBOUNDED


def test_a_degenerate_optimum_without_multipliers_ends_near_it():
    # HS13: the constraint qualification fails at (1, 0), so no multipliers exist there.
    problem = FunctionProblem(
        2,
        cost=lambda x: (x[0] - 2) ** 2 + x[1] ** 2,
        gradient=lambda x: np.array([2 * (x[0] - 2), 2 * x[1]]),
        lower=np.zeros(2),
        inequality=lambda x: np.array([x[1] - (1 - x[0]) ** 3]),
        inequality_jacobian=lambda x: np.array([[3 * (1 - x[0]) ** 2, 1.0]]),
    )
    result = solve(problem, np.array([-2.0, -2.0]))
    assert result.cost == pytest.approx(1.0, abs=0.1)
    assert result.violation <= 1e-5


def test_a_warm_start_at_the_solution_takes_no_step():
    case = next(case for case in CASES if case.number == 71)
    solver = Solver()
    cold = solver.solve(case.problem, np.array(case.start, dtype=float))
    warm = solver.solve(case.problem, cold.x, warm=cold)
    assert warm.status is SolveStatus.OPTIMAL
    assert len(warm.iterations) == 1
    assert len(cold.iterations) > 4


def test_two_runs_are_the_same():
    case = next(case for case in CASES if case.number == 78)
    first, second = (solve(case.problem, np.array(case.start, dtype=float)) for _ in range(2))
    assert first.x.tobytes() == second.x.tobytes()
    assert first.iterations == second.iterations


def test_budgets_end_a_solve_with_what_it_has():
    case = next(case for case in CASES if case.number == 1)
    start = np.array(case.start, dtype=float)
    few = solve(case.problem, start, options=SolverOptions(iterations=3))
    assert few.status is SolveStatus.ITERATIONS
    assert len(few.iterations) == 4
    assert few.cost < case.problem.evaluate(start)[0]
    assert solve(case.problem, start, options=SolverOptions(seconds=1e-9)).status is SolveStatus.TIME


def test_steps_are_limited_by_longest_step():
    case = next(case for case in CASES if case.number == 12)
    result = solve(case.problem, np.array(case.start, dtype=float), options=SolverOptions(longest_step=0.25))
    assert result
    assert max(line.step for line in result.iterations) <= 0.25 + 1e-12


def test_in_a_trust_region_one_unknown_with_far_to_go_holds_up_no_other():
    target = np.array([10.0, 0.5, -0.2])
    bowl = FunctionProblem(3, cost=lambda x: float((x - target) @ (x - target)), gradient=lambda x: 2.0 * (x - target))
    options = SolverOptions(longest_step=1.0, trust_region=True, iterations=1)
    assert np.allclose(solve(bowl, np.zeros(3), options=options).x, [1.0, 0.5, -0.2])
    shorter = solve(bowl, np.zeros(3), options=dataclasses.replace(options, trust_region=False))
    assert np.allclose(shorter.x, target / 10.0)
    assert np.allclose(solve(bowl, np.zeros(3), options=dataclasses.replace(options, iterations=100)).x, target)


def test_values_that_are_not_finite_end_the_solve():
    problem = FunctionProblem(1, cost=lambda x: np.nan, gradient=lambda x: np.zeros(1))
    assert solve(problem, np.zeros(1)).status is SolveStatus.BROKEN


@pytest.mark.parametrize(
    ("arguments", "facts"),
    [
        ({"lower": np.ones(2), "upper": np.zeros(2)}, ("unknown 0", "lower 1.0", "upper 0.0")),
        ({"lower": np.zeros(3)}, ("lower", "shape (3,)", "expected (2,)")),
    ],
)
def test_inconsistent_bounds_are_refused(arguments, facts):
    problem = FunctionProblem(2, cost=lambda x: 0.0, gradient=lambda x: 0 * x, **arguments)
    with pytest.raises(ProblemError) as error:
        solve(problem, np.zeros(2))
    says(error, *facts)


def test_unusable_initial_points_and_options_are_refused():
    problem = FunctionProblem(2, cost=lambda x: x @ x, gradient=lambda x: 2 * x)
    with pytest.raises(ProblemError) as error:
        solve(problem, np.zeros(1))
    says(error, "x0", "shape (1,)", "expected (2,)")
    with pytest.raises(ProblemError) as error:
        solve(problem, np.array([0.0, np.nan]))
    says(error, "x0", "entry 1", "not a number")
    with pytest.raises(ProblemError) as error:
        SolverOptions(kkt=0)
    says(error, "kkt", "0 given", "expected a positive number")


class WrongModel(FunctionProblem):
    """A problem whose model lacks a row or comes in the wrong format."""

    def __init__(self, **changes):
        super().__init__(2, cost=lambda x: float(x @ x), gradient=lambda x: 2 * x)
        self.changes = changes

    def linearise(self, x, y_eq, y_in):
        return dataclasses.replace(super().linearise(x, y_eq, y_in), **self.changes)


@pytest.mark.parametrize(
    ("changes", "facts"),
    [
        ({"gradient": np.zeros(3)}, ("gradient", "shape (3,)", "expected (2,)")),
        ({"eq_jac": sp.csr_matrix((1, 2))}, ("eq_jac", "shape (1, 2)", "expected (0, 2)")),
        ({"hessian": sp.csr_matrix(np.eye(2))}, ("hessian", "csr", "expected csc")),
    ],
)
def test_models_of_wrong_shape_or_format_are_refused(changes, facts):
    with pytest.raises(ProblemError) as error:
        solve(WrongModel(**changes), np.ones(2))
    says(error, *facts)


def test_a_gradient_that_is_not_finite_ends_the_solve():
    assert solve(WrongModel(gradient=np.array([np.nan, 0.0])), np.ones(2)).status is SolveStatus.BROKEN
