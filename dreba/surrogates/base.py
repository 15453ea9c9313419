"""Base class of surrogates: differentiable approximations of the REBA score as scikit-learn estimators.

A kind is one class in one file: it derives from `Surrogate`, is decorated with `register`, and implements `_fit`,
`_value_gradient`, `_hessian` and the names of its learned arrays. The base class checks input, handles single poses,
batches and task factors, and writes files. One contract test runs on every registered kind.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Self, Unpack

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.exceptions import NotFittedError
from sklearn.utils.validation import check_is_fitted, validate_data

import reba
from dreba.errors import FactorWarning, ModelError, ModelTypeError
from dreba.surrogates.estimator_checks import POSTURE_COLUMNS
from dreba.surrogates.metrics import evaluation_of
from dreba.surrogates.registry import ModelInfo
from dreba.surrogates.serialization import save
from dreba.surrogates.task_factors import (
    DEFAULT_FACTORS,
    MODELLED,
    TaskFactorArguments,
    TaskFactors,
    seated_angles,
    task_factors_of,
)
from dreba.surrogates.validation import JOINTS, check_parameters, checked_joints, checked_weights, unnamed_joints
from reba.arrays import Array
from reba.checks import PATH, Allowed, accepts
from reba.errors import warn_user
from reba.posture.columns import COLUMNS
from reba.posture.named_angles import angle_columns, check_angles, checked_poses, read_angles, warn_if_radians
from reba.posture.named_data import named_columns, refuse_doubtful_order
from reba.provenance import provenance


class Surrogate(RegressorMixin, BaseEstimator):
    """Differentiable REBA score of poses: `fit`, `predict`, `value`, `gradient`, `hessian`, `save`.

    Angles are (n, d) [deg] in the order of `joints_`, or (d,) for a single pose; data with column names are read by
    name, see `reba.angle_table`. Kinds that know part tables have the 22 columns of `reba.COLUMNS`, or those named by
    their parameter `joints`; others take any columns.

    Attributes:
        joints_: (d,) column names: the parameter `joints`, or columns of `reba.COLUMNS` in their order, whatever the
            order of the data of the fit.
        feature_names_in_: (d,) the same, by scikit-learn's name; absent where columns never had a name.
        temperatures_: [deg] temperatures at which the model can be evaluated, () for kinds without.
        about_: `ModelInfo`, origin and error of the model.
    """

    kind: ClassVar[str] = ""
    """Name of the kind in the registry and in files."""
    monotone: ClassVar[bool] = False
    """Whether the value never decreases when an angle moves to a class of more points."""
    mirror: ClassVar[bool] = False
    """Whether mirrored poses (sides exchanged, side bends and twists negated) have the same value."""
    any_columns: ClassVar[bool] = False
    """Whether the kind takes columns outside the posture table; scikit-learn's estimator checks then apply."""
    learned: ClassVar[dict[str, int]] = {}
    """Learned arrays, which files hold: names ending in an underscore, and their number of dimensions."""

    allowed: ClassVar[dict[str, Allowed]] = {}
    """Admissible constructor parameters, checked by `fit` and when a file is read."""

    joints_: tuple[str, ...]
    temperatures_: tuple[float, ...] = ()
    about_: ModelInfo

    @property
    def convex(self) -> bool:
        """Whether this model, with its parameters, is convex in the angles."""
        return False

    @property
    def expected_failed_checks(self) -> dict[str, str]:
        """Checks of scikit-learn that this estimator does not pass, with reasons, as `check_estimator` takes them."""
        takes_any = self.any_columns and self.get_params(deep=False).get("free", True)
        return {} if takes_any else dict(POSTURE_COLUMNS)

    @property
    def setting(self) -> str:
        """Kind, domain of the fit and parameters that differ from their defaults, in one line for reports."""
        domain = self.about_.domain.get("name") if hasattr(self, "about_") else None
        standard = type(self)().get_params(deep=False)
        own = {name: value for name, value in self.get_params(deep=False).items() if name not in ("domain", "joints")}
        changed = [f"{name}={json.dumps(value)}" for name, value in own.items() if value != standard[name]]
        return ", ".join([self.kind, *([f"domain {domain}"] if domain else []), *changed])

    @property
    def factors_(self) -> tuple[str, ...]:
        """Factors that the model knows, of load, coupling and activity."""
        check_is_fitted(self, "joints_")
        return tuple(name for name, weight in self._factor_weights().items() if weight)

    def fit(
        self,
        X: Any,
        y: ArrayLike,
        sample_weight: ArrayLike | None = None,
        factors: reba.Factors | Mapping[str, Any] | None = None,
    ) -> Self:
        """Fit the model to poses and their true scores, and return it.

        Args:
            X: (n, d) [deg]. Of data with names those of the parameter `joints` are taken, by default the columns of
                `reba.COLUMNS`, and every column of a table without any.
            y: (n,) REBA scores.
            sample_weight: (n,) weights, not negative; None for equal ones. A pose of weight 0 is left out.
            factors: load, coupling and activity of the poses; None for no load, good coupling, no activity. A factor
                that is the same in all poses is not learned. Knees of seated poses are taken as straight.

        Raises:
            ModelError: wrong shapes, values that are not finite, or too few poses.

        Warns:
            RadiansWarning: all angles are so small that they look like radians.
        """
        check_parameters({**self.allowed, "joints": JOINTS}, self.get_params(deep=False))
        try:
            poses, scores = validate_data(self, self._named(X), y, dtype=np.float64, y_numeric=True)
        except TypeError as error:  # scikit-learn's estimators raise a TypeError here
            raise ModelTypeError(" ".join(str(error).split())) from error
        except (ValueError, OverflowError) as error:
            raise ModelError(" ".join(str(error).split())) from error
        scores = np.asarray(scores, np.float64)
        weights = checked_weights(sample_weight, len(scores))
        self._set_joints(self._joints(poses.shape[1]))
        check_angles(poses, self.joints_, complete=True, error=ModelError)
        warn_if_radians(poses, self.joints_)
        factors = None if factors is None else reba.Factors.of(factors)
        poses, given = seated_angles(poses, self.joints_, factors), task_factors_of(factors, len(scores))
        counted = weights > 0  # a weight of 0 leaves a pose out of everything, knots and scales too
        if not counted.all():
            poses, scores, weights, given = poses[counted], scores[counted], weights[counted], given.rows(counted)
        self._fit(poses, scores, weights, given)
        self.about_ = ModelInfo(provenance={"poses": len(scores), **provenance()})
        self._note_error(poses, scores, given)
        return self

    def predict(self, X: Any) -> Array:
        """Return the values (n,) of n poses without task factors; the scikit-learn name of `value`.

        Raises:
            sklearn.exceptions.NotFittedError: before `fit`.
            ModelError: wrong shape or values that are not finite.

        Warns:
            RadiansWarning: as `value`.
        """
        check_is_fitted(self, "joints_")
        foreign = not set(self.joints_) <= set(COLUMNS)
        if not foreign or (named_columns(X) is not None and not isinstance(X, pd.DataFrame)):
            return self._value(self._poses(X)[0], DEFAULT_FACTORS)
        try:  # as scikit-learn's own estimators
            poses = validate_data(self, X, dtype=np.float64, reset=False)
        except ValueError as error:
            raise ModelError(" ".join(str(error).split())) from error
        return self._value(poses, DEFAULT_FACTORS)

    def score(self, X: Any, y: ArrayLike, sample_weight: ArrayLike | None = None) -> float:
        """Return the coefficient of determination R^2 of `predict` on poses (n, d) [deg] and their scores (n,).

        Raises:
            ModelError: wrong poses, or scores or weights that are not n finite numbers.
        """
        from sklearn.metrics import r2_score

        check_is_fitted(self, "joints_")
        try:
            of_postures = set(self.joints_) <= set(COLUMNS)
            predicted = self._value(self._poses(X)[0], DEFAULT_FACTORS) if of_postures else self.predict(X)
            return float(r2_score(y, predicted, sample_weight=sample_weight))
        except (ModelError, NotFittedError):
            raise
        except (ValueError, TypeError, OverflowError) as error:
            raise ModelError(" ".join(str(error).split())) from error

    def value(self, angles: Any, **factors: Unpack[TaskFactorArguments]) -> Any:
        """Return the surrogate score: (n,) for angles (n, d), a float for (d,).

        Args:
            angles: (n, d) or (d,) degrees.
            **factors: keywords of `TaskFactorArguments`, each one value for all poses or (n,):
                `load` [kg], default 0;
                `coupling`, a word such as "fair" or points from 0 (good) to 3, of both hands or (left, right);
                `activity`, points from 0 to 3 or words such as "static,repeated", default 0;
                `temperature` [deg] of the smoothing, one value, default that of the model; ignored by kinds without.

        Raises:
            ModelError: wrong shapes, NaN, an angle beyond 360 deg, factors out of range, or an unknown keyword.

        Warns:
            RadiansWarning: all angles of ten poses or more are so small that they look like radians.
            FactorWarning: a factor is given that the model does not know, once for each model and factor.
        """
        poses, single = self._poses(angles)
        value = self._value(poses, self._factors(factors, len(poses)))
        return float(value[0]) if single else value

    def gradient(self, angles: Any, **factors: Unpack[TaskFactorArguments]) -> Array:
        """Return the gradient [1/deg]: (n, d), or (d,) for one pose. Arguments as in `value`."""
        poses, single = self._poses(angles)
        gradient = self._value_gradient(poses, self._factors(factors, len(poses)))[1]
        return gradient[0] if single else gradient

    def value_and_gradient(self, angles: Any, **factors: Unpack[TaskFactorArguments]) -> tuple[Any, Array]:
        """Return value and gradient [1/deg] of one pass, for optimisers. Arguments as in `value`."""
        poses, single = self._poses(angles)
        value, gradient = self._value_gradient(poses, self._factors(factors, len(poses)))
        return (float(value[0]), gradient[0]) if single else (value, gradient)

    def hessian(self, angles: Any, **factors: Unpack[TaskFactorArguments]) -> Array:
        """Return the Hessian [1/deg^2]: (n, d, d), or (d, d) for one pose. Arguments as in `value`."""
        poses, single = self._poses(angles)
        hessian = self._hessian(poses, self._factors(factors, len(poses)))
        return hessian[0] if single else hessian

    def gauss_newton(self, angles: Any, **factors: Unpack[TaskFactorArguments]) -> Array:
        """Return the factor J of the Hessian ~ J^T J: (n, k, d), or (k, d) for one pose. Arguments as in `value`.

        Raises:
            ModelError: the kind has no Gauss-Newton factor.
        """
        poses, single = self._poses(angles)
        factor = self._gauss_newton(poses, self._factors(factors, len(poses)))
        return factor[0] if single else factor

    @accepts(ModelError, path=PATH)
    def save(self, path: str | Path) -> None:
        """Write the model as JSON; `dreba.load` reads it back equal.

        Raises:
            ModelError: the model is not fitted, or the file cannot be written.
        """
        save(self, path)

    # To be implemented by a kind.

    def _fit(self, poses: Array, scores: Array, weights: Array, factors: TaskFactors) -> None:
        """Fit to checked poses (n, d) [deg], scores (n,) and weights (n,)."""
        raise ModelError(f"kind {self.kind!r} cannot be fitted")

    def _value(self, poses: Array, factors: TaskFactors) -> Array:
        """Return values (n,); overridden by kinds whose value alone is cheaper."""
        return self._value_gradient(poses, factors)[0]

    def _value_gradient(self, poses: Array, factors: TaskFactors) -> tuple[Array, Array]:
        """Return values (n,) and gradients (n, d) [1/deg]."""
        raise ModelError(f"kind {self.kind!r} has no value")

    def _hessian(self, poses: Array, factors: TaskFactors) -> Array:
        """Return Hessians (n, d, d) [1/deg^2]."""
        raise ModelError(f"kind {self.kind!r} has no Hessian")

    def _gauss_newton(self, poses: Array, factors: TaskFactors) -> Array:
        """Return Gauss-Newton factors (n, k, d)."""
        raise ModelError(f"kind {self.kind!r} has no Gauss-Newton factor; use hessian()")

    def _factor_weights(self) -> dict[str, float]:
        """Return points by the factors of `MODELLED`, 0 for one that the model does not know."""
        return dict.fromkeys(MODELLED, 1.0)

    def _payload(self) -> dict[str, Any]:
        """Return the form of load, coupling and activity as plain data of the file."""
        return {"form": "tables"}

    def _state(self) -> dict[str, Any]:
        """Return the learned state of the file, arrays or plain data: by default the arrays of `learned`."""
        return {name: getattr(self, name) for name in self.learned}

    def _restore(self, state: dict[str, Any]) -> None:
        """Set the learned state from plain data of a file, the inverse of `_state`.

        Raises:
            ModelError: a name is missing or unknown, or an array has wrong dimensions or values that are not finite.
        """
        if set(state) != set(self.learned):
            raise ModelError(f"parameters are {', '.join(sorted(state))}; expected {', '.join(sorted(self.learned))}")
        for name, ndim in self.learned.items():
            try:
                array = np.asarray(state[name], np.float64)
            except (TypeError, ValueError, OverflowError) as error:
                raise ModelError(f"{name} has a value that is not a number; the file is damaged") from error
            if array.ndim != ndim or not np.isfinite(array).all():
                raise ModelError(
                    f"{name} has shape {array.shape}; expected {ndim} dimensions and finite values; the file is damaged"
                )
            setattr(self, name, array if ndim else float(array))

    # Common to all kinds.

    def _note_error(self, poses: Array, scores: Array, factors: TaskFactors) -> None:
        """Record the error per class on the poses of the fit, if these are postures with REBA scores."""
        known = all(joint in reba.COLUMNS for joint in self.joints_)
        if not (known and (scores == np.rint(scores)).all() and scores.min() >= 1 and scores.max() <= 15):
            return
        evaluation = evaluation_of(self.kind, self._value(poses, factors), scores)
        rmse = {str(score): round(error.rmse, 4) for score, error in evaluation.classes.items()}
        self.about_ = ModelInfo({}, rmse, {**self.about_.provenance, "rmse_on": "the poses of the fit"})

    def _poses(self, angles: Any) -> tuple[Array, bool]:
        """Return checked angles (n, d) [deg] and whether they are a single pose (d,)."""
        if not hasattr(self, "joints_"):
            check_is_fitted(self, "joints_")
        return checked_poses(angles, self.joints_, absent="refuse", error=ModelError)

    def _factors(self, arguments: TaskFactorArguments, n: int) -> TaskFactors:
        """Return the factors of an evaluation of n poses, and warn once of each that the model does not know."""
        factors = TaskFactors.checked(arguments, n)
        if factors.is_default or len(self.factors_) == len(MODELLED):
            return factors
        for name in MODELLED:
            warned = self.__dict__.setdefault("_warned", set())
            if name not in self.factors_ and name not in warned and np.any(getattr(factors, name)):
                warned.add(name)
                known = ", ".join(self.factors_) or "no factor"
                text = f"{name} is given, but this {self.kind} model knows {known} only; its value stays the same"
                advice = (
                    "" if self.get_params(deep=False).get("payload_only") else "; fit it to poses that differ in it"
                )
                warn_user(text + advice, FactorWarning)
        return factors

    def _set_joints(self, joints: tuple[str, ...]) -> None:
        """Set the column names, and scikit-learn's attributes of the same."""
        self.joints_, self.n_features_in_ = joints, len(joints)
        if joints != unnamed_joints(len(joints)):
            self.feature_names_in_ = np.array(joints, object)

    def _named(self, X: Any) -> Any:
        """Return poses to learn from, of named data those of the parameter `joints` as a table in its order."""
        named = named_columns(X)
        if named is None:
            refuse_doubtful_order(X, ModelError)
            return X
        joints = self.get_params(deep=False).get("joints")
        names = list(angle_columns(named, ModelError) if joints is None else joints)
        if not names and isinstance(X, pd.DataFrame):
            return X
        angles, _ = read_angles(named, names or list(named), absent="refuse", error=ModelError)
        return pd.DataFrame(angles, columns=names)

    def _joints(self, columns: int) -> tuple[str, ...]:
        """Return the column names: the parameter `joints`, those of the table X, or those of the posture table."""
        named = self.get_params(deep=False).get("joints")
        named = getattr(self, "feature_names_in_", None) if named is None else named
        return checked_joints(named, columns, self.kind, self.any_columns)
