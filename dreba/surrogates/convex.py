"""`ConvexModel`: additive convex regression, a sum of hinges of one angle each with non-negative weights."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Final, NamedTuple

import numpy as np

from dreba.errors import ModelError
from dreba.surrogates.base import Surrogate
from dreba.surrogates.registry import register
from dreba.surrogates.task_factors import TaskFactors, varying
from dreba.surrogates.validation import check_sample_count
from reba.arrays import Array, Indices
from reba.checks import Allowed, at_most, count_to
from reba.method.rules import load_points
from reba.posture.columns import ANGLES, BEST, MIRRORED
from reba.posture.factors import load_kg

RIDGE: Final = 1e-9
"""Ridge of the normal equations as a share of their mean diagonal, which keeps them positive definite."""
CHUNK: Final = 2048
"""Poses evaluated at once, which bounds the memory of their hinges."""


class Hinges(NamedTuple):
    """Hinges w h(scale q - offset) of a model, with h as in `ConvexModel`; r rows.

    Attributes:
        joint: (r,) index of the angle, non-decreasing.
        scale: (r,) [1/deg], its sign is the direction of the hinge.
        offset: (r,) position of the knot, dimensionless.
        weight: (r,) points, above 0.
    """

    joint: Indices
    scale: Array
    offset: Array
    weight: Array


@register
class ConvexModel(Surrogate):
    """Value = constant + sum over angles and knots of w h((s q - k) / width), all weights w >= 0.

    A hinge rises from 0 at its knot, rounded over `width` so that the gradient is continuous: h(t) is t^2 / 2 from 0 to
    1 and t - 1/2 beyond. Every angle has hinges in both directions away from its best angle; the two signs of a side
    bend or twist, and left and right, share their weights. Coefficients: non-negative least squares
    (Lawson & Hanson 1974) on the normal equations.

    Args:
        knots: number of hinges for each direction of an angle.
        width: [deg] range over which a hinge is rounded.
        joints: names of the columns; None for all 22.

    Example:
        >>> import dreba
        >>> poses = dreba.sample(1000, rng=1)
        >>> model = ConvexModel(knots=6).fit(poses.angles, poses.reba)
        >>> model.convex, model.gradient(poses.angles[0]).shape
        (True, (22,))
    """

    kind = "convex"
    mirror = True
    learned: ClassVar[dict[str, int]] = {"knots_": 2, "weights_": 2, "constant_": 0, "points_": 1}

    allowed: ClassVar[dict[str, Allowed]] = {"knots": count_to(1000), "width": at_most(360)}

    knots_: Array
    weights_: Array
    constant_: float
    points_: Array

    def __init__(self, knots: int = 12, width: float = 10.0, joints: Sequence[str] | None = None) -> None:
        self.knots = knots
        self.width = width
        self.joints = joints

    @property
    def convex(self) -> bool:
        """True: every hinge is convex and no weight is negative."""
        return True

    def _fit(self, poses: Array, scores: Array, weights: Array, factors: TaskFactors) -> None:
        from scipy.optimize import nnls

        check_sample_count(len(scores))
        profile = _profiles(self.joints_)
        self.knots_ = self._knot_distances(poses, profile)
        gram, right = self._normal_equations(poses, scores, weights / weights.sum(), factors, profile)
        # The last two columns are the constant and its opposite, so that it may have either sign.
        lower = np.linalg.cholesky(gram + RIDGE * np.trace(gram) / len(gram) * np.eye(len(gram)))
        solution = nnls(lower.T, np.linalg.solve(lower, right))[0]
        self.weights_ = solution[:-4].reshape(-1, self.knots)[profile].reshape(len(self.joints_), -1)
        self.points_ = solution[-4:-2]
        self.constant_ = float(solution[-2] - solution[-1])
        self._set_rows()

    def _normal_equations(
        self, poses: Array, scores: Array, weights: Array, factors: TaskFactors, profile: Indices
    ) -> tuple[Array, Array]:
        """Return Gram matrix and right side of the features: hinges of each profile, load, coupling, 1, -1."""
        count = int(profile.max()) + 1
        sum_profiles = (np.arange(count)[:, None] == profile).astype(float)
        n = len(poses)
        load, coupling, activity = np.broadcast_arrays(*_points(factors, n), factors.activity, np.zeros(n))[:3]
        load, coupling = varying(load, weights), varying(coupling, weights)
        size = count * self.knots + 4
        gram, right = np.zeros((size, size)), np.zeros(size)
        for start in range(0, n, CHUNK):
            rows = slice(start, start + CHUNK)
            hinges = _hinge(self._arguments(poses[rows])).reshape(-1, len(profile), self.knots)
            features = (sum_profiles @ hinges).reshape(len(hinges), -1)
            one = np.ones(len(hinges))
            matrix = np.column_stack([features, load[rows], coupling[rows], one, -one])
            weighted = matrix * weights[rows, None]
            gram += weighted.T @ matrix
            right += weighted.T @ (scores - activity)[rows]
        return gram, right

    def _knot_distances(self, poses: Array, profile: Indices) -> Array:
        """Return distances (d, 2 knots) [deg] of the knots from the neutral angle, upwards then downwards."""
        offset = poses - np.array([BEST[joint] for joint in self.joints_])
        reach = np.stack([offset.max(axis=0), -offset.min(axis=0)], axis=1).ravel()
        farthest = np.array([max(float(reach[profile == own].max()), 1.0) for own in profile])
        steps = np.arange(self.knots) / self.knots
        return np.asarray((farthest[:, None] * steps).reshape(len(self.joints_), -1))

    def _arguments(self, poses: Array) -> Array:
        """Return the arguments (n, d, 2 knots) of h: distance of each angle beyond each knot in units of width."""
        offset = poses - np.array([BEST[joint] for joint in self.joints_])
        senses = np.repeat([1.0, -1.0], self.knots_.shape[1] // 2)
        return (offset[:, :, None] * senses - self.knots_) / self.width

    def _restore(self, state: dict[str, Any]) -> None:
        super()._restore(state)
        shape = (len(self.joints_), 2 * self.knots)
        if self.knots_.shape != shape or self.weights_.shape != shape or self.points_.shape != (2,):
            raise ModelError(f"knots_, weights_ or points_ do not fit {len(self.joints_)} joints; the file is damaged")
        if (self.weights_ < 0).any():
            raise ModelError("weights_ has a negative weight; expected 0 or more; the file is damaged")
        self._set_rows()

    def _value_gradient(self, poses: Array, factors: TaskFactors) -> tuple[Array, Array]:
        value = np.full(len(poses), self.constant_)
        gradient = np.empty(poses.shape)
        for start in range(0, len(poses), CHUNK):
            rows = slice(start, start + CHUNK)
            past = self._past(poses[rows])
            inside = np.clip(past, 0.0, 1.0)
            gradient[rows] = (self._by_column @ inside).T
            np.maximum(past, 0.0, out=past)
            inside *= -0.5 * inside
            inside += past * np.minimum(past, 1.0)
            value[rows] += self._weight @ inside
        load, coupling = _points(factors, len(poses))
        value += self.points_[0] * load + self.points_[1] * coupling + factors.activity
        return value, gradient

    def _hessian(self, poses: Array, factors: TaskFactors) -> Array:
        out = np.zeros((len(poses), len(self.joints_), len(self.joints_)))
        diagonal = np.arange(len(self.joints_))
        out[:, diagonal, diagonal] = self._curvature(poses)
        return out

    def _gauss_newton(self, poses: Array, factors: TaskFactors) -> Array:
        return np.sqrt(self._hessian(poses, factors))

    def _curvature(self, poses: Array) -> Array:
        """Return the diagonals (n, d) [1/deg^2] of the Hessians."""
        past = self._past(poses)
        return np.asarray(((abs(self._by_column) / self.width) @ ((past > 0.0) & (past < 1.0))).T)

    def hinges(self) -> Hinges:
        """Return the hinges of positive weight in the order of their angles."""
        joint, number = np.nonzero(self.weights_)
        sense = np.repeat([1.0, -1.0], self.knots)[number]
        best = np.array([BEST[name] for name in self.joints_])[joint]
        offset = (sense * best + self.knots_[joint, number]) / self.width
        return Hinges(joint, sense / self.width, offset, self.weights_[joint, number])

    def _set_rows(self) -> None:
        """Set the rows of evaluation, the hinges of positive weight."""
        joint, scale, offset, self._weight = self.hinges()
        self._joint, self._scale, self._offset = joint, scale[:, None], offset[:, None]
        self._by_column = np.zeros((len(self.joints_), len(joint)))
        self._by_column[joint, np.arange(len(joint))] = self._weight * scale

    def _past(self, poses: Array) -> Array:
        """Return the arguments (r, n) of h for the rows of evaluation."""
        past = poses.T.take(self._joint, axis=0)
        past *= self._scale
        past -= self._offset
        return past

    def _factor_weights(self) -> dict[str, float]:
        return {"load": float(self.points_[0]), "coupling": float(self.points_[1]), "activity": 1.0}

    def _payload(self) -> dict[str, Any]:
        return {"form": "classes", **self._factor_weights()}


def _hinge(t: Array) -> Array:
    """Return h(t): 0 below 0, t^2 / 2 from 0 to 1, t - 1/2 beyond."""
    inside = np.clip(t, 0.0, 1.0)
    return inside * (np.maximum(t, 0.0) - 0.5 * inside)


def _profiles(joints: tuple[str, ...]) -> Indices:
    """Return profile numbers (2 d,) of each angle upwards and downwards; equal numbers share their weights.

    Left and right share weights, and so do both directions of side bends and twists of the trunk and neck.
    """
    names = {column: angle.name for angle in ANGLES for column in angle.columns}
    keys = [f"{names[j]}{'' if names[j] in MIRRORED else sense}" for j in joints for sense in ("+", "-")]
    return np.asarray(np.unique(keys, return_inverse=True)[1])


def _points(given: TaskFactors, n: int) -> tuple[Array, Array]:
    """Return load points and the worse coupling."""
    load = load_kg(given.load, n)
    points = load_points(load).astype(float)
    return points, np.maximum(*(np.asarray(side, np.float64) for side in given.coupling))
