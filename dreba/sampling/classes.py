"""A domain cut into boxes: for each body part the boxes of its angles, their part score and their weight.

The parts of REBA depend on separate angles, so a distribution over poses that treats angles independently is a product
over parts, and the distribution given a REBA class can be written down instead of being rejected for.
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
"""How likely boxes are before the class is chosen, see `dreba.sample`."""


@dataclass(frozen=True)
class PartBoxes:
    """The boxes of one body part; m boxes over k angle columns.

    Attributes:
        columns: (k,) indices into `reba.COLUMNS`.
        low, high: (m, k) degrees.
        scores: (m,) part score.
        weights: (m,) probability, summing to 1.
        chance: probability of each part score; index 0 stands for score 1.
    """

    columns: Integers
    low: Array
    high: Array
    scores: Integers
    weights: Array
    chance: Array


def arms_of(domain: Domain) -> tuple[tuple[str, ...], ...]:
    """Return the arms that are scored alone, each with the sides it takes the worse part of."""
    return (("left",), ("right",)) if domain.sides == "each" else (SIDES,)


def parts_of(domain: Domain, given: FactorPoints, weights: Weights) -> tuple[list[PartBoxes], list[list[PartBoxes]]]:
    """Return the parts of a domain: trunk, neck, legs; and upper arm, lower arm, wrist of each arm in `arms_of`.

    Args:
        domain: what is drawn from.
        given: points of factors that are the same for every pose.
        weights: "bins": every bin of every angle is equally likely; "volume": in proportion to its width; "cells":
            every part score is equally likely, boxes inside it in proportion to their volume.
    """
    group_a = [_part((name,), PART_MAXIMA[name], domain, given, weights) for name in GROUP_A]
    arms = [
        [
            _part(tuple(f"{name}_{side}" for side in sides), PART_MAXIMA[name], domain, given, weights)
            for name in GROUP_B
        ]
        for sides in arms_of(domain)
    ]
    return group_a, arms


def _part(names: tuple[str, ...], highest: int, domain: Domain, given: FactorPoints, weights: Weights) -> PartBoxes:
    known = angle_classes(domain.rules)
    columns = [column for q in known if q.part in names for column in q.columns]
    bins = [domain.bins_of(column) for column in columns]
    choices = np.array(list(product(*(range(len(b.points)) for b in bins))))
    low = np.stack([np.array(b.edges)[choices[:, i]] for i, b in enumerate(bins)], axis=1)
    high = np.stack([np.array(b.edges)[choices[:, i] + 1] for i, b in enumerate(bins)], axis=1)
    got = {column: np.array(bins[i].points)[choices[:, i]] for i, column in enumerate(columns)}
    scores = np.max([_score(name, known, got, given) for name in names], axis=0)
    # An angle that is held has no width: its one bin counts as 1.
    likely = np.ones(len(scores)) if weights == "bins" else np.where(high > low, high - low, 1.0).prod(axis=1)
    if weights == "cells":
        likely = likely / np.bincount(scores, likely)[scores]
    likely = likely / likely.sum()
    chance = np.asarray(np.bincount(scores - 1, likely, minlength=highest), np.float64)
    return PartBoxes(np.array([INDEX[column] for column in columns]), low, high, scores, likely, chance)


def _score(
    part: str, known: tuple[AngleClasses, ...], got: Mapping[str, NDArray[np.integer]], given: FactorPoints
) -> Integers:
    """Return the score (m,) of one part of one side from the points (m,) of its angles.

    Of several columns the worse counts; quantities that share an adjustment give one point together.
    """
    groups: dict[str, Integers] = {}
    for quantity in (q for q in known if q.part == part):
        most = np.max([got[column] for column in quantity.columns], axis=0).astype(np.int64)
        groups[quantity.adjusts] = np.maximum(groups.get(quantity.adjusts, most), most)
    if part == "legs":
        return np.asarray(given.legs + given.knees_count * sum(groups.values()), np.int64)
    score = np.sum(list(groups.values()), axis=0)
    name, _, side = part.rpartition("_")
    if name == "upper_arm":
        score = np.maximum(score - given.arm_supported[SIDES.index(side)], 1)
    return np.asarray(np.minimum(score, PART_MAXIMA[name if side in SIDES else part]), np.int64)


def true_scores(domain: Domain, angles: Array, factors: Factors | None) -> NDArray[np.uint8]:
    """Return the true REBA (n,) of poses (n, 22) [deg]: exact under the domain's rules, or from its own bins."""
    if not domain.bins:
        return score_angles(angles, factors, domain.rules).reba
    given = points(Factors.of(factors), domain.rules, len(angles))
    known = angle_classes(domain.rules)
    got = {}
    for column, index in INDEX.items():
        edges, scores = domain.bins_of(column)
        got[column] = np.array(scores)[np.searchsorted(edges[1:-1], angles[:, index])]
    part_a = {name: _score(name, known, got, given) for name in GROUP_A}
    totals = []
    for sides in arms_of(domain):
        part_b = {name: np.max([_score(f"{name}_{s}", known, got, given) for s in sides], axis=0) for name in GROUP_B}
        coupling = np.max([given.coupling[SIDES.index(side)] for side in sides], axis=0)
        total = score_parts(
            **part_a, **part_b, load_force=given.load_force, coupling=coupling, activity=given.activity
        ).reba
        totals.append(total)
    return np.asarray(np.max(totals, axis=0), np.uint8)
