"""Distribution of poses in a REBA class: Scores A and B first, then part scores, then class boxes and angles."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dreba.domain import Domain
from dreba.errors import SampleError
from dreba.sampling.classes import PartBoxes, Weights, parts_of
from reba.arrays import Array
from reba.method.factor_points import points
from reba.method.rules import LOAD_EDGES
from reba.method.tables import TABLE_A, TABLE_B, TABLE_C
from reba.posture.columns import COLUMNS, SIDES
from reba.posture.factors import ACTIVITIES, Factors

Integers = NDArray[np.int64]
_TOTALS: Final = 12
"""Scores A and B run from 1 to 12."""


@dataclass(frozen=True)
class _ScoreCells:
    """Cells of Table A or B with the points of load or coupling: m combinations that lead to Score A or B.

    Attributes:
        parts: four (m,) index arrays: part scores minus 1 and points of the factor.
        score: (m,) Score A or B minus 1.
        weight: (m,) probability.
        probability: (12,) probability of each score.
    """

    parts: tuple[Integers, ...]
    score: Integers
    weight: Array
    probability: Array


class SamplingPlan:
    """Joint distribution of Score A, Score B of each arm and activity, and poses drawn from it."""

    def __init__(self, domain: Domain, fixed: Factors, drawn: tuple[str, ...], weights: Weights) -> None:
        factor_points = points(fixed, domain.rules, 1)
        self.domain, self.fixed, self.drawn = domain, fixed, drawn
        self.group_a, self.arms = parts_of(domain, factor_points, weights)
        self.load_bins = load_bins(domain)
        load = _load_probability(self.load_bins, weights) if "load" in drawn else _one(int(factor_points.load_force[0]))
        self.cells_a = _cells(TABLE_A, self.group_a, load)
        coupling = [np.full(4, 0.25) if "coupling" in drawn else _one(int(side[0])) for side in factor_points.coupling]
        if len(self.arms) == 1 and "coupling" not in drawn:
            coupling = [_one(int(max(side[0] for side in factor_points.coupling)))]
        self.cells_b = [
            _cells(TABLE_B, arm, probability) for arm, probability in zip(self.arms, coupling, strict=False)
        ]
        activity = np.full(4, 0.25) if "activity" in drawn else _one(int(factor_points.activity[0]))
        self.probability, self.totals = self._states(activity)

    def _states(self, activity: Array) -> tuple[Array, Integers]:
        """Return the probability and the REBA class of every state (Score A, Score B ..., activity)."""
        b = np.arange(_TOTALS)
        worse = b if len(self.arms) == 1 else np.maximum.outer(b, b)
        if self.domain.rules.two_sides != "worse" and len(self.arms) == 2:
            worse = np.broadcast_to(b[:, None] if self.domain.rules.two_sides == "left" else b, worse.shape)
        totals = TABLE_C[:, worse].astype(np.int64)[..., None] + np.arange(len(activity))
        probability = self.cells_a.probability
        for cells in self.cells_b:
            probability = np.multiply.outer(probability, cells.probability)
        return np.multiply.outer(probability, activity), totals

    def draw(
        self, classes: tuple[int, ...], counts: Integers, rng: np.random.Generator, stratified: bool
    ) -> tuple[Array, Factors]:
        """Return angles (n, 22) [deg] and factors of `counts` poses of each of the `classes`, in random order."""
        reachable = np.unique(self.totals[self.probability > 0])
        for score in classes:
            if score not in reachable:
                raise SampleError(
                    f"class {score} cannot be reached in domain {self.domain.name!r} with "
                    f"{', '.join(self.drawn) or 'no'} factors drawn; reachable: {', '.join(map(str, reachable))}"
                )
        states = np.concatenate(
            [
                _draw(np.where(self.totals == score, self.probability, 0.0).ravel(), int(count), rng, stratified)
                for score, count in zip(classes, counts, strict=True)
            ]
        )
        rng.shuffle(states)
        score_a, *scores_b, activity = np.unravel_index(states, self.probability.shape)
        angles = np.empty((len(states), len(COLUMNS)))
        load = self._fill(angles, self.cells_a, score_a, self.group_a, rng, stratified)
        coupling = [
            self._fill(angles, cells, score, arm, rng, stratified)
            for cells, score, arm in zip(self.cells_b, scores_b, self.arms, strict=True)
        ]
        return angles, self._drawn_factors(load, coupling, activity, rng)

    def _fill(
        self, angles: Array, cells: _ScoreCells, score: Integers, parts: list[PartBoxes], rng: Any, stratified: bool
    ) -> Integers:
        """Draw part scores that lead to Score A or B and angles inside; return the points of load or coupling."""
        cell = _draw_in_groups(score, cells.score, cells.weight, rng, stratified)
        *scores, extra = (index[cell] for index in cells.parts)
        for part, part_score in zip(parts, scores, strict=True):
            box = _draw_in_groups(part_score, part.scores - 1, part.weights, rng, False)
            low, high = part.low[box], part.high[box]
            angles[:, part.columns] = low + (high - low) * rng.random(low.shape)
        return np.asarray(extra, np.int64)

    def _drawn_factors(self, load: Integers, coupling: list[Integers], activity: Integers, rng: Any) -> Factors:
        """Return the factors of drawn points: loads uniform in their class, activity flags in random order."""
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


def _cells(table: NDArray[np.uint8], parts: list[PartBoxes], extra: Array) -> _ScoreCells:
    weight = extra
    for part in reversed(parts):
        weight = np.multiply.outer(part.probability, weight)
    score = table[..., None].astype(np.int64) - 1 + np.arange(len(extra))
    indices = tuple(np.asarray(index.ravel(), np.int64) for index in np.indices(weight.shape))
    probability = np.asarray(np.bincount(score.ravel(), weight.ravel(), minlength=_TOTALS), np.float64)
    return _ScoreCells(indices, score.ravel(), weight.ravel(), probability)


def _draw(weight: Array, n: int, rng: np.random.Generator, stratified: bool) -> Integers:
    """Return n indices drawn in proportion to `weight` (m,), by systematic sampling and a shuffle if stratified."""
    cumulative = np.cumsum(weight)
    quantiles = (np.arange(n) + rng.random()) / n if stratified else rng.random(n)
    drawn = np.searchsorted(cumulative, quantiles * cumulative[-1], side="right")
    drawn = np.minimum(drawn, np.flatnonzero(weight)[-1])
    return np.asarray(rng.permutation(drawn) if stratified else drawn, np.int64)


def _draw_in_groups(group: Integers, key: Integers, weight: Array, rng: Any, stratified: bool) -> Integers:
    """Return for each of `group` (n,) an index of `key` (m,) with the same value, in proportion to `weight` (m,)."""
    drawn = np.empty(len(group), np.int64)
    for value in np.unique(group):
        rows = np.flatnonzero(group == value)
        drawn[rows] = _draw(np.where(key == value, weight, 0.0), len(rows), rng, stratified)
    return drawn


def _one(points_: int) -> Array:
    """Return the distribution (4,) of a factor with the same points, 0 to 3, in all poses."""
    return np.asarray(np.arange(4) == points_, np.float64)


def load_bins(domain: Domain) -> Array:
    """Return lowest and highest load (3, 2) [kg] of 0, 1 and 2 points within the domain."""
    edges = np.clip([0.0, *LOAD_EDGES, domain.load[1]], *domain.load)
    return np.stack([edges[:-1], edges[1:]], axis=1)


def _load_probability(bins: Array, weights: Weights) -> Array:
    width = bins[:, 1] - bins[:, 0]
    if not width.any():
        raise SampleError("the domain has a single load, so it cannot be drawn; give factors=reba.Factors(load=...)")
    volume = width if weights == "volume" else (width > 0).astype(float)
    return np.asarray(volume / volume.sum(), np.float64)
