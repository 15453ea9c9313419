"""Strict reading of one TOML table: keys are queried by name, keys that no method queried are refused."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any, Final

from reba.checks import shown
from reba.errors import RebaError, did_you_mean

LARGEST: Final = 1e6
"""Largest number that is read [m, kg, deg, s, ...]; no real one is near, and its powers stay finite."""
_SHOWN: Final = 200
"""Characters of a value that a message repeats."""


class TomlTable:
    """One table of a TOML file.

    Args:
        where: how messages call the table ("screwdriver: tables.left").
        values: the table.
        error: class of the errors raised.

    >>> TomlTable("scene: human", {"stature": 1.7}, ValueError).number("stature", low=1.0)
    1.7
    """

    def __init__(self, where: str, values: Any, error: type[ValueError] = RebaError) -> None:
        if not isinstance(values, Mapping):
            raise error(f"{where} is {_text(values)}, expected a table of keys")
        self.where, self.values, self.error = where, values, error
        self.queried: set[str] = set()

    def has(self, key: str) -> bool:
        """Return whether the table has a key."""
        self.queried.add(key)
        return key in self.values

    def keys(self, known: Iterable[str], what: str = "key") -> tuple[str, ...]:
        """Return the keys in the order of the file and refuse those not `known`.

        `what` is what messages call a key ("segment", "column").
        """
        names = tuple(known)
        for key in self.values:
            if key not in names:
                hint = did_you_mean(key, names) or f"; known are {', '.join(names)}"
                raise self.error(f"{self.where}: unknown {what} {key!r}{hint}")
        self.queried.update(self.values)
        return tuple(self.values)

    def number(self, key: str, default: float | None = None, low: float = -LARGEST, high: float = LARGEST) -> float:
        """Return a number from low to high."""
        return self._number(key, self._value(key, default), low, high)

    def whole(self, key: str, default: int | None = None, low: int = 0, high: int = int(LARGEST)) -> int:
        """Return a whole number from low to high."""
        value = self._number(key, self._value(key, default), low, high)
        if value != int(value):
            raise self.error(f"{self.where}: {key} is {value:g}, expected a whole number")
        return int(value)

    def vector(
        self,
        key: str,
        n: int,
        default: tuple[float, ...] | None = None,
        low: float = -LARGEST,
        high: float = LARGEST,
        *,
        one: bool = False,
    ) -> Any:
        """Return n numbers from low to high as a tuple; with `one`, a number alone stands for n of it."""
        value = self._value(key, default)
        if one and isinstance(value, (int, float)):
            value = (value,) * n
        if not isinstance(value, (list, tuple)) or len(value) != n:
            expected = f"{n} numbers, or one for all" if one else f"{n} numbers"
            raise self.error(f"{self.where}: {key} is {_text(value)}, expected {expected}")
        return tuple(self._number(key, part, low, high) for part in value)

    def series(self, key: str) -> tuple[float, ...]:
        """Return a list of numbers, of any length, as a tuple."""
        value = self._value(key, None)
        if not isinstance(value, (list, tuple)):
            raise self.error(f"{self.where}: {key} is {_text(value)}, expected a list of numbers")
        numbers: tuple[float, ...] = self.vector(key, len(value))
        return numbers

    def unit(self, key: str, default: tuple[float, float, float] | None = None) -> Any:
        """Return three numbers that are not all 0, scaled to length 1, as a tuple."""
        value = self.vector(key, 3, default)
        length = math.hypot(*value)
        if length < 1e-9:
            raise self.error(f"{self.where}: {key} is {list(value)}, expected a direction")
        return tuple(part / length for part in value)

    def text(self, key: str, default: str | None = None, choices: Iterable[str] | None = None) -> str:
        """Return a string, one of the choices if there are any."""
        value = self._value(key, default)
        known = list(choices or ())
        if not isinstance(value, str) or (choices is not None and value not in known):
            hint = did_you_mean(value, known) if isinstance(value, str) else ""
            expected = f"one of {', '.join(each or repr(each) for each in known) or 'those defined (there is none)'}"
            if choices is None:
                expected = "text in quotes"
            raise self.error(f"{self.where}: {key} is {_text(value)}, expected {expected}{hint}")
        return value

    def texts(self, key: str, default: tuple[str, ...] | None = None) -> tuple[str, ...]:
        """Return a list of strings as a tuple."""
        value = self._value(key, default)
        if not isinstance(value, (list, tuple)) or not all(isinstance(part, str) for part in value):
            raise self.error(f"{self.where}: {key} is {_text(value)}, expected a list of texts in quotes")
        return tuple(value)

    def names(self, key: str) -> tuple[str, ...]:
        """Return one name or a list of names as a tuple; no name is empty."""
        value = self._value(key, None)
        items = value if isinstance(value, list) else [value]
        if not all(isinstance(item, str) and item for item in items):
            raise self.error(f"{self.where}: {key} is {_text(value)}, expected names in quotes")
        return tuple(items)

    def flag(self, key: str) -> bool:
        """Return true or false."""
        value = self._value(key, None)
        if not isinstance(value, bool):
            raise self.error(f"{self.where}: {key} is {_text(value)}, expected true or false")
        return value

    def table(self, key: str) -> TomlTable:
        """Return a table inside this one; an absent one is empty."""
        self.queried.add(key)
        return TomlTable(f"{self.where}{'.' if ':' in self.where else ': '}{key}", self.values.get(key, {}), self.error)

    def tables(self, key: str) -> dict[str, TomlTable]:
        """Return the named tables inside the table of a key."""
        inner = self.table(key)
        return {name: inner.table(name) for name in inner.values}

    def numbers(self, key: str) -> dict[str, float]:
        """Return a table of numbers by name; an absent one is empty."""
        inner = self.table(key)
        return {name: inner.number(name) for name in inner.values}

    def done(self) -> None:
        """Refuse keys that no method queried."""
        self.keys(sorted(self.queried))

    def _value(self, key: str, default: Any) -> Any:
        self.queried.add(key)
        value = self.values.get(key, default)
        if value is None:
            raise self.error(f"{self.where}: {key} is missing; give it a value")
        return value

    def _number(self, key: str, value: Any, low: float, high: float) -> float:
        # TOML and JSON have integers of any size; some are too large for a float.
        whole = isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1 << 1000
        if not whole and not (isinstance(value, float) and math.isfinite(value)):
            raise self.error(f"{self.where}: {key} is {_text(value)}, expected a finite number")
        if not low <= value <= high:
            raise self.error(f"{self.where}: {key} is {value:g}, expected {low:g} to {high:g}")
        return float(value)


def _text(value: Any) -> str:
    """Return a value as a message repeats it; whole numbers of TOML may have more digits than Python writes."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):
        return shown(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}..."
