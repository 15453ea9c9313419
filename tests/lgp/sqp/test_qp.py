"""Quadratic programs: every back end finds the same optimum, and says so when there is none."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.sqp import active_set
from lgp.sqp.active_set import ActiveSet
from lgp.sqp.backends import Piqp, QpSolvers
from lgp.sqp.dual_active_set import BORDERS, DualActiveSet
from lgp.sqp.kkt import DUAL_SHIFTS, KKT
from lgp.sqp.problem import ProblemError
from lgp.sqp.qp import QP, ColumnOrder, QPResult, QPStatus, UpperTriangle, cost_scale, residuals
from lgp.sqp.subproblem import Elastic
from tests.support.says import says


def make_qp(P, q, A=None, b=(), G=None, h=(), lb=None, ub=None):
    """A QP from dense pieces, every entry in the pattern."""
    n = len(q)
    full = sp.csc_matrix(np.ones((n, n)))
    full.data[:] = np.asarray(P, dtype=float).T.ravel()
    rows = [sp.csr_matrix(np.ones((len(r), n))) for r in (b, h)]
    for row, values in zip(rows, (A, G), strict=True):
        row.data[:] = np.asarray(values if values is not None else [], dtype=float).ravel()
    return QP(
        P=UpperTriangle(full).update(full),
        q=np.asarray(q, dtype=float),
        A=rows[0],
        b=np.asarray(b, dtype=float),
        G=rows[1],
        h=np.asarray(h, dtype=float),
        lb=np.full(n, -np.inf) if lb is None else np.asarray(lb, dtype=float),
        ub=np.full(n, np.inf) if ub is None else np.asarray(ub, dtype=float),
    )


def random_qp(seed, n, m_e, m_i, slack=0.5):
    """A feasible, strictly convex QP; some rows and bounds are active at its optimum, and some at the known point."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    A, G, inside = rng.normal(size=(m_e, n)), rng.normal(size=(m_i, n)), 0.5 * rng.normal(size=n)
    return make_qp(
        root @ root.T + 0.1 * np.eye(n),
        3 * rng.normal(size=n),
        A,
        A @ inside,
        G,
        G @ inside + slack * rng.integers(0, 2, m_i) * rng.uniform(size=m_i),
        np.minimum(inside, -rng.uniform(0.1, 1, n)),
        np.maximum(inside, rng.uniform(0.1, 1, n)),
    )


def assert_optimal(qp, found):
    assert found.status is QPStatus.SOLVED
    errors = residuals(qp, found)
    size = 1 + max(np.abs(found.y).max(initial=0), np.abs(found.z).max(initial=0), np.abs(found.z_box).max(initial=0))
    # Interior point back ends stop at 1e-8 or so relative to the multipliers.
    assert max(errors.primal, errors.dual, errors.gap) <= 1e-6 * size


BACKENDS = [ActiveSet, Piqp, QpSolvers]


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), n=st.integers(1, 10), share=st.floats(0, 0.5), m_i=st.integers(0, 12))
def test_back_ends_agree(seed, n, share, m_i):
    qp = random_qp(seed, n, int(share * n), m_i)
    found = [backend().solve(qp) for backend in BACKENDS]
    for one in found:
        assert_optimal(qp, one)
    costs = [qp.objective(one.x) for one in found]
    assert max(costs) - min(costs) <= 1e-6 * (1 + abs(costs[0]))


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10**6), shift=st.floats(0, 0.3))
def test_a_reused_back_end_solves_changed_values(seed, shift):
    rng = np.random.default_rng(seed)
    active, interior = ActiveSet(), Piqp()
    first = random_qp(seed, 8, 2, 6)
    warm = active.solve(first)
    interior.solve(first)
    moved = make_qp(
        (first.P + sp.triu(first.P, 1).T).toarray() * 2,
        first.q + shift * rng.normal(size=8),
        first.A.toarray(),
        first.b,
        first.G.toarray(),
        first.h + shift,
        first.lb - shift,
        first.ub + shift,
    )
    again, fresh = active.solve(moved, warm), interior.solve(moved)
    assert_optimal(moved, again)
    assert_optimal(moved, fresh)
    assert moved.objective(again.x) == pytest.approx(moved.objective(fresh.x), rel=1e-6, abs=1e-6)


def test_the_right_active_set_takes_one_factorisation():
    qp = random_qp(3, 8, 2, 4)
    found = ActiveSet().solve(qp)
    again = ActiveSet().solve(qp, found)
    assert (again.solver, again.iterations) == ("active_set", 1)
    np.testing.assert_allclose(again.x, found.x, atol=1e-9)


def test_a_variable_at_its_bound_equals_it_exactly():
    found = ActiveSet().solve(make_qp(1e8 * np.eye(2), [-1e9, 1.0], lb=[-1, -1], ub=[0.3, 1]))
    assert found.x[0] == 0.3
    assert found.z_box[0] > 0


