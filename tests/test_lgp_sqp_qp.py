"""Quadratic programs: every back end finds the same optimum, and says so when there is none."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.sqp import QP, ActiveSet, Piqp, ProblemError, QPResult, QpSolvers, QPStatus
from lgp.sqp.elastic import Elastic
from lgp.sqp.patterns import ColumnOrder, UpperTriangle
from lgp.sqp.qp import residuals


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
def test_a_kept_back_end_follows_changing_values(seed, shift):
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


def test_a_held_variable_is_on_its_bound_exactly():
    found = ActiveSet().solve(make_qp(1e8 * np.eye(2), [-1e9, 1.0], lb=[-1, -1], ub=[0.3, 1]))
    assert found.x[0] == 0.3
    assert found.z_box[0] > 0


def test_fixed_variables_keep_their_value_whatever_pulls():
    for pull in (-5.0, 5.0):
        found = ActiveSet().solve(make_qp(np.eye(2), [pull, 0], A=[[1, 1]], b=[1], lb=[0.2, -9], ub=[0.2, 9]))
        np.testing.assert_allclose(found.x, [0.2, 0.8])


def test_a_qp_on_which_exchanges_run_in_circles_reaches_the_fallback():
    # A matrix whose principal pivots cycle under exchange of all errors at once (found by search, checked below).
    qp = cycling_qp()
    found = ActiveSet(rounds=6, patience=100).solve(qp)
    assert found.solver == "active_set+piqp"
    assert_optimal(qp, found)
    patient = ActiveSet(rounds=200, patience=2).solve(qp)
    assert patient.solver == "active_set"  # one exchange at a time ends on a strictly convex QP
    assert qp.objective(patient.x) == pytest.approx(qp.objective(found.x), abs=1e-8)


def cycling_qp():
    """The first random QP with bounds only on which exchanges of whole blocks do not end in 30 rounds."""
    for seed in range(2000):
        rng = np.random.default_rng(seed)
        root = rng.normal(size=(4, 3))
        qp = make_qp(root @ root.T + 1e-3 * np.eye(4), rng.normal(size=4), lb=np.zeros(4))
        if ActiveSet(rounds=30, patience=1000, cold=1000).solve(qp).solver != "active_set":
            return qp
    raise AssertionError("no such QP")


@pytest.mark.parametrize("backend", BACKENDS)
def test_rows_that_repeat_each_other_are_solved(backend):
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
def test_infeasible_qps_are_told(backend, qp):
    assert backend().solve(qp).status is QPStatus.INFEASIBLE


@pytest.mark.parametrize("backend", [ActiveSet, Piqp])
def test_unbounded_qps_are_told(backend):
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
    with pytest.raises(ProblemError, match=r"'clarabe' is not installed; installed are .*did you mean 'clarabel'"):
        QpSolvers("clarabe")


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
