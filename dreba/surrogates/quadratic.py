"""`QuadraticModel`: weighted sum of one second-order polynomial for each angle (Busch et al. 2018, section II-C)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np

from dreba.domain import Bins, Domain, domain_of
from dreba.errors import ModelError
from dreba.surrogates.base import Surrogate
from dreba.surrogates.registry import register
from dreba.surrogates.task_factors import OMEGA_LOAD, PAYLOADS, Payload, TaskFactors, delta_payload
from dreba.surrogates.validation import check_sample_count
from reba.arrays import Array, Flags
from reba.checks import NOT_NEGATIVE, POSITIVE, YES_NO, Allowed, one_of
from reba.posture.columns import ANGLES, COLUMNS, MIRRORED


@register
class QuadraticModel(Surrogate):
    """dREBA(q) = delta_payload + sum_i w_i Q_i(q_i) + b (equation 1).

    Each polynomial Q_i is fitted to the part table of its angle, the weights w_i >= 0 to the true scores of poses. Left
    and right share the weight of an angle, and both sides add up.

    Args:
        domain: name, TOML file or `Domain` whose limits and rules define the part tables.
        free: fit the polynomials of all angles together to the true scores instead (w_i = 1).
        intercept: whether there is a constant b. Equation (1) has none, the authors' published code has (-0.206).
        curvature: "nonnegative": convex polynomials, and so a convex model; "any": plain least squares.
        payload: "tree" (equation 3) or "linear" (equation 4).
        omega_load: [kg] load that costs 1 point in the linear payload.
        class_power: the squared error of a pose of REBA class c has the weight c ** -class_power; 0 for plain least
            squares. More weight on low classes (0.5 or 1) moves errors per class towards the published ones.
        joints: names of the columns; None for `reba.COLUMNS`.

    Attributes:
        polynomials_: (d, 3) coefficients of Q_i: 1, q, q^2, q in degrees.
        weights_: (d,) w_i.
        intercept_: b.
        coupling_weight_: weight of the coupling points of the worse hand; 0 if the poses had good coupling only.
            Activity points are added with weight 1, as in REBA.

    Example:
        >>> import dreba
        >>> poses = dreba.sample(2000, rng=1)
        >>> model = dreba.QuadraticModel().fit(poses.angles, poses.reba)
        >>> bool(model.value(poses.angles[0]) == model.predict(poses.angles[:1])[0])
        True
    """

    kind: ClassVar[str] = "quadratic"
    mirror: ClassVar[bool] = True
    any_columns: ClassVar[bool] = True
    learned: ClassVar[dict[str, int]] = {"polynomials_": 2, "weights_": 1, "intercept_": 0, "coupling_weight_": 0}

    allowed: ClassVar[dict[str, Allowed]] = {
        "free": YES_NO,
        "intercept": YES_NO,
        "curvature": one_of("nonnegative", "any"),
        "payload": one_of(*PAYLOADS),
        "omega_load": POSITIVE,
        "class_power": NOT_NEGATIVE,
    }

    polynomials_: Array
    weights_: Array
    intercept_: float
    coupling_weight_: float

    def __init__(
        self,
        *,
        domain: str | Domain = "human",
        free: bool = False,
        intercept: bool = True,
        curvature: Literal["nonnegative", "any"] = "nonnegative",
        payload: Payload = "tree",
        omega_load: float = OMEGA_LOAD,
        class_power: float = 0.0,
        joints: Sequence[str] | None = None,
    ) -> None:
        self.domain = domain
        self.free = free
        self.intercept = intercept
        self.curvature = curvature
        self.payload = payload
        self.omega_load = omega_load
        self.class_power = class_power
        self.joints = joints

    @property
    def convex(self) -> bool:
        """Whether no curvature is negative; before a fit, whether the constructor excludes negative ones."""
        if hasattr(self, "twice_curvature_"):
            return bool((self.twice_curvature_ >= 0).all())
        return self.curvature == "nonnegative"

    def _fit(self, poses: Array, scores: Array, weights: Array, factors: TaskFactors) -> None:
        self._check_columns()
        groups = _groups(self.joints_)
        targets = scores - delta_payload(factors.load, self.payload, self.omega_load) - factors.activity
        if self.class_power:
            weights = weights * np.maximum(scores, 1.0) ** -self.class_power
        features, bounded = self._free_features(poses, groups) if self.free else self._features(poses, groups)
        worse = np.broadcast_to(np.maximum(*factors.coupling), len(scores)).astype(float)
        columns = np.column_stack([features, worse, np.full(len(scores), float(self.intercept))])
        unbounded = np.append(~bounded, [False, True])
        check_sample_count(len(scores))
        solution = solve(build_qp(columns, targets, weights, unbounded))
        self.coupling_weight_ = float(solution[-2])
        self.intercept_ = float(solution[-1]) if self.intercept else 0.0
        self._set_fitted(solution[:-2], groups)
        self._set_coefficients()

    def _check_columns(self) -> None:
        unknown = [joint for joint in self.joints_ if joint not in COLUMNS]
        if unknown and not self.free:
            raise ModelError(
                f"column {unknown[0]!r} has no part table; name columns of reba.COLUMNS by joints=, or use free=True"
            )

    def _features(self, poses: Array, groups: list[list[int]]) -> tuple[Array, Flags]:
        """Return features (n, g), the sum of Q_i over the columns of each group, all with weights >= 0."""
        self.polynomials_ = part_polynomials(domain_of(self.domain), self.joints_, self.curvature == "nonnegative")
        c0, c1, c2 = self.polynomials_.T
        values = c0 + poses * (c1 + c2 * poses)
        features = np.stack([values[:, group].sum(axis=1) for group in groups], axis=1)
        return features, np.ones(len(groups), bool)

    def _free_features(self, poses: Array, groups: list[list[int]]) -> tuple[Array, Flags]:
        """Return features (n, 2g), angle and squared angle of each group, and which coefficients are >= 0."""
        linear = np.stack([poses[:, group].sum(axis=1) for group in groups], axis=1)
        # A symmetric body has no linear term in angles that change sign in a mirror.
        linear[:, [self.joints_[group[0]] in MIRRORED for group in groups]] = 0.0
        squared = np.stack([(poses[:, group] ** 2).sum(axis=1) for group in groups], axis=1)
        bounded = np.repeat([False, self.curvature == "nonnegative"], len(groups))
        return np.hstack([linear, squared]), bounded

    def _set_fitted(self, solution: Array, groups: list[list[int]]) -> None:
        """Set the learned arrays of the columns from the coefficients of the groups."""
        group_of = np.empty(len(self.joints_), int)
        for index, group in enumerate(groups):
            group_of[group] = index
        if self.free:
            self.weights_ = np.ones(len(self.joints_))
            linear, squared = solution[: len(groups)][group_of], solution[len(groups) :][group_of]
            self.polynomials_ = np.column_stack([np.zeros(len(group_of)), linear, squared])
        else:
            self.weights_ = solution[group_of]

    def _set_coefficients(self) -> None:
        """Set constant, linear and curvature coefficients of evaluation."""
        c0, c1, c2 = (self.weights_[:, None] * self.polynomials_).T
        self.constant_ = float(c0.sum() + self.intercept_)
        self.linear_, self.twice_curvature_ = np.ascontiguousarray(c1), np.ascontiguousarray(2.0 * c2)

    def _restore(self, state: dict[str, Any]) -> None:
        super()._restore(state)
        d = len(self.joints_)
        if self.polynomials_.shape != (d, 3) or self.weights_.shape != (d,):
            raise ModelError(f"polynomials_ or weights_ do not fit {d} joints; the file is damaged")
        if (self.weights_ < 0).any():
            raise ModelError("weights_ has a negative weight; expected 0 or more; the file is damaged")
        self._set_coefficients()

    def _factor_points(self, factors: TaskFactors) -> Any:
        """Return the points of load, coupling and activity, a float or (n,)."""
        points = delta_payload(factors.load, self.payload, self.omega_load) + np.asarray(factors.activity, np.float64)
        return points + self.coupling_weight_ * np.maximum(*(np.asarray(side, np.float64) for side in factors.coupling))

    def _value_gradient(self, poses: Array, factors: TaskFactors) -> tuple[Array, Array]:
        # value = constant + sum_i q_i (gradient_i + linear_i) / 2, with the gradient of equation (2)
        gradient = poses * self.twice_curvature_
        gradient += self.linear_
        value = np.vecdot(poses, gradient)
        value += poses @ self.linear_
        value *= 0.5
        value += self.constant_
        if not factors.is_default:
            value += self._factor_points(factors)
        return value, gradient

    def _hessian(self, poses: Array, factors: TaskFactors) -> Array:
        return np.broadcast_to(np.diag(self.twice_curvature_), (len(poses), *(2 * (len(self.joints_),)))).copy()

    def _gauss_newton(self, poses: Array, factors: TaskFactors) -> Array:
        factor = np.diag(np.sqrt(np.maximum(self.twice_curvature_, 0.0)))
        return np.broadcast_to(factor, (len(poses), *factor.shape)).copy()

    def _payload(self) -> dict[str, Any]:
        omega = self.omega_load if self.payload == "linear" else None
        return {"form": self.payload, "omega_load": omega, "coupling": self.coupling_weight_, "activity": 1.0}


def _groups(joints: tuple[str, ...]) -> list[list[int]]:
    """Return groups of column indices that share a weight: both sides of an angle."""
    name_of = {column: angle.name for angle in ANGLES for column in angle.columns}
    groups: dict[str, list[int]] = {}
    for index, joint in enumerate(joints):
        groups.setdefault(name_of.get(joint, joint), []).append(index)
    return list(groups.values())


_SCALE = 100.0
"""[deg] Unit of angles in the normal equations, which keeps their powers near 1."""


def fit_polynomial(bins: Bins, convex: bool = True) -> Array:
    """Return (c0, c1, c2) of the least-squares polynomial c0 + c1 q + c2 q^2 of a step function, q [deg].

    The squared error is integrated exactly over the range of the angle. If c2 >= 0 is required (`convex`) and c2 < 0,
    the best convex parabola is the least-squares line.

    Example:
        >>> fit_polynomial(Bins((-30.0, -10.0, 10.0, 30.0), (1, 0, 1))).round(4).tolist()
        [0.2963, 0.0, 0.0012]
    """
    edges = np.array(bins.edges) / _SCALE
    points = np.array(bins.points, np.float64)
    if edges[0] == edges[-1]:
        return np.array([points[0], 0.0, 0.0])
    moments = np.stack([np.diff(edges ** (power + 1)) / (power + 1) for power in range(5)])
    size = 3
    gram = np.array([[moments[i + j].sum() for j in range(size)] for i in range(size)])
    target = moments[:size] @ points
    coefficients = np.linalg.solve(gram, target)
    if convex and coefficients[2] < 0:
        coefficients = np.append(np.linalg.solve(gram[:2, :2], target[:2]), 0.0)
    return np.asarray(coefficients / _SCALE ** np.arange(size), np.float64)


def part_polynomials(domain: Domain, joints: tuple[str, ...], convex: bool = True) -> Array:
    """Return coefficients (d, 3) of the polynomials of each column, fitted to its points above the lowest.

    The lowest points of all columns are a constant, which belongs to the intercept: a neutral posture then costs about
    the intercept, whatever the weights.
    """
    steps = [domain.bins_of(joint) for joint in joints]
    lowered = [Bins(bins.edges, tuple(points - min(bins.points) for points in bins.points)) for bins in steps]
    return np.array([fit_polynomial(bins, convex) for bins in lowered])


_RIDGE = 1e-8
"""Ridge of the QP, whose features have root mean square 1; it makes the optimum unique."""
_CORRECTIONS = 20
"""Maximum number of active-set corrections after the interior point solver: more than the sign changes it leaves."""


@dataclass(frozen=True)
class BoundedQP:
    """Bounded least squares of features (n, k) and targets (n,) as a QP: min 1/2 w'Pw + q'w subject to w >= lower.

    Attributes:
        P: (k, k), features' S features / sum(S) with the sample weights S, plus a ridge.
        q: (k,) -features' S targets / sum(S).
        lower: (k,), -inf where a weight is free.
        scale: (k,) root mean square of each feature, by which P and q are divided.
    """

    P: Array
    q: Array
    lower: Array
    scale: Array


def build_qp(features: Array, targets: Array, sample_weight: Array, free: Flags) -> BoundedQP:
    """Return the QP of features (n, k), targets (n,) and sample weights (n,); `free` (k,) weights have no bound."""
    share = sample_weight / sample_weight.sum()
    scale = np.sqrt(share @ features**2)
    scale = np.where(scale > 0, scale, 1.0)
    scaled = features / scale
    weighted = scaled * share[:, None]
    # With the ridge, features that are constant or equal get the smallest weights instead of arbitrary ones.
    program = weighted.T @ scaled + _RIDGE * np.eye(features.shape[1])
    return BoundedQP(program, -weighted.T @ targets, np.where(free, -np.inf, 0.0), scale)


def solve(program: BoundedQP) -> Array:
    """Return the optimal weights (k,); ModelError unless the solution satisfies the optimality conditions."""
    from qpsolvers import solve_qp
    from scipy.sparse import csc_matrix

    solution = solve_qp(csc_matrix(program.P), program.q, lb=program.lower, solver="clarabel")
    if solution is None:
        raise ModelError("the QP of the weights has no solution: the poses do not determine them; give more poses")
    weights = _polished(program, np.maximum(solution, program.lower))
    if residual(program, weights) > 1e-6 * max(1.0, float(np.abs(program.q).max())):
        raise ModelError("the weights do not satisfy the optimality conditions; give poses that vary more")
    # A feature that is zero in all poses gets weight 0; its diagonal is the ridge alone.
    return np.where(np.diag(program.P) > 2 * _RIDGE, weights / program.scale, 0.0)


def _polished(program: BoundedQP, scaled: Array) -> Array:
    """Return the exact optimum near an interior point solution (k,), by a primal-dual active set method.

    An interior point solution is slightly off the bounds. It gives the first active set; the free weights then solve a
    linear system, and the active set is corrected until the optimality conditions are satisfied. The solution of the
    smallest residual is returned.
    """
    bounded = np.isfinite(program.lower)
    slope = program.P @ scaled + program.q
    inside = ~bounded | (scaled > slope)
    best = scaled
    for _ in range(_CORRECTIONS):
        exact = np.zeros_like(scaled)
        exact[inside] = np.linalg.solve(program.P[np.ix_(inside, inside)], -program.q[inside])
        if residual(program, exact) < residual(program, best):
            best = exact
        wrong = bounded & np.where(inside, exact < 0, program.P @ exact + program.q < 0)
        if not wrong.any():
            break
        inside = inside ^ wrong
    return best


def residual(program: BoundedQP, scaled: Array) -> float:
    """Return the largest violation of the optimality conditions by scaled weights (k,): 0 at the optimum."""
    slope = program.P @ scaled + program.q
    bounded = np.isfinite(program.lower)
    return float(np.abs(np.where(bounded, np.minimum(scaled, slope), slope)).max())
