"""From a model to a step: the QP, damped where its cost falls without end, elastic where its rows contradict."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from lgp.sqp.active_set import ActiveSet
from lgp.sqp.backends import Piqp
from lgp.sqp.merit import violation_sum
from lgp.sqp.problem import Model, Problem, Values
from lgp.sqp.qp import QP, QPBackend, QPResult, QPStatus, UpperTriangle, cost_scale, same_pattern
from reba.arrays import Array

FIRST_DAMPING = 1e-4
"""First damping, relative to the largest diagonal entry of the Hessian."""
DAMPINGS = 12
"""Dampings tried on a QP whose cost falls without end; one that merely fails is damped once."""
PRICES = 5
"""Elastic prices tried, each ten times the last, before the rows count as contradicting each other."""
MIN_PROGRESS = 0.9
"""An elastic step is taken once it leaves at most this share of the linearised violation."""
CLOSED = 1e-3
"""An elastic step that leaves at most this share shows that the rows no longer contradict each other."""


@dataclass(frozen=True)
class SqpStep:
    """A step (n,) with the QP it solves."""

    step: Array
    curvature: float
    """p'Hp of the problem's Hessian, without damping."""
    found: QPResult
    qp: QP
    damping: float
    elastic: bool
    hopeless: bool
    """Whether even the highest elastic price leaves the violation where it is."""


class SubproblemSolver:
    """Turns models of one pattern into steps; keeps the back ends and their analyses between calls."""

    def __init__(self, backend: QPBackend | None = None, elastic: Elastic | None = None) -> None:
        self.backend = ActiveSet() if backend is None else backend
        self.elastic = Elastic() if elastic is None else elastic
        self._upper: UpperTriangle | None = None
        self.restart()

    def restart(self) -> None:
        """Forget the elastic price and that rows contradicted each other; called at the start of a solve."""
        self._price = 0.0
        self._contradicted = 0

    def make(self, problem: Problem, model: Model, x: Array, damping: float, warm: QPResult | None) -> SqpStep | None:
        """Return a step from x, with more damping than given where the QP is unbounded; None where nothing solves.

        After two steps whose rows contradicted each other the elastic QP comes first: it finds the same step where
        they no longer do, and a verdict that they still do costs as much as a step.
        """
        if self._contradicted >= 2:
            step = self._stretch(self.qp(problem, model, x, damping), model, damping)
            if step is not None:
                return step
        failures = 0
        for _ in range(DAMPINGS):
            qp = self.qp(problem, model, x, damping)
            found = self.backend.solve(qp, warm)
            if found.status is QPStatus.SOLVED:
                self._contradicted = 0
                return self._step(qp, found, damping, elastic=False, hopeless=False)
            if found.status is QPStatus.INFEASIBLE:
                return self._stretch(qp, model, damping)
            failures += found.status is QPStatus.FAILED
            if failures > 1:
                break
            damping = self.more(damping)
        return self._stretch(qp, model, damping)

    @property
    def contradicted(self) -> bool:
        """Whether the rows of the last model contradicted each other."""
        return self._contradicted > 0

    def more(self, damping: float) -> float:
        """Return the next higher damping."""
        if damping > 0.0:
            return 10.0 * damping
        if self._upper is None:
            return FIRST_DAMPING
        largest = float(np.abs(self._upper.matrix.data[self._upper.diagonal]).max(initial=0.0))
        return FIRST_DAMPING * (largest if largest > 0.0 else 1.0)

    def correct(self, step: SqpStep, values: Values, model: Model) -> Array | None:
        """Return the second-order correction of a full step whose values are given; None where the QP fails."""
        rows = model.eq_jac @ step.step - values[1]
        limits = model.in_jac @ step.step - values[2]
        found = self.backend.solve(replace(step.qp, b=rows, h=limits), step.found)
        if found.status is not QPStatus.SOLVED:
            return None
        return np.clip(found.x, step.qp.lb, step.qp.ub)

    def qp(self, problem: Problem, model: Model, x: Array, damping: float = 0.0) -> QP:
        """Return the QP of a step from x (n,); its Hessian is overwritten by the next one."""
        if self._upper is None or not self._upper.fits(model.hessian):
            self._upper = UpperTriangle(model.hessian)
        return QP(
            P=self._upper.update(model.hessian, damping),
            q=model.gradient,
            A=model.eq_jac,
            b=-model.eq,
            G=model.in_jac,
            h=-model.ineq,
            lb=problem.lower - x,
            ub=problem.upper - x,
        )

    def _stretch(self, qp: QP, model: Model, damping: float) -> SqpStep | None:
        """Return an elastic step, at a price that makes it reduce the linearised violation if anything does."""
        before = violation_sum(model.eq, model.ineq)
        price = max(self._price, 10.0 * max(1.0, float(np.abs(model.gradient).max(initial=0.0))))
        best: SqpStep | None = None
        last = np.inf
        for _ in range(PRICES):
            found = self.elastic.solve(qp, price)
            self._price, price = price, 10.0 * price
            if found.status is not QPStatus.SOLVED:
                continue
            after = violation_sum(model.eq + model.eq_jac @ found.x, model.ineq + model.in_jac @ found.x)
            hopeless = after > (1.0 - 1e-4) * before
            best = self._step(qp, found, damping, elastic=True, hopeless=hopeless)
            if after <= MIN_PROGRESS * before or (not hopeless and after > 0.99 * last):
                break
            last = after
        if best is not None:
            self._contradicted = self._contradicted + 1 if after > CLOSED * before else 0
        return best

    def _step(self, qp: QP, found: QPResult, damping: float, *, elastic: bool, hopeless: bool) -> SqpStep:
        step = np.clip(found.x, qp.lb, qp.ub)
        curvature = float(step @ qp.hessian_dot(step)) - damping * float(step @ step)
        return SqpStep(step, curvature, found, qp, damping, elastic, hopeless)


class Elastic:
    """Builds and solves elastic QPs of one pattern.

    Args:
        backend: solves the widened QP; the slacks have no curvature, which suits interior point methods.
    """

    def __init__(self, backend: QPBackend | None = None) -> None:
        self.backend = Piqp() if backend is None else backend
        self._of: QP | None = None
        self._wide: QP | None = None

    def solve(self, qp: QP, price: float) -> QPResult:
        """Return the elastic solution, cut to the unknowns of `qp`; its rows may be violated."""
        wide = self._widen(qp)
        n, slacks = qp.q.size, 2 * qp.b.size + qp.h.size
        wide.P.data[: qp.P.nnz] = qp.P.data
        # The unchanging -1 and +1 close each row, so the values of a row keep their places.
        wide.A.data[self._a] = qp.A.data
        wide.G.data[self._g] = qp.G.data
        price = max(price, 1e-8 / cost_scale(qp))
        filled = replace(
            wide,
            q=np.concatenate([qp.q, np.full(slacks, price)]),
            b=qp.b,
            h=qp.h,
            lb=np.concatenate([qp.lb, np.zeros(slacks)]),
            ub=np.concatenate([qp.ub, np.full(slacks, np.inf)]),
        )
        found = self.backend.solve(filled)
        return replace(found, x=found.x[:n], z_box=found.z_box[:n], solver=f"elastic {found.solver}")

    def _widen(self, qp: QP) -> QP:
        """Return the widened QP, its pattern made on first use."""
        if self._wide is not None and self._of is not None:
            old = self._of
            if all(same_pattern(*pair) for pair in ((old.P, qp.P), (old.A, qp.A), (old.G, qp.G))):
                return self._wide
        m_e, m_i = qp.b.size, qp.h.size
        self._of = replace(qp, P=qp.P.copy(), A=qp.A.copy(), G=qp.G.copy())
        n, slacks = qp.q.size, 2 * m_e + m_i
        diagonal = sp.csc_matrix((np.zeros(slacks), (np.arange(slacks), np.arange(slacks))), shape=(slacks, slacks))
        hessian = sp.block_diag([qp.P, diagonal], format="csc")
        eye, none = sp.eye_array(m_e, format="csr"), sp.csr_matrix((m_e, m_i))
        equality = sp.csr_matrix(sp.hstack([_labels(qp.A), -eye, eye, none], format="csr"))
        limit = sp.csr_matrix(
            sp.hstack([_labels(qp.G), sp.csr_matrix((m_i, 2 * m_e)), -sp.eye_array(m_i, format="csr")], format="csr")
        )
        self._a, self._g = np.flatnonzero(equality.data > 1.5), np.flatnonzero(limit.data > 1.5)
        self._wide = QP(
            P=sp.csc_matrix(hessian),
            q=np.zeros(n + slacks),
            A=equality,
            b=qp.b,
            G=limit,
            h=qp.h,
            lb=np.zeros(n + slacks),
            ub=np.zeros(n + slacks),
        )
        return self._wide


def _labels(matrix: sp.csr_matrix) -> sp.csr_matrix:
    """Return the pattern filled with twos, told apart from the -1 and +1 of the slacks."""
    return sp.csr_matrix((np.full(matrix.nnz, 2.0), matrix.indices, matrix.indptr), shape=matrix.shape)
