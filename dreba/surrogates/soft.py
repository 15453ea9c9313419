"""`SoftModel`: smooth REBA tables at a ladder of temperatures, unfitted or learned on balanced poses."""

from __future__ import annotations

import dataclasses
from typing import Any, ClassVar

import numpy as np

from dreba.errors import ModelError
from dreba.surrogates import soft_curvature, soft_fit
from dreba.surrogates.base import Surrogate
from dreba.surrogates.registry import register
from dreba.surrogates.soft_tables import SoftTables
from dreba.surrogates.task_factors import TaskFactors
from dreba.surrogates.validation import FALLING, TEMPERATURE, check_parameters
from reba.arrays import Array
from reba.checks import SEED, YES_NO, Allowed, accepts, count_to
from reba.method.rules import Rules, load_points, rules_of
from reba.posture.columns import ANGLES, COLUMNS
from reba.posture.factors import load_kg

LADDER = (16.0, 8.0, 4.0, 2.0, 1.0)
"""[deg] Default temperatures, blunt to sharp, each half of the last."""
_NEUTRAL = np.array([angle.best for angle in ANGLES for _ in angle.columns])
_BLOCKS = {
    "thresholds": (27,), "heights": (27,), "overlap": (3,), "table_a": (5, 3, 4), "table_b": (6, 2, 3),
    "table_c": (12, 12),
}  # fmt: skip


