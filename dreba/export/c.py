"""C99 source of a fitted model: one function of value and gradient, without dependencies except the C library."""

from __future__ import annotations

from string import Template
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from dreba.errors import ModelError
from dreba.surrogates import soft_tables
from dreba.surrogates.base import Surrogate
from dreba.surrogates.convex import ConvexModel
from dreba.surrogates.graduated import GraduatedModel
from dreba.surrogates.quadratic import QuadraticModel
from dreba.surrogates.soft import SoftModel
from dreba.surrogates.soft_steps import ROWS
from dreba.surrogates.task_factors import PAYLOADS
from reba.method.rules import LOAD_EDGES
from reba.posture.columns import COLUMNS, INDEX
from reba.provenance import generator


def c_source(model: Surrogate, *, temperature: float | None = None, name: str = "dreba") -> str:
    """Return the C source of `double NAME(angles, load, coupling, activity, gradient)`.

    Raises:
        ModelError: the kind cannot be exported, or soft tables do not have all 22 columns.
    """
    soft = model.soft_ if isinstance(model, GraduatedModel) else model
    if isinstance(model, QuadraticModel):
        body, fields = _QUADRATIC, _quadratic(model)
    elif isinstance(model, ConvexModel):
        body, fields = _CONVEX, _convex(model)
    elif isinstance(soft, SoftModel):
        body, fields = _SOFT, _soft(soft, temperature)
    else:
        raise ModelError(f"kind {model.kind!r} cannot be exported to C; expected quadratic, convex, soft or graduated")
    d = len(model.joints_)
    joints = ",\n *   ".join(f"{index} {joint}" for index, joint in enumerate(model.joints_))
    edges = {"edge_1": repr(LOAD_EDGES[0]), "edge_2": repr(LOAD_EDGES[1])}
    return Template(_HEAD + body).substitute(fields, name=name, d=d, joints=joints, generator=generator(), **edges)


def _quadratic(model: QuadraticModel) -> dict[str, Any]:
    if model.payload not in PAYLOADS:
        raise ModelError(f"payload {model.payload!r} cannot be exported; expected one of {', '.join(PAYLOADS)}")
    d = len(model.joints_)
    return {
        "what": "dREBA, a sum of quadratics (Busch, Toussaint and Lopes 2018, equation 1)",
        "linear": values(model.linear_),
        "half": values(model.twice_curvature_ / 2.0),
        "constant": repr(model.constant_),
        "payload": "load_points(load)" if model.payload == "tree" else f"load / {float(model.omega_load)!r}",
        "grip": repr(model.coupling_weight_),
        "even": d - d % 2,
        "odd": _ODD.replace("LAST", str(d - 1)) if d % 2 else "",
    }


def _convex(model: ConvexModel) -> dict[str, Any]:
    hinges = model.hinges()
    starts = np.searchsorted(hinges.joint, np.arange(len(model.joints_) + 1))
    rows = max(len(hinges.joint), 1)  # C has no empty arrays
    return {
        "what": "a convex sum of rounded hinges",
        "rows": rows,
        "start": values(starts, whole=True),
        "scale": values(hinges.scale if len(hinges.joint) else [0.0]),
        "offset": values(hinges.offset if len(hinges.joint) else [0.0]),
        "weight": values(hinges.weight if len(hinges.joint) else [0.0]),
        "constant": repr(model.constant_),
        "by_load": repr(float(model.points_[0])),
        "grip": repr(float(model.points_[1])),
    }


_HEAD: Final = """\
/* $what. C99, no dependencies.
 * Written by $generator.
 *
 * double $name(const double angles[$d], double load, const double coupling[2], double activity, double *gradient)
 *   angles    degrees:
 *   $joints
 *   load      kg
 *   coupling  left and right, 0 (good) to 3 (unacceptable)
 *   activity  points, 0 to 3
 *   gradient  $d values per degree, or NULL; must not overlap angles
 */
#include <math.h>
#include <stddef.h>

static double load_points(double load)
{
    return (load >= $edge_1) + (load > $edge_2);
}

"""
_ODD: Final = """
    {
        const double bend = half[LAST] * angles[LAST], rise = linear[LAST] + bend;
        sum[0] += angles[LAST] * rise;
        gradient[LAST] = rise + bend;
    }"""
