"""Strict reading of one TOML table: every key is queried by name, keys left over are refused."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from reba.errors import RebaError, did_you_mean


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
            raise error(f"{where} is {values!r}, expected a table of keys")
        self.where, self.values, self.error = where, values, error
        self.asked: set[str] = set()

    def has(self, key: str) -> bool:
        """Return whether a key is given."""
        self.asked.add(key)
        return key in self.values

    def number(self, key: str, default: float | None = None, low: float = -math.inf, high: float = math.inf) -> float:
        """Return a finite number from low to high."""
        return self._number(key, self._value(key, default), low, high)

    def vector(self, key: str, n: int, default: tuple[float, ...] | None = None, low: float = -math.inf) -> Any:
        """Return n numbers as a tuple."""
        value = self._value(key, default)
        if not isinstance(value, (list, tuple)) or len(value) != n:
            raise self.error(f"{self.where}: {key} is {value!r}, expected {n} numbers")
        return tuple(self._number(key, part, low, math.inf) for part in value)

    def series(self, key: str) -> tuple[float, ...]:
        """Return a list of numbers, of any length, as a tuple."""
        value = self._value(key, None)
        if not isinstance(value, (list, tuple)):
            raise self.error(f"{self.where}: {key} is {value!r}, expected a list of numbers")
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
        """Return a string, one of the choices if they are given."""
        value = self._value(key, default)
        known = list(choices or ())
        if not isinstance(value, str) or (choices is not None and value not in known):
            hint = did_you_mean(value, known) if isinstance(value, str) else ""
            expected = f"one of {', '.join(known) or 'those that are given (there is none)'}"
            if choices is None:
                expected = "a text"
            raise self.error(f"{self.where}: {key} is {value!r}, expected {expected}{hint}")
        return value

    def texts(self, key: str, default: tuple[str, ...] | None = None) -> tuple[str, ...]:
        """Return a list of strings as a tuple."""
        value = self._value(key, default)
        if not isinstance(value, (list, tuple)) or not all(isinstance(part, str) for part in value):
            raise self.error(f"{self.where}: {key} is {value!r}, expected a list of texts")
        return tuple(value)

    def table(self, key: str) -> TomlTable:
        """Return a table inside this one; an absent one is empty."""
        self.asked.add(key)
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
        """Refuse keys that nobody asked for."""
        for key in self.values:
            if key not in self.asked:
                hint = did_you_mean(key, self.asked) or f"; known are {', '.join(sorted(self.asked))}"
                raise self.error(f"{self.where}: unknown key {key!r}{hint}")

    def _value(self, key: str, default: Any) -> Any:
        self.asked.add(key)
        value = self.values.get(key, default)
        if value is None:
            raise self.error(f"{self.where}: {key} is missing; give it a value")
        return value

    def _number(self, key: str, value: Any, low: float, high: float) -> float:
        # Whole numbers can be too large for a float, and of TOML and JSON they have no end.
        whole = isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1 << 1000
        if not whole and not (isinstance(value, float) and math.isfinite(value)):
            raise self.error(f"{self.where}: {key} is {value!r}, expected a finite number")
        if not low <= value <= high:
            bounds = f"at least {low:g}" if math.isinf(high) else f"{low:g} to {high:g}"
            raise self.error(f"{self.where}: {key} is {value:g}, expected {bounds}")
        return float(value)
