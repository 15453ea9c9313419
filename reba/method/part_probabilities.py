"""Probabilities of the part scores under measurement error, from the step table.

A part score rises where an angle lies outside a boundary of `reba.method.steps`. With a normal error the probability of
that is a sum of normal tails, and the angles of a part are independent, so the score of a part has a product form:

    angles (22, m), error -> P(angle outside each boundary) -> P(part score = k), exact
"""

from __future__ import annotations

import functools
import itertools
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array, Flags
from reba.method.measurement_error import MeasurementError
from reba.method.normal import MIDDLE, PER_SD, normal_cdf
from reba.method.rules import Rules
from reba.method.steps import AngleSteps, Boundary, outside, part_steps
from reba.method.tables import PART_MAXIMA
from reba.posture.angles import against_gravity
from reba.posture.columns import ANGLES, COLUMNS_OF, INDEX

Outside = dict[str, list[Array]]
"""Angle without a side -> P(outside) for each of its boundaries, (m,) or (2, m) for both sides."""
_ENDS: Final = {angle.name: {"low": angle.best, "high": angle.worst} for angle in ANGLES}
FAR: Final = 1e4
"""[deg] Larger angles are scored like this one."""
TRUNK: Final = ("trunk_flexion", "trunk_side_bend", "trunk_twist")
ARM: Final = ("upper_arm_flexion", "upper_arm_abduction")


class _Tail(NamedTuple):
    """Rows of the tails of one boundary: above its high end and below its low end, None where it has none."""

    angle: AngleSteps
    boundary: Boundary
    above: slice | None
    below: slice | None


class _Tails(NamedTuple):
    """Every tail as a row: the column, the edge [deg] and the direction along which it is passed."""

    column: NDArray[np.int64]
    edge: Array
    sense: Array
    places: tuple[_Tail, ...]


class BlockAngles(NamedTuple):
    """Angles of a block with their error: (22, m) true angles on average, (22, 1) or (22, m) standard deviations [deg].

    `unmeasured` (22, m) says where there is no angle, None if all are known; those places hold 0.
    """

    angles: Array
    sd: Array
    unmeasured: Flags | None


def block_angles(columns: Array, rules: Rules, error: MeasurementError) -> BlockAngles:
    """Return the angles (22, m) of a block, NaN where not measured, with bias removed and the reference of the rules.

    Upper arms against gravity are functions of five columns: their standard deviation is propagated to first order and
    their errors count as independent of the trunk's. Everything else is exact.
    """
    sd = np.array(error.sd)[:, None]
    # Angles beyond any joint count as far beyond every edge: table places stay within whole numbers.
    angles = np.clip(columns - np.array(error.bias)[:, None], -FAR, FAR)
    if rules.upper_arm_reference == "gravity":
        sd = _sd_against_gravity(angles, sd)
        against_gravity(angles)
    unmeasured = np.isnan(angles)
    if not unmeasured.any():
        return BlockAngles(angles, sd, None)
    angles[unmeasured] = 0.0
    return BlockAngles(angles, np.nan_to_num(sd), unmeasured)


def _sd_against_gravity(angles: Array, sd: Array) -> Array:
    """Return (22, m) standard deviations with those of the upper arms against gravity, by central differences."""
    rows = [INDEX[column] for name in ARM for column in COLUMNS_OF[name]]
    spread = np.broadcast_to(sd, angles.shape).copy()
    variance = np.zeros((len(rows), angles.shape[1]))
    for names in (*((name,) for name in TRUNK), *(COLUMNS_OF[name] for name in ARM)):
        moved = [INDEX[name] for name in names]
        if not sd[moved].any():
            continue
        ends = []
        for sense in (1.0, -1.0):
            end = angles.copy()
            end[moved] += sense * sd[moved]
            against_gravity(end)
            ends.append(end[rows])
        turn = ends[0] - ends[1]
        variance += (0.5 * (turn - 360.0 * np.rint(turn / 360.0))) ** 2
    spread[rows] = np.sqrt(variance)
    return spread