# Two interleaved sums let the compiler use vector registers of two doubles at -O2.
_QUADRATIC: Final = """\
static double value_and_slope(const double *restrict angles, double *restrict gradient)
{
    static const double linear[$d] = $linear;
    static const double half[$d] = $half;
    double sum[2] = {0.0, 0.0};
    for (int i = 0; i < $even; i += 2)
        for (int k = 0; k < 2; ++k) {
            const double bend = half[i + k] * angles[i + k], rise = linear[i + k] + bend;
            sum[k] += angles[i + k] * rise;
            gradient[i + k] = rise + bend;
        }$odd
    return sum[0] + sum[1] + $constant;
}

double $name(const double angles[$d], double load, const double coupling[2], double activity, double *gradient)
{
    double unused[$d];
    const double worse = coupling[0] > coupling[1] ? coupling[0] : coupling[1];
    (void)load_points;
    return value_and_slope(angles, gradient ? gradient : unused) + $payload + activity + $grip * worse;
}
"""
_CONVEX: Final = """\
double $name(const double angles[$d], double load, const double coupling[2], double activity, double *gradient)
{
    static const int start[$d + 1] = $start;
    static const double scale[$rows] = $scale;
    static const double offset[$rows] = $offset;
    static const double weight[$rows] = $weight;
    const double worse = coupling[0] > coupling[1] ? coupling[0] : coupling[1];
    double value = $constant + $by_load * load_points(load) + $grip * worse + activity;
    for (int i = 0; i < $d; ++i) {
        double slope = 0.0;
        for (int r = start[i]; r < start[i + 1]; ++r) {
            const double past = scale[r] * angles[i] - offset[r];
            if (past > 0.0) {
                const double inside = past < 1.0 ? past : 1.0;
                value += weight[r] * inside * (past - 0.5 * inside);
                slope += weight[r] * scale[r] * inside;
            }
        }
        if (gradient) gradient[i] = slope;
    }
    return value;
}
"""


def values(array: ArrayLike, whole: bool = False) -> str:
    """Return numbers as a C initialiser that reads back exactly, `whole` ones as integers."""
    return "{" + ", ".join(str(int(v)) if whole else repr(float(v)) for v in np.asarray(array).ravel()) + "}"


def _soft(model: SoftModel, temperature: float | None) -> dict[str, Any]:
    """Return the fields of the template `_SOFT`; ModelError without all 22 columns or without this temperature."""
    if model.joints_ != COLUMNS:
        count = len(model.joints_)
        raise ModelError(
            f"soft tables of {count} columns cannot be exported; fit on all 22, in the order of reba.COLUMNS"
        )
    tables = model.tables(temperature)
    return {
        "what": f"soft REBA tables at {tables.temperature:g} deg",
        "rows": len(ROWS.step),
        "column": values(ROWS.column, whole=True),
        "group": values(ROWS.group, whole=True),
        "scale": values(ROWS.sense / (2.0 * tables.temperature)),
        "offset": values(tables.thresholds[ROWS.step] / (2.0 * tables.temperature)),
        "height": values(tables.heights[ROWS.step] / 2.0),
        "overlap": values(tables.overlap[[0, 1, 2, 2]]),
        "a": values(tables.table_a),
        "b": values(tables.table_b),
        "c": values(tables.table_c),
        "knee": INDEX["knee_flexion_left"],
        "knee_width": repr(soft_tables.KNEE_WIDTH * tables.temperature),
        "side_width": repr(soft_tables.SIDE_WIDTH * tables.temperature),
    }


