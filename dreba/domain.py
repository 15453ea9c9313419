"""Domains: the angles that poses are drawn from, and how those poses are scored.

A domain names columns of the posture table with limits in degrees; columns it does not name are held at the angle of
their lowest score. Most domains are scored by exact REBA under their rules; a domain may bring its own bins instead.
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
from reba.errors import RebaError, did_you_mean
from reba.method.classes import angle_classes
from reba.method.rules import Rules, rules_of
from reba.posture.columns import BEST, COLUMNS, COLUMNS_OF

DOMAINS: Final = ("human", "human_description", "paper")
"""Domains that come with the package."""
LOAD: Final = (0.0, 20.0)
"""[kg] Loads that are drawn where a domain says nothing else."""


class Bins(NamedTuple):
    """Intervals of one angle and the points of each: k + 1 rising `edges` [deg], k `points`."""

    edges: tuple[float, ...]
    points: tuple[int, ...]


@dataclass(frozen=True)
class Domain:
    """Angles that poses are drawn from.

    Attributes:
        name: shown in files and reports.
        limits: column -> (low, high) [deg]; equal limits hold a column.
        rules: of the exact score of its poses.
        source: where the limits come from.
        title: for people.
        bins: column -> its own bins, which then give the true score; empty for exact REBA.
        sides: "each": arms are scored whole and the worse one counts, as REBA says; "worst part": the worse upper arm,
            lower arm and wrist count, whichever side they are on (only with own bins).
        load: [kg] lowest and highest load that is drawn, if loads are.

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
            whole = all(isinstance(points, int) and 0 <= points <= 4 for points in own.points)
            if column not in self.limits or len(own.edges) != len(own.points) + 1 or not rising or not whole:
                raise DomainError(f"domain {self.name!r}: bins of {column} need k + 1 rising edges and k points 0-4")
        if self.sides not in ("each", "worst part") or (self.sides == "worst part" and not self.bins):
            raise DomainError(f"domain {self.name!r}: sides is {self.sides!r}; expected 'each', or bins of its own")

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns that vary, in the order of `reba.COLUMNS`."""
        return tuple(c for c in COLUMNS if c in self.limits and self.limits[c][0] < self.limits[c][1])

    @property
    def low(self) -> Array:
        """(22,) lower limits [deg] in the order of `reba.COLUMNS`."""
        return np.array([self.limits.get(c, (BEST[c], BEST[c]))[0] for c in COLUMNS])

    @property
    def high(self) -> Array:
        """(22,) upper limits [deg] in the order of `reba.COLUMNS`."""
        return np.array([self.limits.get(c, (BEST[c], BEST[c]))[1] for c in COLUMNS])

    def hold(self, **angles: float) -> Self:
        """Return the domain with some columns held at an angle [deg].

        Raises:
            DomainError: an unknown column.
        """
        limits = {**self.limits, **{column: (float(angle), float(angle)) for column, angle in angles.items()}}
        return dataclasses.replace(self, limits=limits)

    def only(self, joints: Iterable[str]) -> Self:
        """Return the domain with every column but the named ones held at the angle of its lowest score."""
        moving = set(joints)
        return self.hold(**{column: best for column, best in BEST.items() if column not in moving})

    def bins_of(self, column: str) -> Bins:
        """Return the bins of a column within its limits: its own, or those of the rules' classes."""
        low, high = self.limits.get(column, (BEST[column], BEST[column]))
        if column in self.bins:
            own = self.bins[column]
            inside = [edge for edge in own.edges[1:-1] if low < edge < high]
            edges = (low, *inside, high)
            points = [own.points[int(np.searchsorted(own.edges[1:-1], _middle(edges, i)))] for i in _each(edges)]
            return Bins(edges, tuple(points))
        quantity = next(q for q in angle_classes(self.rules) if column in q.columns)
        # "Under 30" ends just below 30; poses are drawn up to the printed edge, which they meet with probability 0.
        ends = {round(end, 3) for c in quantity.classes for end in (c.low, c.high)}
        edges = (low, *sorted(end for end in ends if low < end < high), high)
        return Bins(edges, tuple(quantity.class_of(_middle(edges, i)).points for i in _each(edges)))

    def to_dict(self) -> dict[str, Any]:
        """Return the domain as plain data, as it is kept in pose and model files."""
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
        """Return the domain of what `to_dict` gave.

        Raises:
            DomainError: it is damaged.

        Example:
            >>> held = domain_of("paper").hold(knee_flexion_left=0.0)
            >>> Domain.from_dict(held.to_dict()) == held
            True
        """
        name = data.get("name")
        try:
            if data["scored_by"] == "own bins" and "bins" not in data and name in DOMAINS:  # named only
                own = domain_of(name).bins
            else:
                own = _bins(data.get("bins", {}))
            low, high = data.get("load", LOAD)
            return Domain(
                name=str(name),
                limits={column: (float(low), float(high)) for column, (low, high) in data["limits"].items()},
                rules=Rules().replace(**data["rules"]),
                source=str(data["source"]),
                title=str(data.get("title", "")),
                bins=own,
                sides=data["sides"],
                load=(float(low), float(high)),
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise DomainError(f"domain {name!r} is not whole ({error}); give --domain or --poses") from error

    @staticmethod
    def load_file(path: str | Path) -> Domain:
        """Read a domain from a TOML file: `name`, `[limits]` in degrees, and optionally `title`, `source`, `rules`
        (a preset's name or a table), `load`, `[bins]`, `sides`. A name without a side stands for both.

        Raises:
            DomainError: the file cannot be read, a key is unknown or a value wrong.
        """
        try:
            text = Path(path).read_text(encoding="utf-8")
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
    if not isinstance(which, str | Path):
        raise DomainError(f"domain is {which!r}; expected a name ({', '.join(DOMAINS)}), a .toml file or a Domain")
    if str(which) in DOMAINS:
        place = resources.files("dreba").joinpath("domains", f"{which}.toml")
        return _parse(place.read_text(encoding="utf-8"), str(which))
    if Path(which).suffix == ".toml":
        return Domain.load_file(which)
    near = did_you_mean(str(which), DOMAINS)
    raise DomainError(f"domain {str(which)!r} is unknown{near}; use {', '.join(DOMAINS)}, or a .toml file")


def _parse(text: str, where: str) -> Domain:
    try:
        given = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise DomainError(f"{where}: not TOML ({error})") from error
    known = {"name", "title", "source", "rules", "load", "limits", "bins", "sides"}
    for key in given:
        if key not in known:
            raise DomainError(f"{where}: unknown key {key!r}{did_you_mean(key, known)}; known: {', '.join(known)}")
    try:
        rules = given.get("rules", "measured")
        chosen = rules_of(rules) if isinstance(rules, str) else Rules().replace(**rules)
        bins = _bins(_both_sides(given.get("bins", {})))
        limits = {column: (own.edges[0], own.edges[-1]) for column, own in bins.items()}
        for column, (low, high) in _both_sides(given.get("limits", {})).items():
            limits[column] = (float(low), float(high))
        low, high = given.get("load", LOAD)
        return Domain(
            name=str(given.get("name", Path(where).stem)),
            limits=limits,
            rules=chosen,
            source=str(given.get("source", "")),
            title=str(given.get("title", "")),
            bins=bins,
            sides=given.get("sides", "each"),
            load=(float(low), float(high)),
        )
    except RebaError as error:
        raise DomainError(f"{where}: {error}") from error
    except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
        raise DomainError(
            f"{where}: a limit, bin or load is not as expected ({error}); write COLUMN = [low, high] in degrees"
        ) from error


def _bins(given: dict[str, Any]) -> dict[str, Bins]:
    return {
        column: Bins(tuple(float(edge) for edge in own["edges"]), tuple(own["points"])) for column, own in given.items()
    }


def _both_sides(given: dict[str, Any]) -> dict[str, Any]:
    """Return names without a side written out for both columns."""
    return {column: value for name, value in given.items() for column in COLUMNS_OF.get(name, (name,))}


def _each(edges: tuple[float, ...]) -> range:
    return range(len(edges) - 1)


def _middle(edges: tuple[float, ...], i: int) -> float:
    return (edges[i] + edges[i + 1]) / 2
