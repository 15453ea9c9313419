"""The factors beside the angles: load, coupling, support, arm support and activity.

A factor is one value for a recording or one per frame. Factors that are not given take the defaults of `ASSUMED`, which
every output names; only angles carry a range of what is unmeasured.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array, Flags
from reba.checks import shown
from reba.errors import PostureError, did_you_mean
from reba.posture.columns import SIDES
from reba.posture.value_codes import coded

COUPLINGS: Final = ("good", "fair", "poor", "unacceptable")
"""Coupling 0 to 3."""
SUPPORTS: Final = ("bilateral", "unilateral", "walking", "sitting")
"""How the legs bear the weight."""
ACTIVITIES: Final = ("static", "repeated", "unstable")
"""The three kinds of activity, +1 each."""
ASSUMED: Final[dict[str, str]] = {
    "load": "load 0 kg",
    "shock": "no shock",
    "coupling_left": "coupling good (left)",
    "coupling_right": "coupling good (right)",
    "support": "support bilateral",
    "arm_supported_left": "left arm unsupported",
    "arm_supported_right": "right arm unsupported",
}
"""Text of the default of each factor, reported where it is not given."""
ASSUMED_ACTIVITY: Final = "activity from the movement"
"""The same for activity, which is detected in the movement."""
Points = NDArray[np.uint8]


@dataclass(frozen=True)
class Factors:
    """Factors of a recording; every field is a scalar or has one value per frame.

    Attributes:
        load: [kg], not negative.
        shock: shock or rapid build-up of force.
        coupling_left, coupling_right: "good", "fair", "poor", "unacceptable" or 0 to 3.
        support: "bilateral", "unilateral", "walking" or "sitting".
        arm_supported_left, arm_supported_right: arm leaning, supported or gravity assisted.
        static, repeated, unstable: the activity points, +1 each.
    """

    load: Any = 0.0
    shock: Any = False
    coupling_left: Any = "good"
    coupling_right: Any = "good"
    support: Any = "bilateral"
    arm_supported_left: Any = False
    arm_supported_right: Any = False
    static: Any = False
    repeated: Any = False
    unstable: Any = False

    @staticmethod
    def of(factors: Factors | Mapping[str, Any] | None) -> Factors:
        """Return the record for a mapping of some of its fields; `coupling` and `arm_supported` stand for both sides.

        Raises:
            PostureError: it is neither record nor mapping, or a name is unknown.
        """
        if factors is None:
            return Factors()
        if isinstance(factors, Factors):
            return factors
        if not isinstance(factors, Mapping):
            raise PostureError(f"factors are {shown(factors)}; expected reba.Factors or a mapping like {{'load': 5.0}}")
        values = expand_sides(factors)
        for name in values:
            if name not in FACTORS:
                raise PostureError(
                    f"factor {name!r} is unknown{did_you_mean(name, FACTORS)}; known: {', '.join(FACTORS)}"
                )
        return Factors(**values)


BOTH_SIDES: Final = ("coupling", "arm_supported")
"""Names that stand for a factor of both sides."""
GRIPS: Final = tuple(f"coupling_{side}" for side in SIDES)
"""Names of the coupling of either hand."""
FLAGS: Final = ("shock", *(f"arm_supported_{side}" for side in SIDES), *ACTIVITIES)
"""Names of the factors that are true or false."""
FACTORS: Final = tuple(field.name for field in fields(Factors))
"""The factor names, which are also the names of factor columns of a posture table."""


def expand_sides(factors: Mapping[str, Any]) -> dict[str, Any]:
    """Return the mapping with `coupling` and `arm_supported` written out for both sides.

    >>> expand_sides({"coupling": "fair"})
    {'coupling_left': 'fair', 'coupling_right': 'fair'}
    """
    values: dict[str, Any] = {}
    for name, value in factors.items():
        if name in BOTH_SIDES:
            for side in SIDES:
                values.setdefault(f"{name}_{side}", value)
        else:
            values[name] = value
    return values


def checked(factors: Factors, n: int) -> Factors:
    """Return the factors of n frames in one spelling: kilograms, booleans and words, as one value or (n,) arrays.

    Raises:
        PostureError: a value is missing, out of range or has another number of frames.
    """

    def plain(values: NDArray[Any]) -> Any:
        return values[0].item() if len(values) == 1 else values

    couplings = {name: np.array(COUPLINGS)[codes(name, getattr(factors, name), COUPLINGS, n)] for name in GRIPS}
    flags = {name: flag(name, getattr(factors, name), n) for name in FLAGS}
    support = np.array(SUPPORTS)[codes("support", factors.support, SUPPORTS, n)]
    columns = {"load": load_kg(factors.load, n), "support": support, **couplings, **flags}
    return Factors(**{name: plain(values) for name, values in columns.items()})


def load_kg(value: Any, n: int) -> Array:
    """Return a load as (n,) or (1,) kilograms; negative, infinite or missing loads and codes are refused."""
    try:
        load = np.atleast_1d(np.asarray(value, np.float64))
    except (TypeError, ValueError, OverflowError) as error:
        raise PostureError(f"load is {str(value)[:80]!r}; expected kilograms, one number or one per frame") from error
    _check_length("load", load, n)
    bad = ~(np.isfinite(load) & (load >= 0)) | coded(load)
    if bad.any():
        where = int(np.argmax(bad))
        what = f"load is {load[where]} at frame {where}{', a code for no value' * bool(coded(load[where]))}"
        raise PostureError(f"{what}; expected kilograms, 0 or more, at every frame: correct it, or give one load")
    return load


def flag(name: str, value: Any, n: int) -> Flags:
    """Return a yes-or-no factor as (n,) or (1,) booleans; words and 0 and 1 stand for no and yes."""
    values = _values(name, value, n)
    if values.dtype == bool:
        return values
    words = dict.fromkeys(("true", "yes", "1", "1.0"), True) | dict.fromkeys(("false", "no", "0", "0.0"), False)
    items = values.tolist()
    yes = [words.get(str(item).strip().lower()) for item in items]
    if None in yes:
        where = yes.index(None)
        raise PostureError(f"{name} is {items[where]!r} at frame {where}; expected true or false at every frame")
    return np.array(yes, bool)


def codes(name: str, value: Any, words: tuple[str, ...], n: int) -> Points:
    """Return the places (n,) or (1,) of a factor's values in `words`; coupling may also be given as points 0 to 3."""
    values = _values(name, value, n)
    places = np.full(len(values), 255, np.uint8)
    for code, word in enumerate(words):
        places[values == word] = code
    if (places == 255).any():  # numbers or other spellings
        by_text = {word: code for code, word in enumerate(words)}
        if name in GRIPS:
            by_text |= {text: code for code in range(4) for text in (str(code), f"{code}.0")}
        kinds, inverse = np.unique(values.astype(str), return_inverse=True)
        read = [by_text.get(str(kind).strip().lower()) for kind in kinds]
        if None in read:
            raise PostureError(
                f"{name} is {str(kinds[read.index(None)])!r}; expected one of {', '.join(words)} at every frame"
            )
        places = np.array(read, np.uint8)[inverse]
    return places


def _values(name: str, value: Any, n: int) -> NDArray[Any]:
    try:
        values = np.atleast_1d(np.asarray(value))
    except ValueError as error:
        raise PostureError(f"{name} is {value!r}; expected one value or one for each of {n} frames") from error
    _check_length(name, values, n)
    return values


def _check_length(name: str, values: NDArray[Any], n: int) -> None:
    if values.ndim != 1 or len(values) not in (1, n):
        raise PostureError(f"{name} has shape {values.shape}; expected one value or one for each of {n} frames")
