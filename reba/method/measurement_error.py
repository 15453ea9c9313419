"""Measurement error as an input: how far measured angles lie from the true ones, in degrees for each column.

The model: measured angle = true angle + bias + a normal error of the given standard deviation, independent of the
errors of all other angles. Tables for four kinds of measurement are in `errors/`, with the source of every number.
"""

from __future__ import annotations

import dataclasses
import functools
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from reba.checks import is_number, shown
from reba.errors import PostureError
from reba.open_file import read_settings
from reba.posture.columns import COLUMNS, COLUMNS_OF, columns_named
from reba.toml_table import TomlTable

MEASUREMENTS: Final = ("optical", "inertial", "multi-camera", "one-camera")
"""Kinds of measurement with a table: markers, inertial sensors, several cameras without markers, one camera."""
SHIPPED: Final = Path(__file__).parent / "errors"
LARGEST: Final = 180.0
"""[deg] No standard deviation or bias is larger."""
EXACT: Final = 1e-6
"""[deg] A smaller standard deviation counts as 0."""
_NOTHING: Final = (0.0,) * len(COLUMNS)


@dataclass(frozen=True)
class MeasurementError:
    """The error of each angle column.

    Attributes:
        name: shown in every output.
        title: what was measured, and how.
        sd: (22,) standard deviation [deg] in the order of `reba.COLUMNS`; 0: the angle is exact.
        bias: (22,) measured minus true angle on average [deg].
        sources: (22,) where the numbers come from; "" if not given.
        chosen: columns whose numbers are a choice, because no source gives them.

    Raises:
        PostureError: not one number in its range for each column.

    Example:
        >>> MeasurementError.of({"knee_flexion": 4.0}).sd[COLUMNS.index("knee_flexion_left")]
        4.0
    """

    name: str = "own"
    title: str = ""
    sd: tuple[float, ...] = _NOTHING
    bias: tuple[float, ...] = _NOTHING
    sources: tuple[str, ...] = ("",) * len(COLUMNS)
    chosen: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, numbers, lowest in (("sd", self.sd, 0.0), ("bias", self.bias, -LARGEST)):
            fits = isinstance(numbers, tuple) and len(numbers) == len(COLUMNS) and all(map(is_number, numbers))
            if not fits or not all(lowest <= number <= LARGEST for number in numbers):
                expected = f"{len(COLUMNS)} numbers from {lowest:g} to {LARGEST:g} [deg], in a tuple"
                raise PostureError(f"{name} of a measurement error is {shown(numbers)}; expected {expected}")

    @staticmethod
    def of(which: str | Path | Mapping[str, Any] | MeasurementError) -> MeasurementError:
        """Return the table of a kind of measurement, a TOML file or a mapping, or the record itself.

        Args:
            which: "optical", "inertial", "multi-camera" or "one-camera"; a file ending in .toml; or a mapping of
                columns to a standard deviation [deg] or to `{"sd": ..., "bias": ...}`. A name without a side stands for
                both, and columns without an entry have no error, or with `base` that of a table.

        Raises:
            PostureError: no such table, the file cannot be read, or a column or number is wrong.
        """
        if isinstance(which, MeasurementError):
            return which
        if isinstance(which, Mapping):
            return _from_table(TomlTable("error", _plain(which), PostureError), "own")
        if isinstance(which, str) and which in MEASUREMENTS:
            return _shipped(which)
        if isinstance(which, str | Path) and str(which).endswith(".toml"):
            return _load(Path(which), Path(which).stem)
        kinds = ", ".join(MEASUREMENTS)
        raise PostureError(f"error {shown(which)} is unknown; use one of {kinds}, or a file ending in .toml")

    def without(self, columns: Iterable[str]) -> MeasurementError:
        """Return the record with some columns exact: flags that stand for angles have no error in degrees.

        Raises:
            PostureError: a column is unknown.
        """
        if isinstance(columns, tuple | list) and not columns:
            return self
        exact = columns_named(columns)
        sd, bias = (
            tuple(0.0 if column in exact else number for column, number in zip(COLUMNS, numbers, strict=True))
            for numbers in (self.sd, self.bias)
        )
        return dataclasses.replace(self, sd=sd, bias=bias)

    def to_dict(self) -> dict[str, Any]:
        """Return name, standard deviations and biases by column, and the columns whose numbers are a choice."""
        return {
            "name": self.name,
            "sd": dict(zip(COLUMNS, self.sd, strict=True)),
            "bias": dict(zip(COLUMNS, self.bias, strict=True)),
            "chosen": list(self.chosen),
        }


ErrorInput = str | Path | Mapping[str, Any] | MeasurementError
"""What public functions take as a measurement error, see `MeasurementError.of`."""


@functools.lru_cache(maxsize=len(MEASUREMENTS))
def _shipped(name: str) -> MeasurementError:
    return _load(SHIPPED / f"{name}.toml", name)


def _load(path: Path, name: str) -> MeasurementError:
    try:
        values = tomllib.loads(read_settings(path))
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or error
        raise PostureError(f"{path}: cannot be read as measurement error ({why}); give a TOML file") from error
    except (ValueError, RecursionError) as error:
        raise PostureError(f"{path}: not TOML ({error})") from error
    return _from_table(TomlTable(str(path), values, PostureError), name)


def _plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a mapping with numbers of NumPy as those of Python, which TOML has."""
    return {
        key: _plain(value) if isinstance(value, Mapping) else value.item() if isinstance(value, np.generic) else value
        for key, value in values.items()
    }


def _from_table(table: TomlTable, name: str) -> MeasurementError:
    given = table.keys(("base", "title", *COLUMNS_OF, *COLUMNS), "column")
    if not {*given} - {"title"}:
        raise table.error(f"{table.where}: no error of any column; give some, like trunk_flexion = 4.0")
    base = _shipped(table.text("base", choices=MEASUREMENTS)) if table.has("base") else MeasurementError()
    sd, bias, sources = list(base.sd), list(base.bias), list(base.sources)
    chosen = set(base.chosen)
    # A side given by its own name replaces what stands for both, in whatever order the file has them.
    for key in dict.fromkeys((*COLUMNS_OF, *COLUMNS)):
        if key not in table.values:
            continue
        one = table.table(key) if isinstance(table.values[key], Mapping) else None
        spread = table.number(key, low=0.0, high=LARGEST) if one is None else one.number("sd", low=0.0, high=LARGEST)
        offset = 0.0 if one is None else one.number("bias", 0.0, -LARGEST, LARGEST)
        source = "" if one is None else one.text("source", "")
        ours = one is not None and one.has("choice") and one.flag("choice")
        if one is not None:
            one.done()
        for column in COLUMNS_OF.get(key, (key,)):
            at = COLUMNS.index(column)
            sd[at], bias[at], sources[at] = (spread if spread >= EXACT else 0.0), offset, source
            (chosen.add if ours else chosen.discard)(column)
    return MeasurementError(
        name=name,
        title=table.text("title", base.title),
        sd=tuple(sd),
        bias=tuple(bias),
        sources=tuple(sources),
        chosen=tuple(column for column in COLUMNS if column in chosen),
    )
