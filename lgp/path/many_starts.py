"""The keyframes of a sequence from many starts at once: its problem on the joints that act, for `lgp.sqp.many`.

Unknowns are, in each keyframe, the joints of the limbs that act in it (of a person all, for the posture counts), and
the variables of grasps and placements. All other joints follow: they move as the least acceleration through their own
keyframes has them. So every solution is a point of the sequence problem, and a start of `lgp.sqp.solver` close to its
minimum.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from lgp.kinematics.ik import least_squares
from lgp.path.costs import eliminate_slices
from lgp.path.ergonomics import PersonScore
from lgp.path.hessian import MAX_VIOLATION, PENALTY, admissible_shares
from lgp.path.problem import VARIABLE_CURVATURE, PathProblem
from lgp.search.time_limit import stop_if_time_is_up
from lgp.sqp.many import ManyModels, solve_many
from reba.arrays import Array, Flags, Indices

STARTS = 32
"""Random starts of a sequence, from a fixed seed; 10 to 60 % of them end in its best minimum."""
LARGE = 100
"""Unknowns and rows above which there are fewer starts, as the time of one grows with the cube of their number."""
RADII = (0.1, 0.6)
"""Share of the way from the initial configuration to a random one: from farther away fewer starts end in a minimum."""
PROJECTED = 0.02
"""[m, rad] Violation of a projected start above which it is given up."""
PROJECTIONS = 25
"""Least squares steps towards the constraints."""
ENDED = 1e-3
"""[m, rad] Violation of a minimum."""
AGREE = 1e-2
"""Relative difference of costs up to which two starts agree."""
DISTINCT = 1e-3
"""Relative difference of costs from which on two minima are distinct."""
NEAR_BEST = 0.02
"""Relative difference of costs, to the best minimum, up to which a path is solved from another one too."""
CHOSEN = 3
"""Minima kept at most."""


@dataclass(frozen=True)
class Minima:
    """Local minima of a sequence from many starts.

    Attributes:
        points: (M, N) the best one and distinct ones that cost little more, points of the sequence problem.
        agreed, starts: number of starts that agree with the best one, and of all.
    """

    points: Array
    agreed: int
    starts: int


@dataclass(frozen=True)
class _ScoredKeyframes:
    """The keyframes (k,) in which the posture of a person counts: those in which the person acts.

    Attributes:
        loads: what the person carries in them [kg], (k,).
    """

    score: PersonScore
    at: Indices
    loads: Array
    temperature: float | None

    @classmethod
    def of(cls, problem: PathProblem, number: int, acting: Sequence[Indices]) -> _ScoredKeyframes:
        """Return those of the person of a number, for the joints that are unknowns in each keyframe."""
        assert problem.ergonomics is not None
        score = problem.ergonomics.people[number]
        at = np.flatnonzero([np.isin(score.columns, joints).any() for joints in acting])
        return cls(score, at, problem.loads[at, number], problem.ergonomics.stages[problem.stage])

    def knots(self, q: Array) -> tuple[Array, Array]:
        """Return configurations (B k, nq) and loads (B k,) of these keyframes in (B, P, nq)."""
        return q[:, self.at].reshape(-1, q.shape[2]), np.tile(self.loads, len(q))


class ManyStarts:
    """The sequence problem `problem` on the joints that act.

    Args:
        count: random starts of a small problem; larger ones have fewer.
    """

    def __init__(self, problem: PathProblem, count: int = STARTS) -> None:
        self.problem, self._count = problem, count
        self.nq, knots = problem.world.nq, len(problem.knots)
        acting = self._acting()
        self.columns = np.concatenate(
            [*(at * self.nq + joints for at, joints in enumerate(acting)), np.arange(knots * self.nq, problem.n)]
        ).astype(np.intp)
        self.n = len(self.columns)
        self._place = np.full(problem.n, -1)
        self._place[self.columns] = np.arange(self.n)
        self.lower, self.upper = problem.lower[self.columns], problem.upper[self.columns]
        self._start = np.concatenate([np.tile(problem.initial_configuration, knots), np.zeros(problem.modes.size)])
        self._spread(acting)
        self._rows = [_Rows(rows.matrix, self._place) for rows in problem.constraints.row_blocks]
        self._blocks = [self._place[block] for block in problem.constraints.switch_columns()]
        people = () if problem.ergonomics is None else problem.ergonomics.people
        scored = [_ScoredKeyframes.of(problem, number, acting) for number in range(len(people))]
        self._score_elsewhere = problem.score_elsewhere + sum(
            one.score.lower_bound * float(np.delete(problem.rates, one.at).sum()) for one in scored
        )
        self._scored = [one for one in scored if len(one.at)]

    def _acting(self) -> list[Indices]:
        """Return the joints that are unknowns in each keyframe: of a person who acts all."""
        problem, world = self.problem, self.problem.world
        people = [set(world.columns(name).tolist()) for name in world.scene.humans]
        acting = [np.zeros(0, np.intp)] * len(problem.knots)
        for number in problem.constraints.enforced:
            at = int(np.searchsorted(problem.knots, problem.phases.keyframes[number]))
            joints = set(problem.constraints.limb(number).tolist())
            joints = joints.union(*(own for own in people if joints & own))
            acting[at] = np.union1d(acting[at], sorted(joints)).astype(np.intp)
        return acting

    def _spread(self, acting: list[Indices]) -> None:
        """Set how all unknowns of the sequence follow from those that act, and the cost of accelerations."""
        problem, nq = self.problem, self.nq
        self._expand = np.zeros((self.n, problem.n))
        self._expand[np.arange(self.n), self.columns] = 1.0
        self._quadratic = np.zeros((self.n, self.n))
        for joints, condensed in problem.groups:
            by_knots: dict[tuple[int, ...], list[int]] = {}
            for joint in joints.tolist():
                own = tuple(at for at, part in enumerate(acting) if joint in part)
                by_knots.setdefault(own, []).append(joint)
            for own, members in by_knots.items():
                if not own:
                    continue
                smaller = eliminate_slices(condensed.cost, np.array(own))
                for joint in members:
                    places = self._place[np.array(own) * nq + joint]
                    self._expand[places[:, None], np.arange(len(condensed.cost)) * nq + joint] = smaller.expand.T
                    self._quadratic[np.ix_(places, places)] = 2.0 * smaller.cost
        tail = np.arange(self.n - problem.modes.size, self.n)
        self._model_quadratic = self._quadratic.copy()
        self._model_quadratic[tail, tail] = VARIABLE_CURVATURE
        self._rest = self._start[self.columns]

    def full(self, u: Array) -> Array:
        """Return the points (B, N) of the sequence problem for unknowns (B, n)."""
        return (u - self._rest) @ self._expand + self._start

    def _split(self, u: Array) -> tuple[Array, Array]:
        full, tail = self.full(u), len(self.problem.knots) * self.nq
        return full[:, :tail].reshape(len(u), -1, self.nq), full[:, tail:]

    def evaluate(self, u: Array) -> tuple[Array, Array, Array]:
        """Return costs (B,), equalities and inequalities at u (B, n)."""
        q, z = self._split(u)
        values = self.problem.constraints.evaluate_many(q, z)
        away = u - self._rest
        cost = 0.5 * np.einsum("bi,bi->b", away, away @ self._quadratic) + self._score_elsewhere
        for one in self._scored:
            scores = one.score.value(*one.knots(q), one.temperature)
            cost += scores.reshape(len(u), -1) @ self.problem.rates[one.at]
        if self.problem.terms:
            own = self.problem.terms.value(q.reshape(-1, self.nq)).reshape(len(u), -1)
            cost += own @ self.problem.term_rates
        return cost, values.equality[:, self._rows[0].kept], values.inequality[:, self._rows[1].kept]

    def linearise(self, u: Array, y_eq: Array, y_in: Array) -> ManyModels:
        """Return the convex models at u (B, n)."""
        stop_if_time_is_up()
        q, z = self._split(u)
        problem, constraints = self.problem, self.problem.constraints
        values = constraints.evaluate_many(q, z)
        away = u - self._rest
        gradient = away @ self._quadratic
        hessian = np.broadcast_to(self._model_quadratic, (len(u), self.n, self.n)).copy()
        every = np.zeros(values.equality.shape)
        every[:, self._rows[0].kept] = y_eq
        negative = []
        for columns, block in zip(self._blocks, constraints.switch_hessians(values, q, z, every), strict=True):
            spectrum, vectors = np.linalg.eigh(block)
            hessian[:, columns[:, None], columns] += _scaled(vectors, np.maximum(spectrum, 0.0))
            negative.append(vectors * np.sqrt(np.maximum(-spectrum, 0.0))[:, None])
        limits = np.zeros(values.inequality.shape)
        limits[:, self._rows[1].kept] = y_in
        for columns, block in constraints.leg_hessians(q, limits):
            own = self._place[columns]
            if (own >= 0).all():
                hessian[:, own[:, None], own] += block
        for one in self._scored:
            _, slope, parts = one.score.quadratic_model(*one.knots(q), one.temperature)
            for number, at in enumerate(one.at):
                pick = slice(number, None, len(one.at))
                own = self._place[at * self.nq + one.score.columns]
                gradient[:, own] += problem.rates[at] * slope[pick]
                for part, block in zip(one.score.parts, parts, strict=True):
                    hessian[:, own[part][:, None], own[part]] += problem.rates[at] * block[pick]
        if problem.terms:
            self._add_terms(q, gradient, hessian)
        eq, ineq = (
            rows.dense(blocks, len(u), self.n)
            for rows, blocks in zip(self._rows, (values.eq_blocks, values.in_blocks), strict=True)
        )
        equality = values.equality[:, self._rows[0].kept]
        near = np.flatnonzero(np.abs(equality).max(axis=1, initial=0.0) <= MAX_VIOLATION)
        if len(near) and negative:
            self._bend(hessian, near, eq, negative)
        return ManyModels(
            hessian,
            gradient,
            equality,
            eq,
            values.inequality[:, self._rows[1].kept],
            ineq,
        )

    def _add_terms(self, q: Array, gradient: Array, hessian: Array) -> None:
        """Add one's own cost terms in the keyframes (B, P, nq); joints that do not act follow those that do."""
        terms, count = self.problem.terms, len(q)
        _, slope, curvature = (part.reshape(count, -1, *part.shape[1:])
                               for part in terms.quadratic_model(q.reshape(-1, self.nq)))  # fmt: skip
        for at, rate in enumerate(self.problem.term_rates):
            expand = self._expand[:, at * self.nq + terms.columns]
            gradient += rate * slope[:, at] @ expand.T
            hessian += rate * expand @ curvature[:, at] @ expand.T

    def _bend(self, hessian: Array, near: Indices, jacobian: Array, negative: list[Array]) -> None:
        """Subtract from some Hessians the negative curvature that they and the rows outweigh (`lgp.path.hessian`)."""
        matrix, rows = hessian[near], jacobian[near]
        scale = np.einsum("bii->bi", matrix).max(axis=1)
        matrix += (PENALTY * scale)[:, None, None] * (np.swapaxes(rows, 1, 2) @ rows)
        np.einsum("bii->bi", matrix)[:] += (1e-9 * scale)[:, None]
        widths = np.cumsum([0, *(part.shape[2] for part in negative)])
        factor = np.zeros((len(near), self.n, widths[-1]))
        for columns, part, begin, end in zip(self._blocks, negative, widths, widths[1:], strict=False):
            factor[:, columns, begin:end] = part[near]
        shares = admissible_shares(np.swapaxes(factor, 1, 2) @ np.linalg.solve(matrix, factor))
        hessian[near] -= _scaled(factor, shares)

    def project(self, u: Array) -> tuple[Array, Array]:
        """Return the projections (B, n) of starts to the constraints, and their violations (B,)."""

        def residuals(x: Array, which: Indices) -> tuple[Array, Array]:
            values = self.problem.constraints.evaluate_many(*self._split(x))
            equal, limits = (
                rows.dense(blocks, len(x), self.n)
                for rows, blocks in zip(self._rows, (values.eq_blocks, values.in_blocks), strict=True)
            )
            excess = values.inequality[:, self._rows[1].kept]
            violated = excess > 0.0
            value = np.concatenate([values.equality[:, self._rows[0].kept], np.where(violated, excess, 0.0)], axis=1)
            return value, np.concatenate([equal, limits * violated[:, :, None]], axis=1)

        return least_squares(residuals, u, self.lower, self.upper, 1e-3, PROJECTIONS)

    def minima(self, guesses: Array, seed: int = 0) -> Minima:
        """Return the minima from guesses (G, N), points of the sequence problem, and from random starts."""
        u = np.concatenate([guesses, self.starts(seed)])[:, self.columns]
        projected, violation = self.project(u)
        good = np.flatnonzero(violation <= PROJECTED)
        cost = np.full(len(u), np.inf)
        points = np.zeros_like(u)
        if len(good):
            results = solve_many(self, projected[good])
            points[good] = results.x
            cost[good] = np.where(results.violation <= ENDED, results.cost, np.inf)
        best = float(cost.min(initial=np.inf))
        limit = best + NEAR_BEST * max(1.0, abs(best))
        chosen: list[int] = []
        for number in np.argsort(cost, kind="stable").tolist():
            if cost[number] > limit or len(chosen) == CHOSEN or not np.isfinite(best):
                break
            if not chosen or cost[number] - cost[chosen[-1]] > DISTINCT * max(1.0, abs(best)):
                chosen.append(number)
        agreed = np.count_nonzero(cost <= best + AGREE * max(1.0, abs(best))) if chosen else 0
        return Minima(self.full(points[chosen]), int(agreed), len(u))

    def starts(self, seed: int) -> Array:
        """Return random starts (S, N), points of the sequence problem, fewer of larger problems."""
        problem, knots, phase_of = self.problem, len(self.problem.knots), self.problem.phases.phase_of
        size = self.n + sum(int(rows.kept.sum()) for rows in self._rows)
        count = int(self._count * min(1.0, (LARGE / size) ** 2))
        rng = np.random.default_rng(seed)
        q = np.tile(problem.initial_configuration, (count, knots, 1))
        q += rng.uniform(*RADII, (count, 1, 1)) * (rng.uniform(problem.world.lower, problem.world.upper, q.shape) - q)
        return np.reshape([problem.join(one, problem.modes.guess(one[phase_of])) for one in q], (count, problem.n))