def outside_probabilities(block: BlockAngles, rules: Rules) -> Outside:
    """Return the probability that each true angle lies outside each boundary; unmeasured angles count as certain."""
    tails = _tails(rules)
    exact = block.sd <= 0.0
    some_exact = exact.any()
    per_sd = (PER_SD * tails.sense) / np.where(exact, 1.0, block.sd)[tails.column]
    z = block.angles.take(tails.column, axis=0)
    z *= per_sd
    z += MIDDLE - tails.edge * per_sd
    normal_cdf(z)
    result: Outside = {}
    for angle, boundary, above, below in tails.places:
        parts = [z[rows] for rows in (above, below) if rows is not None]
        probability = parts[0]
        if len(parts) > 1:
            probability += parts[1]
        if some_exact and exact[rows := _rows(angle)].any():
            np.copyto(probability, outside(block.angles[rows], boundary), where=exact[rows])
        result.setdefault(angle.angle, []).append(probability if len(probability) > 1 else probability[0])
    return result


def set_unmeasured(probabilities: Outside, block: BlockAngles, rules: Rules, end: str) -> None:
    """Put the certainty of the lowest ("low") or highest ("high") class into the unmeasured places."""
    if block.unmeasured is None:
        return
    for tail in _tails(rules).places:
        rows = _rows(tail.angle)
        unmeasured = block.unmeasured[rows]
        if not unmeasured.any():
            continue
        name = tail.angle.angle
        where = unmeasured if len(unmeasured) > 1 else unmeasured[0]
        place = tail.angle.boundaries.index(tail.boundary)
        certain = outside(np.array(_ENDS[name][end]), tail.boundary)
        np.copyto(probabilities[name][place], float(certain), where=where)


def _rows(angle: AngleSteps) -> slice:
    return angle.rows if isinstance(angle.rows, slice) else slice(angle.rows, angle.rows + 1)


@functools.lru_cache(maxsize=64)
def _tails(rules: Rules) -> _Tails:
    columns: list[int] = []
    edges: list[float] = []
    senses: list[float] = []

    def tail(rows: slice, edge: float, sense: float) -> slice | None:
        if not np.isfinite(edge):
            return None
        first = len(columns)
        for row in range(rows.start, rows.stop):
            columns.append(row)
            edges.append(edge)
            senses.append(sense)
        return slice(first, len(columns))

    places = tuple(
        _Tail(angle, one, tail(_rows(angle), one.high, 1.0), tail(_rows(angle), one.low, -1.0))
        for part in part_steps(rules).values()
        for angle in part.angles
        for one in angle.boundaries
    )
    return _Tails(np.array(columns), np.array(edges)[:, None], np.array(senses)[:, None], places)


def part_score_probabilities(part: str, probabilities: Outside, rules: Rules) -> Array:
    """Return P(points = lowest + k) of a body part, (scores, m) or (scores, 2, m) for both sides.

    For the legs these are the points of the knees, of which the one bent further counts.
    """
    (main, *adjustments), shares_point = part_steps(rules)[part]
    steps = probabilities[main.angle]
    if part == "legs":
        steps = [1.0 - (1.0 - one[0]) * (1.0 - one[1]) for one in steps]
    adds = [probabilities[each.angle][0] for each in adjustments]
    if shares_point:
        one, other = adds
        adds = [one + other - one * other]
    lowest = 0 if part == "legs" else 1
    scores = np.zeros((len(steps) + 1 + len(adds), *steps[0].shape))
    np.subtract(1.0, steps[0], out=scores[0])
    for place, (inner, outer) in enumerate(itertools.pairwise(steps), start=1):
        np.subtract(inner, outer, out=scores[place])
    scores[len(steps)] = steps[-1]
    for place, add in enumerate(adds, start=len(steps) + 1):
        moved = scores[:place] * add
        scores[:place] -= moved
        scores[1 : place + 1] += moved
    rows = PART_MAXIMA[part] + 1 - lowest
    if len(scores) > rows:  # clamped to the table
        scores[rows - 1] += scores[rows:].sum(axis=0)
        scores = scores[:rows]
    return scores
