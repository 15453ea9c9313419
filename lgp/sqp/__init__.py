"""Sequential quadratic programming (Nocedal & Wright 2006, ch. 18) on sparse problems of fixed sparsity pattern.

A `Problem` gives bounds, values and convex quadratic models; `solve` minimises it once, a `Solver` several like it; QPs
go through the protocol `QPBackend` to `ActiveSet` (the default), `Piqp`, or any solver of qpsolvers (`QpSolvers`).
"""

from __future__ import annotations

from lgp.sqp.active_set import ActiveSet
from lgp.sqp.backends import Piqp, QpSolvers
from lgp.sqp.problem import FunctionProblem, Model, Problem, ProblemError, SolverOptions
from lgp.sqp.qp import QP, QPBackend, QPResult, QPStatus
from lgp.sqp.result import ConstraintViolation, Iteration, Result, SolveStatus
from lgp.sqp.solver import Solver, solve

__all__ = [
    "QP",
    "ActiveSet",
    "ConstraintViolation",
    "FunctionProblem",
    "Iteration",
    "Model",
    "Piqp",
    "Problem",
    "ProblemError",
    "QPBackend",
    "QPResult",
    "QPStatus",
    "QpSolvers",
    "Result",
    "SolveStatus",
    "Solver",
    "SolverOptions",
    "solve",
]