@register
class SoftModel(Surrogate):
    """Soft tables: sigmoid steps of temperature T [deg], multilinear Tables A, B, C, a smooth maximum of the sides.

    Load, coupling and activity are added where REBA adds them, load by its exact classes (under 5, to 10, over 10 kg).
    Left and right share every parameter. Values are not clipped to 1: that of a neutral pose may be below 1.

    Args:
        ladder: [deg] falling temperatures; the model has one set of parameters for each.
        temperature: [deg] default of evaluations.
        learn: False keeps the printed tables and thresholds; every temperature is then admissible in evaluations.
        rules: preset of the initial thresholds ("measured" or "paper").
        updates: updates of the fit at each temperature, with 512 poses each.
        seed: seed of the order of the poses.
        joints: names of the columns; None for all 22. Other angles are neutral.

    Example:
        >>> model = SoftModel(learn=False).fit(np.zeros((2, 22)), [1, 1])
        >>> squat = np.zeros(22)
        >>> squat[6:8] = 70.0  # both knees
        >>> round(model.value(squat, temperature=0.001), 3)  # table scores: legs 3, elbows straight
        2.0
    """

    kind = "soft"
    monotone = True
    mirror = True
    learned: ClassVar[dict[str, int]] = {
        "thresholds_": 2, "heights_": 2, "overlap_": 2, "table_a_": 4, "table_b_": 4, "table_c_": 3,
    }  # fmt: skip

    allowed: ClassVar[dict[str, Allowed]] = {
        "ladder": FALLING,
        "temperature": TEMPERATURE,
        "learn": YES_NO,
        "updates": count_to(1_000_000),
        "seed": SEED,
    }

    thresholds_: Array
    heights_: Array
    overlap_: Array
    table_a_: Array
    table_b_: Array
    table_c_: Array

    def __init__(
        self,
        ladder: tuple[float, ...] = LADDER,
        temperature: float = 2.0,
        learn: bool = True,
        rules: str = "measured",
        updates: int = 4000,
        seed: int = 0,
        joints: tuple[str, ...] | None = None,
    ) -> None:
        self.ladder = ladder
        self.temperature = temperature
        self.learn = learn
        self.rules = rules
        self.updates = updates
        self.seed = seed
        self.joints = joints

    @accepts(ModelError, temperature=TEMPERATURE.or_none())
    def tables(self, temperature: float | None = None) -> SoftTables:
        """Return the tables at a temperature [deg]: one of the ladder if learned, else any; None for the default.

        Raises:
            ModelError: the temperature is not on the ladder of a learned model.
        """
        degrees = float(self.temperature if temperature is None else temperature)
        if degrees not in self._tables:
            if self.learn:
                raise ModelError(
                    f"temperature {degrees:g} is not on the ladder; expected one of "
                    f"{', '.join(f'{t:g}' for t in self.temperatures_)}"
                )
            self._tables[degrees] = SoftTables.of(self._rules(), degrees)
        return self._tables[degrees]

    def _fit(self, poses: Array, scores: Array, weights: Array, factors: TaskFactors) -> None:
        self._check_parameters()
        angles, (added, activity) = self._all_columns(poses), self._added(factors, len(poses))
        added = np.zeros((3, 1)) if added is None else added
        rng = np.random.default_rng(self.seed)
        fitted: dict[float, SoftTables] = {}
        # From sharp to blunt: the sharpest tables are nearest to the printed ones, which start the fit.
        tables = SoftTables.of(self._rules(), min(self.ladder))
        for temperature in sorted(self.ladder):
            if self.learn:
                tables = dataclasses.replace(tables, temperature=float(temperature))
                tables = soft_fit.learn(tables, angles, scores, weights, added, activity, self.updates, rng)
            else:
                tables = SoftTables.of(self._rules(), temperature)
            fitted[float(temperature)] = tables
        self._set_fitted(fitted)

    def _check_parameters(self) -> None:
        # Checked here again for the stages of `GraduatedModel`, which calls `_fit`.
        check_parameters(self.allowed, self.get_params(deep=False))
        if self.learn and float(self.temperature) not in self.ladder:
            raise ModelError(
                f"temperature {self.temperature!r} is not on the ladder; expected one of {tuple(self.ladder)}"
            )

    def _rules(self) -> Rules:
        return rules_of(self.rules)

    def _set_fitted(self, fitted: dict[float, SoftTables]) -> None:
        self.temperatures_ = tuple(float(t) for t in self.ladder)
        self._tables = fitted
        for name in _BLOCKS:
            setattr(self, f"{name}_", np.array([getattr(fitted[t], name) for t in self.temperatures_]))

    def _restore(self, state: dict[str, Any]) -> None:
        super()._restore(state)
        self._check_parameters()
        for name, shape in _BLOCKS.items():
            stored = getattr(self, f"{name}_").shape
            if stored != (len(self.ladder), *shape):
                raise ModelError(f"{name}_ has shape {stored}; expected {(len(self.ladder), *shape)}")
        self._set_fitted(
            {
                float(t): SoftTables(**{name: getattr(self, f"{name}_")[i] for name in _BLOCKS}, temperature=float(t))
                for i, t in enumerate(self.ladder)
            }
        )

    # Evaluation: angles without a column are neutral.

    def _all_columns(self, poses: Array) -> Array:
        """Return all 22 angles (n, 22) [deg] of poses (n, d)."""
        if self.joints_ == COLUMNS:
            return poses
        angles = np.tile(_NEUTRAL, (len(poses), 1))
        angles[:, self._indices()] = poses
        return angles

    def _indices(self) -> list[int]:
        """Return the indices of `joints_` among the 22 columns."""
        return [COLUMNS.index(joint) for joint in self.joints_]

    def _added(self, given: TaskFactors, n: int) -> tuple[Array | None, Any]:
        """Return (3, 1) or (3, n) points on Score A and both Scores B, None for none, and those on the total."""
        if given.is_default:
            return None, given.activity
        load = load_kg(given.load, n)
        points = load_points(load).astype(float)
        try:
            rows = [np.atleast_1d(np.asarray(side, float)) for side in given.coupling]
            added = np.array(np.broadcast_arrays(points, *rows))
        except ValueError as error:
            raise ModelError(f"coupling is {given.coupling!r}; expected left and right points, 0 to 3") from error
        if added.shape[0] != 3 or added.shape[1] not in (1, n):
            raise ModelError(f"coupling is {given.coupling!r}; expected left and right, one value or one for each pose")
        return added, given.activity

    def _value(self, poses: Array, factors: TaskFactors) -> Array:
        return self.tables(factors.temperature).value(self._all_columns(poses), *self._added(factors, len(poses)))

    def _value_gradient(self, poses: Array, factors: TaskFactors) -> tuple[Array, Array]:
        tables = self.tables(factors.temperature)
        value, gradient = tables.value_gradient(self._all_columns(poses), *self._added(factors, len(poses)))
        return value, gradient if self.joints_ == COLUMNS else gradient[:, self._indices()]

    def _hessian(self, poses: Array, factors: TaskFactors) -> Array:
        added = self._added(factors, len(poses))[0]
        hessian = soft_curvature.hessian(self.tables(factors.temperature), self._all_columns(poses), added)
        return hessian if self.joints_ == COLUMNS else hessian[:, self._indices()][:, :, self._indices()]

    def _gauss_newton(self, poses: Array, factors: TaskFactors) -> Array:
        added = self._added(factors, len(poses))[0]
        factor = soft_curvature.gauss_newton(self.tables(factors.temperature), self._all_columns(poses), added)
        return factor if self.joints_ == COLUMNS else factor[:, :, self._indices()]
