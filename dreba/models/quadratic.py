"""The paper's model: a weighted sum of one second-order polynomial per angle (Busch et al. 2018, section II-C)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from dreba.domain import Domain, domain_of
from dreba.errors import ModelError
from dreba.given import Given
from dreba.model import Surrogate, register
from dreba.parameters import NOT_NEGATIVE, POSITIVE, YES_NO, Allowed, one_of
from dreba.part_polynomials import part_polynomials
from dreba.payload import OMEGA_LOAD, PAYLOADS, Payload, delta_payload
from dreba.weights import build_qp, solve
from reba.posture import ANGLES, COLUMNS

Array = NDArray[np.float64]

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

    def _fit(self, poses: Array, scores: Array, weights: Array, given: Given) -> None:
        self._check_columns()
        groups = _groups(self.joints_)
        targets = scores - delta_payload(given.load, self.payload, self.omega_load) - given.activity
        if self.class_power:
            weights = weights * np.maximum(scores, 1.0) ** -self.class_power
        features, bounded = self._free_features(poses, groups) if self.free else self._features(poses, groups)
        worse = np.broadcast_to(np.maximum(*given.coupling), len(scores)).astype(float)
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

    def _features(self, poses: Array, groups: list[list[int]]) -> tuple[Array, NDArray[np.bool_]]:
        """Return the sum of Q_i over the columns of each group (n, g); their weights must not be negative."""
        self.polynomials_ = part_polynomials(domain_of(self.domain), self.joints_, self.curvature == "nonnegative")
        c0, c1, c2 = self.polynomials_.T
        values = c0 + poses * (c1 + c2 * poses)
        features = np.stack([values[:, group].sum(axis=1) for group in groups], axis=1)
        return features, np.ones(len(groups), bool)

    def _free_features(self, poses: Array, groups: list[list[int]]) -> tuple[Array, NDArray[np.bool_]]:
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

    def _extra(self, given: Given) -> Any:
        """Return what load, coupling and activity add, a float or (n,)."""
        extra = delta_payload(given.load, self.payload, self.omega_load) + np.asarray(given.activity, np.float64)
        return extra + self.coupling_weight_ * np.maximum(*(np.asarray(side, np.float64) for side in given.coupling))

    def _value_gradient(self, poses: Array, given: Given) -> tuple[Array, Array]:
        # The value is constant + sum_i q_i (slope_i + linear_i) / 2, so one product serves both (equation 2).
        gradient = poses * self.twice_curvature_
        gradient += self.linear_
        value = np.vecdot(poses, gradient)
        value += poses @ self.linear_
        value *= 0.5
        value += self.constant_
        if not given.nothing:
            value += self._extra(given)
        return value, gradient

    def _hessian(self, poses: Array, given: Given) -> Array:
        return np.broadcast_to(np.diag(self.twice_curvature_), (len(poses), *(2 * (len(self.joints_),)))).copy()

    def _gauss_newton(self, poses: Array, given: Given) -> Array:
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
