"""The distribution of REBA that independent measurement errors imply: exact, without sampling.

    P(part scores) -> P(Score A), P(Score B) of both sides -> P(larger Score B) -> Table C -> P(REBA)

Part scores depend on different columns, so they are independent and Table A and B are sums over their cells. Trunk,
neck and legs are shared by both sides, so Score A is, and Table C never decreases in Score B: the worse side is the one
with the larger Score B, whose distribution function is the product of both. Factors have no error.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, Literal, NamedTuple

import numpy as np

from reba.arrays import Array, Flags
from reba.checks import accepts, one_of
from reba.errors import PostureError
from reba.method.factor_points import FactorPoints, points
from reba.method.measurement_error import ErrorInput, MeasurementError
from reba.method.part_probabilities import (
    Outside,
    block_angles,
    outside_probabilities,
    part_score_probabilities,
    set_unmeasured,
)
from reba.method.rules import Rules, rules_of
from reba.method.tables import ACTION_LEVEL_FROM, TABLE_A, TABLE_B, TABLE_C, UNKNOWN, Scores8
from reba.posture.columns import GROUP_A, GROUP_B, SIDES
from reba.posture.factors import Factors
from reba.posture.named_angles import checked_poses, flag_columns

LEVELS: Final = range(1, len(ACTION_LEVEL_FROM))
"""Action levels whose probability of being reached is given."""
SHARE: Final = 0.95
"""Probability of the range `reba_95_low` to `reba_95_high`, as much on either side of it."""
SCORES: Final = 15
"""Highest REBA score."""
BLOCK: Final = 5000
"""Frames handled at once: few enough for the cache, enough to make the cost of a numpy call small."""
KEPT_BYTES: Final = 1 << 24
"""glibc gives memory back to the system after each block and asks for it again in the next, which takes longer than the
arithmetic; once an array of this size was freed, it keeps up to twice as much (mallopt(3), M_TRIM_THRESHOLD)."""
_ROUNDING: Final = 2e-8
"""Probabilities that differ by less than the error of the normal distribution function allows count as equal: of two
equally likely scores the lower one is named."""


@dataclass(frozen=True)
class ScoreDistribution:
    """The distribution of REBA in n frames under measurement error.

    Unmeasured angles leave a range: `low` is with their lowest, `high` with their highest class; equal where all is
    measured. A probability for any values of the unmeasured angles lies between both.

    Attributes:
        reba_likely: (n,) uint8 most likely score, `UNKNOWN` (255) where unmeasured angles leave more than one.
        reba_95_low, reba_95_high: (n,) uint8 the range that holds REBA with a probability of at least 95 %.
        level_low, level_high: (4, n) probability that the action level is at least 1, 2, 3, 4.
        mean_low, mean_high: (n,) expected REBA.
        exact: False where upper arms count against gravity, which couples their columns with the trunk's.
    """

    reba_likely: Scores8
    reba_95_low: Scores8
    reba_95_high: Scores8
    level_low: Array
    level_high: Array
    mean_low: Array
    mean_high: Array
    exact: bool

    def columns(self) -> dict[str, Any]:
        """Return the columns of the score table: scores as uint8, then probabilities `p_level_2_low`, ..."""
        scores = {name: getattr(self, name) for name in LIKELY_COLUMNS}
        ends = {"low": self.level_low, "high": self.level_high}
        return scores | {f"p_level_{level}_{end}": ends[end][level - 1] for level in (2, 3) for end in ends}


LIKELY_COLUMNS: Final = tuple(field.name for field in fields(ScoreDistribution))[:3]
"""Whole-numbered columns that measurement error adds to the score table."""
PROBABILITY_COLUMNS: Final = tuple(f"p_level_{level}_{end}" for level in (2, 3) for end in ("low", "high"))
"""Columns of probabilities that it adds."""


def distribution(
    table: Array, factors: Factors, rules: Rules, error: MeasurementError, missing: str
) -> ScoreDistribution:
    """Return the distribution of REBA in n frames of angles (n, 22), NaN = not measured.

    Args:
        missing: "neutral" or "worst": `reba_likely` is with unmeasured angles at that end; else it is unknown where the
            ends differ.
    """
    n = len(table)
    likely, low, high = np.empty((3, n), np.uint8)
    levels, means = np.empty((2, len(LEVELS), n)), np.empty((2, n))
    for rows, of_table, activity in _blocks(table, points(factors, rules, n), rules, error):
        ends = [_figures(one, activity) for one in of_table]
        first, last = ends[0], ends[-1]
        low[rows], high[rows] = first.low, last.high
        likely[rows] = (last if missing == "worst" else first).likely
        if missing not in ("neutral", "worst"):
            likely[rows][first.likely != last.likely] = UNKNOWN
        for place, end in enumerate((first, last)):
            levels[place, :, rows], means[place, rows] = end.levels, end.mean
    exact = rules.upper_arm_reference == "trunk"
    return ScoreDistribution(likely, low, high, levels[0], levels[1], means[0], means[1], exact)


@accepts(PostureError, missing=one_of("neutral", "worst"))
def score_probabilities(
    angles: Any,
    factors: Factors | Mapping[str, Any] | None = None,
    rules: Rules | str = "measured",
    *,
    error: ErrorInput,
    missing: Literal["neutral", "worst"] = "neutral",
) -> Array:
    """Return the probability of each REBA score under measurement error.

    The distribution is exact for errors that are normal and independent from column to column, which follows from the
    tables without sampling; against gravity (`Rules.upper_arm_reference`) upper arms are approximated, see
    `ScoreDistribution.exact`.

    Args:
        angles, factors, rules: as in `score_array`.
        error: measurement error, see `MeasurementError.of`.
        missing: whether unmeasured angles have the lowest class ("neutral") or the highest ("worst"); for any other
            values P(REBA > k) lies between both.

    Returns:
        (n, 15) probabilities of REBA 1 to 15.

    Raises:
        PostureError: as in `score_array`.

    Example:
        >>> import numpy as np
        >>> from reba.posture.columns import INDEX
        >>> posture = np.zeros((1, 22))
        >>> posture[0, INDEX["trunk_flexion"]] = 62.0
        >>> score_probabilities(posture, error={"trunk_flexion": 3.0})[0, :3].round(3).tolist()
        [0.252, 0.748, 0.0]
    """
    table, _ = checked_poses(angles)
    spread, chosen = MeasurementError.of(error).without(flag_columns(angles)), rules_of(rules)
    result = np.zeros((len(table), SCORES))
    for rows, of_table, activity in _blocks(table, points(Factors.of(factors), chosen, len(table)), chosen, spread):
        chances = np.maximum(of_table[0 if missing == "neutral" else -1], 0.0)
        for added, frames in _kinds(activity, chances.shape[1]):
            result[rows][frames, added : added + len(chances)] = chances.T[frames]
    return result


class _Figures(NamedTuple):
    """What is kept of the distributions of m frames; fields as in `ScoreDistribution`, of one end."""

    likely: Scores8
    low: Scores8
    high: Scores8
    levels: Array
    mean: Array


def _figures(of_table: Array, activity: Scores8) -> _Figures:
    """Return the figures of P(Table C = 1), ..., (12, m), to which activity points (m,) or (1,) are added."""
    up_to = _up_to(of_table)
    likely = np.zeros(of_table.shape[1], np.uint8)
    largest = of_table[0].copy()
    for place, chance in enumerate(of_table[1:], start=1):
        np.copyto(likely, np.uint8(place), where=chance > largest + _ROUNDING)
        np.maximum(chance, largest, out=largest)
    tail = (1.0 - SHARE) / 2.0
    first = activity + np.uint8(1)
    low, high = (first + _count(up_to < limit - _ROUNDING) for limit in (tail, 1.0 - tail))
    levels = np.ones((len(LEVELS), of_table.shape[1]))
    for added, frames in _kinds(activity, of_table.shape[1]):
        for level in LEVELS:
            below = ACTION_LEVEL_FROM[level] - 1 - added  # scores of Table C that do not reach the level
            if below > 0:
                levels[level - 1, frames] = 1.0 - up_to[below - 1, frames]
    np.clip(levels, 0.0, 1.0, out=levels)
    mean = np.arange(1.0, len(of_table) + 1.0) @ of_table + activity
    return _Figures(first + likely, low, high, levels, mean)


def _count(flags: Flags) -> Scores8:
    """Return how many of the (k, m) flags are true in each of m columns."""
    return np.add.reduce(flags.view(np.uint8), axis=0, dtype=np.uint8)


def _kinds(values: Scores8, m: int) -> Iterator[tuple[int, Any]]:
    """Yield each of the few values of m frames, (m,) or (1,), with the frames that have it."""
    if len(values) == 1:
        yield int(values[0]), slice(0, m)
        return
    for value in np.flatnonzero(np.bincount(values)).tolist():
        yield value, values == value


def _blocks(
    table: Array, factor_points: FactorPoints, rules: Rules, error: MeasurementError
) -> Iterator[tuple[slice, list[Array], Scores8]]:
    """Yield frames, P(Table C = 1), ... (12, m) at the low and, if it differs, the high end, and activity points."""
    np.empty(KEPT_BYTES, np.uint8)
    for start in range(0, len(table), BLOCK):
        rows = slice(start, min(start + BLOCK, len(table)))
        block = block_angles(table[rows].T, rules, error)
        outside = outside_probabilities(block, rules)
        of_frames = factor_points.rows(rows.start, rows.stop)
        ends = []
        for end in ("low",) if block.unmeasured is None else ("low", "high"):
            set_unmeasured(outside, block, rules, end)
            ends.append(_table_c(outside, of_frames, rules))
        yield rows, ends, of_frames.activity


def _table_c(outside: Outside, factor_points: FactorPoints, rules: Rules) -> Array:
    """Return P(Table C = 1), ..., P(Table C = 12), (12, m)."""
    first_a, score_a = _score_a(outside, factor_points, rules)
    first_b, score_b = _score_b(outside, factor_points, rules)
    if rules.two_sides == "worse":
        both = _up_to(score_b)
        score_b = both[:, 0] * both[:, 1]  # P(the larger of the two is at most ...)
        score_b[1:] -= score_b[:-1].copy()
    else:
        score_b = score_b[:, SIDES.index(rules.two_sides)]
    return _sum_over(first_a, len(score_a), first_b, len(score_b)) @ _cells(score_a, score_b)


def _score_a(outside: Outside, factor_points: FactorPoints, rules: Rules) -> tuple[int, Array]:
    """Return the lowest Score A that occurs and P(Score A = lowest + k), (k, m)."""
    knees = outside["knee_flexion"]
    outside = {**outside, "knee_flexion": [one * factor_points.knees_count for one in knees]}
    trunk, neck, bent = (part_score_probabilities(part, outside, rules) for part in GROUP_A)
    legs = np.zeros((TABLE_A.shape[2], bent.shape[1]))
    for score, frames in _kinds(factor_points.legs, bent.shape[1]):
        legs[score - 1 : score - 1 + len(bent), frames] = bent[:, frames]
    cells = _cells(_cells(trunk, neck), legs)
    return _added(_A @ cells, factor_points.load_force)


def _score_b(outside: Outside, factor_points: FactorPoints, rules: Rules) -> tuple[int, Array]:
    """Return the lowest Score B that occurs and P(Score B = lowest + k) of both sides, (k, 2, m)."""
    upper, lower, wrist = (part_score_probabilities(part, outside, rules) for part in GROUP_B)
    if factor_points.arm_supported.any():
        supported = np.zeros_like(upper)  # one point less, never below 1
        supported[:-1] = upper[1:]
        supported[0] += upper[0]
        upper = np.where(factor_points.arm_supported, supported, upper)
    arms = _cells(*(one.reshape(len(one), -1) for one in (upper, lower)))
    cells = _cells(arms, wrist.reshape(len(wrist), -1))
    return _added((_B @ cells).reshape(-1, *upper.shape[1:]), factor_points.coupling)


def _cells(one: Array, other: Array) -> Array:
    """Return the probability of every pair of independent scores (k, m) and (l, m) as (k * l, m)."""
    return (one[:, None] * other[None]).reshape(-1, one.shape[1])


def _added(scores: Array, added: Scores8) -> tuple[int, Array]:
    """Return the lowest score that occurs and P(score = lowest + k) after points are added to scores from 1 on."""
    lowest, highest = int(added.min()), int(added.max())
    if lowest == highest:
        return lowest + 1, scores
    result = np.zeros((len(scores) + highest - lowest, *scores.shape[1:]))
    for more in range(lowest, highest + 1):
        first = more - lowest
        result[first : first + len(scores)] += np.where(added == more, scores, 0.0)
    return lowest + 1, result


def _up_to(chances: Array) -> Array:
    """Return the sums from the first row on, (k, ...): several times as fast as numpy.cumsum along this axis."""
    sums = chances.copy()
    for place in range(1, len(sums)):
        sums[place] += sums[place - 1]
    return sums


def _sums(table: Scores8, highest: int) -> Array:
    """Return the (scores, cells) matrix that sums the probabilities of the cells of a table score by score."""
    scores = np.arange(1, highest + 1)
    return np.ascontiguousarray((table.ravel() == scores[:, None]).astype(np.float64))


_A: Final = _sums(TABLE_A, int(TABLE_A.max()))
_B: Final = _sums(TABLE_B, int(TABLE_B.max()))


@functools.lru_cache(maxsize=256)
def _sum_over(first_a: int, rows: int, first_b: int, columns: int) -> Array:
    """Return the matrix of `_sums` for the part of Table C that occurs, with all 12 scores."""
    part = TABLE_C[first_a - 1 : first_a - 1 + rows, first_b - 1 : first_b - 1 + columns]
    return _sums(part, int(TABLE_C.max()))
