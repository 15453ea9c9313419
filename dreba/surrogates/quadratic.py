"""The paper's model: a weighted sum of one second-order polynomial per angle (Busch et al. 2018, section II-C)."""

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
from dreba.surrogates.validation import NOT_NEGATIVE, POSITIVE, YES_NO, Allowed, one_of
from reba.arrays import Array, Flags
from reba.posture.columns import ANGLES, COLUMNS

_SIGNED = ("trunk_side_bend", "trunk_twist", "neck_side_bend", "neck_twist")
"""Midline angles whose sign changes in a mirror: a symmetric body has no linear term in them."""


@register
class QuadraticModel(Surrogate):
    """dREBA(q) = delta_payload + sum_i w_i Q_i(q_i) + b (equation 1).

    The polynomials Q_i are fitted to the part tables, each angle for itself; the weights w_i >= 0 to the true scores of
    poses. An angle of both sides has one weight, so left and right are alike, and both sides add up.

    Args:
        domain: name, TOML file or record whose limits and rules give the part tables.
        free: fit the polynomials of all angles together to the true scores instead (w_i = 1).
        intercept: whether there is a constant b. Equation (1) has none, the authors' published code has (-0.206).
        curvature: "nonnegative": polynomials are kept convex, so the model is; "any": plain least squares.
        payload: "tree" (equation 3) or "linear" (equation 4).
        omega_load: [kg] of the linear payload.
        class_power: squared errors of a pose of REBA class c weigh c ** -class_power; 0 for plain least squares. More
            weight on low classes (0.5 or 1) moves errors per class towards the published ones.
        joints: names of the columns; None for `reba.COLUMNS`.

    Attributes:
        polynomials_: (d, 3) coefficients of Q_i: 1, q, q^2, q in degrees.
        weights_: (d,) w_i.
        intercept_: b.
        coupling_weight_: per coupling point of the worse hand; 0 where the poses had no coupling. Activity points are
            added as they are, which is exact.

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
        """Whether no curvature is negative; before a fit, whether none can become so."""
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
        if len(scores) < 2:
            raise ModelError(f"{len(scores)} sample is too few poses to fit anything; give 1000 or more")
        found = solve(build_qp(columns, targets, weights, unbounded))
        self.coupling_weight_ = float(found[-2])
        self.intercept_ = float(found[-1]) if self.intercept else 0.0
        self._take(found[:-2], groups)
        self._fold()

    def _check_columns(self) -> None:
        unknown = [joint for joint in self.joints_ if joint not in COLUMNS]
        if unknown and not self.free:
            raise ModelError(
                f"column {unknown[0]!r} has no part table; name the columns by joints=, or fit with free=True"
            )

    def _features(self, poses: Array, groups: list[list[int]]) -> tuple[Array, Flags]:
        """Return the sum of Q_i over the columns of each group (n, g); their weights must not be negative."""
        self.polynomials_ = part_polynomials(domain_of(self.domain), self.joints_, self.curvature == "nonnegative")
        c0, c1, c2 = self.polynomials_.T
        values = c0 + poses * (c1 + c2 * poses)
        features = np.stack([values[:, group].sum(axis=1) for group in groups], axis=1)
        return features, np.ones(len(groups), bool)

    def _free_features(self, poses: Array, groups: list[list[int]]) -> tuple[Array, Flags]:
        """Return angle and squared angle of each group (n, 2g), and which coefficients must not be negative."""
        linear = np.stack([poses[:, group].sum(axis=1) for group in groups], axis=1)
        linear[:, [self.joints_[group[0]] in _SIGNED for group in groups]] = 0.0
        squared = np.stack([(poses[:, group] ** 2).sum(axis=1) for group in groups], axis=1)
        bounded = np.repeat([False, self.curvature == "nonnegative"], len(groups))
        return np.hstack([linear, squared]), bounded

    def _take(self, found: Array, groups: list[list[int]]) -> None:
        """Spread what was found per group over its columns."""
        group_of = np.empty(len(self.joints_), int)
        for index, group in enumerate(groups):
            group_of[group] = index
        if self.free:
            self.weights_ = np.ones(len(self.joints_))
            linear, squared = found[: len(groups)][group_of], found[len(groups) :][group_of]
            self.polynomials_ = np.column_stack([np.zeros(len(group_of)), linear, squared])
        else:
            self.weights_ = found[group_of]

    def _fold(self) -> None:
        """Keep one constant, one linear and one curvature vector for evaluation."""
        c0, c1, c2 = (self.weights_[:, None] * self.polynomials_).T
        self.constant_ = float(c0.sum() + self.intercept_)
        self.linear_, self.twice_curvature_ = np.ascontiguousarray(c1), np.ascontiguousarray(2.0 * c2)

    def _restore(self, state: dict[str, Any]) -> None:
        super()._restore(state)
        d = len(self.joints_)
        if self.polynomials_.shape != (d, 3) or self.weights_.shape != (d,):
            raise ModelError(f"polynomials_ or weights_ do not fit {d} joints; the file is damaged")
        if (self.weights_ < 0).any():
            raise ModelError("weights_ holds a negative weight; the file is damaged")
        self._fold()

    def _extra(self, factors: TaskFactors) -> Any:
        """Return what load, coupling and activity add, a float or (n,)."""
        extra = delta_payload(factors.load, self.payload, self.omega_load) + np.asarray(factors.activity, np.float64)
        return extra + self.coupling_weight_ * np.maximum(*(np.asarray(side, np.float64) for side in factors.coupling))

    def _value_gradient(self, poses: Array, factors: TaskFactors) -> tuple[Array, Array]:
        # The value is constant + sum_i q_i (slope_i + linear_i) / 2, so one product serves both (equation 2).
        gradient = poses * self.twice_curvature_
        gradient += self.linear_
        value = np.vecdot(poses, gradient)
        value += poses @ self.linear_
        value *= 0.5
        value += self.constant_
        if not factors.is_default:
            value += self._extra(factors)
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
    """Return the indices of columns that share a weight: both sides of an angle."""
    name_of = {column: angle.name for angle in ANGLES for column in angle.columns}
    groups: dict[str, list[int]] = {}
    for index, joint in enumerate(joints):
        groups.setdefault(name_of.get(joint, joint), []).append(index)
    return list(groups.values())


_SCALE = 100.0
"""[deg] Unit in which the normal equations are solved, so that powers of an angle stay near 1."""


def fit_polynomial(bins: Bins, convex: bool = True) -> Array:
    """Return (c0, c1, c2) of the polynomial c0 + c1 q + c2 q^2 nearest to a step function, q in degrees.

    Least squares over the whole range of the angle, every degree counting the same; the integrals are exact. With
    `convex` the curvature c2 is kept from being negative, where the best parabola is the best line.

    Args:
        bins: k + 1 edges [deg] and the k points between them.
        convex: whether c2 must not be negative.

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
    found = np.linalg.solve(gram, target)
    if convex and found[2] < 0:
        found = np.append(np.linalg.solve(gram[:2, :2], target[:2]), 0.0)
    return np.asarray(found / _SCALE ** np.arange(size), np.float64)


