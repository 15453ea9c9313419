"""From a model to a step: the QP subproblem, damped where it is unbounded, elastic where its rows are inconsistent.

Elastic mode (Nocedal & Wright 2006, 18.1; Gill, Murray & Saunders 2005) moves the rows into the cost with l1 slacks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from lgp.sqp.active_set import ActiveSet
from lgp.sqp.backends import Piqp
from lgp.sqp.merit import violation_sum
from lgp.sqp.problem import Model, Problem, Values
from lgp.sqp.qp import QP, QPBackend, QPResult, QPStatus, UpperTriangle, cost_scale, limits_of, same_pattern
from lgp.sqp.reduced_qp import ReducedQP
from reba.arrays import Array

FIRST_DAMPING = 1e-4
"""First damping, relative to the largest diagonal entry of the Hessian."""
DAMPINGS = 12
"""Dampings tried on an unbounded QP, each ten times the last; a failed one is damped once."""
PENALTIES = 5
"""Elastic penalty parameters tried, each ten times the last, before the rows count as inconsistent."""
ELASTIC_FAILURES = 2
"""Elastic QPs without a solution, one after another, at which to stop."""
MIN_PROGRESS = 0.9
"""Share of the linearised violation; an elastic step that leaves at most this is accepted."""
CONSISTENT = 1e-3
"""Share of the linearised violation; an elastic step that leaves at most this shows consistent rows."""


@dataclass(frozen=True)
class SqpStep:
    """A step (n,) with the QP it solves."""

    step: Array
    curvature: float
    """p'Hp of the model Hessian, without damping."""
    result: QPResult
    qp: QP
    damping: float
    elastic: bool
    stationary_infeasible: bool
    """Whether the highest elastic penalty does not reduce the violation: the point is stationary and infeasible."""


class SubproblemSolver:
    """Solves the QP subproblems of models of one pattern; back ends and their analyses persist between calls.

    Args:
        radius: largest change of an unknown in a step (trust region in the largest norm).
    """

    def __init__(self, backend: QPBackend | None = None, radius: float = np.inf) -> None:
        self.backend, self.radius = ActiveSet() if backend is None else backend, radius
        self.elastic = Elastic()
        self.reduced = ReducedQP()
        self._upper: UpperTriangle | None = None
        self.restart()

    def restart(self) -> None:
        """Reset the elastic penalty and the count of inconsistent models; called at the start of a solve."""
        self._penalty = 0.0
        self._inconsistent = 0
        self._failed = False

    def solve(self, problem: Problem, model: Model, x: Array, damping: float, warm: QPResult | None) -> SqpStep | None:
        """Return a step from x, with more damping where the QP is unbounded; None where no QP is solved.

        After two inconsistent models, or one that no back end solves, the elastic QP comes first: for consistent rows
        it has the same solution, and to detect inconsistent ones costs as much as a step.
        """
        if self._failed or self._inconsistent >= 2:
            step = self._elastic_step(self.qp(problem, model, x, damping), model, damping)
            if step is not None:
                return step
        for _ in range(DAMPINGS):
            qp = self.qp(problem, model, x, damping)
            result = self.reduced.solve(qp, warm, self.backend.solve)
            if result.status is QPStatus.SOLVED:
                self._inconsistent = 0
                return self._step(qp, result, damping, elastic=False, stationary_infeasible=False)
            if result.status is QPStatus.INFEASIBLE:
                return self._elastic_step(qp, model, damping)
            if result.status is QPStatus.FAILED:
                self._failed = True
                break
            damping = self.next_damping(damping)
        return self._elastic_step(qp, model, damping)

    @property
    def inconsistent(self) -> bool:
        """Whether the linearised rows of the last model are inconsistent."""
        return self._inconsistent > 0

    def next_damping(self, damping: float) -> float:
        """Return the next higher damping."""
        if damping > 0.0:
            return 10.0 * damping
        if self._upper is None:
            return FIRST_DAMPING
        largest = float(np.abs(self._upper.matrix.data[self._upper.diagonal]).max(initial=0.0))
        return FIRST_DAMPING * (largest if largest > 0.0 else 1.0)

    def second_order_correction(self, step: SqpStep, values: Values, model: Model) -> Array | None:
        """Return the second-order correction (n,) of a full step with these values (NW eq. 18.55); None if it fails."""
        left = values[1] - model.eq_jac @ step.step, values[2] - model.in_jac @ step.step
        equalities, inequalities = limits_of(*left, model.eq_jac, model.in_jac)
        corrected = replace(step.qp, b=equalities, h=inequalities)
        result = self.reduced.solve(corrected, step.result, self.backend.solve)
        if result.status is not QPStatus.SOLVED:
            return None
        return np.clip(result.x, step.qp.lb, step.qp.ub)

    def qp(self, problem: Problem, model: Model, x: Array, damping: float = 0.0) -> QP:
        """Return the QP of a step from x (n,); the next call overwrites its Hessian."""
        if self._upper is None or not self._upper.fits(model.hessian):
            self._upper = UpperTriangle(model.hessian)
        b, h = limits_of(model.eq, model.ineq, model.eq_jac, model.in_jac)
        return QP(
            P=self._upper.update(model.hessian, damping),
            q=model.gradient,
            A=model.eq_jac,
            b=b,
            G=model.in_jac,
            h=h,
            lb=np.maximum(problem.lower - x, -self.radius),
            ub=np.minimum(problem.upper - x, self.radius),
        )

    def _elastic_step(self, qp: QP, model: Model, damping: float) -> SqpStep | None:
        """Return an elastic step with a penalty parameter at which it reduces the linearised violation, if any does."""
        before = violation_sum(model.eq, model.ineq)
        penalty = max(self._penalty, 10.0 * max(1.0, float(np.abs(model.gradient).max(initial=0.0))))
        best: SqpStep | None = None
        last = np.inf

        def elastic(part: QP, _: QPResult | None) -> QPResult:
            return self.elastic.solve(part, penalty)

        failures = 0
        for _ in range(PENALTIES):
            result = self.reduced.solve(qp, None, elastic, whole=False)
            self._penalty, penalty = penalty, 10.0 * penalty
            if result.status is not QPStatus.SOLVED:
                failures += 1
                if best is not None or failures == ELASTIC_FAILURES:
                    break  # a higher penalty is harder still
                continue
            after = violation_sum(model.eq + model.eq_jac @ result.x, model.ineq + model.in_jac @ result.x)
            stationary_infeasible = after > (1.0 - 1e-4) * before
            best = self._step(qp, result, damping, elastic=True, stationary_infeasible=stationary_infeasible)
            if after <= MIN_PROGRESS * before or (not stationary_infeasible and after > 0.99 * last):
                break
            last = after
        if best is not None:
            self._inconsistent = self._inconsistent + 1 if after > CONSISTENT * before else 0
        return best

    def _step(self, qp: QP, result: QPResult, damping: float, *, elastic: bool, stationary_infeasible: bool) -> SqpStep:
        step = np.clip(result.x, qp.lb, qp.ub)
        curvature = float(step @ qp.hessian_dot(step)) - damping * float(step @ step)
        return SqpStep(step, curvature, result, qp, damping, elastic, stationary_infeasible)


