"""Second derivatives of the soft tables: the exact Hessian and a Gauss-Newton factor.

With parts p(x) and value y(p), H = J^T Y J + sum_i y_i p_i'': J (9, 22) is the Jacobian of the parts, Y the Hessian of
the value by the parts. The tables are multilinear, so H is exact between the integer scores, where they have kinks.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from dreba.surrogates.soft_steps import GROUPS, PAIRED, ROWS, SINGLE
from dreba.surrogates.soft_tables import KNEE_WIDTH, SIDE_WIDTH, Pass, SoftTables
from reba.arrays import Array
from reba.posture.columns import COLUMNS, INDEX

RESIDUAL_OFFSET: Final = 0.1
"""[points] Added under the square root of the Gauss-Newton residuals, whose derivative is infinite at 0; small beside
the steps of 1 point."""
_KNEES: Final = INDEX["knee_flexion_left"]


def hessian(tables: SoftTables, angles: Array, added: Array | None = None) -> Array:
    """Return Hessians (n, 22, 22) [1/deg^2]; arguments as in `SoftTables.value_gradient`."""
    run = tables.forward(angles.T, added)
    by_part = tables.reverse_parts(run, tables.reverse_tables(run))
    by_group = tables.reverse_groups(by_part, run)
    group_slopes, group_hessians = _group_derivatives(tables, run)
    slopes = _part_slopes(tables, run, group_slopes)
    out: Array = np.einsum("pin,pqn,qjn->nij", slopes, _by_parts(tables, run), slopes, optimize=True)
    out += np.einsum("gn,gijn->nij", by_group, group_hessians)
    shared = -tables.overlap[[0, 1, 2, 2]][:, None] * by_part[PAIRED]
    cross = np.einsum("kn,kin,kjn->nij", shared, group_slopes[4:8], group_slopes[8:12], optimize=True)
    return out + cross + cross.transpose(0, 2, 1)


def gauss_newton(tables: SoftTables, angles: Array, added: Array | None = None) -> Array:
    """Return Gauss-Newton factors J (n, 9, 22); J^T J approximates the Hessian and is positive semidefinite.

    Each part p above its lowest score is half a squared residual, r = sqrt(2 (p + 0.1)), weighted by the derivative of
    the value by that part; curvature of the tables between parts is omitted. The factor gives the direction of a
    Gauss-Newton step; the size of the curvature is approximated near a minimum only.
    """
    run = tables.forward(angles.T, added)
    slopes = _part_slopes(tables, run, _group_derivatives(tables, run)[0])
    parts = np.maximum(_parts(tables, run), 0.0)
    by_part = np.maximum(tables.reverse_parts(run, tables.reverse_tables(run)), 0.0)
    weight = np.sqrt(by_part / (2.0 * (parts + RESIDUAL_OFFSET)))
    return np.ascontiguousarray((slopes * weight[:, None]).transpose(2, 0, 1))


def _group_derivatives(tables: SoftTables, run: Pass) -> tuple[Array, Array]:
    """Return Jacobians (17, 22, n) [1/deg] and Hessians (17, 22, 22, n) [1/deg^2] of the groups of steps."""
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
    slopes, hessians = by_column[:, :columns].copy(), np.zeros((len(GROUPS), columns, columns, n))
    diagonal = np.arange(columns)
    hessians[:, diagonal, diagonal] = twice[:, :columns]
    share = np.array([run.knee, 1.0 - run.knee])
    curvature = _smooth_max_curvature(run.knee_root, KNEE_WIDTH * tables.temperature)
    for i in range(2):
        slopes[:, _KNEES + i] += by_column[:, columns] * share[i]
        for j in range(2):
            sign = 1.0 if i == j else -1.0
            hessians[:, _KNEES + i, _KNEES + j] += twice[:, columns] * share[i] * share[j]
            hessians[:, _KNEES + i, _KNEES + j] += by_column[:, columns] * curvature * sign
    return slopes, hessians


def _part_slopes(tables: SoftTables, run: Pass, group_slopes: Array) -> Array:
    """Return the Jacobian (9, 22, n) of the parts from that of the groups."""
    shared = tables.overlap[[0, 1, 2, 2]][:, None]
    out = np.empty((9, *group_slopes.shape[1:]))
    one, other = (1.0 - shared * run.groups[8:12])[:, None], (1.0 - shared * run.groups[4:8])[:, None]
    out[PAIRED] = group_slopes[:4] + one * group_slopes[4:8] + other * group_slopes[8:12]
    out[SINGLE] = group_slopes[12:]
    return out


def _parts(tables: SoftTables, run: Pass) -> Array:
    """Return part scores above their lowest, (9, n)."""
    shared = tables.overlap[[0, 1, 2, 2]][:, None]
    out = np.empty((9, len(run.value)))
    one, other = run.groups[4:8], run.groups[8:12]
    out[PAIRED] = run.groups[:4] + one + other - shared * one * other
    out[SINGLE] = run.groups[12:]
    return out


def _by_parts(tables: SoftTables, run: Pass) -> Array:
    """Return the Hessian (9, 9, n) of the value by the parts."""
    by_table = tables.reverse_tables(run)
    inside = run.inside.reshape(3, 3, -1)
    slopes = run.slopes * inside
    curvature = _smooth_max_curvature(run.side_root, SIDE_WIDTH * tables.temperature)
    share = (run.side, 1.0 - run.side)
    # Hessian by the table scores: A and worse B through Table C, left and right B through the smooth maximum.
    by_tables = np.zeros((3, 3, len(run.value)))
    for i in range(2):
        by_tables[0, 1 + i] = by_tables[1 + i, 0] = run.cross_c * share[i]
        for j in range(2):
            by_tables[1 + i, 1 + j] = run.slopes_c[1] * curvature * (1.0 if i == j else -1.0)
    # Rows of parts are (index of the table, table): see `soft_tables`.
    out = np.einsum("atn,tsn,bsn->atbsn", slopes, by_tables, slopes, optimize=True)
    mixed = _mixed(run) * by_table
    for table in range(3):
        for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
            both = mixed[k, table] * inside[i, table] * inside[j, table]
            out[i, table, j, table] += both
            out[j, table, i, table] += both
    return out.reshape(9, 9, -1)


def _mixed(run: Pass) -> Array:
    """Return mixed derivatives ab, ac, bc (3, 3, n) of the three tables inside their cells."""
    a, b, c = run.place[:3], run.place[3:6], run.place[6:]
    coef = run.coef
    return np.array([coef[6] + coef[7] * c, coef[5] + coef[7] * b, coef[3] + coef[7] * a])


def _smooth_max_curvature(root: Array, width: float) -> Array:
    """Return the second derivative of the smooth maximum by its first argument."""
    return 0.5 * width**2 / root**3
