"""Task factors of poses as surrogates take them: load, coupling and activity, with the temperature of an evaluation."""

from __future__ import annotations

from typing import Any, Final, Literal, NamedTuple, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from dreba.errors import ModelError
from reba.checks import shown
from reba.errors import did_you_mean
from reba.method.factor_points import points
from reba.method.rules import Rules, load_points
from reba.posture.factors import FACTORS, Factors
from reba.posture.factors import load_kg as checked_load


class TaskFactorArguments(TypedDict, total=False):
    """Keywords of an evaluation (`Surrogate.value` and the others), with the units and defaults of `TaskFactors`."""

    load: Any
    coupling: tuple[Any, Any]
    activity: Any
    temperature: float | None


class TaskFactors(NamedTuple):
    """Task factors of n poses: scalars or (n,) arrays; every field broadcasts over the poses.

    Attributes:
        load: [kg], not negative.
        coupling: left and right coupling points, 0 (good) to 3 (unacceptable).
        activity: activity points, 0 to 3.
        temperature: [deg] of the smoothing, None for the kind's own default.
    """

    load: Any = 0.0
    coupling: tuple[Any, Any] = (0, 0)
    activity: Any = 0
    temperature: float | None = None

    @property
    def is_default(self) -> bool:
        """Whether load, coupling and activity are all 0."""
        return self is DEFAULT_FACTORS or all(
            type(value) in (int, float) and value == 0 for value in (self.load, *self.coupling, self.activity)
        )

    def rows(self, which: Any) -> TaskFactors:
        """Return the factors of the selected poses (a slice, an index or an index array)."""

        def select(value: Any) -> Any:
            return value[which] if np.ndim(value) else value

        return TaskFactors(
            select(self.load),
            (select(self.coupling[0]), select(self.coupling[1])),
            select(self.activity),
            self.temperature,
        )

    @staticmethod
    def checked(arguments: TaskFactorArguments, n: int) -> TaskFactors:
        """Return the keywords of an evaluation as factors of n poses.

        Raises:
            ModelError: an unknown keyword, not a number, a value out of range, or another length than n.
        """
        if not arguments:
            return DEFAULT_FACTORS
        for name in arguments:
            if name not in TaskFactors._fields:
                near = did_you_mean(name, TaskFactors._fields)
                raise ModelError(f"keyword {name!r} is unknown{near}; expected {', '.join(TaskFactors._fields)}")
        load, coupling, activity, temperature = DEFAULT_FACTORS._replace(**arguments)
        if not isinstance(coupling, tuple | list) or len(coupling) != 2:
            raise ModelError(f"coupling is {coupling!r}; expected left and right points, such as (0, 1)")
        _check("load", load, n, np.inf, "kilograms, 0 or more")
        for side in coupling:
            _check("coupling", side, n, HIGHEST_POINTS, "points from 0 (good) to 3 (unacceptable)")
        _check("activity", activity, n, HIGHEST_POINTS, "points from 0 to 3")
        if temperature is not None and (not isinstance(temperature, _NUMBER) or isinstance(temperature, bool)):
            raise ModelError(f"temperature is {temperature!r}; expected degrees, or None for the model's default")
        return TaskFactors(
            load, (coupling[0], coupling[1]), activity, None if temperature is None else float(temperature)
        )


DEFAULT_FACTORS: Final = TaskFactors()
"""No load, good coupling, no activity, the default temperature of the model."""
_MODELLED: Final = ("load", "coupling_left", "coupling_right", "static", "repeated", "unstable")
HIGHEST_POINTS: Final = 3
"""Maximum of the coupling points of a hand and of the activity points (REBA, Hignett & McAtamney 2000)."""
_NUMBER: Final = (int, float, np.integer, np.floating)


def _check(name: str, value: Any, n: int, highest: float, expected: str) -> None:
    if type(value) in (int, float):  # the usual case of one number needs no array
        fits = 0 <= value <= highest and value != np.inf
    else:
        try:
            array = np.asarray(value, np.float64)
        except (TypeError, ValueError) as error:
            raise ModelError(f"{name} is {str(value)[:80]!r}; expected {expected}") from error
        if array.shape not in ((), (1,), (n,)):
            raise ModelError(f"{name} has shape {array.shape}; expected one value or one for each of {n} poses")
        fits = bool(((array >= 0) & (array <= highest) & np.isfinite(array)).all())
    if not fits:
        raise ModelError(f"{name} is {str(value)[:80]}; expected {expected}")


def task_factors_of(factors: Factors | None, n: int) -> TaskFactors:
    """Return REBA factors of n poses as load [kg] and coupling and activity points, (n,) each.

    Raises:
        ModelError: a factor that no surrogate takes (shock, support, arm support) is not at its default.
        reba.PostureError: a factor has a wrong value or length.
    """
    if factors is None:
        return DEFAULT_FACTORS
    for name in FACTORS:
        default = getattr(Factors(), name)
        if name not in _MODELLED and np.any(np.asarray(getattr(factors, name)) != default):
            raise ModelError(
                f"factor {name} differs from {default!r} in some poses; surrogates take load, coupling and activity "
                f"only, so leave such poses out or use reba.score"
            )
    factor_points = points(factors, Rules(), n)
    coupling = tuple(side.astype(float) for side in factor_points.coupling)
    return TaskFactors(checked_load(factors.load, n), (coupling[0], coupling[1]), factor_points.activity.astype(float))


Payload = Literal["tree", "linear"]
PAYLOADS: Final = ("tree", "linear")
OMEGA_LOAD: Final = 5.0
"""[kg] Load that costs 1 in the linear form (equation 4)."""


def delta_payload(load: ArrayLike, form: Payload = "tree", omega: float = OMEGA_LOAD) -> Any:
    """Return the payload cost [points] of a load, a float or (n,).

    Args:
        load: [kg], one or (n,), not negative.
        form: "tree": 0 below 5 kg, 1 from 5 to 10 kg, 2 above, the decision tree of equation (3); "linear":
            load / omega, equation (4), which makes light loads cost something and has a gradient.
        omega: [kg] load that costs 1 in the linear form.

    Raises:
        ModelError: an unknown form, or a load that is negative or not a number.

    Example:
        >>> delta_payload(7.0), delta_payload(7.0, "linear")
        (1.0, 1.4)
    """
    try:
        kilograms = np.asarray(load, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ModelError(f"load is {shown(load)}; expected kilograms, 0 or more") from error
    if not (np.isfinite(kilograms).all() and (kilograms >= 0).all()):
        raise ModelError(f"load is {shown(load)}; expected kilograms, 0 or more")
    if form == "linear":
        cost = kilograms / omega
    elif form == "tree":
        cost = np.asarray(load_points(kilograms), np.float64)
    else:
        raise ModelError(f"payload is {form!r}; expected one of {', '.join(PAYLOADS)}")
    return float(cost) if cost.ndim == 0 else cost