def test_fixed_variables_keep_their_value_under_any_gradient():
    for pull in (-5.0, 5.0):
        found = ActiveSet().solve(make_qp(np.eye(2), [pull, 0], A=[[1, 1]], b=[1], lb=[0.2, -9], ub=[0.2, 9]))
        np.testing.assert_allclose(found.x, [0.2, 0.8])


def test_a_qp_on_which_block_exchanges_cycle_is_solved_by_the_dual_method(monkeypatch):
    with monkeypatch.context() as without_dual:
        without_dual.setattr(active_set, "MAX_EXCHANGES", 0)
        qp = next(qp for qp in small_qps() if ActiveSet().solve(qp).solver != "active_set")
        by_piqp = ActiveSet().solve(qp)
    assert by_piqp.solver == "active_set+piqp"
    assert_optimal(qp, by_piqp)
    by_dual = ActiveSet().solve(qp)
    assert by_dual.solver == "active_set"
    assert_optimal(qp, by_dual)
    assert qp.objective(by_dual.x) == pytest.approx(qp.objective(by_piqp.x), abs=1e-8)


def small_qps():
    """Random QPs with lower bounds only; on some of them exchanges of whole blocks run in circles."""
    for seed in range(2000):
        rng = np.random.default_rng(seed)
        root = rng.normal(size=(4, 3))
        yield make_qp(root @ root.T + 1e-3 * np.eye(4), rng.normal(size=4), lb=np.zeros(4))


def on(qp, rows, side):
    """The factorised system of a working set, with its solution."""
    kkt, scale = KKT(qp), cost_scale(qp)
    kkt.load(qp, scale)
    kkt.refactor(side == 0, rows)
    n, m_e = qp.q.size, qp.b.size
    held = np.where(side < 0, qp.lb, np.where(side > 0, qp.ub, 0.0))
    right = np.concatenate([-scale * (qp.q + qp.hessian_dot(held)), qp.b - qp.A @ held, qp.h - qp.G @ held])
    right[:n][side != 0] = held[side != 0]
    right[n + m_e :][~rows] = 0.0
    x, y, z = np.split(kkt.solve(right, np.zeros_like(right), 1e-13)[0], [n, n + m_e])
    z_box = np.where(side == 0, 0.0, -scale * (qp.hessian_dot(x) + qp.q) - qp.transpose_product(y, z))
    return kkt, (x, y, z, z_box)


def dual_from(qp, rows, side, limit=1000):
    """The dual method from a working set, and whether it found the solution."""
    kkt, solution = on(qp, rows, side)
    method = DualActiveSet(kkt, qp, cost_scale(qp), rows, side, solution)
    return method, method.run(limit)


def assert_optimal_working_set(qp, method):
    """The working set is that of the optimum, rows up to the regularisation of the KKT system."""
    x, y, z = np.split(method.point, [qp.q.size, qp.q.size + qp.b.size])
    y, z = y / cost_scale(qp), z / cost_scale(qp)
    slope = qp.hessian_dot(x) + qp.q + qp.transpose_product(y, z)
    np.testing.assert_allclose(slope[method.side == 0], 0.0, atol=1e-6)
    assert not z[~method.rows].any()
    z_box = np.where(method.side == 0, 0.0, -slope)
    errors = residuals(qp, QPResult(QPStatus.SOLVED, x, y, z, z_box, 0, "dual"))
    size = 1 + max(np.abs(part).max(initial=0) for part in (y, z, z_box))
    assert errors.dual <= 1e-6 * size
    assert errors.primal <= 2 * DUAL_SHIFTS[0] * size
    assert errors.gap <= 2 * DUAL_SHIFTS[0] * size**2


@given(seed=st.integers(0, 10_000), guess=st.sampled_from([0.0, 0.1, 0.25]))
@settings(max_examples=60, deadline=None)
def test_the_dual_method_finds_the_optimum_from_any_working_set(seed, guess):
    rng = np.random.default_rng(seed)
    n, m_e, m_i = int(rng.integers(2, 60)), int(rng.integers(0, 2)), int(rng.integers(0, 30))
    qp = random_qp(seed, n, m_e, m_i)
    # A working set may not hold more rows and bounds than there are unknowns.
    rows = rng.uniform(size=m_i) < guess * min(1.0, n / (4.0 * max(m_i, 1)))
    side = np.where(rng.uniform(size=n) < guess, rng.choice([-1, 1], size=n), 0).astype(np.int8)
    method, solved = dual_from(qp, rows, side)
    assert solved
    assert_optimal_working_set(qp, method)


def test_the_dual_method_factorises_again_after_many_changes():
    n = 3 * BORDERS
    rng = np.random.default_rng(0)
    root = rng.normal(size=(n, n))
    qp = make_qp(root @ root.T / n + np.eye(n), rng.normal(size=n) - 2.0, ub=np.full(n, 0.1))
    method, solved = dual_from(qp, np.zeros(0, bool), np.zeros(n, np.int8))
    assert solved
    assert np.count_nonzero(method.side) > BORDERS
    assert_optimal_working_set(qp, method)


