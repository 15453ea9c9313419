"""Dual active-set method (Goldfarb & Idnani 1983): from a working set to that of the solution, one change at a time.

It starts from the solution of a working set whose multipliers have the right signs, adds the most violated constraint,
and drops those whose multipliers reach zero before. The cost only rises, so it ends where block exchanges cycle; nearly
dependent rows have similar multipliers by the regularisation of the KKT system. Changes since the last factorisation
border the system, as in QPSchur (Bartlett & Biegler 2006): each costs one solve with the present factor and a dense
system of their number.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lgp.sqp.kkt import KKT
from lgp.sqp.qp import QP
from reba.arrays import Array, Flags

BORDERS = 40
"""Changes since the last factorisation beyond which a new one is cheaper."""
VIOLATED = 1e-9
"""Violation of a row or bound that is added, relative to its limit."""
WRONG_SIGN = 1e-9
"""Negative multiplier, relative to the largest, whose constraint is dropped."""
DEPENDENT = 10.0
"""Response of a constraint to its own multiplier, in shifts of the system, below which it is linearly dependent."""
INCONSISTENT = 1e-6
"""Violation of a dependent constraint above the effect of the shift: it is inconsistent with the others."""
ROUNDING = 1e-11
"""Change of a multiplier, relative to the largest, below which it is rounding."""


class DualActiveSet:
    """The method on one QP whose values are in `kkt`.

    Args:
        kkt: factorised for the working set.
        qp: the QP, its cost times `scale` in `kkt`.
        rows: (m_i,) active rows.
        side: (n,) -1 or +1 for unknowns held at their lower or upper bound.
        solution: of the working set: unknowns (n,), and the multipliers of equalities (m_e,), rows (m_i,) and bounds
            (n,), negative at lower ones; of the scaled cost.

    Attributes:
        rows, side, point: of the working set reached.
        exchanged: number of constraints added and dropped.
    """

    def __init__(
        self,
        kkt: KKT,
        qp: QP,
        scale: float,
        rows: Flags,
        side: NDArray[np.int8],
        solution: tuple[Array, Array, Array, Array],
    ) -> None:
        self.kkt, self.qp, self.scale = kkt, qp, scale
        self.rows, self.side = rows.copy(), side.copy()
        x, y, z, z_box = solution
        self.x, self.y = x.copy(), y.copy()
        self.exchanged = 0
        self._sign = side.copy()  # of bounds that are active or entering
        self._n, self._m_e, self._m_i = kkt.sizes
        # Multipliers of rows, then of bounds: all count from 0 up.
        self._u = np.concatenate([np.where(rows, z, 0.0), z_box * side])
        self._fixed = qp.lb == qp.ub
        self._clear_borders()

    @property
    def point(self) -> Array:
        """Unknowns and multipliers (n + m_e + m_i,) reached."""
        return np.concatenate([self.x, self.y, self._u[: self._m_i]])

    def run(self, limit: int) -> bool:
        """Solve; False where rows are inconsistent or `limit` exchanges do not suffice.

        Raises:
            RuntimeError, LinAlgError: a working set cannot be factorised.
        """
        if not self._drop_wrong_signs(limit):
            return False
        while self.exchanged <= limit:
            entering = self._most_violated()
            if entering is None:
                self._store_working_set()
                return True
            if not self._add_most_violated(entering, limit):
                return False
        return False

    def _add_most_violated(self, entering: int, limit: int) -> bool:
        """Add a violated constraint to the working set, dropping those whose multipliers reach zero before."""
        normal, response = self._column(entering)
        multiplier = 0.0
        while self.exchanged <= limit:
            self.exchanged += 1
            step, shares = self._direction(normal, response)
            change = self._changes(entering, step, shares)
            free = -float(normal @ step)
            gap = self._violation(entering)
            independent = free > DEPENDENT * self.kkt.shift
            full = gap / (free + self.kkt.shift) if independent or gap < INCONSISTENT else np.inf
            blocked, length = self._blocking(change)
            length = min(length, full)
            if length == np.inf:
                return False
            multiplier += length
            self._advance(length * step, length * change)
            np.maximum(self._u, 0.0, out=self._u)
            if length == full:
                self._add_constraint(entering, normal, response, multiplier)
                return True
            if not self._drop_constraint(blocked):
                normal, response = self._column(entering)
        return False

    def _drop_wrong_signs(self, limit: int) -> bool:
        """Drop constraints with multipliers of the wrong sign, largest first; whether that took few steps."""
        for self.exchanged in range(min(limit, BORDERS)):
            worst = int(np.argmin(np.where(self._active, self._u, np.inf)))
            wrong = self._u[worst] if self._active[worst] else 0.0
            if not wrong < -WRONG_SIGN * float(np.abs(self._u).max()):
                self._u = np.maximum(self._u, 0.0)
                return True
            self._drop_constraint(worst)
            # The multiplier of a row, or the slope by an unknown, becomes zero.
            target = np.zeros(len(self._borders))
            target[-1] = -wrong if worst < self._m_i else wrong * self._sign[worst - self._m_i]
            shares = self._solve_borders(target)
            step = self._with_freed_unknowns(-self._responses[:, : len(target)] @ shares, shares)
            self._advance(step, self._changes(None, step, shares))
        return False

    def _clear_borders(self) -> None:
        """Start without borders from the factorised working set."""
        self._fixed_in_factor = self.side != 0
        size = sum(self.kkt.sizes)
        # Constraints added since, and dropped constraints of the factorised set.
        self._borders: list[int] = []
        self._freed = np.full(BORDERS + 1, -1)  # the unknown that a border sets free, if any
        self._normals, self._responses = np.zeros((size, BORDERS + 1)), np.zeros((size, BORDERS + 1))
        self._square = np.zeros((BORDERS + 1, BORDERS + 1))
        self._active = np.concatenate([self.rows, self._fixed_in_factor & ~self._fixed])
        self._in_base = self._active.copy()

    def _store_working_set(self) -> None:
        """Write the borders into the working set."""
        self.rows = self._active[: self._m_i].copy()
        self.side = np.where(self._active[self._m_i :] | self._fixed, self._sign, 0).astype(np.int8)

    def _refactor(self) -> None:
        """Factorise the working set as it is now."""
        self._store_working_set()
        self.kkt.refactor(self.side == 0, self.rows)
        self._clear_borders()

    def _most_violated(self) -> int | None:
        """Return the most violated constraint outside the working set, and store the violated side of an unknown."""
        over = np.concatenate([self.qp.G @ self.x - self.qp.h, np.maximum(self.qp.lb - self.x, self.x - self.qp.ub)])
        size = np.concatenate([np.abs(self.qp.h), np.abs(self.x)])
        over[self._active | np.concatenate([np.zeros(self._m_i, bool), self._fixed])] = -np.inf
        over[over <= VIOLATED * (1.0 + size)] = -np.inf
        worst = int(np.argmax(over)) if over.size else 0
        if not over.size or over[worst] == -np.inf:
            return None
        if worst >= self._m_i:
            at = worst - self._m_i
            self._sign[at] = 1 if self.x[at] > self.qp.ub[at] else -1
        return worst

    def _violation(self, constraint: int) -> float:
        if constraint < self._m_i:
            begin, end = self.qp.G.indptr[constraint : constraint + 2]
            value = self.qp.G.data[begin:end] @ self.x[self.qp.G.indices[begin:end]]
            return float(value - self.qp.h[constraint])
        at = constraint - self._m_i
        return float(self.x[at] - self.qp.ub[at] if self._sign[at] > 0 else self.qp.lb[at] - self.x[at])

    def _gradient(self, constraint: int) -> tuple[NDArray[np.integer], Array]:
        """Return the unknowns of a constraint and its slopes by them."""
        if constraint < self._m_i:
            begin, end = self.qp.G.indptr[constraint : constraint + 2]
            return self.qp.G.indices[begin:end], self.qp.G.data[begin:end]
        at = constraint - self._m_i
        return np.array([at]), np.array([float(self._sign[at])])

    def _column(self, constraint: int) -> tuple[Array, Array]:
        """Return the normal of a constraint in the system, and the response to it of the factorised part."""
        normal = np.zeros(sum(self.kkt.sizes))
        places, slopes = self._gradient(constraint)
        normal[places] = slopes
        return normal, self._solve(normal)

    def _solve(self, right: Array) -> Array:
        right = right.copy()
        right[: self._n][self._fixed_in_factor] = 0.0
        return self.kkt.solve_shifted(right)

    def _direction(self, normal: Array, response: Array) -> tuple[Array, Array]:
        """Return how unknowns and multipliers change per multiplier of the entering one, and those of borders."""
        count = len(self._borders)
        if not count:
            return -response, np.zeros(0)
        freed = self._freed[:count]
        by_freed = np.where(freed >= 0, normal[freed], 0.0)
        shares = self._solve_borders(self._normals[:, :count].T @ response - by_freed)
        return self._with_freed_unknowns(-response - self._responses[:, :count] @ shares, shares), shares

    def _solve_borders(self, target: Array) -> Array:
        """Solve the dense system of the borders."""
        return np.asarray(np.linalg.solve(self._square[: len(target), : len(target)], target), dtype=float)

    def _with_freed_unknowns(self, step: Array, shares: Array) -> Array:
        """Return a step of the factorised part with those of the unknowns set free."""
        freed = self._freed[: len(shares)]
        step[freed[freed >= 0]] = shares[freed >= 0]
        return step

    def _changes(self, entering: int | None, step: Array, shares: Array) -> Array:
        """Return the change of every multiplier of the working set, (m_i + n,)."""
        n, m_e, m_i = self._n, self._m_e, self._m_i
        z = np.where(self.rows, step[n + m_e :], 0.0)
        gradient = self.scale * self.qp.hessian_dot(step[:n]) + self.qp.transpose_product(step[n : n + m_e], z)
        if entering is not None:
            places, slopes = self._gradient(entering)
            gradient[places] += slopes
        change = np.concatenate([z, np.zeros(n)])
        for constraint, share in zip(self._borders, shares, strict=True):
            if not self._in_base[constraint]:
                places, slopes = self._gradient(constraint)
                gradient[places] += share * slopes
        change[m_i:][self._fixed_in_factor] = -(gradient * self._sign)[self._fixed_in_factor]
        for constraint, share in zip(self._borders, shares, strict=True):
            change[constraint] = 0.0 if self._in_base[constraint] else share
        return change

    def _blocking(self, change: Array) -> tuple[int, float]:
        """Return the first constraint whose multiplier falls to zero, and after what step."""
        size = float(np.abs(change[self._active]).max(initial=1.0))
        falls = self._active & (change < -ROUNDING * size)
        ratios = np.full(len(change), np.inf)
        ratios[falls] = self._u[falls] / -change[falls]
        first = int(np.argmin(ratios))
        return first, float(ratios[first])

    def _advance(self, step: Array, change: Array) -> None:
        self.x += step[: self._n]
        self.y += step[self._n : self._n + self._m_e]
        self._u = np.where(self._active, self._u + change, 0.0)

    def _add_constraint(self, constraint: int, normal: Array, response: Array, multiplier: float) -> None:
        self._active[constraint] = True
        self._u[constraint] = multiplier
        if self._in_base[constraint]:
            self._remove_border(constraint)  # a dropped row of the factorised set
        else:
            self._append_border(constraint, normal, response)

    def _drop_constraint(self, constraint: int) -> bool:
        """Drop a constraint; return whether the present factor is still used."""
        self._active[constraint] = False
        self._u[constraint] = 0.0
        if not self._in_base[constraint]:
            self._remove_border(constraint)
        else:
            normal = self._dropping_border(constraint)
            return self._append_border(constraint, normal, self._solve(normal))
        return True

    def _dropping_border(self, constraint: int) -> Array:
        """Return the border that drops a constraint of the factorised set.

        A row gets a slack; an unknown gets its column of the system back.
        """
        n, m_e = self._n, self._m_e
        if constraint < self._m_i:
            normal = np.zeros(sum(self.kkt.sizes))
            normal[n + m_e + constraint] = 1.0
            return normal
        unit = np.zeros(n)
        unit[constraint - self._m_i] = 1.0
        limits = np.where(self.rows, self.qp.G @ unit, 0.0)
        return np.concatenate([self.scale * self.qp.hessian_dot(unit), self.qp.A @ unit, limits])

    def _append_border(self, constraint: int, normal: Array, response: Array) -> bool:
        """Add a border; return whether the present factor is still used."""
        count, dropped = len(self._borders), bool(self._in_base[constraint])
        if count == BORDERS:
            self._refactor()
            return False
        self._borders.append(constraint)
        self._normals[:, count], self._responses[:, count] = normal, response
        self._freed[count] = constraint - self._m_i if dropped and constraint >= self._m_i else -1
        # C - B' K^-1 B of the borders is symmetric: a new one adds a row and the same column. C couples borders
        # with unknowns that other borders set free.
        across = -(self._normals[:, : count + 1].T @ response)
        freed = self._freed[: count + 1]
        across += np.where(freed >= 0, normal[freed], 0.0)
        if not dropped and constraint < self._m_i:
            across[count] -= self.kkt.shift
        if freed[count] >= 0:
            across[:count] += np.where(freed[:count] >= 0, 0.0, self._normals[freed[count], :count])
        self._square[count, : count + 1] = self._square[: count + 1, count] = across
        return True

    def _remove_border(self, constraint: int) -> None:
        at = self._borders.index(constraint)
        last = len(self._borders)
        del self._borders[at]
        self._freed[at : last - 1] = self._freed[at + 1 : last].copy()
        for matrix in (self._normals, self._responses, self._square):
            matrix[:, at : last - 1] = matrix[:, at + 1 : last].copy()
        self._square[at : last - 1] = self._square[at + 1 : last].copy()