_SOFT: Final = """\
static const double table_a[60] = $a;
static const double table_b[36] = $b;
static const double table_c[144] = $c;

static double smooth_max(double left, double right, double width, double *by_left)
{
    const double difference = left - right, root = sqrt(difference * difference + width * width);
    *by_left = 0.5 + 0.5 * difference / root;
    return 0.5 * (left + right + root - width);
}

/* Place in a cell (0 to 1); *inside is 0 where the table ends. */
static int cell_of(double score, int last, double *place, double *inside)
{
    const double held = fmin(fmax(score, 0.0), (double)last);
    int corner = (int)held;
    if (corner > last - 1) corner = last - 1;
    *inside = held == score;
    *place = held - corner;
    return corner;
}

/* Trilinear interpolation in table (.., n1, n2) at scores from 0; slopes by the three scores. */
static double trilinear(const double *table, const int last[3], const double score[3], double slope[3])
{
    double p[3], inside[3];
    int corner[3];
    for (int k = 0; k < 3; ++k) corner[k] = cell_of(score[k], last[k], &p[k], &inside[k]);
    const int s1 = last[2] + 1, s0 = (last[1] + 1) * s1;
    const double *v = table + corner[0] * s0 + corner[1] * s1 + corner[2];
    const double v00 = v[0] + p[2] * (v[1] - v[0]), v01 = v[s1] + p[2] * (v[s1 + 1] - v[s1]);
    const double v10 = v[s0] + p[2] * (v[s0 + 1] - v[s0]);
    const double v11 = v[s0 + s1] + p[2] * (v[s0 + s1 + 1] - v[s0 + s1]);
    const double low = v00 + p[1] * (v01 - v00), high = v10 + p[1] * (v11 - v10);
    const double d0 = (v[1] - v[0]) + p[1] * ((v[s1 + 1] - v[s1]) - (v[1] - v[0]));
    const double d1 = (v[s0 + 1] - v[s0]) + p[1] * ((v[s0 + s1 + 1] - v[s0 + s1]) - (v[s0 + 1] - v[s0]));
    slope[0] = inside[0] * (high - low);
    slope[1] = inside[1] * ((v01 - v00) + p[0] * ((v11 - v10) - (v01 - v00)));
    slope[2] = inside[2] * (d0 + p[0] * (d1 - d0));
    return low + p[0] * (high - low);
}

double $name(const double angles[$d], double load, const double coupling[2], double activity, double *gradient)
{
    static const int column[$rows] = $column;
    static const int group_of[$rows] = $group;
    static const double scale[$rows] = $scale;
    static const double offset[$rows] = $offset;
    static const double height[$rows] = $height;
    static const double overlap[4] = $overlap;
    static const int paired[4] = {0, 3, 7, 8}, single[5] = {6, 1, 2, 4, 5};
    static const int last[2][3] = {{4, 2, 3}, {5, 1, 2}};
    double step[$rows], group[17] = {0.0}, part[9], score[3], slope[3][3], knee_left, side_left;
    const double knee = smooth_max(angles[$knee], angles[$knee + 1], $knee_width, &knee_left);

    double seen[$d + 1];
    for (int k = 0; k < $d; ++k) seen[k] = angles[k];
    seen[$d] = knee;
    /* exp is faster than tanh; the bounds keep it from overflowing. */
    for (int r = 0; r < $rows; ++r) step[r] = fmax(fmin(2.0 * (offset[r] - scale[r] * seen[column[r]]), 700.0), -700.0);
    for (int r = 0; r < $rows; ++r) step[r] = 2.0 / (1.0 + exp(step[r])) - 1.0;
    for (int r = 0; r < $rows; ++r) group[group_of[r]] += height[r] * (1.0 + step[r]);
    for (int k = 0; k < 4; ++k)
        part[paired[k]] = group[k] + group[4 + k] + group[8 + k] - overlap[k] * group[4 + k] * group[8 + k];
    for (int k = 0; k < 5; ++k) part[single[k]] = group[12 + k];

    for (int t = 0; t < 3; ++t) {
        const double own[3] = {part[t], part[3 + t], part[6 + t]};
        score[t] = trilinear(t ? table_b : table_a, last[t > 0], own, slope[t]);
    }
    score[0] += load_points(load);
    score[1] += coupling[0];
    score[2] += coupling[1];
    const double worse = smooth_max(score[1], score[2], $side_width, &side_left);
    double x, y, inside_x, inside_y;
    const int i = cell_of(score[0] - 1.0, 11, &x, &inside_x), j = cell_of(worse - 1.0, 11, &y, &inside_y);
    const double *v = table_c + 12 * i + j;
    const double low = v[0] + y * (v[1] - v[0]), high = v[12] + y * (v[13] - v[12]);
    if (gradient) {
        const double by_a = inside_x * (high - low);
        const double by_b = inside_y * ((v[1] - v[0]) + x * ((v[13] - v[12]) - (v[1] - v[0])));
        const double by_score[3] = {by_a, by_b * side_left, by_b * (1.0 - side_left)};
        double by_group[17], by_column[$d + 1] = {0.0};
        for (int k = 0; k < 9; ++k) part[k] = slope[k % 3][k / 3] * by_score[k % 3];
        for (int k = 0; k < 4; ++k) {
            by_group[k] = part[paired[k]];
            by_group[4 + k] = part[paired[k]] * (1.0 - overlap[k] * group[8 + k]);
            by_group[8 + k] = part[paired[k]] * (1.0 - overlap[k] * group[4 + k]);
        }
        for (int k = 0; k < 5; ++k) by_group[12 + k] = part[single[k]];
        for (int r = 0; r < $rows; ++r)
            by_column[column[r]] += by_group[group_of[r]] * height[r] * (1.0 - step[r] * step[r]) * scale[r];
        by_column[$knee] += by_column[$d] * knee_left;
        by_column[$knee + 1] += by_column[$d] * (1.0 - knee_left);
        for (int k = 0; k < $d; ++k) gradient[k] = by_column[k];
    }
    return low + x * (high - low) + activity;
}
"""
