"""Smooth REBA tables: sigmoid steps, multilinear Tables A, B and C and a smooth maximum of the sides, with gradient.

    angles -> 45 steps, sigmoids of temperature T [deg] -> nine parts -> A, B left, B right -> smooth maximum B -> C

Every stage is an array (rows, n) over all poses. Left and right arm are rows of one array; Table A and both lookups of
Table B are one multilinear interpolation. The gradient is a reverse pass (reverse-mode differentiation). As T goes to 0
the value of the unfitted tables converges to the exact score of `reba.method.scoring`, which has the same stages.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from dreba.errors import ModelError
from dreba.surrogates.soft_steps import GROUPS, PAIRED, ROWS, SINGLE
from reba.arrays import Array, Indices
from reba.method.rules import Rules
from reba.method.steps import STEPS, part_steps
from reba.method.tables import PART_MAXIMA, TABLE_A, TABLE_B, TABLE_C
from reba.posture.columns import COLUMNS, GROUP_A, GROUP_B, INDEX

CHUNK: Final = 1024
"""Poses evaluated at once, so that all rows fit into the second-level cache."""
KNEE_WIDTH: Final = 0.5
"""Width of the smooth maximum of the knees [deg] per degree of temperature."""
SIDE_WIDTH: Final = 0.05
"""Width of the smooth maximum of both Scores B [points] per degree of temperature."""
_KNEES: Final = INDEX["knee_flexion_left"]
_WORSE_KNEE: Final = len(COLUMNS)
# Rows: first, second, third index of Table A, of Table B left and right; indices start at 0.
_HIGHEST: Final = np.array(
    [PART_MAXIMA[part] - 1 for a, b in zip(GROUP_A, GROUP_B, strict=True) for part in (a, b, b)], float
)[:, None]
_LAST_CELL: Final = _HIGHEST - 1
_STRIDES: Final = np.concatenate([_HIGHEST[3:6] * _HIGHEST[6:], _HIGHEST[6:], np.ones((3, 1))])
_FIRST_CELL: Final = np.array([0, 24, 24], float)[:, None]


class Pass(NamedTuple):
    """Intermediate results of a forward pass of n poses, for the reverse pass and for curvature.

    Attributes:
        steps: (45, n) tanh of half the step arguments.
        groups: (17, n) sums of the steps.
        knee, side: (n,) derivative of the smooth maximum of the knees, of both Scores B, by the left one.
        knee_root, side_root: (n,) smooth absolute difference of the knees [deg], of both Scores B.
        inside: (9, n) 1.0 where a part is within its table, else 0.0.
        place: (9, n) position in the table cell, 0 to 1.
        cell: (3, n) cell number of A, B left, B right.
        coef: (8, 3, n) monomial coefficients of these cells.
        slopes: (3, 3, n) derivatives of A, B left, B right by their three parts.
        cell_c, place_c: (n,) cell number of Table C, (2, n) position in this cell.
        slopes_c, cross_c: (2, n) derivatives by Score A and Score B, (n,) mixed derivative by both.
    """

    value: Array
    steps: Array
    groups: Array
    knee: Array
    knee_root: Array
    inside: Array
    place: Array
    cell: Indices
    coef: Array
    slopes: Array
    side: Array
    side_root: Array
    cell_c: Indices
    place_c: Array
    slopes_c: Array
    cross_c: Array


@dataclass(frozen=True)
class SoftTables:
    """Smooth tables at one temperature [deg], above 0.

    Attributes:
        thresholds: (27,) [deg] along the direction of each step of `reba.method.steps.STEPS`.
        heights: (27,) points a step adds, not negative.
        overlap: (3,) share of one point common to both adjustments of trunk, neck, wrist: 1 one together, 0 one each.
        table_a, table_b, table_c: (5, 3, 4), (6, 2, 3), (12, 12), non-decreasing along every axis.

    Example:
        >>> tables = SoftTables.of(Rules(), temperature=0.001)
        >>> pose = np.zeros((1, 22))
        >>> pose[0, INDEX["trunk_flexion"]] = 70.0
        >>> float(tables.value(pose)[0].round(6))
        2.0
    """

    thresholds: Array
    heights: Array
    overlap: Array
    table_a: Array
    table_b: Array
    table_c: Array
    temperature: float

    @staticmethod
    def of(rules: Rules, temperature: float) -> SoftTables:
        """Return the unfitted tables: printed values and thresholds of the rules.

        Raises:
            ModelError: the rules need more than angles against the trunk, or the temperature is not above 0.
        """
        if rules.upper_arm_reference != "trunk" or rules.two_sides != "worse":
            raise ModelError(
                f"rules have upper_arm_reference {rules.upper_arm_reference!r} and two_sides {rules.two_sides!r}; "
                f"expected 'trunk' and 'worse' for soft tables"
            )
        if not temperature > 0:
            raise ModelError(f"temperature is {temperature}; expected degrees above 0, such as 0.001 for almost exact")
        return SoftTables(
            thresholds=np.array([step.threshold(rules) for step in STEPS]),
            heights=np.ones(len(STEPS)),
            overlap=np.array([float(part_steps(rules)[part].shares_point) for part in ("trunk", "neck", "wrist")]),
            table_a=TABLE_A.astype(float),
            table_b=TABLE_B.astype(float),
            table_c=TABLE_C.astype(float),
            temperature=float(temperature),
        )

    # Constants of the passes, cached.

    @cached_property
    def _scale(self) -> Array:
        return ROWS.sense[:, None] / (2.0 * self.temperature)

    @cached_property
    def _offset(self) -> Array:
        return self.thresholds[ROWS.step][:, None] / (2.0 * self.temperature)

    @cached_property
    def _into_groups(self) -> Array:
        weights = np.zeros((len(GROUPS), len(ROWS.step)))
        weights[ROWS.group, np.arange(len(ROWS.step))] = self.heights[ROWS.step] / 2.0
        return weights

    @cached_property
    def _group_middle(self) -> Array:
        return self._into_groups.sum(axis=1, keepdims=True)

    @cached_property
    def _into_columns(self) -> Array:
        places = np.zeros((_WORSE_KNEE + 1, len(ROWS.step)))
        places[ROWS.column, np.arange(len(ROWS.step))] = self._scale[:, 0]
        return places

    @cached_property
    def _shared(self) -> Array:
        return self.overlap[[0, 1, 2, 2]][:, None]

    @cached_property
    def _coef_ab(self) -> Array:
        cells = np.concatenate([self.table_a.ravel(), self.table_b.ravel()])
        return np.ascontiguousarray(MONOMIALS_AB @ cells[CORNERS_AB])

    @cached_property
    def _coef_c(self) -> Array:
        return np.ascontiguousarray(MONOMIALS_C @ self.table_c.ravel()[CORNERS_C])

    # Evaluation.

    def value(self, angles: Array, added: Array | None = None, activity: Any = 0.0) -> Array:
        """Return values (n,); arguments as in `value_gradient`."""
        out = np.empty(len(angles))
        for rows in _chunks(len(angles)):
            out[rows] = self.forward(angles[rows].T, _part(added, rows)).value
        return out + activity

    def value_gradient(self, angles: Array, added: Array | None = None, activity: Any = 0.0) -> tuple[Array, Array]:
        """Return values (n,) and gradients (n, 22) [1/deg] at angles (n, 22) [deg].

        Args:
            added: (3, n) or (3, 1) points of load and coupling, added to Score A, Score B left and right; None for 0.
            activity: points added to the total, a scalar or (n,).
        """
        if len(angles) <= CHUNK:
            run = self.forward(angles.T, added)
            return run.value + activity, self.reverse(run).T
        value, gradient = np.empty(len(angles)), np.empty(angles.shape)
        for rows in _chunks(len(angles)):
            run = self.forward(angles[rows].T, _part(added, rows))
            value[rows], gradient[rows] = run.value, self.reverse(run).T
        return value + activity, gradient

    def forward(self, columns: Array, added: Array | None = None) -> Pass:
        """Return the forward pass of columns (22, n) [deg]."""
        temperature = self.temperature
        angles = np.empty((_WORSE_KNEE + 1, columns.shape[1]))
        angles[:_WORSE_KNEE] = columns
        angles[_WORSE_KNEE], knee, knee_root = _smooth_max(
            columns[_KNEES], columns[_KNEES + 1], KNEE_WIDTH * temperature
        )
        steps = angles.take(ROWS.column, axis=0)
        steps *= self._scale
        steps -= self._offset
        np.tanh(steps, out=steps)
        groups = self._into_groups @ steps
        groups += self._group_middle

        parts = np.empty((9, columns.shape[1]))
        one, other = groups[4:8], groups[8:12]
        parts[PAIRED] = groups[:4] + one + other - self._shared * one * other
        parts[SINGLE] = groups[12:]
        place = np.minimum(np.maximum(parts, 0.0), _HIGHEST)
        inside = (place == parts).astype(float)
        corner = np.minimum(np.floor(place), _LAST_CELL)
        place -= corner
        corner *= _STRIDES
        cell = (corner[:3] + corner[3:6] + corner[6:] + _FIRST_CELL).astype(np.intp)
        coef = self._coef_ab.take(cell, axis=1)
        table, slopes = trilinear(coef, place)
        if added is not None:
            table += added
        worse, side, side_root = _smooth_max(table[1], table[2], SIDE_WIDTH * temperature)
        value, cell_c, place_c, slopes_c, cross_c = self._through_c(table[0], worse)
        return Pass(
            value, steps, groups, knee, knee_root, inside, place, cell, coef, slopes,
            side, side_root, cell_c, place_c, slopes_c, cross_c,
        )  # fmt: skip

    def _through_c(self, score_a: Array, score_b: Array) -> tuple[Array, Indices, Array, Array, Array]:
        """Return value, cell, position, slopes and mixed derivative of Table C at Scores A and B from 1 to 12."""
        scores = np.array([score_a, score_b])
        scores -= 1.0
        place = np.minimum(np.maximum(scores, 0.0), 11.0)
        inside = place == scores
        corner = np.minimum(np.floor(place), 10.0)
        place -= corner
        cell = (corner[0] * 11.0 + corner[1]).astype(np.intp)
        constant, by_b, by_a, cross = self._coef_c.take(cell, axis=1)
        slope_a = by_a + cross * place[1]
        slope_b = by_b + cross * place[0]
        value = constant + by_b * place[1] + slope_a * place[0]
        slopes = np.array([slope_a, slope_b])
        slopes *= inside
        return value, cell, place, slopes, cross * (inside[0] & inside[1])

    def reverse(self, run: Pass) -> Array:
        """Return the gradient (22, n) [1/deg]."""
        by_part = self.reverse_parts(run, self.reverse_tables(run))
        out = self._into_columns @ self.reverse_steps(self.reverse_groups(by_part, run), run)
        out[_KNEES] += out[_WORSE_KNEE] * run.knee
        out[_KNEES + 1] += out[_WORSE_KNEE] * (1.0 - run.knee)
        return out[:_WORSE_KNEE]

    def reverse_tables(self, run: Pass, weight: Array | None = None) -> Array:
        """Return the derivatives (3, n) of the values, times weight (n,), by Score A, Score B left and right."""
        out = np.empty((3, len(run.value)))
        by_a, by_b = run.slopes_c if weight is None else run.slopes_c * weight
        out[0] = by_a
        np.multiply(by_b, run.side, out=out[1])
        np.subtract(by_b, out[1], out=out[2])
        return out

    def reverse_parts(self, run: Pass, by_table: Array) -> Array:
        """Return the derivatives (9, n) by the parts from those by the table scores (3, n)."""
        return (run.slopes * by_table).reshape(9, -1) * run.inside

    def reverse_groups(self, by_part: Array, run: Pass) -> Array:
        """Return the derivatives (17, n) by the groups of steps from those by the parts."""
        out = np.empty_like(run.groups)
        paired = by_part[PAIRED]
        out[:4] = paired
        out[4:8] = paired * (1.0 - self._shared * run.groups[8:12])
        out[8:12] = paired * (1.0 - self._shared * run.groups[4:8])
        out[12:] = by_part[SINGLE]
        return out

    def reverse_steps(self, by_group: Array, run: Pass) -> Array:
        """Return the derivatives (45, n) by the arguments of the steps from those by the groups."""
        out = self._into_groups.T @ by_group
        out *= 1.0 - run.steps * run.steps
        return out


def _smooth_max(left: Array, right: Array, width: float) -> tuple[Array, Array, Array]:
    """Return a smooth maximum, its derivative by `left`, and the smooth absolute difference.

    The maximum of equal arguments is exact (half the width is subtracted); a larger value would leave the tables.
    """
    difference = left - right
    root = np.sqrt(difference * difference + width * width)
    return 0.5 * (left + right + root - width), 0.5 + 0.5 * difference / root, root


def _chunks(n: int) -> list[slice]:
    return [slice(start, min(start + CHUNK, n)) for start in range(0, n, CHUNK)]


def _part(added: Array | None, rows: slice) -> Array | None:
    """Return the added points of selected poses; (3, 1) applies to all."""
    return added if added is None or added.shape[1] == 1 else added[:, rows]


def _corner_numbers(shape: tuple[int, ...], first: int) -> Indices:
    """Return the entry numbers (2^k, cells) of the corners of every cell of a table, first index slowest."""
    numbers = np.arange(np.prod(shape)).reshape(shape) + first
    k = len(shape)
    corners = []
    for corner in range(2**k):
        shifts = [(corner >> (k - 1 - axis)) & 1 for axis in range(k)]
        part = numbers[tuple(slice(s, size - 1 + s) for s, size in zip(shifts, shape, strict=True))]
        corners.append(part.ravel())
    return np.array(corners)


_ONE: Final = np.array([[1.0, 0.0], [-1.0, 1.0]])
CORNERS_AB: Final = np.hstack([_corner_numbers((5, 3, 4), 0), _corner_numbers((6, 2, 3), 60)])
"""Corners (8, 34) of the 24 cells of A and 10 of B among the 60 entries of A followed by the 36 of B."""
CORNERS_C: Final = _corner_numbers((12, 12), 0)
"""Corners (4, 121) of the cells of C among its 144 entries."""
MONOMIALS_AB: Final = np.kron(_ONE, np.kron(_ONE, _ONE))
"""Matrix (8, 8) from corner values to the coefficients of 1, c, b, bc, a, ac, ab, abc inside a cell."""
MONOMIALS_C: Final = np.kron(_ONE, _ONE)
"""Matrix (4, 4) from corner values to the coefficients of 1, y, x, xy."""


def trilinear(coef: Array, place: Array) -> tuple[Array, Array]:
    """Return interpolated values (3, n) and slopes (3, 3, n) from the coefficients of 1, c, b, bc, a, ac, ab, abc."""
    a, b, c = place[:3], place[3:6], place[6:]
    slopes = np.empty((3, *a.shape))
    low_b = coef[2] + coef[3] * c
    low = coef[0] + coef[1] * c + low_b * b
    high_b = coef[6] + coef[7] * c
    slopes[0] = coef[4] + coef[5] * c + high_b * b
    slopes[1] = low_b + high_b * a
    slopes[2] = coef[1] + coef[3] * b + (coef[5] + coef[7] * b) * a
    return low + slopes[0] * a, slopes