def part_polynomials(domain: Domain, joints: tuple[str, ...], convex: bool = True) -> Array:
    """Return (d, 3) coefficients, one row per column, for the points above the lowest that the column can get.

    Leaving out the lowest score moves a constant from the polynomials to the model's intercept: a posture at rest then
    costs about the intercept, and a model without one is not tied to it by its weights.
    """
    steps = [domain.bins_of(joint) for joint in joints]
    lowered = [Bins(bins.edges, tuple(points - min(bins.points) for points in bins.points)) for bins in steps]
    return np.array([fit_polynomial(bins, convex) for bins in lowered])


_TRACE = 1e-8
"""Added to the diagonal of the program, whose features have size 1."""
_CORRECTIONS = 20
"""Exchanges between weights on and off their bounds after the solver."""


@dataclass(frozen=True)
class LeastSquares:
    """min 1/2 w'Pw + q'w with w >= lower: the squared error of features (n, k) against targets (n,), written as a QP.

    Attributes:
        P: (k, k), features' S features / sum(S) with the sample weights S, plus a trace for features that coincide.
        q: (k,).
        lower: (k,), -inf where a weight is free.
        scale: (k,) size of each feature, by which P and q are divided.
    """

    P: Array
    q: Array
    lower: Array
    scale: Array


def build_qp(features: Array, targets: Array, sample_weight: Array, free: Flags) -> LeastSquares:
    """Return the program.

    Args:
        features: (n, k).
        targets: (n,).
        sample_weight: (n,), not negative, not all zero.
        free: (k,) whose weights may be negative.
    """
    share = sample_weight / sample_weight.sum()
    scale = np.sqrt(share @ features**2)
    scale = np.where(scale > 0, scale, 1.0)
    scaled = features / scale
    weighted = scaled * share[:, None]
    # A feature that never varies, or two that coincide, would leave the optimum open: the smallest weights are taken.
    program = weighted.T @ scaled + _TRACE * np.eye(features.shape[1])
    return LeastSquares(program, -weighted.T @ targets, np.where(free, -np.inf, 0.0), scale)


def solve(program: LeastSquares) -> Array:
    """Return the weights (k,).

    Raises:
        ModelError: the solver gives up, or what it returns is not optimal.
    """
    from qpsolvers import solve_qp
    from scipy.sparse import csc_matrix

    found = solve_qp(csc_matrix(program.P), program.q, lb=program.lower, solver="clarabel")
    if found is None:
        raise ModelError("no weights were found: the poses do not determine them; give more poses")
    weights = _polished(program, np.maximum(found, program.lower))
    if residual(program, weights) > 1e-6 * max(1.0, float(np.abs(program.q).max())):
        raise ModelError("the solver stopped before the weights were optimal; give poses that vary more")
    # A feature that is zero everywhere has no weight; its diagonal holds the added trace alone.
    return np.where(np.diag(program.P) > 2 * _TRACE, weights / program.scale, 0.0)


def _polished(program: LeastSquares, scaled: Array) -> Array:
    """Return the exact optimum near an interior point solution (k,), or that solution if none is found.

    An interior point method stops a little off the bounds. Which weights lie on them is guessed from it; the others
    then solve a linear system, and the guess is corrected until the optimality conditions hold.
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


def residual(program: LeastSquares, scaled: Array) -> float:
    """Return by how much (scaled) weights (k,) miss the optimality conditions: 0 at the optimum."""
    slope = program.P @ scaled + program.q
    bounded = np.isfinite(program.lower)
    return float(np.abs(np.where(bounded, np.minimum(scaled, slope), slope)).max())
