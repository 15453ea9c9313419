"""PIQP's sparse proximal interior point method (Schwan et al. 2023), set up once per pattern and then updated."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import scipy.sparse as sp

from lgp.sqp.problem import ProblemError
from lgp.sqp.qp import QP, ColumnOrder, QPResult, QPStatus, cost_scale, same_pattern
from reba.errors import did_you_mean


class Piqp:
    """The default interior point back end: no warm start, but sturdy on any convex QP.

    Args:
        tolerance: absolute residual at which PIQP stops, after its cost was scaled by 1 / max|P|.
        max_iterations: interior point iterations.
    """

    name = "piqp"

    def __init__(self, tolerance: float = 1e-9, max_iterations: int = 80) -> None:
        self.tolerance = tolerance
        self.max_iterations = max_iterations
        self._solver: Any = None
        self._hessian: Any = None
        self._orders: list[ColumnOrder] = []

    def solve(self, qp: QP, warm: QPResult | None = None) -> QPResult:
        """Solve one QP; `warm` is not used, an interior point method starts from its centre."""
        scale = cost_scale(qp)
        self._load(qp, scale)
        self._solver.solve()
        found = self._solver.result
        status = _STATUS.get(found.info.status.name, QPStatus.FAILED)
        if status is not QPStatus.SOLVED:
            return QPResult.nothing(qp, status, found.info.iter, self.name)
        return QPResult(
            status=status,
            x=np.clip(found.x, qp.lb, qp.ub),
            y=np.array(found.y) / scale,
            z=np.maximum(found.z_u, 0.0) / scale,
            z_box=(np.maximum(found.z_bu, 0.0) - np.maximum(found.z_bl, 0.0)) / scale,
            iterations=found.info.iter,
            solver=self.name,
        )

    def _load(self, qp: QP, scale: float) -> None:
        """Hand the values to PIQP; a pattern seen before is updated in place."""
        known = self._solver is not None and same_pattern(qp.P, self._hessian)
        if not (known and self._orders[0].fits(qp.A) and self._orders[1].fits(qp.G)):
            self._solver = self._new()
            self._hessian = qp.P.copy()
            self._orders = [ColumnOrder(qp.A), ColumnOrder(qp.G)]
            load = self._solver.setup
        else:
            load = self._solver.update
        np.multiply(qp.P.data, scale, out=self._hessian.data)
        rows, limits = (order.update(matrix) for order, matrix in zip(self._orders, (qp.A, qp.G), strict=True))
        values: dict[str, Any] = {"P": self._hessian, "c": qp.q * scale, "x_l": qp.lb, "x_u": qp.ub}
        if qp.b.size:
            values |= {"A": rows, "b": qp.b}
        if qp.h.size:
            values |= {"G": limits, "h_u": qp.h}
        load(**values)

    def _new(self) -> Any:
        import piqp

        solver = piqp.SparseSolver()
        solver.settings.eps_abs = solver.settings.eps_duality_gap_abs = self.tolerance
        solver.settings.max_iter = self.max_iterations
        # Paths of some hundred slices have curvatures nine orders apart; without refinement PIQP stalls on them.
        solver.settings.iterative_refinement_always_enabled = True
        return solver


_STATUS = {
    "PIQP_SOLVED": QPStatus.SOLVED,
    "PIQP_PRIMAL_INFEASIBLE": QPStatus.INFEASIBLE,
    "PIQP_DUAL_INFEASIBLE": QPStatus.UNBOUNDED,
}


class QpSolvers:
    """A QP back end by its qpsolvers name.

    Args:
        solver: a name from `qpsolvers.available_solvers`, e.g. "clarabel".
        options: handed to that solver as they are.

    Raises:
        ProblemError: the solver is not installed; the message lists those that are.
    """

    def __init__(self, solver: str = "clarabel", **options: Any) -> None:
        # Imported here because the package scans for every solver it knows, which takes half a second.
        import qpsolvers

        if solver not in qpsolvers.available_solvers:
            known = ", ".join(sorted(qpsolvers.available_solvers))
            raise ProblemError(
                f"QP solver {solver!r} is not installed; installed are {known}"
                + did_you_mean(solver, qpsolvers.available_solvers)
            )
        self.name = solver
        self._dense = solver in qpsolvers.dense_solvers and solver not in qpsolvers.sparse_solvers
        self._options = options

    def solve(self, qp: QP, warm: QPResult | None = None) -> QPResult:
        """Solve one QP from scratch; the cost is scaled by 1 / max|P|, `warm` is handed on as a first guess."""
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
            warnings.simplefilter("ignore")  # back ends warn about formats they convert themselves
            found = qpsolvers.solve_problem(
                problem, solver=self.name, initvals=None if warm is None else warm.x, **self._options
            )
        if not found.found or found.x is None:
            return QPResult.nothing(qp, _status(found.extras), 0, self.name)
        return QPResult(
            status=QPStatus.SOLVED,
            x=np.clip(found.x, qp.lb, qp.ub),
            y=_multipliers(found.y, qp.b.size) / scale,
            z=np.maximum(_multipliers(found.z, qp.h.size), 0.0) / scale,
            z_box=_multipliers(found.z_box, qp.q.size) / scale,
            iterations=0,
            solver=self.name,
        )


def _multipliers(given: Any, size: int) -> np.ndarray:
    return np.zeros(size) if given is None or not np.size(given) else np.asarray(given, dtype=float)


def _status(extras: dict[str, Any]) -> QPStatus:
    """Read the reason from the words of the solver, where it gives one."""
    words = " ".join(str(value) for value in extras.values()).lower().replace("_", "")
    if "dualinfeasible" in words or "unbounded" in words:
        return QPStatus.UNBOUNDED
    return QPStatus.INFEASIBLE if "infeasible" in words else QPStatus.FAILED
