"""`QuadraticModel`: weighted sum of one second-order polynomial for each angle (Busch et al. 2018, section II-C)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np

from dreba.domain import Domain, domain_of
from dreba.errors import ModelError
from dreba.surrogates.base import Surrogate
from dreba.surrogates.bounded_qp import build_qp, solve
from dreba.surrogates.part_polynomials import MINIMA, Minimum, lowest_class, part_polynomials
from dreba.surrogates.registry import register
from dreba.surrogates.task_factors import OMEGA_LOAD, PAYLOADS, Payload, TaskFactors, delta_payload, varying
from dreba.surrogates.validation import check_sample_count
from reba.arrays import Array
from reba.checks import YES_NO, Allowed, at_most, is_finite, one_of
from reba.posture.columns import ANGLES, BEST, COLUMNS, MIRRORED


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
        minimum: "lowest": the minimum of each convex polynomial lies in the class of lowest points of its angle, and so
            the minimum of the model where every part has its lowest score; "free": anywhere; None for "lowest", and for
            "free" with `free`.
        payload: "tree" (equation 3) or "linear" (equation 4).
        omega_load: [kg] load that costs 1 point in the linear payload.
        payload_only: equation (1) to the letter: load is the only factor, coupling and activity cost nothing.
        class_power: the squared error of a pose of REBA class c has the weight c ** -class_power; 0 for plain least
            squares. More weight on low classes (0.5 or 1) moves errors per class towards the published ones.
        joints: names of the columns; None for `reba.COLUMNS`.

    Attributes:
        polynomials_: (d, 3) coefficients of Q_i: 1, q, q^2, q in degrees.
        weights_: (d,) w_i.
        intercept_: b.
        coupling_weight_: weight of the coupling points of the worse hand; 0 if the poses all had the same coupling.
            Activity points are added with weight 1, as in REBA, unless `payload_only`.

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
        "minimum": one_of(*MINIMA).or_none(),
        "payload": one_of(*PAYLOADS),
        "omega_load": at_most(10_000),
        "payload_only": YES_NO,
        "class_power": Allowed("a number from 0 to 100", lambda value: is_finite(value) and 0 <= value <= 100),
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
        minimum: Minimum | None = None,
        payload: Payload = "tree",
        omega_load: float = OMEGA_LOAD,
        payload_only: bool = False,
        class_power: float = 0.0,
        joints: Sequence[str] | None = None,
    ) -> None:
        self.domain = domain
        self.free = free
        self.intercept = intercept
        self.curvature = curvature
        self.minimum = minimum
        self.payload = payload
        self.omega_load = omega_load
        self.payload_only = payload_only
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
        check_sample_count(len(scores))
        targets = scores - delta_payload(factors.load, self.payload, self.omega_load)
        coupling = np.zeros(len(scores))  # a column of zeros gets weight 0
        if not self.payload_only:
            targets = targets - factors.activity
            coupling = varying(np.broadcast_to(np.maximum(*factors.coupling), len(scores)), weights)
        if self.class_power:
            weights = weights * np.maximum(scores, 1.0) ** -self.class_power
        terms = self._free_terms() if self.free else self._part_terms()
        features = [np.sum(_evaluate(poses[:, term.group], term.polynomials), axis=1) for term in terms]
        columns = np.column_stack([*features, coupling, np.full(len(scores), float(self.intercept))])
        unbounded = np.array([term.free for term in terms] + [False, True])
        solution = solve(build_qp(columns, targets, weights, unbounded))
        self.coupling_weight_ = float(solution[-2])
        self.intercept_ = float(solution[-1]) if self.intercept else 0.0
        self._set_fitted(terms, solution[:-2])
        self._set_coefficients()

    def _check_columns(self) -> None:
        unknown = [joint for joint in self.joints_ if joint not in COLUMNS]
        if unknown and not self.free:
            raise ModelError(
                f"column {unknown[0]!r} has no part table; name columns of reba.COLUMNS by joints=, or use free=True"
            )

    def _part_terms(self) -> list[_Term]:
        """Return a term for each angle, Q_i of its columns, with weights >= 0."""
        convex = self.curvature == "nonnegative"
        polynomials = part_polynomials(domain_of(self.domain), self.joints_, convex, self.minimum or "lowest")
        return [_Term(group, polynomials[group], False) for group in _groups(self.joints_)]

    def _free_terms(self) -> list[_Term]:
        """Return terms whose sum is the polynomial of each angle: two parabolas, or its square and itself."""
        terms = []
        for group in _groups(self.joints_):
            for polynomial, free in self._free_polynomials(self.joints_[group[0]]):
                terms.append(_Term(group, np.tile(polynomial, (len(group), 1)), free))
        return terms

    def _free_polynomials(self, joint: str) -> list[tuple[Array, bool]]:
        """Return polynomials (3,) and whether their weight may be negative."""
        convex = self.curvature == "nonnegative"
        square = (np.array([0.0, 0.0, 1.0]), not convex)
        if joint in MIRRORED:  # a symmetric body has no linear term in angles that change sign in a mirror
            return [square]
        if joint not in COLUMNS or not convex or self.minimum != "lowest":
            return [(np.array([0.0, 1.0, 0.0]), True), square]
        ends = lowest_class(domain_of(self.domain).bins_of(joint), BEST[joint])
        return [(np.array([0.0, -2.0 * end, 1.0]), False) for end in ends]

    def _set_fitted(self, terms: list[_Term], solution: Array) -> None:
        """Set the learned arrays of the columns from the weights of the terms."""
        self.weights_ = np.ones(len(self.joints_))
        self.polynomials_ = np.zeros((len(self.joints_), 3))
        for term, weight in zip(terms, solution, strict=True):
            self.polynomials_[term.group] += (weight if self.free else 1.0) * term.polynomials
            if not self.free:
                self.weights_[term.group] = weight

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
        points = delta_payload(factors.load, self.payload, self.omega_load)
        if self.payload_only:
            return points
        return points + factors.activity + self.coupling_weight_ * np.maximum(*factors.coupling)

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

    def _factor_weights(self) -> dict[str, float]:
        activity = 0.0 if self.payload_only else 1.0
        return {"load": 1.0, "coupling": self.coupling_weight_, "activity": activity}

    def _payload(self) -> dict[str, Any]:
        omega = self.omega_load if self.payload == "linear" else None
        return {"form": self.payload, "omega_load": omega, **self._factor_weights()}


class _Term(NamedTuple):
    """Polynomials (k, 3) of a group of columns (k,) with one weight, which is >= 0 unless `free`."""

    group: list[int]
    polynomials: Array
    free: bool


def _evaluate(angles: Array, polynomials: Array) -> Array:
    """Return the polynomials (k, 3) at angles (n, k)."""
    c0, c1, c2 = polynomials.T
    return np.asarray(c0 + angles * (c1 + c2 * angles))


def _groups(joints: tuple[str, ...]) -> list[list[int]]:
    """Return groups of column indices that share a weight: both sides of an angle."""
    name_of = {column: angle.name for angle in ANGLES for column in angle.columns}
    groups: dict[str, list[int]] = {}
    for index, joint in enumerate(joints):
        groups.setdefault(name_of.get(joint, joint), []).append(index)
    return list(groups.values())
