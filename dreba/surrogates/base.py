"""The surrogate protocol: what every kind of differentiable REBA answers, and the registry of kinds.

A kind is one class in one file: it derives from `Surrogate`, is decorated with `register`, and implements `_fit`,
`_value_gradient`, `_hessian` and the names of what it learned. The base class does the rest: checks, single poses and
batches, factors, files. Every registered kind runs through one contract test.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted, validate_data

import reba
from dreba.errors import ModelError
from dreba.surrogates.metrics import evaluation_of
from dreba.surrogates.registry import ModelInfo
from dreba.surrogates.serialization import save
from dreba.surrogates.task_factors import NOTHING, TaskFactors, given_of
from dreba.surrogates.validation import (
    Allowed,
    check_parameters,
    checked_joints,
    checked_weights,
)
from reba._version import __version__
from reba.arrays import Array
from reba.posture.columns import COLUMNS
from reba.posture.named_angles import check_angles, named_columns, read_angles, warn_if_radians


class Surrogate(RegressorMixin, BaseEstimator):
    """A differentiable score of posture: `fit`, `predict`, `value`, `gradient`, `hessian`, `save`.

    Angles are (n, d) degrees in the order of `joints_`, or (d,) for a single pose. A kind that reads the body (all but
    the purely statistical ones) works on the 22 columns of `reba.COLUMNS`, or on those named by its parameter `joints`.

    Attributes:
        joints_: (d,) column names.
        temperatures_: [deg] the ladder of temperatures a kind can be evaluated at, () for none.
        about_: `ModelInfo`, origin and error of the model.
    """

    kind: ClassVar[str] = ""
    """Name in the registry and in files."""
    monotone: ClassVar[bool] = False
    """Never decreases when a part score's angle moves to a worse class."""
    mirror: ClassVar[bool] = False
    """Left and right exchanged (with side bends and twists negated) give the same value."""
    any_columns: ClassVar[bool] = False
    """Takes columns that REBA does not know, so scikit-learn's estimator checks apply."""
    learned: ClassVar[dict[str, int]] = {}
    """Names of learned arrays (ending in an underscore) and their number of dimensions: what a file holds."""

    allowed: ClassVar[dict[str, Allowed]] = {}
    """What constructor parameters may be, checked by `fit` and when a file is read."""

    joints_: tuple[str, ...]
    temperatures_: tuple[float, ...] = ()
    about_: ModelInfo

    @property
    def convex(self) -> bool:
        """Whether this model, with its parameters, is convex in the angles."""
        return False

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        factors: reba.Factors | None = None,
    ) -> Self:
        """Learn from poses and their true scores.

        Args:
            X: (n, d) degrees.
            y: (n,) REBA scores.
            sample_weight: (n,) weights, not negative; None for equal ones.
            factors: load, coupling and activity of the poses; None for none of them.

        Raises:
            ModelError: wrong shapes, values that are not finite, or too few poses.

        Warns:
            RadiansWarning: all angles are so small that they look like radians.
        """
        check_parameters(self.allowed, self.get_params(deep=False))
        try:
            poses, scores = validate_data(self, self._named(X), y, dtype=np.float64, y_numeric=True)
        except ValueError as error:
            raise ModelError(" ".join(str(error).split())) from error
        scores = np.asarray(scores, np.float64)
        weights = checked_weights(sample_weight, len(scores))
        self.joints_ = self._joints(poses.shape[1])
        check_angles(poses, self.joints_, complete=True, error=ModelError)
        warn_if_radians(poses, self.joints_)
        self._fit(poses, scores, weights, given_of(factors, len(scores)))
        self.about_ = ModelInfo(provenance={"poses": len(scores), "version": __version__})
        self._note_error(poses, scores, factors)
        return self

    def predict(self, X: ArrayLike) -> Array:
        """Return the value of n poses, (n,), after checking them: the scikit-learn spelling of `value`.

        Raises:
            sklearn.exceptions.NotFittedError: before `fit`.
            ModelError: wrong shape or values that are not finite.
        """
        check_is_fitted(self, "joints_")
        try:
            if set(self.joints_) <= set(COLUMNS) and named_columns(X) is not None:
                poses, _ = read_angles(X, self.joints_, absent="refuse", error=ModelError)
            else:
                poses = validate_data(self, X, dtype=np.float64, reset=False)
        except ModelError:
            raise
        except ValueError as error:
            raise ModelError(" ".join(str(error).split())) from error
        check_angles(poses, self.joints_, complete=True, error=ModelError)
        warn_if_radians(poses, self.joints_)
        return self._value(poses, NOTHING)

    def value(
        self,
        angles: ArrayLike,
        *,
        load: Any = 0.0,
        coupling: tuple[Any, Any] = (0, 0),
        activity: Any = 0,
        temperature: float | None = None,
    ) -> Any:
        """Return the score: (n,) for angles (n, d), a float for (d,).

        Args:
            angles: (n, d) or (d,) degrees.
            load: [kg], one or (n,).
            coupling: left and right points 0-3, each one or (n,).
            activity: points 0-3, one or (n,).
            temperature: [deg] of the smoothing, for kinds that have one.

        Raises:
            ModelError: wrong shapes, NaN, an angle that no body has, or factors out of range.

        Warns:
            RadiansWarning: all angles of ten poses or more are so small that they look like radians.
        """
        poses, single = self._poses(angles)
        warn_if_radians(poses, self.joints_)
        found = self._value(poses, TaskFactors.checked(load, coupling, activity, temperature, len(poses)))
        return float(found[0]) if single else found

    def gradient(
        self,
        angles: ArrayLike,
        *,
        load: Any = 0.0,
        coupling: tuple[Any, Any] = (0, 0),
        activity: Any = 0,
        temperature: float | None = None,
    ) -> Array:
        """Return the gradient [1/deg]: (n, d), or (d,) for one pose. Arguments as in `value`."""
        poses, single = self._poses(angles)
        found = self._value_gradient(poses, TaskFactors.checked(load, coupling, activity, temperature, len(poses)))[1]
        return found[0] if single else found

    def value_and_gradient(
        self,
        angles: ArrayLike,
        *,
        load: Any = 0.0,
        coupling: tuple[Any, Any] = (0, 0),
        activity: Any = 0,
        temperature: float | None = None,
    ) -> tuple[Any, Array]:
        """Return value and gradient in one pass, for optimisers. Arguments as in `value`."""
        poses, single = self._poses(angles)
        value, gradient = self._value_gradient(
            poses, TaskFactors.checked(load, coupling, activity, temperature, len(poses))
        )
        return (float(value[0]), gradient[0]) if single else (value, gradient)

    def hessian(
        self,
        angles: ArrayLike,
        *,
        load: Any = 0.0,
        coupling: tuple[Any, Any] = (0, 0),
        activity: Any = 0,
        temperature: float | None = None,
    ) -> Array:
        """Return the Hessian [1/deg^2]: (n, d, d), or (d, d) for one pose. Arguments as in `value`."""
        poses, single = self._poses(angles)
        found = self._hessian(poses, TaskFactors.checked(load, coupling, activity, temperature, len(poses)))
        return found[0] if single else found

    def gauss_newton(
        self,
        angles: ArrayLike,
        *,
        load: Any = 0.0,
        coupling: tuple[Any, Any] = (0, 0),
        activity: Any = 0,
        temperature: float | None = None,
    ) -> Array:
        """Return the factor J with Hessian ~ J^T J: (n, k, d), or (k, d) for one pose. Arguments as in `value`.

        Raises:
            ModelError: the kind has no such factor.
        """
        poses, single = self._poses(angles)
        found = self._gauss_newton(poses, TaskFactors.checked(load, coupling, activity, temperature, len(poses)))
        return found[0] if single else found

    def save(self, path: str | Path) -> None:
        """Write the model as JSON; `dreba.load` reads it back equal."""

        save(self, path)

    # What a kind implements.

    def _fit(self, poses: Array, scores: Array, weights: Array, given: TaskFactors) -> None:
        """Learn from checked poses (n, d), scores (n,), weights (n,) and factors."""
        raise ModelError(f"kind {self.kind!r} cannot be fitted")

    def _value(self, poses: Array, given: TaskFactors) -> Array:
        """Return (n,) values; kinds override it where the value alone is cheaper."""
        return self._value_gradient(poses, given)[0]

    def _value_gradient(self, poses: Array, given: TaskFactors) -> tuple[Array, Array]:
        """Return (n,) values and (n, d) gradients."""
        raise ModelError(f"kind {self.kind!r} has no value")

    def _hessian(self, poses: Array, given: TaskFactors) -> Array:
        """Return (n, d, d) second derivatives."""
        raise ModelError(f"kind {self.kind!r} has no Hessian")

    def _gauss_newton(self, poses: Array, given: TaskFactors) -> Array:
        """Return (n, k, d) factors."""
        raise ModelError(f"kind {self.kind!r} has no Gauss-Newton factor; use hessian()")

    def _payload(self) -> dict[str, Any]:
        """Return how load, coupling and activity enter, as plain data for the file."""
        return {"form": "tables"}

    def _state(self) -> dict[str, Any]:
        """Return what was learned, as arrays or plain data; the default takes the names in `learned`."""
        return {name: getattr(self, name) for name in self.learned}

    def _restore(self, state: dict[str, Any]) -> None:
        """Take over what `_state` gave after it was read from a file.

        Raises:
            ModelError: a name is missing or unknown, or an array has another number of dimensions or is not finite.
        """
        if set(state) != set(self.learned):
            raise ModelError(f"parameters are {', '.join(sorted(state))}; expected {', '.join(sorted(self.learned))}")
        for name, ndim in self.learned.items():
            try:
                array = np.asarray(state[name], np.float64)
            except (TypeError, ValueError, OverflowError) as error:
                raise ModelError(f"{name} holds something that is no number") from error
            if array.ndim != ndim or not np.isfinite(array).all():
                raise ModelError(f"{name} has shape {array.shape} or holds NaN; expected {ndim} dimensions, finite")
            setattr(self, name, array if ndim else float(array))

    # What the base does for all kinds.

    def _note_error(self, poses: Array, scores: Array, factors: reba.Factors | None) -> None:
        """Keep the error per class on the poses of the fit, if these are postures with REBA scores."""

        known = all(joint in reba.COLUMNS for joint in self.joints_)
        if not (known and (scores == np.rint(scores)).all() and scores.min() >= 1 and scores.max() <= 15):
            return
        found = evaluation_of(self.kind, self._value(poses, given_of(factors, len(scores))), scores)
        rmse = {str(score): round(error.rmse, 4) for score, error in found.classes.items()}
        self.about_ = ModelInfo({}, rmse, {**self.about_.provenance, "rmse_on": "the poses of the fit"})

    def _poses(self, angles: ArrayLike) -> tuple[Array, bool]:
        """Return angles as (n, d) and whether a single pose was given."""
        if not hasattr(self, "joints_"):
            check_is_fitted(self, "joints_")
        poses, single = read_angles(angles, self.joints_, absent="refuse", error=ModelError)
        check_angles(poses, self.joints_, complete=True, error=ModelError)
        return poses, single

    def _named(self, X: Any) -> Any:
        """Return poses to learn from, of named data those of the parameter `joints` as a table in its order."""
        joints = self.get_params(deep=False).get("joints")
        if joints is None and isinstance(X, pd.DataFrame):
            return X
        named = named_columns(X)
        if named is None:
            return X
        names = [name for name in named if name in COLUMNS] if joints is None else list(joints)
        angles, _ = read_angles(named, names, absent="refuse", error=ModelError)
        return pd.DataFrame(angles, columns=names)

    def _joints(self, columns: int) -> tuple[str, ...]:
        """Return the names of the columns: the parameter `joints`, those of a table, or the posture table's."""
        named = self.get_params(deep=False).get("joints")
        named = getattr(self, "feature_names_in_", None) if named is None else named
        return checked_joints(named, columns, self.kind, self.any_columns)
