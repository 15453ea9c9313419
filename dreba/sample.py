"""Random poses, evenly filled over REBA classes, without rejection.

The distribution, in the order of drawing:

1. The class is uniform over the classes asked for (their counts differ by one at most).
2. Given the class, the pose follows the domain's own distribution *conditioned on that class*. Before conditioning
   every angle is independent: it falls into one of its bins (the classes of the rules, cut at the domain's limits) and
   is uniform inside. How likely the bins are is `weights`:
   "bins" (default): each bin of an angle is equally likely, as in the sampler of the paper's authors. Every threshold
   then has poses on both sides, however narrow a band is.
   "volume": in proportion to width. Within a class the poses are then uniform draws over the limits that have it.
   "cells": every combination of part scores that leads to the class is equally likely, uniform within it.

Because parts depend on separate angles, the conditional distribution is drawn exactly: first the pair of Score A and
Score B (both arms, load, coupling and activity included), then part scores that lead to them, then boxes, then angles.
Class 1 is 1e-5 to 1e-4 of uniform draws, so rejection would need 10^5 draws per pose.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

import reba
from dreba.cells import WEIGHTS, Part, Weights, parts_of, true_scores
from dreba.domain import Domain, domain_of
from dreba.errors import SampleError
from dreba.poses import Poses
from reba.factors import ACTIVITIES, Factors, points
from reba.posture import ANGLES, COLUMNS, SIDES
from reba.rules import LOAD_EDGES
from reba.tables import TABLE_A, TABLE_B, TABLE_C

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

Rng = np.random.Generator | int | tuple[int, ...] | None

FACTOR_NAMES: Final = ("load", "coupling", "activity")
"""Factors that can be drawn."""
ADJUSTMENTS: Final = (
    "trunk_side_bend", "trunk_twist", "neck_side_bend", "neck_twist", "upper_arm_abduction", "shoulder_elevation",
    "wrist_deviation", "wrist_twist",
)  # fmt: skip
"""Angles that only give an adjustment."""
MOST: Final = 20_000_000
"""Poses drawn at once at most; they take 8 GB."""
_ARM: Final = (
    "upper_arm_flexion", "upper_arm_abduction", "shoulder_elevation", "lower_arm_flexion", "wrist_flexion",
    "wrist_deviation", "wrist_twist",
)  # fmt: skip
_TOTALS: Final = 12
"""Scores A and B run from 1 to 12."""


def sample(
    n: int,
    classes: Iterable[int] = range(1, 11),
    *,
    domain: str | Domain = "human",
    rng: Rng = None,
    weights: Weights = "bins",
    stratified: bool = False,
    factors: Sequence[str] | Factors | None = None,
    adjustments: bool = True,
    arms: str = "both",
) -> Poses:
    """Draw poses evenly over REBA classes. The module's text says from which distribution.

    Args:
        n: number of poses.
        classes: REBA scores to fill; up to 11 without factors, up to 15 with them.
        domain: name, TOML file or record.
        rng: generator, or a seed (a whole number or several); None for a fresh seed, which is recorded.
        weights: "bins", "volume" or "cells".
        stratified: within each class keep the counts of Scores A and B, and within these of the part scores, within
            one of their expectation, instead of drawing them independently.
        factors: names of factors to draw ("load", "coupling", "activity"), or a record of scalars that all poses share.
        adjustments: whether angles that only adjust a part score are drawn; otherwise they are held at 0.
        arms: "both", or "left" or "right": the other arm is held at rest.

    Raises:
        SampleError: an argument is wrong, or a class cannot be reached in the domain.

    Example:
        >>> poses = sample(1000, classes=range(1, 11), rng=7)
        >>> poses.counts[1], poses.counts[10]
        (100, 100)
    """
    wanted = _classes(classes)
    if isinstance(n, bool) or not isinstance(n, int | np.integer) or not len(wanted) <= n <= MOST:
        raise SampleError(
            f"n is {n!r}; expected a whole number, at least one pose for each of {len(wanted)} classes, "
            f"at most {MOST:,} (draw more in parts, each with a seed of its own)"
        )
    if weights not in WEIGHTS:
        raise SampleError(f"weights are {weights!r}; expected one of {', '.join(WEIGHTS)}")
    fixed, drawn = _factors(factors)
    space = _held(domain_of(domain), adjustments, arms)
    generator, seed = _generator(rng)
    plan = _Plan(space, fixed, drawn, weights)
    shares = np.full(len(wanted), n // len(wanted)) + (np.arange(len(wanted)) < n % len(wanted))
    angles, found = plan.draw(wanted, shares, generator, stratified)
    used = found if drawn else (fixed if factors is not None else None)
    provenance = {
        "domain": space.to_dict(), "n": int(n), "classes": list(wanted), "weights": weights, "stratified": stratified,
        "factors": list(drawn), **_shared(factors), "adjustments": adjustments, "arms": arms, **seed,
        "version": reba.__version__,
    }  # fmt: skip
    return Poses(angles, true_scores(space, angles, used), used, provenance)


@dataclass(frozen=True)
class _Cells:
    """Combinations of three part scores and one factor's points that lead to Score A or B; m cells.

    Attributes:
        parts: four (m,) index arrays, part scores minus 1 and the factor's points.
        score: (m,) Score A or B minus 1.
        weight: (m,) probability.
        chance: (12,) probability of each score.
    """

    parts: tuple[Integers, ...]
    score: Integers
    weight: Array
    chance: Array


class _Plan:
    """The distribution over (Score A, Score B of each arm, activity), and how to draw poses from it."""

    def __init__(self, domain: Domain, fixed: Factors, drawn: tuple[str, ...], weights: Weights) -> None:
        given = points(fixed, domain.rules, 1)
        self.domain, self.fixed, self.drawn = domain, fixed, drawn
        self.group_a, self.arms = parts_of(domain, given, weights)
        self.load_bins = _load_bins(domain)
        load = _load_chances(self.load_bins, weights) if "load" in drawn else _one(int(given.load_force[0]))
        self.cells_a = _cells(TABLE_A, self.group_a, load)
        coupling = [np.full(4, 0.25) if "coupling" in drawn else _one(int(side[0])) for side in given.coupling]
        if len(self.arms) == 1 and "coupling" not in drawn:
            coupling = [_one(int(max(side[0] for side in given.coupling)))]
        self.cells_b = [_cells(TABLE_B, arm, chance) for arm, chance in zip(self.arms, coupling, strict=False)]
        activity = np.full(4, 0.25) if "activity" in drawn else _one(int(given.activity[0]))
        self.chances, self.totals = self._states(activity)

    def _states(self, activity: Array) -> tuple[Array, Integers]:
        """Return the probability and the REBA class of every state (Score A, Score B ..., activity)."""
        b = np.arange(_TOTALS)
        worse = b if len(self.arms) == 1 else np.maximum.outer(b, b)
        if self.domain.rules.two_sides != "worse" and len(self.arms) == 2:
            worse = np.broadcast_to(b[:, None] if self.domain.rules.two_sides == "left" else b, worse.shape)
        totals = TABLE_C[:, worse].astype(np.int64)[..., None] + np.arange(len(activity))
        chances = self.cells_a.chance
        for cells in self.cells_b:
            chances = np.multiply.outer(chances, cells.chance)
        return np.multiply.outer(chances, activity), totals

    def draw(
        self, wanted: tuple[int, ...], shares: Integers, rng: np.random.Generator, stratified: bool
    ) -> tuple[Array, Factors]:
        """Return angles (n, 22) and factors of the given number of poses of each class."""
        reachable = np.unique(self.totals[self.chances > 0])
        for score in wanted:
            if score not in reachable:
                raise SampleError(
                    f"class {score} cannot be reached in domain {self.domain.name!r} with "
                    f"{', '.join(self.drawn) or 'no'} factors drawn; reachable: {', '.join(map(str, reachable))}"
                )
        states = np.concatenate(
            [
                _draw(np.where(self.totals == score, self.chances, 0.0).ravel(), int(count), rng, stratified)
                for score, count in zip(wanted, shares, strict=True)
            ]
        )
        rng.shuffle(states)
        score_a, *scores_b, activity = np.unravel_index(states, self.chances.shape)
        angles = np.empty((len(states), len(COLUMNS)))
        load = self._fill(angles, self.cells_a, score_a, self.group_a, rng, stratified)
        coupling = [
            self._fill(angles, cells, score, arm, rng, stratified)
            for cells, score, arm in zip(self.cells_b, scores_b, self.arms, strict=True)
        ]
        return angles, self._found(load, coupling, activity, rng)

    def _fill(
        self, angles: Array, cells: _Cells, score: Integers, parts: list[Part], rng: Any, stratified: bool
    ) -> Integers:
        """Draw part scores that lead to a score A or B and angles inside; return the points of load or coupling."""
        chosen = _draw_in_groups(score, cells.score, cells.weight, rng, stratified)
        *scores, extra = (index[chosen] for index in cells.parts)
        for part, wanted in zip(parts, scores, strict=True):
            box = _draw_in_groups(wanted, part.scores - 1, part.weights, rng, False)
            low, high = part.low[box], part.high[box]
            angles[:, part.columns] = low + (high - low) * rng.random(low.shape)
        return np.asarray(extra, np.int64)

    def _found(self, load: Integers, coupling: list[Integers], activity: Integers, rng: Any) -> Factors:
        """Return the factors of drawn points: kilograms uniform in their class, activity flags in any order."""
        changes: dict[str, Any] = {}
        n = len(load)
        if "load" in self.drawn:
            low, high = self.load_bins[load, 0], self.load_bins[load, 1]
            changes["load"] = high - (high - low) * rng.random(n)
        if "coupling" in self.drawn:
            for index, side in enumerate(SIDES):
                changes[f"coupling_{side}"] = coupling[min(index, len(coupling) - 1)]
        if "activity" in self.drawn:
            order = rng.random((n, len(ACTIVITIES))).argsort(axis=1)
            for index, name in enumerate(ACTIVITIES):
                changes[name] = order[:, index] < activity
        return dataclasses.replace(self.fixed, **changes)


def _cells(table: NDArray[np.uint8], parts: list[Part], extra: Array) -> _Cells:
    weight = extra
    for part in reversed(parts):
        weight = np.multiply.outer(part.chance, weight)
    score = table[..., None].astype(np.int64) - 1 + np.arange(len(extra))
    indices = tuple(np.asarray(index.ravel(), np.int64) for index in np.indices(weight.shape))
    chance = np.asarray(np.bincount(score.ravel(), weight.ravel(), minlength=_TOTALS), np.float64)
    return _Cells(indices, score.ravel(), weight.ravel(), chance)


def _draw(weight: Array, n: int, rng: np.random.Generator, stratified: bool) -> Integers:
    """Return n indices drawn in proportion to `weight`, systematically (then shuffled) if stratified."""
    cumulative = np.cumsum(weight)
    places = (np.arange(n) + rng.random()) / n if stratified else rng.random(n)
    found = np.searchsorted(cumulative, places * cumulative[-1], side="right")
    found = np.minimum(found, np.flatnonzero(weight)[-1])
    return np.asarray(rng.permutation(found) if stratified else found, np.int64)


def _draw_in_groups(group: Integers, key: Integers, weight: Array, rng: Any, stratified: bool) -> Integers:
    """Return for each of `group` (n,) an index into `key` (m,) that has this value, in proportion to `weight` (m,)."""
    found = np.empty(len(group), np.int64)
    for value in np.unique(group):
        rows = np.flatnonzero(group == value)
        found[rows] = _draw(np.where(key == value, weight, 0.0), len(rows), rng, stratified)
    return found


def _one(points_: int) -> Array:
    """Return the distribution of a factor whose points, 0 to 3, are the same for all poses."""
    return np.asarray(np.arange(4) == points_, np.float64)


def _load_bins(domain: Domain) -> Array:
    """Return lowest and highest load [kg] of 0, 1 and 2 points within the domain, (3, 2)."""
    edges = np.clip([0.0, *LOAD_EDGES, domain.load[1]], *domain.load)
    return np.stack([edges[:-1], edges[1:]], axis=1)


def _load_chances(bins: Array, weights: Weights) -> Array:
    width = bins[:, 1] - bins[:, 0]
    if not width.any():
        raise SampleError("the domain's load has no width, so load cannot be drawn; give a record with that load")
    likely = width if weights == "volume" else (width > 0).astype(float)
    return np.asarray(likely / likely.sum(), np.float64)


def _held(domain: Domain, adjustments: bool, arms: str) -> Domain:
    """Return the domain with the angles held that are not drawn."""
    if arms not in ("both", *SIDES):
        raise SampleError(f"arms is {arms!r}; expected both, left or right")
    held = {}
    for angle in ANGLES:
        for column in angle.columns:
            if not adjustments and angle.name in ADJUSTMENTS:
                held[column] = 0.0
            if arms in SIDES and angle.name in _ARM and not column.endswith(arms):
                held[column] = angle.best
    return domain.hold(**held)


def _classes(classes: Iterable[int]) -> tuple[int, ...]:
    try:
        wanted = tuple(classes)
    except TypeError as error:
        raise SampleError(f"classes are {classes!r}; expected REBA scores such as range(1, 11)") from error
    if not wanted or len(set(wanted)) != len(wanted):
        raise SampleError(f"classes are {wanted}; expected each REBA score once, at least one")
    for score in wanted:
        if isinstance(score, bool) or not isinstance(score, int | np.integer) or not 1 <= score <= 15:
            raise SampleError(f"class {score!r} is no REBA score; expected whole numbers from 1 to 15")
    return tuple(int(score) for score in wanted)


def _factors(given: Sequence[str] | Factors | None) -> tuple[Factors, tuple[str, ...]]:
    """Return factors that all poses share, and the names of those that are drawn."""
    if given is None:
        return Factors(), ()
    if isinstance(given, Factors):
        if any(np.ndim(value) for value in dataclasses.asdict(given).values()):
            raise SampleError("factors hold an array; expected one value each, or the names of factors to draw")
        return given, ()
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise SampleError(f"factors are {given!r}; expected a list of names out of {', '.join(FACTOR_NAMES)}")
    for name in given:
        if name not in FACTOR_NAMES:
            raise SampleError(f"factor {name!r} cannot be drawn; expected names out of {', '.join(FACTOR_NAMES)}")
    return Factors(), tuple(name for name in FACTOR_NAMES if name in given)


def _shared(given: Any) -> dict[str, Any]:
    """Return the factors that all poses share, as provenance; nothing if there are none."""
    return {"shared_factors": dataclasses.asdict(given)} if isinstance(given, Factors) else {}


def _generator(rng: Rng) -> tuple[np.random.Generator, dict[str, Any]]:
    """Return a generator and what it takes to start it again."""
    if isinstance(rng, np.random.Generator):
        state = rng.bit_generator.state
        return rng, {"seed": None, "generator": {key: _listed(value) for key, value in state.items()}}
    seeds = list(rng) if isinstance(rng, tuple) else [rng]
    if rng is None:
        seeds = [int(np.random.SeedSequence().generate_state(1)[0])]
    if not seeds or any(isinstance(s, bool) or not isinstance(s, int | np.integer) or s < 0 for s in seeds):
        raise SampleError(f"rng is {rng!r}; expected a numpy Generator or a seed, whole numbers from 0")
    whole = [int(seed) for seed in seeds if seed is not None]
    return np.random.default_rng(whole), {"seed": whole if len(whole) > 1 else whole[0]}


def _listed(value: Any) -> Any:
    """Return a generator's state as plain data."""
    if isinstance(value, dict):
        return {key: _listed(item) for key, item in value.items()}
    return value.tolist() if isinstance(value, np.ndarray) else value
