"""Second derivatives of the soft tables: the exact Hessian and a Gauss-Newton factor.

With parts p(x) and value y(p), H = J^T Y J + sum_i y_i p_i'': J (9, 22) are the slopes of the parts, Y the second
derivatives by the parts. The tables are multilinear, so that between the integer scores, where they have kinks, all of
this is exact.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from dreba.surrogates.soft_steps import GROUPS, PAIRED, ROWS, SINGLE
from dreba.surrogates.soft_tables import KNEE_WIDTH, SIDE_WIDTH, Pass, SoftTables
from reba.arrays import Array
from reba.posture.columns import COLUMNS, INDEX

SOFTENED: Final = 0.1
"""[points] Added under the root of the Gauss-Newton residuals, which have no slope at 0."""
_KNEES: Final = INDEX["knee_flexion_left"]
_OF_GROUP: Final = (np.arange(len(GROUPS))[:, None] == ROWS.group[None, :]).astype(float)


def hessian(tables: SoftTables, angles: Array, added: Array | None = None) -> Array:
    """Return (n, 22, 22) second derivatives [1/deg^2]; arguments as in `SoftTables.value_gradient`."""
    run = tables.forward(angles.T, added)
    by_part = tables.reverse_parts(run)
    by_group = tables.reverse_groups(by_part, run)
    group_slopes, group_bends = _group_derivatives(tables, run)
    slopes = _part_slopes(tables, run, group_slopes)
    out: Array = np.einsum("pin,pqn,qjn->nij", slopes, _by_parts(tables, run), slopes, optimize=True)
    out += np.einsum("gn,gijn->nij", by_group, group_bends)
    shared = -tables.overlap[[0, 1, 2, 2]][:, None] * by_part[PAIRED]
    cross = np.einsum("kn,kin,kjn->nij", shared, group_slopes[4:8], group_slopes[8:12], optimize=True)
    return out + cross + cross.transpose(0, 2, 1)


def gauss_newton(tables: SoftTables, angles: Array, added: Array | None = None) -> Array:
    """Return (n, 9, 22) factors J, whose J^T J stands for the Hessian and is never indefinite.

    Each part p above its lowest score is read as half a squared residual r = sqrt(2 (p + 0.1)), weighted by the slope
    of the value by that part; what the tables bend between parts is left out. The factor points the way a
    Gauss-Newton step should go; it approximates the size of the curvature only near a minimum.
    """
    run = tables.forward(angles.T, added)
    slopes = _part_slopes(tables, run, _group_derivatives(tables, run)[0])
    parts = np.maximum(_parts(tables, run), 0.0)
    weight = np.sqrt(np.maximum(tables.reverse_parts(run), 0.0) / (2.0 * (parts + SOFTENED)))
    return np.ascontiguousarray((slopes * weight[:, None]).transpose(2, 0, 1))


def _group_derivatives(tables: SoftTables, run: Pass) -> tuple[Array, Array]:
    """Return (17, 22, n) slopes and (17, 22, 22, n) second derivatives of the groups of steps."""
    n, columns = len(run.value), len(COLUMNS)
    scale = ROWS.sense / (2.0 * tables.temperature)
    height = tables.heights[ROWS.step] / 2.0
    slope = 1.0 - run.steps**2
    first = (height * scale)[:, None] * slope
    second = -2.0 * (height * scale**2)[:, None] * run.steps * slope
    by_column, twice = np.zeros((len(GROUPS), columns + 1, n)), np.zeros((len(GROUPS), columns + 1, n))
    for row in range(len(ROWS.step)):
        by_column[ROWS.group[row], ROWS.column[row]] += first[row]
        twice[ROWS.group[row], ROWS.column[row]] += second[row]
    slopes, bends = by_column[:, :columns].copy(), np.zeros((len(GROUPS), columns, columns, n))
    diagonal = np.arange(columns)
    bends[:, diagonal, diagonal] = twice[:, :columns]
    share = np.array([run.knee, 1.0 - run.knee])
    bend = _bend(run.knee_root, KNEE_WIDTH * tables.temperature)
    for i in range(2):
        slopes[:, _KNEES + i] += by_column[:, columns] * share[i]
        for j in range(2):
            sign = 1.0 if i == j else -1.0
            bends[:, _KNEES + i, _KNEES + j] += twice[:, columns] * share[i] * share[j]
            bends[:, _KNEES + i, _KNEES + j] += by_column[:, columns] * bend * sign
    return slopes, bends


def _part_slopes(tables: SoftTables, run: Pass, group_slopes: Array) -> Array:
    """Return (9, 22, n) slopes of the parts from those of the groups."""
    shared = tables.overlap[[0, 1, 2, 2]][:, None]
    out = np.empty((9, *group_slopes.shape[1:]))
    one, other = (1.0 - shared * run.groups[8:12])[:, None], (1.0 - shared * run.groups[4:8])[:, None]
    out[PAIRED] = group_slopes[:4] + one * group_slopes[4:8] + other * group_slopes[8:12]
    out[SINGLE] = group_slopes[12:]
    return out


def _parts(tables: SoftTables, run: Pass) -> Array:
    """Return (9, n) part scores above their lowest."""
    shared = tables.overlap[[0, 1, 2, 2]][:, None]
    out = np.empty((9, len(run.value)))
    one, other = run.groups[4:8], run.groups[8:12]
    out[PAIRED] = run.groups[:4] + one + other - shared * one * other
    out[SINGLE] = run.groups[12:]
    return out


def _by_parts(tables: SoftTables, run: Pass) -> Array:
    """Return (9, 9, n) second derivatives of the value by the parts."""
    by_table = tables.reverse_tables(run)
    inside = run.inside.reshape(3, 3, -1)
    slopes = run.slopes * inside
    bend = _bend(run.side_root, SIDE_WIDTH * tables.temperature)
    share = (run.side, 1.0 - run.side)
    # Between the three table scores: A with the worse B through Table C, left with right through the worse side.
    tops = np.zeros((3, 3, len(run.value)))
    for i in range(2):
        tops[0, 1 + i] = tops[1 + i, 0] = run.cross_c * share[i]
        for j in range(2):
            tops[1 + i, 1 + j] = run.slopes_c[1] * bend * (1.0 if i == j else -1.0)
    # Rows of parts are (index of the table, table): see `soft_tables`.
    out = np.einsum("atn,tsn,bsn->atbsn", slopes, tops, slopes, optimize=True)
    mixed = _mixed(run) * by_table
    for table in range(3):
        for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
            both = mixed[k, table] * inside[i, table] * inside[j, table]
            out[i, table, j, table] += both
            out[j, table, i, table] += both
    return out.reshape(9, 9, -1)


def _mixed(run: Pass) -> Array:
    """Return (3, 3, n) mixed derivatives ab, ac, bc of the three tables inside their cells."""
    a, b, c = run.place[:3], run.place[3:6], run.place[6:]
    coef = run.coef
    return np.array([coef[6] + coef[7] * c, coef[5] + coef[7] * b, coef[3] + coef[7] * a])


def _bend(root: Array, width: float) -> Array:
    """Return the second derivative of the smooth maximum by its first argument."""
    return 0.5 * width**2 / root**3
