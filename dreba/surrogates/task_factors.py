"""Task factors of poses as surrogates take them: load, coupling and activity, with the temperature of an evaluation."""

from __future__ import annotations

import dataclasses
from typing import Any, Final, Literal, NamedTuple, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from dreba.errors import ModelError
from reba.arrays import Array
from reba.checks import POSITIVE, is_finite, shown
from reba.errors import PostureError, did_you_mean
from reba.method.factor_points import points
from reba.method.rules import Rules, load_points
from reba.posture.columns import COLUMNS_OF, SIDES
from reba.posture.factors import ACTIVITIES, COUPLINGS, FACTORS, GRIPS, SUPPORTS, Factors, codes, flag
from reba.posture.factors import load_kg as checked_load


class TaskFactorArguments(TypedDict, total=False):
    """Keywords of an evaluation (`Surrogate.value` and the others), as `reba.score` takes them.

    Attributes:
        load: [kg], not negative.
        coupling: of both hands, or of the left and the right one: words ("good", "fair", "poor", "unacceptable") or
            points from 0 to 3. Two entries are always left and right; (n, 2) has them for each pose.
        activity: points from 0 to 3, or words: "none", or a comma list of static, repeated, unstable.
        temperature: [deg] of the smoothing, one value.
        coupling_left, coupling_right: of one hand.
        static, repeated, unstable: yes or no, one point each, in the place of `activity`.
    """

    load: Any
    coupling: Any
    activity: Any
    temperature: float | None
    coupling_left: Any
    coupling_right: Any
    static: Any
    repeated: Any
    unstable: Any


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
        known = tuple(TaskFactorArguments.__annotations__)
        for name in arguments:
            if name not in known:
                near = did_you_mean(name, known)
                raise ModelError(f"keyword {name!r} is unknown{near}; expected {', '.join(known)}")
        load, temperature = arguments.get("load", 0.0), arguments.get("temperature")
        _check("load", load, n, np.inf, "kilograms, 0 or more")
        coupling = _hands(arguments.get("coupling", DEFAULT_FACTORS.coupling), n)
        sides = [_grip(arguments.get(f"coupling_{side}", one)) for side, one in zip(SIDES, coupling, strict=True)]
        for side in sides:
            _check("coupling", side, n, HIGHEST_POINTS, _GRIPS)
        activity = _activity(arguments, n)
        _check("activity", activity, n, HIGHEST_POINTS, _ACTIVITY)
        if temperature is not None and not is_finite(temperature):
            raise ModelError(f"temperature is {shown(temperature)}; expected degrees, or None for the model's default")
        return TaskFactors(
            _plain(load),
            (_plain(sides[0]), _plain(sides[1])),
            _plain(activity),
            None if temperature is None else float(temperature),
        )


DEFAULT_FACTORS: Final = TaskFactors()
"""No load, good coupling, no activity, the default temperature of the model."""
MODELLED: Final = ("load", "coupling", "activity")
"""Factors that a surrogate may know."""
_FIELDS: Final = ("load", "coupling_left", "coupling_right", "static", "repeated", "unstable")
HIGHEST_POINTS: Final = 3
"""Maximum of the coupling points of a hand and of the activity points (REBA, Hignett & McAtamney 2000)."""
_GRIPS: Final = f"{', '.join(COUPLINGS)}, or points from 0 (good) to 3 (unacceptable)"
_SITTING: Final = SUPPORTS.index("sitting")
_ACTIVITY: Final = f"points from 0 to 3, or none, or a comma list of {', '.join(ACTIVITIES)}"


def _hands(given: Any, n: int) -> tuple[Any, Any]:
    """Return the coupling of the left and of the right hand: two entries are both hands, anything else is for both."""
    if isinstance(given, str):
        return given, given
    if isinstance(given, tuple | list):
        return (given[0], given[1]) if len(given) == len(SIDES) else (given, given)
    shape = np.shape(given)
    if shape == (len(SIDES),) or (len(shape) == 2 and shape[1] == len(SIDES)):
        values = np.asarray(given)
        return values[..., 0], values[..., 1]
    return given, given


