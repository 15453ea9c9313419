"""`GraduatedModel`: `SoftModel` in the form of earlier versions, with a convex score as its first stage.

Graduated is a way to minimise a soft model, not a model: a convex cost leads to the region of low scores, and soft
tables of falling temperature refine the posture. This class keeps files, names and exports of both parts working;
values and derivatives are those of the soft tables.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Literal, NamedTuple

from dreba.errors import ModelError
from dreba.surrogates.base import Surrogate
from dreba.surrogates.convex import ConvexModel
from dreba.surrogates.quadratic import QuadraticModel
from dreba.surrogates.registry import ModelInfo, register
from dreba.surrogates.serialization import from_dict, to_dict
from dreba.surrogates.soft import LADDER, SoftModel
from dreba.surrogates.task_factors import TaskFactors
from dreba.surrogates.validation import FALLING, TEMPERATURE
from reba.arrays import Array
from reba.checks import SEED, Allowed, accepts, count_to, instance, one_of

FIRST: dict[str, type[Surrogate]] = {"quadratic": QuadraticModel, "convex": ConvexModel}
"""Kinds of the first stage."""


class Stage(NamedTuple):
    """Continuation stage: a model and the temperature [deg] of its evaluation, None for a model without."""

    name: str
    model: Surrogate
    temperature: float | None

    def objective(self, **factors: Any) -> Callable[[Array], tuple[float, Array]]:
        """Return the objective of one pose (d,) [deg] -> value and gradient (d,), with load, coupling and activity.

        Example:
            >>> import dreba
            >>> poses = dreba.sample(200, rng=0, factors=["load"])
            >>> model = GraduatedModel(updates=5).fit(poses, poses.reba, factors=poses.factors)
            >>> value, slope = model.stages_[0].objective(load=3.0)(poses.angles[0])
            >>> slope.shape
            (22,)
        """

        def evaluate(angles: Array) -> tuple[float, Array]:
            return self.model.value_and_gradient(angles, temperature=self.temperature, **factors)

        return evaluate


@register
class GraduatedModel(Surrogate):
    """Continuation stages of one cost. Its value and derivatives are those of the soft tables.

    Args:
        first: kind of the first stage, "convex" or "quadratic".
        ladder: [deg] falling temperatures of the soft stages.
        temperature: [deg] default of evaluations.
        updates, seed: parameters of the fit of the soft tables, see `SoftModel`.
        joints: names of the columns; None for all 22.

    Attributes:
        stages_: stages in the order of their minimisation.

    Example:
        >>> import dreba
        >>> [stage.name for stage in dreba.load("graduated").stages_]
        ['convex', 'soft 16 deg', 'soft 8 deg', 'soft 4 deg', 'soft 2 deg', 'soft 1 deg']
    """

    kind = "graduated"
    monotone = True
    mirror = True
    learned: ClassVar[dict[str, int]] = {}

    allowed: ClassVar[dict[str, Allowed]] = {
        "first": one_of(*FIRST),
        "ladder": FALLING,
        "temperature": TEMPERATURE,
        "updates": count_to(1_000_000),
        "seed": SEED,
    }

    def __init__(
        self,
        first: Literal["quadratic", "convex"] = "convex",
        ladder: tuple[float, ...] = LADDER,
        temperature: float = 2.0,
        updates: int = 4000,
        seed: int = 0,
        joints: tuple[str, ...] | None = None,
    ) -> None:
        self.first = first
        self.ladder = ladder
        self.temperature = temperature
        self.updates = updates
        self.seed = seed
        self.joints = joints

    @staticmethod
    @accepts(
        ModelError,
        first=instance("a fitted convex or quadratic model", Surrogate),
        soft=instance("fitted soft tables", SoftModel),
    )
    def of(first: Surrogate, soft: SoftModel) -> GraduatedModel:
        """Return the graduated model of two fitted models.

        Raises:
            ModelError: the kind of the first is not in `FIRST`, or the models have different joints.
        """
        model = GraduatedModel(
            first.kind,  # type: ignore[arg-type]
            tuple(soft.ladder), soft.temperature, soft.updates, soft.seed, soft.joints,
        )  # fmt: skip
        model._set_joints(soft.joints_)
        model._set_fitted(first, soft)
        model.about_ = soft.about_
        return model

    def _fit(self, poses: Array, scores: Array, weights: Array, factors: TaskFactors) -> None:
        parts = (
            FIRST[self.first](joints=self.joints_),
            SoftModel(self.ladder, self.temperature, updates=self.updates, seed=self.seed, joints=self.joints_),
        )
        for part in parts:
            part._set_joints(self.joints_)
            part._fit(poses, scores, weights, factors)
            part.about_ = ModelInfo()
        self._set_fitted(*parts)

    def _set_fitted(self, first: Surrogate, soft: Surrogate) -> None:
        if first.kind not in FIRST or not isinstance(soft, SoftModel) or first.joints_ != soft.joints_:
            raise ModelError(
                f"stages are {first.kind!r} and {soft.kind!r}; expected quadratic or convex, then soft, on equal joints"
            )
        self.first_, self.soft_ = first, soft
        self.temperatures_ = soft.temperatures_
        self.stages_ = (
            Stage(first.kind, first, None),
            *(Stage(f"soft {t:g} deg", soft, t) for t in soft.temperatures_),
        )

    def _state(self) -> dict[str, Any]:
        return {"first": to_dict(self.first_), "soft": to_dict(self.soft_)}

    def _restore(self, state: dict[str, Any]) -> None:
        if set(state) != {"first", "soft"}:
            raise ModelError(f"parameters are {', '.join(sorted(state))}; expected first, soft")
        first, soft = from_dict(state["first"]), from_dict(state["soft"])
        if first.kind != self.first or soft.joints_ != self.joints_:
            raise ModelError("the stages differ from the model in kind or joints; the file is damaged")
        self._set_fitted(first, soft)

    def _value(self, poses: Array, factors: TaskFactors) -> Array:
        return self.soft_._value(poses, factors)

    def _value_gradient(self, poses: Array, factors: TaskFactors) -> tuple[Array, Array]:
        return self.soft_._value_gradient(poses, factors)

    def _hessian(self, poses: Array, factors: TaskFactors) -> Array:
        return self.soft_._hessian(poses, factors)

    def _gauss_newton(self, poses: Array, factors: TaskFactors) -> Array:
        return self.soft_._gauss_newton(poses, factors)
