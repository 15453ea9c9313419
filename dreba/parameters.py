"""Constructor parameters are checked when a model is fitted or read, against what its class allows."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np

from dreba.errors import ModelError

_WHOLE: Final = (int, np.integer)
_NUMBER: Final = (*_WHOLE, float, np.floating)
_YES_NO: Final = (bool, np.bool_)


class Allowed(NamedTuple):
    """What a parameter may be: in words, and as a test."""

    expected: str
    fits: Callable[[Any], bool]


def _is(value: Any, kinds: tuple[type, ...]) -> bool:
    return isinstance(value, kinds) and not isinstance(value, _YES_NO)


def one_of(*names: str) -> Allowed:
    """Return that a parameter is one of some names."""
    return Allowed("one of " + ", ".join(names), lambda value: isinstance(value, str) and value in names)


YES_NO: Final = Allowed("True or False", lambda value: isinstance(value, _YES_NO))
POSITIVE: Final = Allowed("a number above 0", lambda value: _is(value, _NUMBER) and 0 < value < np.inf)
NOT_NEGATIVE: Final = Allowed("a number, 0 or more", lambda value: _is(value, _NUMBER) and 0 <= value < np.inf)
COUNT: Final = Allowed("a whole number above 0", lambda value: _is(value, _WHOLE) and value > 0)
SEED: Final = Allowed("a whole number from 0 to 4294967295", lambda value: _is(value, _WHOLE) and 0 <= value < 2**32)
COUNTS: Final = Allowed(
    "whole numbers above 0, such as (124, 7)",
    lambda value: isinstance(value, tuple | list) and len(value) > 0 and all(COUNT.fits(item) for item in value),
)
FALLING: Final = Allowed(
    "falling temperatures above 0 [deg], such as (16.0, 8.0, 4.0, 2.0, 1.0)",
    lambda value: (
        isinstance(value, tuple | list)
        and len(value) > 0
        and all(POSITIVE.fits(item) for item in value)
        and all(blunt > sharp for blunt, sharp in pairwise(value))
    ),
)


def check_parameters(allowed: dict[str, Allowed], given: dict[str, Any]) -> None:
    """Check parameters by name; those that `allowed` does not know pass.

    Raises:
        ModelError: one is not as allowed.
    """
    for name, rule in allowed.items():
        if not rule.fits(given[name]):
            raise ModelError(f"{name} is {given[name]!r}; expected {rule.expected}")