class _Rows:
    """The rows of a sparse Jacobian that depend on the unknowns of `place` alone (-1 where another joint)."""

    def __init__(self, matrix: sp.csr_matrix, place: Indices) -> None:
        indptr, indices = np.asarray(matrix.indptr), place[np.asarray(matrix.indices)]
        rows = np.repeat(np.arange(len(indptr) - 1), np.diff(indptr))
        missing = np.zeros(len(indptr) - 1, bool)
        missing[rows[indices < 0]] = True
        self.kept: Flags = ~missing
        number = np.cumsum(self.kept) - 1
        self._entries = np.flatnonzero(self.kept[rows])
        self._row, self._column = number[rows[self._entries]], indices[self._entries]

    def dense(self, blocks: list[Array], count: int, width: int) -> Array:
        """Return the rows (B, m, n) of Jacobian blocks, (B, ...) each, for `count` B and `width` n."""
        out = np.zeros((count, int(self.kept.sum()), width))
        if blocks:
            data = np.concatenate([block.reshape(count, -1) for block in blocks], axis=1)
            out[:, self._row, self._column] = data[:, self._entries]
        return out


def _scaled(vectors: Array, weights: Array) -> Array:
    """Return V diag(w) V' (B, n, n) for V (B, n, m) and w (B, m)."""
    return np.asarray((vectors * weights[:, None]) @ np.swapaxes(vectors, 1, 2))
