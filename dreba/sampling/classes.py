"""Class boxes of a domain: for each body part the boxes of its angle classes, their part score and probability.

The parts of REBA depend on separate angles. A distribution with independent angles is therefore a product over parts,
and its distribution conditioned on a REBA class is known in closed form, without rejection sampling.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from dreba.domain import Domain
from reba.arrays import Array
from reba.method.classes import AngleClasses, angle_classes
from reba.method.factor_points import FactorPoints, points
from reba.method.scoring import score_angles, score_parts
from reba.method.tables import PART_MAXIMA
from reba.posture.columns import GROUP_A, GROUP_B, INDEX, SIDES
from reba.posture.factors import Factors

Integers = NDArray[np.int64]
Weights = Literal["bins", "volume", "cells"]
WEIGHTS: Final = ("bins", "volume", "cells")
"""Probability of class boxes before conditioning on the REBA class, see `dreba.sample`."""


@dataclass(frozen=True)
class PartBoxes:
    """Class boxes of one body part: m boxes over k angle columns.

    Attributes:
        columns: (k,) indices into `reba.COLUMNS`.
        low, high: (m, k) [deg].
        scores: (m,) part scores.
        weights: (m,) probabilities, their sum is 1.
        probability: (highest score,) probability of each part score from 1.
    """

    columns: Integers
    low: Array
    high: Array
    scores: Integers
    weights: Array
    probability: Array


def arms_of(domain: Domain) -> tuple[tuple[str, ...], ...]:
    """Return the sides combined into each Score B: each arm alone, or the worse parts of both (`Domain.sides`)."""
    return (("left",), ("right",)) if domain.sides == "each" else (SIDES,)


def parts_of(domain: Domain, factors: FactorPoints, weights: Weights) -> tuple[list[PartBoxes], list[list[PartBoxes]]]:
    """Return the parts of a domain: trunk, neck, legs; and upper arm, lower arm, wrist of each arm in `arms_of`.

    Args:
        factors: points of the factors that all poses share.
        weights: "bins": every bin of an angle has the same probability; "volume": in proportion to its width; "cells":
            every part score has the same probability, boxes inside it in proportion to their volume.
    """
    group_a = [_part((name,), PART_MAXIMA[name], domain, factors, weights) for name in GROUP_A]
    arms = [
        [
            _part(tuple(f"{name}_{side}" for side in sides), PART_MAXIMA[name], domain, factors, weights)
            for name in GROUP_B
        ]
        for sides in arms_of(domain)
    ]
    return group_a, arms


def _part(names: tuple[str, ...], highest: int, domain: Domain, factors: FactorPoints, weights: Weights) -> PartBoxes:
    known = angle_classes(domain.rules)
    columns = [column for q in known if q.part in names for column in q.columns]
    bins = [domain.bins_of(column) for column in columns]
    choices = np.array(list(product(*(range(len(b.points)) for b in bins))))
    low = np.stack([np.array(b.edges)[choices[:, i]] for i, b in enumerate(bins)], axis=1)
    high = np.stack([np.array(b.edges)[choices[:, i] + 1] for i, b in enumerate(bins)], axis=1)
    angle_points = {column: np.array(bins[i].points)[choices[:, i]] for i, column in enumerate(columns)}
    scores = np.max([_score(name, known, angle_points, factors) for name in names], axis=0)
    # A held angle has one bin of width 0, which counts as width 1.
    volume = np.ones(len(scores)) if weights == "bins" else np.where(high > low, high - low, 1.0).prod(axis=1)
    if weights == "cells":
        volume = volume / np.bincount(scores, volume)[scores]
    share = volume / volume.sum()
    probability = np.asarray(np.bincount(scores - 1, share, minlength=highest), np.float64)
    return PartBoxes(np.array([INDEX[column] for column in columns]), low, high, scores, share, probability)


def _score(
    part: str, known: tuple[AngleClasses, ...], angle_points: Mapping[str, NDArray[np.integer]], factors: FactorPoints
) -> Integers:
    """Return the score (m,) of one part of one side from the points (m,) of its angles.

    The worse of several columns counts; angles that share an adjustment add one point together.
    """
    groups: dict[str, Integers] = {}
    for classes in (own for own in known if own.part == part):
        worst = np.max([angle_points[column] for column in classes.columns], axis=0).astype(np.int64)
        groups[classes.adjusts] = np.maximum(groups.get(classes.adjusts, worst), worst)
    if part == "legs":
        return np.asarray(factors.legs + factors.knees_count * sum(groups.values()), np.int64)
    score = np.sum(list(groups.values()), axis=0)
    name, _, side = part.rpartition("_")
    if name == "upper_arm":
        score = np.maximum(score - factors.arm_supported[SIDES.index(side)], 1)
    return np.asarray(np.minimum(score, PART_MAXIMA[name if side in SIDES else part]), np.int64)


def true_scores(domain: Domain, angles: Array, factors: Factors | None) -> NDArray[np.uint8]:
    """Return the true REBA (n,) of poses (n, 22) [deg]: exact under the rules of the domain, or from its bins."""
    if not domain.bins:
        return score_angles(angles, factors, domain.rules).reba
    factor_points = points(Factors.of(factors), domain.rules, len(angles))
    known = angle_classes(domain.rules)
    angle_points = {}
    for column, index in INDEX.items():
        edges, scores = domain.bins_of(column)
        angle_points[column] = np.array(scores)[np.searchsorted(edges[1:-1], angles[:, index])]
    part_a = {name: _score(name, known, angle_points, factor_points) for name in GROUP_A}
    totals = []
    for sides in arms_of(domain):
        part_b = {
            name: np.max([_score(f"{name}_{s}", known, angle_points, factor_points) for s in sides], axis=0)
            for name in GROUP_B
        }
        coupling = np.max([factor_points.coupling[SIDES.index(side)] for side in sides], axis=0)
        total = score_parts(
            **part_a, **part_b, load_force=factor_points.load_force, coupling=coupling, activity=factor_points.activity
        ).reba
        totals.append(total)
    return np.asarray(np.max(totals, axis=0), np.uint8)
