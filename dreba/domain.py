"""Domains: limits [deg] of the angles that poses are drawn from, and the rules that score these poses.

Columns of the posture table without limits are held at the angle of their lowest score. Poses are scored by exact REBA
under the rules of the domain, or by bins that the domain defines itself.
"""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple, Self

import numpy as np

from dreba.errors import DomainError
from reba.arrays import Array
from reba.checks import PATH, accepts, from_home, is_finite, shown
from reba.errors import RebaError, did_you_mean
from reba.method.classes import angle_classes
from reba.method.rules import Rules, rules_of
from reba.open_file import read_settings
from reba.posture.columns import BEST, COLUMNS, by_column, columns_named
from reba.toml_table import TomlTable

DOMAINS: Final = ("human", "human_description", "paper")
"""Names of the shipped domains."""
LOAD: Final = (0.0, 20.0)
"""[kg] Range of drawn loads by default: all three load classes of REBA, and up to twice the last edge of 10 kg."""


class Bins(NamedTuple):
    """Classes of one angle: k + 1 rising `edges` [deg] and the `points` of the k intervals between them."""

    edges: tuple[float, ...]
    points: tuple[int, ...]


@dataclass(frozen=True)
class Domain:
    """Limits of the angles that poses are drawn from, and the rules of their scores.

    Attributes:
        name: identifier in files and reports.
        limits: column -> (low, high) [deg]; equal limits hold the column at an angle.
        rules: rules of the exact score of its poses.
        source: reference for the limits.
        title: heading in reports.
        bins: column -> `Bins` that give the true score instead of the rules; empty for exact REBA.
        sides: "each": each arm has a Score B and the worse one counts, as in REBA; "worst part": the worse upper arm,
            lower arm and wrist of the two sides are combined (only with bins).
        load: (low, high) [kg] of drawn loads.

    Example:
        >>> domain_of("human").limits["trunk_flexion"]
        (-30.0, 110.0)
    """

    name: str
    limits: dict[str, tuple[float, float]]
    rules: Rules = field(default_factory=Rules)
    source: str = ""
    title: str = ""
    bins: dict[str, Bins] = field(default_factory=dict)
    sides: Literal["each", "worst part"] = "each"
    load: tuple[float, float] = LOAD

    def __post_init__(self) -> None:
        self._check_types()
        for column, (low, high) in self.limits.items():
            if column not in COLUMNS:
                raise DomainError(f"domain {self.name!r}: column {column!r} is unknown{did_you_mean(column, COLUMNS)}")
            if not -360.0 <= low <= high <= 360.0:
                raise DomainError(
                    f"domain {self.name!r}: {column} has limits {low:g} to {high:g}; expected rising degrees"
                )
        if not 0.0 <= self.load[0] <= self.load[1] < float("inf"):
            raise DomainError(f"domain {self.name!r}: load is {self.load}; expected rising kilograms, 0 or more")
        for column, own in self.bins.items():
            rising = all(a < b for a, b in zip(own.edges, own.edges[1:], strict=False))
            valid = all(isinstance(points, int) and 0 <= points <= 4 for points in own.points)
            if column not in self.limits or len(own.edges) != len(own.points) + 1 or not rising or not valid:
                raise DomainError(
                    f"domain {self.name!r}: bins of {column} are {own}; expected k + 1 rising edges and k points 0-4"
                )
        if self.sides not in ("each", "worst part") or (self.sides == "worst part" and not self.bins):
            raise DomainError(
                f"domain {self.name!r}: sides is {self.sides!r}; expected 'each', or 'worst part' with bins"
            )

    def _check_types(self) -> None:
        """Refuse values of the wrong type (DomainError); `__post_init__` checks the numbers."""
        tables = {"limits": ("degrees, (low, high) by column", self.limits, _is_pair),
                  "bins": ("Bins by column", self.bins, lambda own: isinstance(own, Bins))}  # fmt: skip
        for name, (expected, table, fits) in tables.items():
            if not isinstance(table, dict) or not all(map(fits, table.values())):
                raise DomainError(f"domain {shown(self.name)}: {name} are {shown(table)}; expected {expected}")
        for name, expected, right in (
            ("name", "a text", isinstance(self.name, str)),
            ("rules", "reba.Rules", isinstance(self.rules, Rules)),
            ("sides", "'each', or 'worst part' with bins", isinstance(self.sides, str)),
            ("load", "rising kilograms, 0 or more", _is_pair(self.load)),
        ):
            if not right:
                raise DomainError(
                    f"domain {shown(self.name)}: {name} is {shown(getattr(self, name))}; expected {expected}"
                )

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns that vary, in the order of `reba.COLUMNS`."""
        return tuple(c for c in COLUMNS if c in self.limits and self.limits[c][0] < self.limits[c][1])

    @property
    def low(self) -> Array:
        """Lower limits (22,) [deg] in the order of `reba.COLUMNS`."""
        return np.array([self.limits.get(c, (BEST[c], BEST[c]))[0] for c in COLUMNS])

    @property
    def high(self) -> Array:
        """Upper limits (22,) [deg] in the order of `reba.COLUMNS`."""
        return np.array([self.limits.get(c, (BEST[c], BEST[c]))[1] for c in COLUMNS])

    def hold(self, **angles: float) -> Self:
        """Return the domain with some columns held at an angle [deg]; a name without a side stands for both.

        Raises:
            DomainError: an unknown column.
        """
        for name, angle in angles.items():
            if not is_finite(angle):
                raise DomainError(f"{name} is held at {shown(angle)}; expected degrees")
        limits = self.limits | {name: (float(angle), float(angle)) for name, angle in by_column(angles).items()}
        return dataclasses.replace(self, limits=limits)

    def only(self, joints: Iterable[str]) -> Self:
        """Return the domain in which only the named columns vary; the others are held at their neutral angle.

        Raises:
            DomainError: an unknown column.
        """
        moving = columns_named(joints, DomainError)
        return self.hold(**{column: best for column, best in BEST.items() if column not in moving})

    def bins_of(self, column: str) -> Bins:
        """Return the bins of a column within its limits: those of the domain, or the angle classes of the rules."""
        if not isinstance(column, str) or column not in BEST:
            raise DomainError(f"column {shown(column)} is unknown; expected one of reba.COLUMNS")
        low, high = self.limits.get(column, (BEST[column], BEST[column]))
        if column in self.bins:
            own = self.bins[column]
            inside = [edge for edge in own.edges[1:-1] if low < edge < high]
            edges = (low, *inside, high)
            points = [own.points[int(np.searchsorted(own.edges[1:-1], _midpoint(edges, i)))] for i in _intervals(edges)]
            return Bins(edges, tuple(points))
        classes = next(known for known in angle_classes(self.rules) if column in known.columns)
        # "Under 30" ends just below 30; poses are drawn up to the printed edge, which they meet with probability 0.
        ends = {round(end, 3) for c in classes.classes for end in (c.low, c.high)}
        edges = (low, *sorted(end for end in ends if low < end < high), high)
        return Bins(edges, tuple(classes.class_of(_midpoint(edges, i)).points for i in _intervals(edges)))

    def to_dict(self) -> dict[str, Any]:
        """Return the domain as plain data, the form of pose and model files."""
        return {
            "name": self.name,
            "limits": {column: list(ends) for column, ends in self.limits.items()},
            "rules": dataclasses.asdict(self.rules),
            "scored_by": "own bins" if self.bins else "rules",
            "bins": {
                column: {"edges": list(own.edges), "points": list(own.points)} for column, own in self.bins.items()
            },
            "sides": self.sides,
            "load": list(self.load),
            "source": self.source,
            "title": self.title,
        }

    @staticmethod
    def from_dict(data: dict[str, Any]) -> Domain:
        """Return the domain from the plain data of `to_dict`.

        Raises:
            DomainError: a key is missing or a value wrong.

        Example:
            >>> held = domain_of("paper").hold(knee_flexion_left=0.0)
            >>> Domain.from_dict(held.to_dict()) == held
            True
        """
        if not isinstance(data, dict):
            raise DomainError(f"a domain is {shown(data)}; expected the plain data of `to_dict`")
        name = data.get("name")
        try:
            if data["scored_by"] == "own bins" and "bins" not in data and name in DOMAINS:
                bins = domain_of(name).bins  # a file may name a shipped domain without its bins
            else:
                bins = {
                    column: Bins(tuple(float(edge) for edge in own["edges"]), tuple(own["points"]))
                    for column, own in data.get("bins", {}).items()
                }
            low, high = data.get("load", LOAD)
            return Domain(
                name=str(name),
                limits={column: (float(low), float(high)) for column, (low, high) in data["limits"].items()},
                rules=Rules().replace(**data["rules"]),
                source=str(data["source"]),
                title=str(data.get("title", "")),
                bins=bins,
                sides=data["sides"],
                load=(float(low), float(high)),
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise DomainError(f"domain {name!r} is incomplete or damaged ({error}); use --domain or --poses") from error

    @staticmethod
    @accepts(DomainError, path=PATH)
    def load_file(path: str | Path) -> Domain:
        """Read a domain from a TOML file: `name`, `[limits]` in degrees, and optionally `title`, `source`, `rules`
        (a preset's name or a table), `load`, `[bins]`, `sides`. A name without a side stands for both.

        Raises:
            DomainError: the file cannot be read, a key is unknown or a value wrong.
        """
        try:
            text = read_settings(path)
        except (OSError, UnicodeDecodeError) as error:
            raise DomainError(f"{path}: cannot be read as a domain ({error}); give a TOML file or a name") from error
        return _parse(text, str(path))


def domain_of(which: str | Path | Domain) -> Domain:
    """Return a domain by its name, from a TOML file, or the record itself.

    Raises:
        DomainError: neither a known name nor a readable file.
    """
    if isinstance(which, Domain):
        return which
    which = from_home(which)
    if not isinstance(which, str | Path):
        raise DomainError(f"domain is {shown(which)}; expected a name ({', '.join(DOMAINS)}), a .toml file or a Domain")
    if str(which) in DOMAINS:
        place = resources.files("dreba").joinpath("domains", f"{which}.toml")
        return _parse(place.read_text(encoding="utf-8"), str(which))
    if Path(which).suffix == ".toml":
        return Domain.load_file(which)
    near = did_you_mean(str(which), DOMAINS)
    raise DomainError(f"domain {str(which)!r} is unknown{near}; use {', '.join(DOMAINS)}, or a .toml file")


def _parse(text: str, where: str) -> Domain:
    """Return the domain of a TOML text; `where` is its file or name, for messages."""
    try:
        table = TomlTable(where, tomllib.loads(text), DomainError)
    except (ValueError, RecursionError) as error:
        raise DomainError(f"{where}: not TOML ({error})") from error
    bins = by_column({name: _bins(own) for name, own in table.tables("bins").items()})
    limits = {column: (own.edges[0], own.edges[-1]) for column, own in bins.items() if own.edges}
    ranges = table.table("limits")
    limits |= by_column({name: ranges.vector(name, 2) for name in ranges.values})
    preset = isinstance(table.values.get("rules", ""), str)
    rules = table.text("rules", "measured") if preset else table.table("rules").values
    name, title, source = table.text("name", Path(where).stem), table.text("title", ""), table.text("source", "")
    sides, load = table.text("sides", "each"), table.vector("load", 2, LOAD)
    table.done()
    try:
        return Domain(
            name=name,
            limits=limits,
            rules=rules_of(rules) if isinstance(rules, str) else Rules().replace(**rules),
            source=source,
            title=title,
            bins=bins,
            sides=sides,  # type: ignore[arg-type]
            load=load,
        )
    except RebaError as error:
        raise DomainError(f"{where}: {error}") from error


def _bins(table: TomlTable) -> Bins:
    edges, points = table.series("edges"), table.series("points")
    table.done()
    if not all(number.is_integer() for number in points):
        raise DomainError(f"{table.where}: points are {points}; expected whole numbers from 0 to 4")
    return Bins(edges, tuple(int(number) for number in points))


def _is_pair(value: Any) -> bool:
    """Return whether a value is two finite numbers."""
    return isinstance(value, tuple | list) and len(value) == len(("low", "high")) and all(map(is_finite, value))


def _intervals(edges: tuple[float, ...]) -> range:
    return range(len(edges) - 1)


def _midpoint(edges: tuple[float, ...], i: int) -> float:
    return (edges[i] + edges[i + 1]) / 2
