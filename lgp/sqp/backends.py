"""QP back ends: PIQP, a sparse proximal interior point method (Schwan et al. 2023), and the solvers of qpsolvers."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import scipy.sparse as sp

from lgp.sqp.problem import ProblemError
from lgp.sqp.qp import QP, ColumnOrder, QPResult, QPStatus, cost_scale, same_pattern
from reba.errors import did_you_mean

TOLERANCE = 1e-9
"""Absolute residual at which PIQP stops, cost scaled by 1 / max|P|: well below the tolerance of a solution, 1e-6."""
MAX_ITERATIONS = 80
"""Interior point iterations before a QP counts as failed, so that it is damped and solved again."""


class Piqp:
    """The default interior point back end: no warm start, but it converges on any convex QP."""

    name = "piqp"

    def __init__(self) -> None:
        self._solver: Any = None
        self._hessian: Any = None
        self._orders: list[ColumnOrder] = []

    def solve(self, qp: QP, warm: QPResult | None = None) -> QPResult:
        """Solve one QP; `warm` is not used: interior point methods start from the central path."""
        scale = cost_scale(qp)
        self._load(qp, scale)
        self._solver.solve()
        result = self._solver.result
        status = _STATUS.get(result.info.status.name, QPStatus.FAILED)
        if status is not QPStatus.SOLVED:
            return QPResult.unsolved(qp, status, result.info.iter, self.name)
        return QPResult(
            status=status,
            x=np.clip(result.x, qp.lb, qp.ub),
            y=np.array(result.y) / scale,
            z=np.maximum(result.z_u, 0.0) / scale,
            z_box=(np.maximum(result.z_bu, 0.0) - np.maximum(result.z_bl, 0.0)) / scale,
            iterations=result.info.iter,
            solver=self.name,
        )

    def _load(self, qp: QP, scale: float) -> None:
        """Pass the values to PIQP; QPs of the last sparsity pattern update its set-up in place."""
        same = self._solver is not None and same_pattern(qp.P, self._hessian)
        if not (same and self._orders[0].fits(qp.A) and self._orders[1].fits(qp.G)):
            self._solver = self._new_solver()
            self._hessian = qp.P.copy()
            self._orders = [ColumnOrder(qp.A), ColumnOrder(qp.G)]
            load = self._solver.setup
        else:
            load = self._solver.update
        np.multiply(qp.P.data, scale, out=self._hessian.data)
        equalities, inequalities = (
            order.update(matrix) for order, matrix in zip(self._orders, (qp.A, qp.G), strict=True)
        )
        values: dict[str, Any] = {"P": self._hessian, "c": qp.q * scale, "x_l": qp.lb, "x_u": qp.ub}
        if qp.b.size:
            values |= {"A": equalities, "b": qp.b}
        if qp.h.size:
            values |= {"G": inequalities, "h_u": qp.h}
        load(**values)

    def _new_solver(self) -> Any:
        import piqp

        solver = piqp.SparseSolver()
        solver.settings.eps_abs = solver.settings.eps_duality_gap_abs = TOLERANCE
        solver.settings.max_iter = MAX_ITERATIONS
        # Curvatures of paths of some hundred slices differ by nine orders of magnitude: PIQP stalls without refinement.
        solver.settings.iterative_refinement_always_enabled = True
        return solver


_STATUS = {
    "PIQP_SOLVED": QPStatus.SOLVED,
    "PIQP_PRIMAL_INFEASIBLE": QPStatus.INFEASIBLE,
    "PIQP_DUAL_INFEASIBLE": QPStatus.UNBOUNDED,
}


class QpSolvers:
    """A QP back end by its qpsolvers name, e.g. "clarabel"; `options` are passed to that solver.

    Raises:
        ProblemError: the solver is not installed; the message lists those that are.
    """

    def __init__(self, solver: str = "clarabel", **options: Any) -> None:
        # Imported here because the package looks for every solver it supports, which takes half a second.
        import qpsolvers

        if solver not in qpsolvers.available_solvers:
            installed = ", ".join(sorted(qpsolvers.available_solvers))
            raise ProblemError(
                f"QP solver {solver!r} is not installed; expected one of {installed}"
                + did_you_mean(solver, qpsolvers.available_solvers)
            )
        self.name = solver
        self._dense = solver in qpsolvers.dense_solvers and solver not in qpsolvers.sparse_solvers
        self._options = options

    def solve(self, qp: QP, warm: QPResult | None = None) -> QPResult:
        """Solve one QP, its cost scaled by 1 / max|P|; `warm` is the initial guess."""
        import qpsolvers

        scale = cost_scale(qp)
        full = qp.P + sp.triu(qp.P, k=1, format="csc").T
        shape = np.asarray if self._dense else sp.csc_matrix
        matrices = [shape(m.toarray() if self._dense else m) for m in (full * scale, qp.G, qp.A)]
        problem = qpsolvers.Problem(
            matrices[0],
            qp.q * scale,
            matrices[1] if qp.h.size else None,
            qp.h if qp.h.size else None,
            matrices[2] if qp.b.size else None,
            qp.b if qp.b.size else None,
            qp.lb,
            qp.ub,
        )
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # solvers warn about formats they convert themselves
            solution = qpsolvers.solve_problem(
                problem, solver=self.name, initvals=None if warm is None else warm.x, **self._options
            )
        if not solution.found or solution.x is None:
            return QPResult.unsolved(qp, _status(solution.extras), 0, self.name)
        return QPResult(
            status=QPStatus.SOLVED,
            x=np.clip(solution.x, qp.lb, qp.ub),
            y=_multipliers(solution.y, qp.b.size) / scale,
            z=np.maximum(_multipliers(solution.z, qp.h.size), 0.0) / scale,
            z_box=_multipliers(solution.z_box, qp.q.size) / scale,
            iterations=0,
            solver=self.name,
        )


def _multipliers(values: Any, size: int) -> np.ndarray:
    return np.zeros(size) if values is None or not np.size(values) else np.asarray(values, dtype=float)


def _status(extras: dict[str, Any]) -> QPStatus:
    """Return the status that the solver's own words name."""
    words = " ".join(str(value) for value in extras.values()).lower().replace("_", "")
    if "dualinfeasible" in words or "unbounded" in words:
        return QPStatus.UNBOUNDED
    return QPStatus.INFEASIBLE if "infeasible" in words else QPStatus.FAILED