def test_the_dual_method_ends_at_inconsistent_rows_and_at_its_limit():
    none, free = np.zeros(2, bool), np.zeros(2, np.int8)
    inconsistent = make_qp(np.eye(2), [0, 0], G=[[1, 0], [-1, 0]], h=[-1, -1])
    assert not dual_from(inconsistent, none, free)[1]
    far = make_qp(np.eye(2), [0, 0], G=[[1, 0], [0, 1]], h=[-1, -1])
    assert not dual_from(far, none, free, limit=0)[1]
    assert dual_from(far, none, free)[1]


def test_the_dual_method_solves_linearly_dependent_rows():
    qp = make_qp(np.eye(2), [0, 0], G=[[1, 1e-9], [1, 0], [2, 0]], h=[-0.2, -0.2, -0.4])
    method, solved = dual_from(qp, np.zeros(3, bool), np.zeros(2, np.int8))
    assert solved
    assert_optimal_working_set(qp, method)


@pytest.mark.parametrize("backend", BACKENDS)
def test_linearly_dependent_rows_are_solved(backend):
    qp = make_qp(np.eye(2), [0, 0], A=[[1, 1], [1, 1]], b=[1, 1], G=[[1, 0], [1, 0], [2, 0]], h=[0.2, 0.2, 0.4])
    found = backend().solve(qp)
    assert_optimal(qp, found)
    np.testing.assert_allclose(found.x, [0.2, 0.8], atol=1e-6)


@pytest.mark.parametrize("backend", BACKENDS)
@pytest.mark.parametrize(
    "qp",
    [
        make_qp(np.eye(2), [0, 0], A=[[1, 1], [1, 1]], b=[1, 2]),
        make_qp(np.eye(2), [0, 0], G=[[1, 0], [-1, 0]], h=[-1, -1]),
        make_qp(np.eye(2), [0, 0], A=[[1, 1]], b=[5], lb=[0, 0], ub=[1, 1]),
    ],
    ids=["equalities", "inequalities", "bounds"],
)
def test_infeasible_qps_are_reported(backend, qp):
    assert backend().solve(qp).status is QPStatus.INFEASIBLE


@pytest.mark.parametrize("backend", [ActiveSet, Piqp])
def test_unbounded_qps_are_reported(backend):
    assert backend().solve(make_qp(np.diag([1.0, 0.0]), [0, -1])).status is QPStatus.UNBOUNDED


def test_elastic_mode_gives_the_least_violation():
    qp = make_qp(1e-3 * np.eye(2), [0, 0], A=[[1, 1]], b=[5], G=[[1, 0]], h=[0.5], lb=[0, 0], ub=[1, 1])
    found = Elastic().solve(qp, 100.0)
    # The sum can reach 2 within the bounds, at a violation of the row by 0.5 (or as much of the equality).
    assert abs(qp.A @ found.x - qp.b).sum() + np.maximum(qp.G @ found.x - qp.h, 0).sum() == pytest.approx(3.5, abs=1e-5)
    assert (found.x >= 0).all()


def test_elastic_mode_agrees_with_the_qp_where_that_has_a_solution():
    qp = random_qp(11, 6, 2, 5)
    np.testing.assert_allclose(Elastic().solve(qp, 1e4).x, Piqp().solve(qp).x, atol=1e-5)


def test_residuals_see_a_wrong_solution():
    qp = make_qp(np.eye(1), [1.0], lb=[0.0])
    right = QPResult(QPStatus.SOLVED, np.zeros(1), np.zeros(0), np.zeros(0), np.array([-1.0]), 0, "by hand")
    assert residuals(qp, right).dual == 0
    wrong = QPResult(QPStatus.SOLVED, np.full(1, -0.5), np.zeros(0), np.zeros(0), np.array([2.0]), 0, "by hand")
    errors = residuals(qp, wrong)
    assert errors.primal == 0.5
    assert errors.dual == 2.5


def test_an_unknown_solver_is_refused_with_those_that_are_there():
    with pytest.raises(ProblemError) as error:
        QpSolvers("clarabe")
    says(error, "'clarabe' is not installed", "expected one of", "did you mean 'clarabel'")


@given(seed=st.integers(0, 1000))
def test_patterns_move_values_only(seed):
    rng = np.random.default_rng(seed)
    dense = np.where(rng.uniform(size=(6, 6)) < 0.4, rng.normal(size=(6, 6)), 0.0)
    symmetric = dense + dense.T
    for source in (sp.csc_matrix(symmetric), sp.csc_matrix(np.triu(symmetric))):
        if source.nnz > np.count_nonzero(np.diag(symmetric)):
            copied = UpperTriangle(source).update(source, damping=2.0)
            np.testing.assert_array_equal(copied.toarray(), np.triu(symmetric) + 2.0 * np.eye(6))
    rows = sp.csr_matrix(dense)
    order = ColumnOrder(rows)
    np.testing.assert_array_equal(order.update(rows * 3.0).toarray(), dense * 3.0)


def test_a_lower_triangle_is_refused():
    with pytest.raises(ProblemError, match="lower triangle"):
        UpperTriangle(sp.csc_matrix(np.tril(np.ones((3, 3)))))