def _grip(given: Any) -> Any:
    """Return coupling with words read as points, one or (n,); numbers as they are."""
    if type(given) in (int, float):
        return given
    try:
        values = np.asarray(given)
        if values.dtype.kind in "OUS" and values.ndim < 2:
            places = codes(GRIPS[0], values, COUPLINGS, values.size).astype(np.float64)
            return places if values.ndim else float(places[0])
    except (ValueError, TypeError) as error:
        raise ModelError(f"coupling is {str(given)[:80]!r}; expected {_GRIPS}") from error
    return given


def _activity(arguments: TaskFactorArguments, n: int) -> Any:
    """Return the activity points, of words and of the three kinds too."""
    given = arguments.get("activity", 0)
    kinds = [name for name in ACTIVITIES if name in arguments]
    try:
        if isinstance(given, str):
            words = [] if given.strip().lower() == "none" else [word.strip().lower() for word in given.split(",")]
            if not set(words) <= set(ACTIVITIES):
                raise ModelError(f"activity is {given[:80]!r}; expected {_ACTIVITY}")
            given = len(set(words))
        if not kinds:
            return given
        if "activity" in arguments:
            raise ModelError(f"activity and {kinds[0]} are given; expected one or the other")
        flags = [flag(name, arguments[name], n) for name in kinds]
        return np.sum(np.broadcast_arrays(*flags), axis=0, dtype=np.float64)
    except PostureError as error:
        raise ModelError(str(error)) from error


def _plain(value: Any) -> Any:
    """Return numbers as they are and all else as an array."""
    return value if type(value) in (int, float) else np.asarray(value, np.float64)


def varying(values: Any, weights: Array) -> Array:
    """Return values (n,) of a factor, or zeros if all poses of weight above 0 have the same: no weight is learned."""
    counted = values[weights > 0]
    return np.asarray(values if counted.size and np.ptp(counted) > 0 else np.zeros(len(values)), np.float64)


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
        ModelError: a factor that no surrogate takes (shock, arm support, support other than both legs or sitting) is
            not at its default.
        reba.PostureError: a factor has a wrong value or length.
    """
    if factors is None:
        return DEFAULT_FACTORS
    # A seated pose costs what standing with straight knees does, see `seated_angles`.
    support = codes("support", factors.support, SUPPORTS, n)
    factors = dataclasses.replace(
        factors, support=np.where(support == _SITTING, SUPPORTS[0], np.array(SUPPORTS)[support])
    )
    for name in FACTORS:
        default = getattr(Factors(), name)
        if name not in _FIELDS and np.any(np.asarray(getattr(factors, name)) != default):
            raise ModelError(
                f"factor {name} differs from {default!r} in some poses; surrogates take load, coupling and activity "
                f"only, so leave such poses out or use reba.score"
            )
    factor_points = points(factors, Rules(), n)
    coupling = tuple(side.astype(float) for side in factor_points.coupling)
    return TaskFactors(checked_load(factors.load, n), (coupling[0], coupling[1]), factor_points.activity.astype(float))


def seated_angles(angles: Array, joints: tuple[str, ...], factors: Factors | None) -> Array:
    """Return angles (n, d) [deg] with the knees of seated poses straight.

    Knees do not count while sitting, and the legs then have the same score as standing on both legs: to a surrogate,
    whose score has no support of the legs, a seated pose is one with straight knees.
    """
    if factors is None:
        return angles
    seated = codes("support", factors.support, SUPPORTS, len(angles)) == _SITTING
    knees = [index for index, joint in enumerate(joints) if joint in COLUMNS_OF["knee_flexion"]]
    if not (seated.any() and knees):
        return angles
    out = angles.copy()
    for knee in knees:
        out[np.broadcast_to(seated, len(angles)), knee] = 0.0
    return out


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
    if not (isinstance(form, str) and form in PAYLOADS):
        raise ModelError(f"payload is {shown(form)}; expected one of {', '.join(PAYLOADS)}")
    if not POSITIVE.fits(omega):
        raise ModelError(f"omega is {shown(omega)}; expected {POSITIVE.expected} of kilograms")
    cost = kilograms / omega if form == "linear" else np.asarray(load_points(kilograms), np.float64)
    return float(cost) if cost.ndim == 0 else cost