class Elastic:
    """Elastic QPs of one pattern, solved by PIQP: the slacks have no curvature, which suits interior point methods."""

    def __init__(self) -> None:
        self.backend = Piqp()
        self._original: QP | None = None
        self._extended: QP | None = None

    def solve(self, qp: QP, penalty: float) -> QPResult:
        """Return the elastic solution without its slacks; the rows of `qp` may be violated."""
        extended = self._with_slacks(qp)
        n, slacks = qp.q.size, 2 * qp.b.size + qp.h.size
        extended.P.data[: qp.P.nnz] = qp.P.data
        # The constant -1 and +1 of the slacks are the last entries of each row.
        extended.A.data[self._a] = qp.A.data
        extended.G.data[self._g] = qp.G.data
        penalty = max(penalty, 1e-8 / cost_scale(qp))
        elastic = replace(
            extended,
            q=np.concatenate([qp.q, np.full(slacks, penalty)]),
            b=qp.b,
            h=qp.h,
            lb=np.concatenate([qp.lb, np.zeros(slacks)]),
            ub=np.concatenate([qp.ub, np.full(slacks, np.inf)]),
        )
        result = self.backend.solve(elastic)
        return replace(result, x=result.x[:n], z_box=result.z_box[:n], solver=f"elastic {result.solver}")

    def _with_slacks(self, qp: QP) -> QP:
        """Return the QP extended by slacks; its pattern is built on first use."""
        if self._extended is not None and self._original is not None:
            old = self._original
            if all(same_pattern(*pair) for pair in ((old.P, qp.P), (old.A, qp.A), (old.G, qp.G))):
                return self._extended
        m_e, m_i = qp.b.size, qp.h.size
        self._original = replace(qp, P=qp.P.copy(), A=qp.A.copy(), G=qp.G.copy())
        n, slacks = qp.q.size, 2 * m_e + m_i
        diagonal = sp.csc_matrix((np.zeros(slacks), (np.arange(slacks), np.arange(slacks))), shape=(slacks, slacks))
        hessian = sp.block_diag([qp.P, diagonal], format="csc")
        eye, empty = sp.eye_array(m_e, format="csr"), sp.csr_matrix((m_e, m_i))
        equality = sp.csr_matrix(sp.hstack([_labels(qp.A), -eye, eye, empty], format="csr"))
        limit = sp.csr_matrix(
            sp.hstack([_labels(qp.G), sp.csr_matrix((m_i, 2 * m_e)), -sp.eye_array(m_i, format="csr")], format="csr")
        )
        self._a, self._g = np.flatnonzero(equality.data > 1.5), np.flatnonzero(limit.data > 1.5)
        self._extended = QP(
            P=sp.csc_matrix(hessian),
            q=np.zeros(n + slacks),
            A=equality,
            b=qp.b,
            G=limit,
            h=qp.h,
            lb=np.zeros(n + slacks),
            ub=np.zeros(n + slacks),
        )
        return self._extended


def _labels(matrix: sp.csr_matrix) -> sp.csr_matrix:
    """Return the pattern filled with 2, which marks its entries among the -1 and +1 of the slacks."""
    return sp.csr_matrix((np.full(matrix.nnz, 2.0), matrix.indices, matrix.indptr), shape=matrix.shape)
