"""Arguments of public functions are checked once, at the border: wrong types end in the package's own error.

`accepts` names what each argument may be; below the border nothing is checked again.
"""

from __future__ import annotations

import functools
import inspect
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, NamedTuple, ParamSpec, TypeVar

import numpy as np

from reba.errors import RebaError

_Given = ParamSpec("_Given")
_Result = TypeVar("_Result")
_WHOLE: Final = (int, np.integer)
_NUMBER: Final = (*_WHOLE, float, np.floating)
_YES_NO: Final = (bool, np.bool_)
LONGEST: Final = 60
"""Characters of a value that a message repeats."""
_LONG_BITS: Final = 200
FEW: Final = 8
"""Numbers of a list that a message repeats."""


def from_home(value: Any) -> Any:
    """Return a path with the home folder in the place of a leading `~`; other values as they are.

    >>> from_home("~/shift.mcap") == os.path.expanduser("~") + "/shift.mcap", from_home(3)
    (True, 3)
    """
    if isinstance(value, str) and value.startswith("~"):
        return os.path.expanduser(value)
    if isinstance(value, Path) and value.parts[:1] and value.parts[0].startswith("~"):
        return Path(os.path.expanduser(value))
    return value


class Allowed(NamedTuple):
    """What an argument may be: in words, and as a test; and how a function gets it, by default as it is."""

    expected: str
    fits: Callable[[Any], bool]
    given_as: Callable[[Any], Any] | None = None

    def or_none(self) -> Allowed:
        """Return the same with None allowed.

        >>> COUNT.or_none().fits(None)
        True
        """
        return Allowed(f"{self.expected}, or None", lambda value: value is None or self.fits(value), self.given_as)


def is_number(value: Any) -> bool:
    """Return whether a value is a real number and no truth value."""
    return isinstance(value, _NUMBER) and not isinstance(value, _YES_NO)


def is_finite(value: Any) -> bool:
    """Return whether a value is a real number that a float can hold."""
    return is_number(value) and bool(abs(value) <= sys.float_info.max)


def items_of(value: Any) -> tuple[Any, ...] | None:
    """Return the items of a list, an array or another iterable; None of a text and of what has no items.

    >>> items_of(["a", "b"]), items_of("ab"), items_of(3)
    (('a', 'b'), None, None)
    """
    if isinstance(value, str):
        return None
    try:
        return tuple(value)
    except TypeError:
        return None


def _is_whole(value: Any) -> bool:
    return isinstance(value, _WHOLE) and not isinstance(value, _YES_NO)


def one_of(*names: str) -> Allowed:
    """Return that an argument is one of some names."""
    return Allowed("one of " + ", ".join(names), lambda value: isinstance(value, str) and value in names)


def instance(expected: str, *kinds: type) -> Allowed:
    """Return that an argument is an instance of one of some classes, in words a caller knows."""
    return Allowed(expected, lambda value: isinstance(value, kinds))


def has(expected: str, *attributes: str) -> Allowed:
    """Return that an argument has some attributes, for classes that are too costly to import for a check."""
    return Allowed(expected, lambda value: all(hasattr(value, name) for name in attributes))


def _names_a_file(value: Any) -> bool:
    if not isinstance(value, str | os.PathLike) or value == "":
        return False
    try:
        return b"\0" not in os.fsencode(value)
    except UnicodeEncodeError:  # half of a pair of UTF-16
        return False


TEXT: Final = Allowed("a text", lambda value: isinstance(value, str))
PATH: Final = Allowed("a path, as text or pathlib.Path", _names_a_file, from_home)
PATHS: Final = Allowed(
    "a path, or a list of the files of one recording",
    lambda value: PATH.fits(value) or (isinstance(value, list | tuple) and all(map(PATH.fits, value))),
    lambda value: [from_home(each) for each in value] if isinstance(value, list | tuple) else from_home(value),
)
YES_NO: Final = Allowed("True or False", lambda value: isinstance(value, _YES_NO))
MOMENT: Final = Allowed(
    "seconds from -1e9 to 1e9", lambda value: is_number(value) and -1_000_000_000 <= value <= 1_000_000_000
)
"""A time of a recording [s]."""
POSITIVE: Final = Allowed("a number above 0", lambda value: is_finite(value) and value > 0)
NOT_NEGATIVE: Final = Allowed("a number, 0 or more", lambda value: is_finite(value) and value >= 0)


def at_most(most: float) -> Allowed:
    """Return that an argument is a number above 0 up to another one."""
    return Allowed(f"a number above 0, at most {most:g}", lambda value: is_finite(value) and 0 < value <= most)


def count_to(most: int) -> Allowed:
    """Return that an argument is a whole number from 1 to another one."""
    return Allowed(f"a whole number from 1 to {most}", lambda value: _is_whole(value) and 0 < value <= most)


COUNT: Final = count_to(1_000_000_000)
SEED: Final = Allowed("a whole number from 0 to 4294967295", lambda value: _is_whole(value) and 0 <= value < 2**32)


def shown(value: Any) -> str:
    """Return a value as a message repeats it.

    >>> shown("x" * 100)
    'a str'
    >>> shown(2.5)
    '2.5'
    """
    if isinstance(value, int) and value.bit_length() > _LONG_BITS:  # Python refuses to write thousands of digits
        return f"a whole number of {value.bit_length()} bits"
    few = isinstance(value, tuple | list) and len(value) <= FEW and all(map(is_number, value))
    text = repr(value) if few or isinstance(value, str | int | float | bool | np.number | os.PathLike | None) else ""
    return text if 0 < len(text) <= LONGEST else f"a {type(value).__name__}"


def accepts(
    error: type[RebaError], **allowed: Allowed
) -> Callable[[Callable[_Given, _Result]], Callable[_Given, _Result]]:
    """Check arguments of a public function by name (a decorator); a wrong one raises `error`. `~` in paths is home.

    Args:
        **allowed: argument -> what it may be; arguments left out by the caller are not checked.

    >>> @accepts(RebaError, depth=COUNT)
    ... def search(depth: int = 3) -> int:
    ...     return depth
    >>> search(depth=2.5)
    Traceback (most recent call last):
    reba.errors.RebaError: search: depth is 2.5; expected a whole number from 1 to 1000000000
    """

    def decorate(function: Callable[_Given, _Result]) -> Callable[_Given, _Result]:
        signature = inspect.signature(function)
        called = function.__name__ if function.__name__ != "__init__" else function.__qualname__.split(".")[-2]

        @functools.wraps(function)
        def checked(*args: _Given.args, **kwargs: _Given.kwargs) -> _Result:
            try:
                bound = signature.bind(*args, **kwargs)
            except TypeError:
                return function(*args, **kwargs)  # Python's own words on a missing or unknown argument
            given = bound.arguments
            for name, rule in allowed.items():
                if name in given and not rule.fits(given[name]):
                    raise error(f"{called}: {name} is {shown(given[name])}; expected {rule.expected}")
                if name in given and rule.given_as is not None:
                    given[name] = rule.given_as(given[name])
            return function(*bound.args, **bound.kwargs)

        return checked

    return decorate
