"""Problem protocol: bounds, values, and a convex quadratic model of fixed sparsity pattern; solver options."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Final, Protocol

import numpy as np
import scipy.sparse as sp

from reba.arrays import Array
from reba.checks import COUNT, YES_NO, Allowed, is_number, shown
from reba.errors import RebaError

Values = tuple[float, Array, Array]


class ProblemError(RebaError):
    """Inconsistent problem: shapes, bounds, sparsity patterns, or values that are not numbers."""


@dataclass(frozen=True)
class Model:
    """Cost and constraints around a point x: f + g'p + p'Hp/2, c + Jp, d + Kp.

    The three matrices have one sparsity pattern (indptr, indices) for the life of a problem, so the solver analyses
    them once. The solver does not write to a model and reads it until the next one, so `linearise` may overwrite the
    same arrays; `evaluate` must not.
    """

    hessian: sp.csc_matrix
    """(n, n) positive semidefinite, either full symmetric or its upper triangle."""
    gradient: Array
    """(n,) gradient of the cost."""
    eq_jac: sp.csr_matrix
    """(m_e, n) Jacobian of the equalities."""
    eq: Array
    """(m_e,) equalities, zero where satisfied."""
    in_jac: sp.csr_matrix
    """(m_i, n) Jacobian of the inequalities."""
    ineq: Array
    """(m_i,) inequalities, at most zero where satisfied."""


class Problem(Protocol):
    """Minimise a cost under equalities c(x) = 0, inequalities d(x) <= 0 and bounds lower <= x <= upper.

    The cost counts in multiples of `cost_unit`, a size that matters: so no tolerance or penalty depends on the unit in
    which a user states costs. The solver returns costs in that unit of the user, multipliers by cost units.
    """

    @property
    def n(self) -> int:
        """Number of unknowns."""

    @property
    def cost_unit(self) -> float:
        """What a cost of 1 in `evaluate` and `linearise` is worth, > 0."""

    @property
    def lower(self) -> Array:
        """(n,) lower bounds, -inf where free."""

    @property
    def upper(self) -> Array:
        """(n,) upper bounds, +inf where free."""

    def evaluate(self, x: Array) -> Values:
        """Return cost, equalities (m_e,) and inequalities (m_i,) at x (n,)."""

    def linearise(self, x: Array, y_eq: Array, y_in: Array) -> Model:
        """Return the model at x; multipliers y_eq (m_e,) and y_in (m_i,) >= 0 weight the constraint curvature."""


class FunctionProblem:
    """A small dense problem from callables, for examples and tests.

    Args:
        cost: x (n,) -> float.
        gradient: x -> (n,).
        lower, upper: bounds (n,); None for none.
        equality, equality_jacobian: x -> (m_e,), x -> (m_e, n); None for no equality.
        inequality, inequality_jacobian: x -> (m_i,) <= 0, x -> (m_i, n); None for no inequality.
        hessian: (x, y_eq, y_in) -> (n, n) of the Lagrangian; None for central differences of its gradient.
            It is made convex by reflecting negative eigenvalues.
        cost_unit: size of a cost that matters; `cost`, `gradient` and `hessian` are divided by it.

    >>> import numpy as np
    >>> bowl = FunctionProblem(2, cost=lambda x: x @ x, gradient=lambda x: 2 * x)
    >>> bowl.evaluate(np.ones(2))[0]
    2.0
    """

    def __init__(
        self,
        n: int,
        *,
        cost: Callable[[Array], float],
        gradient: Callable[[Array], Array],
        lower: Array | None = None,
        upper: Array | None = None,
        equality: Callable[[Array], Array] | None = None,
        equality_jacobian: Callable[[Array], Array] | None = None,
        inequality: Callable[[Array], Array] | None = None,
        inequality_jacobian: Callable[[Array], Array] | None = None,
        hessian: Callable[[Array, Array, Array], Array] | None = None,
        cost_unit: float = 1.0,
    ) -> None:
        self.n, self.cost_unit = n, cost_unit
        self.lower = np.full(n, -np.inf) if lower is None else np.asarray(lower, dtype=float)
        self.upper = np.full(n, np.inf) if upper is None else np.asarray(upper, dtype=float)
        self._cost, self._gradient, self._hessian = cost, gradient, hessian
        self._equality, self._equality_jacobian = equality, equality_jacobian
        self._inequality, self._inequality_jacobian = inequality, inequality_jacobian

    def evaluate(self, x: Array) -> Values:
        """Return cost, equalities and inequalities at x (n,)."""
        return float(self._cost(x)) / self.cost_unit, _vector(self._equality, x), _vector(self._inequality, x)

    def linearise(self, x: Array, y_eq: Array, y_in: Array) -> Model:
        """Return the model at x with a positive semidefinite Hessian; every entry belongs to the pattern."""
        eq_jac, in_jac = self._jacobian(self._equality_jacobian, x), self._jacobian(self._inequality_jacobian, x)
        unit = self.cost_unit
        if self._hessian is None:
            hessian = self._finite_difference_hessian(x, y_eq, y_in)
        else:
            hessian = np.asarray(self._hessian(x, unit * y_eq, unit * y_in), dtype=float) / unit
        return Model(
            hessian=sp.csc_matrix(_full_pattern(_reflected(hessian))),
            gradient=np.asarray(self._gradient(x), dtype=float) / unit,
            eq_jac=sp.csr_matrix(_full_pattern(eq_jac)),
            eq=_vector(self._equality, x),
            in_jac=sp.csr_matrix(_full_pattern(in_jac)),
            ineq=_vector(self._inequality, x),
        )

    def _jacobian(self, function: Callable[[Array], Array] | None, x: Array) -> Array:
        if function is None:
            return np.zeros((0, self.n))
        return np.asarray(function(x), dtype=float).reshape(-1, self.n)

    def _lagrangian_gradient(self, x: Array, y_eq: Array, y_in: Array) -> Array:
        """Return the gradient (n,) of the Lagrangian."""
        gradient = np.array(self._gradient(x), dtype=float) / self.cost_unit
        gradient += self._jacobian(self._equality_jacobian, x).T @ y_eq
        return gradient + self._jacobian(self._inequality_jacobian, x).T @ y_in

    def _finite_difference_hessian(self, x: Array, y_eq: Array, y_in: Array) -> Array:
        steps = np.eye(self.n) * (6e-6 * np.maximum(1.0, np.abs(x)))  # cube root of machine precision
        columns = [
            (self._lagrangian_gradient(x + step, y_eq, y_in) - self._lagrangian_gradient(x - step, y_eq, y_in))
            / (2.0 * step.sum())
            for step in steps
        ]
        return 0.5 * (np.array(columns) + np.array(columns).T)


def _vector(function: Callable[[Array], Array] | None, x: Array) -> Array:
    return np.zeros(0) if function is None else np.atleast_1d(np.asarray(function(x), dtype=float))


def _reflected(matrix: Array) -> Array:
    """Return |H|: negative eigenvalues reflected, so that step lengths still follow the size of the curvature."""
    values, vectors = np.linalg.eigh(matrix)
    if values.size == 0 or values[0] >= 0.0:
        return matrix
    return (vectors * np.abs(values)) @ vectors.T


def _full_pattern(matrix: Array) -> sp.coo_matrix:
    """Return every entry, zeros included: the sparsity pattern must not depend on the values."""
    rows, columns = np.indices(matrix.shape)
    return sp.coo_matrix((matrix.ravel(), (rows.ravel(), columns.ravel())), shape=matrix.shape)


_RULES: Final = {
    bool: YES_NO,
    int: COUNT,
    float: Allowed("a positive number", lambda value: is_number(value) and value > 0),
}
"""What an option may be, by the type of its default."""


@dataclass(frozen=True)
class SolverOptions:
    """Tolerances and limits of a solve; rows have the scale of the problem (metres, radians).

    Raises:
        ProblemError: a tolerance or limit that is not positive.
    """

    violation: float = 1e-6
    """Largest violation of a row at a solution."""
    kkt: float = 1e-6
    """Largest relative stationarity and complementarity error of an OPTIMAL point."""
    decrease: float = 1e-10
    """Decrease in cost units, relative to 1 or the size of the cost where that is larger, below which a feasible point
    is ACCEPTABLE: of the model, or of each of some steps in a row."""
    iterations: int = 100
    seconds: float = float("inf")
    """Wall time; checked between iterations."""
    longest_step: float = float("inf")
    """Largest change of an unknown in one iteration, e.g. 0.5 rad where constraints turn quickly."""
    trust_region: bool = False
    """Whether the step is the best one within `longest_step`, not a longer one made shorter: each unknown goes as far
    as it may, where a single one that wants to go far would hold up all others."""
    max_stalled_iterations: int = 6
    """Iterations in which the violation falls by less than a tenth, before inconsistent rows end the solve."""
    penalty: float = 1.0
    """Initial penalty parameter of the merit function, by cost units; raised automatically."""

    def __post_init__(self) -> None:
        for field in fields(self):
            rule, value = _RULES[type(field.default)], getattr(self, field.name)
            if not rule.fits(value):
                raise ProblemError(f"option {field.name}: {shown(value)} given, expected {rule.expected}")
