"""Paths of several persons with common places: one problem for `lgp.sqp` made of one path problem for each person.

Where a thing is put down is one unknown of all persons, and all other unknowns are each person's own. What is minimised
is the mean cost of the persons, or the largest one: a bound t of all costs (epigraph form), with a small share of the
mean, without which persons who cost less than t would not be optimised at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import scipy.sparse as sp

from lgp.path.phases import Phases
from lgp.path.problem import PathProblem
from lgp.sqp.problem import Model
from reba.arrays import Array, Flags, Indices

MEAN_SHARE: Final = 0.02
"""Share of the mean in the objective where the largest cost is minimised."""
LEAST_WEIGHT: Final = 0.02
"""Least share of a person in the curvature where the largest cost is minimised, so that no step is unbounded."""


def common_variables(phases: Phases, names: Sequence[str]) -> Flags:
    """Return which variables of a sequence are places on tables, by their `names` (nz,): those are in common."""
    placed = {
        f"{number}.{switch.object_name}."
        for number, switch in enumerate(phases.switches)
        if switch.action.attaches_to == "table"
    }
    return np.array([name[: name.rindex(".") + 1] in placed for name in names], dtype=bool)


class CommonPlaces:
    """The problem of several persons.

    Unknowns: those of each person without the common variables, then the common ones, then t in cost units where the
    largest cost is minimised.

    Args:
        problems: of the persons: the same sequence, on the same slices.
        worst: whether the largest cost is minimised instead of the mean.
    """

    def __init__(self, problems: Sequence[PathProblem], *, worst: bool) -> None:
        self.problems, self.worst = tuple(problems), worst
        first = self.problems[0]
        self.cost_unit = first.cost_unit
        common = common_variables(first.phases, first.modes.names)
        own = first.n - int(common.sum())
        shared = own * len(self.problems) + np.arange(int(common.sum()))
        self.columns: list[Indices] = []
        for number, problem in enumerate(self.problems):
            columns = np.empty(problem.n, dtype=np.intp)
            is_common = np.concatenate([np.zeros(problem.n - len(common), dtype=bool), common])
            columns[~is_common] = own * number + np.arange(own)
            columns[is_common] = shared
            self.columns.append(columns)
        self.n = own * len(self.problems) + len(shared) + int(worst)
        self.lower, self.upper = np.full(self.n, -np.inf), np.full(self.n, np.inf)
        for problem, columns in zip(self.problems, self.columns, strict=True):
            self.lower[columns], self.upper[columns] = problem.lower, problem.upper
        self._patterns: tuple[_Stacked, _Stacked, _Summed] | None = None

    def join(self, points: Sequence[Array]) -> Array:
        """Return x (n,) of the points (n_m,) of all persons; the common places are those of the first."""
        x = np.zeros(self.n)
        for point, columns in reversed(list(zip(points, self.columns, strict=True))):
            x[columns] = point
        if self.worst:
            x[-1] = max(problem.evaluate(x[own])[0] for problem, own in zip(self.problems, self.columns, strict=True))
        return x

    def split(self, x: Array) -> list[Array]:
        """Return the point (n_m,) of each person."""
        return [x[columns] for columns in self.columns]

    def evaluate(self, x: Array) -> tuple[float, Array, Array]:
        """Return the objective, equalities and inequalities; the costs of persons minus t come last."""
        values = [problem.evaluate(point) for problem, point in zip(self.problems, self.split(x), strict=True)]
        costs = np.array([one[0] for one in values])
        equality, inequality = (np.concatenate([one[part] for one in values]) for part in (1, 2))
        if not self.worst:
            return float(costs.mean()), equality, inequality
        objective = (1.0 - MEAN_SHARE) * x[-1] + MEAN_SHARE * costs.mean()
        return float(objective), equality, np.concatenate([inequality, costs - x[-1]])

    def linearise(self, x: Array, y_eq: Array, y_in: Array) -> Model:
        """Return the convex model: those of all persons, weighted with their shares in the objective."""
        count, points = len(self.problems), self.split(x)
        weights = np.full(count, 1.0 / count)
        if self.worst:
            shares = y_in[-count:] if y_in[-count:].sum() > 0.0 else weights
            weights = np.maximum((1.0 - MEAN_SHARE) * shares + MEAN_SHARE / count, LEAST_WEIGHT)
        models, eq_at, in_at = [], 0, 0
        for problem, point, weight in zip(self.problems, points, weights, strict=True):
            rows, limits = len(problem.constraints.eq_rows), len(problem.constraints.in_rows)
            own = problem.linearise(point, y_eq[eq_at : eq_at + rows] / weight, y_in[in_at : in_at + limits] / weight)
            models.append(own)
            eq_at, in_at = eq_at + rows, in_at + limits
        if self._patterns is None:
            self._set_patterns(models)
        assert self._patterns is not None
        eq_rows, in_rows, curvature = self._patterns
        gradient, ineq = np.zeros(self.n), np.concatenate([model.ineq for model in models])
        share = MEAN_SHARE if self.worst else 1.0
        for model, columns in zip(models, self.columns, strict=True):
            gradient[columns] += share / count * model.gradient
        jacobians = [model.in_jac.data for model in models]
        if self.worst:
            gradient[-1] = 1.0 - MEAN_SHARE
            costs = np.array([p.evaluate(point)[0] for p, point in zip(self.problems, points, strict=True)])
            ineq = np.concatenate([ineq, costs - x[-1]])
            jacobians += [np.append(model.gradient, -1.0) for model in models]
        return Model(
            curvature.fill([weight * model.hessian.data for weight, model in zip(weights, models, strict=True)]),
            gradient,
            eq_rows.fill([model.eq_jac.data for model in models]),
            np.concatenate([model.eq for model in models]),
            in_rows.fill(jacobians),
            ineq,
        )

    def _set_patterns(self, models: Sequence[Model]) -> None:
        limits = [(model.in_jac.indptr, columns[model.in_jac.indices]) for model, columns in self._with(models)]
        if self.worst:
            limits += [(np.array([0, len(columns) + 1]), np.append(columns, self.n - 1)) for columns in self.columns]
        self._patterns = (
            _Stacked([(m.eq_jac.indptr, columns[m.eq_jac.indices]) for m, columns in self._with(models)], self.n),
            _Stacked(limits, self.n),
            _Summed([(m.hessian, columns) for m, columns in self._with(models)], self.n),
        )

    def _with(self, models: Sequence[Model]) -> list[tuple[Model, Indices]]:
        return list(zip(models, self.columns, strict=True))


class _Stacked:
    """Sparse rows of several matrices one below the other, (indptr, columns) each; columns rise in each row."""

    def __init__(self, parts: Sequence[tuple[Indices, Indices]], width: int) -> None:
        rows = np.concatenate([np.diff(indptr) for indptr, _ in parts])
        columns = np.concatenate([indices for _, indices in parts])
        order = sp.csr_matrix(
            (np.arange(len(columns)), (np.repeat(np.arange(len(rows)), rows), columns)), shape=(len(rows), width)
        )
        order.sort_indices()
        self._order = order.data
        self.matrix = sp.csr_matrix((np.zeros(len(columns)), order.indices, order.indptr), shape=order.shape)

    def fill(self, values: Sequence[Array]) -> sp.csr_matrix:
        """Return the matrix with the values of all parts, in their order; the next call overwrites it."""
        self.matrix.data[:] = np.concatenate(values)[self._order]
        return self.matrix


class _Summed:
    """The upper triangle of the sum of symmetric matrices, upper triangles (CSC) each, on some columns of n."""

    def __init__(self, parts: Sequence[tuple[sp.csc_matrix, Indices]], width: int) -> None:
        keys = []
        for matrix, columns in parts:
            i, j = columns[matrix.indices], columns[np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))]
            keys.append(np.maximum(i, j) * width + np.minimum(i, j))
        every, self._places = np.unique(np.concatenate(keys), return_inverse=True)
        indptr = np.searchsorted(every, np.arange(width + 1) * width).astype(np.int32)
        indices = (every % width).astype(np.int32)
        self.matrix = sp.csc_matrix((np.zeros(len(every)), indices, indptr), shape=(width, width))

    def fill(self, values: Sequence[Array]) -> sp.csc_matrix:
        """Return the sum with the values of all parts, in their order; the next call overwrites it."""
        self.matrix.data[:] = np.bincount(self._places, np.concatenate(values), len(self.matrix.data))
        return self.matrix
