"""The vectorised core: posture angles and factors in, every part score and total out.

    angles (n, 22) -> chunks that fit in cache -> part classes -> Tables A, B, C -> uint8 arrays

Unmeasured angles (NaN) never fall into a class by themselves: they are replaced once by the angle of the lowest and
once by that of the highest class. A, B and C are non-decreasing in every index, so the two evaluations give the exact
range over everything unmeasured.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reba.arrays import Array, Flags
from reba.checks import shown
from reba.errors import PostureError
from reba.method.distribution import ScoreDistribution, distribution
from reba.method.factor_points import FactorPoints, points
from reba.method.measurement_error import ErrorInput, MeasurementError
from reba.method.rules import Rules, rules_of
from reba.method.steps import PartSteps, outside, part_steps
from reba.method.tables import LEVEL_OF, PART_MAXIMA, TABLE_A, TABLE_B, TABLE_C, UNKNOWN, Scores8
from reba.posture.angles import against_gravity
from reba.posture.columns import BEST, COLUMNS, GROUP_A, GROUP_B, SIDES, WORST
from reba.posture.factors import Factors
from reba.posture.named_angles import (
    LARGEST,
    flag_columns,
    read_angles,
    refuse_infinite,
    refuse_large,
    warn_if_radians,
)

Missing = Literal["range", "neutral", "worst", "error"]
MISSING: Final = ("range", "neutral", "worst", "error")
"""What may stand for a score that unmeasured angles leave open, see `score_array`."""
CHUNK: Final = 16_000
"""Frames handled at once: few enough for the cache, enough to make the cost of a numpy call small."""
TILE: Final = 1000
"""Frames turned from rows to columns at once: a tile of 88 kB is read and written within the first caches."""
_BEST: Final = np.array([BEST[column] for column in COLUMNS])
_WORST: Final = np.array([WORST[column] for column in COLUMNS])
_A, _B, _C = (np.ascontiguousarray(table.ravel()) for table in (TABLE_A, TABLE_B, TABLE_C))
# A cell of the flat tables is score * stride + score * stride + score - first, all in uint8: strides of cells of one
# byte are plain integers. Scores start at 1.
_A_STRIDES, _B_STRIDES, _C_STRIDES = (table.strides for table in (TABLE_A, TABLE_B, TABLE_C))
_A_FIRST, _B_FIRST, _C_FIRST = map(sum, (_A_STRIDES, _B_STRIDES, _C_STRIDES))
Steps = dict[str, PartSteps]


@dataclass(frozen=True)
class ScoreArrays:
    """Scores of n frames, each (n,) uint8, `UNKNOWN` (255) where the measured angles leave more than one value.

    Fields are the columns of the score table; `reba_low` and `reba_high` are always known. Items can be taken by
    name as well: `arrays["reba"]`. `distribution` is what a measurement error implies, None without one.
    """

    trunk: Scores8
    neck: Scores8
    legs: Scores8
    load_force: Scores8
    upper_arm_left: Scores8
    upper_arm_right: Scores8
    lower_arm_left: Scores8
    lower_arm_right: Scores8
    wrist_left: Scores8
    wrist_right: Scores8
    coupling_left: Scores8
    coupling_right: Scores8
    activity: Scores8
    score_a: Scores8
    score_b_left: Scores8
    score_b_right: Scores8
    reba_left: Scores8
    reba_right: Scores8
    reba: Scores8
    action_level: Scores8
    reba_low: Scores8
    reba_high: Scores8
    distribution: ScoreDistribution | None = None

    def __getitem__(self, name: str) -> Scores8:
        """Return one column by its name."""
        if name not in SCORE_COLUMNS:
            raise KeyError(name)
        column: Scores8 = getattr(self, name)
        return column


SCORE_COLUMNS: Final = tuple(field.name for field in fields(ScoreArrays) if field.name != "distribution")
"""Columns of the score table after `time`, in their public order."""
_ROW: Final = {name: row for row, name in enumerate(SCORE_COLUMNS)}
_RANGED: Final = SCORE_COLUMNS[: SCORE_COLUMNS.index("reba_low")]


def score_array(
    angles: Any,
    factors: Factors | Mapping[str, Any] | None = None,
    rules: Rules | str = "measured",
    missing: Missing = "range",
    error: ErrorInput | None = None,
) -> ScoreArrays:
    """Score n postures.

    Args:
        angles: (n, 22) degrees in the order of `reba.COLUMNS`, or (22,) for one posture; NaN = not measured. Data with
            column names, such as a DataFrame, are read by name, see `reba.angle_table`; their other columns, those of
            factors too, are not used.
        factors: a `Factors` record or a mapping of some of its fields; scalars or (n,) arrays.
        rules: a preset's name or a `Rules` record.
        missing: what stands for a score that unmeasured angles leave open: `UNKNOWN` ("range"), the score of the
            neutral, lowest class ("neutral"), that of the highest ("worst"), or an error ("error"). `reba_low` and
            `reba_high` hold the exact range all the same.
        error: measurement error, see `MeasurementError.of`; the scores then carry the `distribution` that it implies,
            beside scores that stay as they are. None: no distribution.

    Returns:
        The scores of every part and the totals, see `ScoreArrays`.

    Raises:
        PostureError: a wrong shape, an angle that is infinite or beyond 360 deg, a bad factor or measurement error, or
            an unmeasured angle with missing="error".

    Warns:
        RadiansWarning: ten postures or more of angles so small that they look like radians.

    Example:
        >>> import numpy as np
        >>> posture = np.zeros((1, 22))
        >>> posture[0, COLUMNS.index("trunk_flexion")] = 70.0
        >>> int(score_array(posture).reba[0])
        2
        >>> score_array(posture, error={"trunk_flexion": 5.0}).distribution.reba_likely.tolist()
        [2]
    """
    table, _ = read_angles(angles, COLUMNS)
    warn_if_radians(table)
    spread = None if error is None else MeasurementError.of(error).without(flag_columns(angles))
    return score_angles(table, factors, rules, missing, limit=LARGEST, error=spread)


def score_angles(
    table: Array,
    factors: Factors | Mapping[str, Any] | None = None,
    rules: Rules | str = "measured",
    missing: Missing = "range",
    *,
    limit: float = np.finfo(np.float64).max,
    error: MeasurementError | None = None,
) -> ScoreArrays:
    """Score the angles (n, 22) of a posture table; as `score_array`, with any finite angle up to `limit` [deg]."""
    chosen = rules_of(rules)
    if not isinstance(missing, str) or missing not in MISSING:
        raise PostureError(f"missing is {shown(missing)}; expected one of {', '.join(MISSING)}")
    factor_points = points(Factors.of(factors), chosen, len(table))
    out = np.empty((len(SCORE_COLUMNS), len(table)), np.uint8)
    columns = np.empty((len(COLUMNS), CHUNK))
    for start in range(0, len(table), CHUNK):
        stop = min(start + CHUNK, len(table))
        block = columns[:, : stop - start]
        complete = True
        for first in range(0, stop - start, TILE):
            rows = table[start + first : min(start + first + TILE, stop)]
            # NaN passes through both and fails the comparison, as infinity does. This also fetches the rows.
            complete &= bool(max(rows.max(), -rows.min()) <= limit)
            block[:, first : first + len(rows)] = rows.T
        if not complete and max(np.fmax.reduce(block, axis=None), -np.fmin.reduce(block, axis=None)) > limit:
            refuse_infinite(block.T, start)
            refuse_large(block.T, start)
        _score_block(block, complete, factor_points.rows(start, stop), chosen, missing, out[:, start:stop], start)
    implied = None if error is None else distribution(table, Factors.of(factors), chosen, error, missing)
    return ScoreArrays(**dict(zip(SCORE_COLUMNS, out, strict=True)), distribution=implied)


def _score_block(
    block: Array,
    complete: bool,
    factor_points: FactorPoints,
    rules: Rules,
    missing: Missing,
    out: Scores8,
    start: int,
) -> None:
    if rules.upper_arm_reference == "gravity":
        against_gravity(block)
    if complete:
        _evaluate(block, factor_points, rules, out)
        out[_ROW["reba_low"]] = out[_ROW["reba_high"]] = out[_ROW["reba"]]
        return
    unmeasured = np.isnan(block)
    if missing == "error":
        row, frame = np.argwhere(unmeasured)[0]
        raise PostureError(
            f"{COLUMNS[row]} is not measured at frame {start + frame}; measure it, or choose missing='range'"
        )
    high = np.empty_like(out)
    _fill(block, unmeasured, _BEST)
    _evaluate(block, factor_points, rules, out)
    _fill(block, unmeasured, _WORST)
    _evaluate(block, factor_points, rules, high)
    out[_ROW["reba_low"]] = out[_ROW["reba"]]
    out[_ROW["reba_high"]] = high[_ROW["reba"]]
    ends = len(_RANGED)
    if missing == "range":
        np.copyto(out[:ends], UNKNOWN, where=out[:ends] != high[:ends])
    elif missing == "worst":
        out[:ends] = high[:ends]


def _fill(block: Array, unmeasured: Flags, ends: Array) -> None:
    """Put one angle for each column into the unmeasured places of `block` (22, m); most columns have none."""
    for column in np.flatnonzero(unmeasured.any(axis=1)):
        np.copyto(block[column], ends[column], where=unmeasured[column])


def _evaluate(c: Array, factor_points: FactorPoints, rules: Rules, out: Scores8) -> None:
    """Score one block of fully known columns c (22, m) into the rows of `out`.

    Left and right stand beside each other in `c` and `out`, so that both arms are scored as one (2, m) array.
    """
    score_a, score_b, sides = out[_ROW["score_a"]], _both(out, "score_b"), _both(out, "reba")
    out[_ROW["activity"]] = factor_points.activity
    steps = part_steps(rules)
    _group_a(c, factor_points, steps, out, score_a)
    _group_b(c, factor_points, steps, out, score_b)
    np.add(_C.take(score_a * _C_STRIDES[0] + score_b - _C_FIRST), factor_points.activity, out=sides)
    if rules.two_sides == "worse":
        np.maximum(sides[0], sides[1], out=out[_ROW["reba"]])
    else:
        out[_ROW["reba"]] = sides[SIDES.index(rules.two_sides)]
    out[_ROW["action_level"]] = LEVEL_OF.take(out[_ROW["reba"]])


def _both(out: Scores8, name: str) -> Scores8:
    """Return the rows of the left and the right side, (2, m)."""
    first = _ROW[f"{name}_left"]
    return out[first : first + 2]


def _group_a(c: Array, factor_points: FactorPoints, steps: Steps, out: Scores8, score_a: Scores8) -> None:
    trunk, neck, legs = (out[_ROW[part]] for part in GROUP_A)
    _part_score(c, steps["trunk"], trunk, PART_MAXIMA["trunk"])
    _part_score(c, steps["neck"], neck, PART_MAXIMA["neck"])
    _part_score(c, steps["legs"], legs, PART_MAXIMA["legs"], lowest=0)
    legs *= factor_points.knees_count
    legs += factor_points.legs
    out[_ROW["load_force"]] = factor_points.load_force
    cells = trunk * _A_STRIDES[0] + neck * _A_STRIDES[1] + legs - _A_FIRST
    np.add(_A.take(cells), factor_points.load_force, out=score_a)


def _group_b(c: Array, factor_points: FactorPoints, steps: Steps, out: Scores8, score_b: Scores8) -> None:
    upper, lower, wrist = (_both(out, part) for part in GROUP_B)
    _part_score(c, steps["upper_arm"], upper, PART_MAXIMA["upper_arm"])
    if factor_points.arm_supported.any():
        # A supported arm takes one off but never below 1: index 0 would wrap to the last row of Table B.
        upper -= factor_points.arm_supported & (upper > 1)
    _part_score(c, steps["lower_arm"], lower, PART_MAXIMA["lower_arm"])
    _part_score(c, steps["wrist"], wrist, PART_MAXIMA["wrist"])
    _both(out, "coupling")[:] = factor_points.coupling
    cells = upper * _B_STRIDES[0] + lower * _B_STRIDES[1] + wrist - _B_FIRST
    np.add(_B.take(cells), factor_points.coupling, out=score_b)


def _part_score(c: Array, steps: PartSteps, score: Scores8, highest: int, lowest: int = 1) -> None:
    """Write the score of a body part, (m,) or (2, m) for both sides, from the columns c (22, m)."""
    (main, *adjustments), shares_point = steps
    angle = c[main.rows]
    if angle.ndim > score.ndim:  # two knees, one score
        angle = np.maximum(angle[0], angle[1])
    first, *others = main.boundaries
    np.add(outside(angle, first), lowest, out=score)
    for boundary in others:
        score += outside(angle, boundary)
    if not adjustments:
        return
    one, other = (outside(c[each.rows], each.boundaries[0]) for each in adjustments)
    if shares_point:
        score += one | other
        return
    score += one
    score += other
    if lowest + len(main.boundaries) + len(adjustments) > highest:
        np.minimum(score, highest, out=score)


class PartScores(NamedTuple):
    """What the tables give for part scores: ints for scalars, (n,) integer arrays for arrays."""

    score_a: Any
    score_b: Any
    score_c: Any
    reba: Any
    action_level: Any


def score_parts(
    *,
    trunk: ArrayLike,
    neck: ArrayLike,
    legs: ArrayLike,
    upper_arm: ArrayLike,
    lower_arm: ArrayLike,
    wrist: ArrayLike,
    load_force: ArrayLike = 0,
    coupling: ArrayLike = 0,
    activity: ArrayLike = 0,
) -> PartScores:
    """Apply Tables A, B, C to part scores of one side.

    Args:
        trunk, neck, legs, upper_arm, lower_arm, wrist: body part scores from 1 (scalars or arrays that broadcast).
        load_force, coupling, activity: 0 to 3.

    Raises:
        PostureError: a score is not a whole number in its range, or the shapes do not broadcast.

    Example:
        >>> score_parts(trunk=4, neck=2, legs=2, load_force=3, upper_arm=4, lower_arm=2, wrist=3, coupling=3)
        PartScores(score_a=9, score_b=10, score_c=12, reba=12, action_level=4)
    """
    part_scores = {
        "trunk": trunk, "neck": neck, "legs": legs, "upper_arm": upper_arm, "lower_arm": lower_arm, "wrist": wrist,
        "load_force": load_force, "coupling": coupling, "activity": activity,
    }  # fmt: skip
    scores = {name: _integers(name, value) for name, value in part_scores.items()}
    try:
        np.broadcast_shapes(*(values.shape for values in scores.values()))
    except ValueError as error:
        shapes = ", ".join(f"{name} {values.shape}" for name, values in scores.items() if values.ndim)
        raise PostureError(f"part scores do not fit together: {shapes}; expected scalars or equal lengths") from error
    score_a = TABLE_A[scores["trunk"] - 1, scores["neck"] - 1, scores["legs"] - 1].astype(int) + scores["load_force"]
    score_b = (
        TABLE_B[scores["upper_arm"] - 1, scores["lower_arm"] - 1, scores["wrist"] - 1].astype(int) + scores["coupling"]
    )
    score_c = TABLE_C[score_a - 1, score_b - 1].astype(int)
    reba = score_c + scores["activity"]
    results = (score_a, score_b, score_c, reba, LEVEL_OF[reba].astype(int))
    return PartScores(*(int(value) if np.ndim(value) == 0 else value for value in results))


def _integers(name: str, value: ArrayLike) -> NDArray[np.int64]:
    lowest = 0 if name in ("load_force", "coupling", "activity") else 1
    highest = PART_MAXIMA[name]
    try:
        values = np.asarray(value)
        if np.iscomplexobj(values):
            raise TypeError("NumPy would drop the imaginary part")
        with np.errstate(invalid="ignore"):  # NaN and infinity become some integer, which the comparison refuses
            integers = values.astype(np.int64)
        fits = bool(np.all((integers == values) & (integers >= lowest) & (integers <= highest)))
    except (TypeError, ValueError, OverflowError):
        fits = False
    if not fits:
        raise PostureError(f"{name} score is {shown(value)}; expected whole numbers from {lowest} to {highest}")
    return integers
