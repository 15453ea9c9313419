"""Any solver that qpsolvers knows, Clarabel first; the cross-check of the faster back ends."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import scipy.sparse as sp

from lgp.sqp.problem import ProblemError
from lgp.sqp.qp import QP, QPResult, QPStatus, cost_scale
from reba.errors import did_you_mean


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
