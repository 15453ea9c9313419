"""C99 source of a fitted model: one function for value and gradient, no dependency but the C library."""

from __future__ import annotations

from string import Template
from typing import Any, Final

import numpy as np

from dreba.convex import ConvexModel
from dreba.errors import ModelError
from dreba.export_c_soft import SOFT, fields, values
from dreba.graduated import GraduatedModel
from dreba.model import Surrogate
from dreba.payload import PAYLOADS
from dreba.quadratic import QuadraticModel
from dreba.soft import SoftModel
from reba.rules import LOAD_EDGES


def c_source(model: Surrogate, *, temperature: float | None = None, name: str = "dreba") -> str:
    """Return the source of `double NAME(angles, load, coupling, activity, gradient)`.

    Raises:
        ModelError: the kind cannot be exported, or soft tables do not have all 22 columns.
    """
    soft = model.soft_ if isinstance(model, GraduatedModel) else model
    if isinstance(model, QuadraticModel):
        body, given = _QUADRATIC, _quadratic(model)
    elif isinstance(model, ConvexModel):
        body, given = _CONVEX, _convex(model)
    elif isinstance(soft, SoftModel):
        body, given = SOFT, fields(soft, temperature)
    else:
        raise ModelError(f"kind {model.kind!r} cannot be exported to C; export any kind but a net")
    d = len(model.joints_)
    joints = ",\n *   ".join(f"{index} {joint}" for index, joint in enumerate(model.joints_))
    edges = {"edge_1": repr(LOAD_EDGES[0]), "edge_2": repr(LOAD_EDGES[1])}
    return Template(_HEAD + body).substitute(given, name=name, d=d, joints=joints, **edges)


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

# Two sums side by side fill the two places of a vector register, so that -O2 is enough.
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
