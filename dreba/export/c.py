"""C source of a fitted model, C99 and C++17: value and gradient, a header, and on request a Hessian."""

from __future__ import annotations

import re
from string import Template
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from dreba.errors import ModelError
from dreba.export import c_templates as templates
from dreba.export.c_soft_template import CURVATURE, EXACT, GAUSS_NEWTON, PARTS_KEPT, SOFT
from dreba.export.joint_map import JointMap
from dreba.surrogates import soft_tables
from dreba.surrogates.base import Surrogate
from dreba.surrogates.convex import ConvexModel
from dreba.surrogates.graduated import GraduatedModel
from dreba.surrogates.quadratic import QuadraticModel
from dreba.surrogates.soft import SoftModel
from dreba.surrogates.soft_curvature import RESIDUAL_OFFSET
from dreba.surrogates.soft_steps import ROWS
from dreba.surrogates.task_factors import HIGHEST_POINTS, PAYLOADS
from reba.method.rules import LOAD_EDGES
from reba.posture.columns import COLUMNS, INDEX
from reba.printable import printable
from reba.provenance import generator

_UNUSED: Final = "        (void)second;\n"
HESSIANS: Final = ("exact", "gauss-newton")
"""Second derivatives that an export may have."""


def c_source(
    model: Surrogate,
    *,
    temperature: float | None = None,
    name: str = "dreba",
    joint_map: JointMap | None = None,
    hessian: str | None = None,
) -> str:
    """Return the C source of `double NAME(angles, load, coupling, activity, gradient)`, and of `NAME_hessian`.

    Raises:
        ModelError: the kind cannot be exported, or soft tables do not have all 22 columns.
    """
    soft = model.soft_ if isinstance(model, GraduatedModel) else model
    if isinstance(model, QuadraticModel):
        body, curvature, fields = templates.QUADRATIC, templates.QUADRATIC_CURVATURE, _quadratic(model)
    elif isinstance(model, ConvexModel):
        body, curvature, fields = templates.CONVEX_TABLES + templates.CONVEX, templates.CONVEX_CURVATURE, _convex(model)
    elif isinstance(soft, SoftModel):
        body, curvature, fields = SOFT, "", _soft(soft, temperature, hessian)
    else:
        raise ModelError(f"kind {model.kind!r} cannot be exported to C; expected quadratic, convex, soft or graduated")
    if "${name}_load_points(load)" in body or "load_points" in str(fields.get("payload")):
        body = templates.LOAD + body
    plain, second = templates.PLAIN, templates.PLAIN_HESSIAN
    if joint_map is not None:
        plain, second = templates.MAP + templates.MAPPED, templates.MAPPED_HESSIAN
    parts = [templates.HEAD, body, curvature if hessian else "", templates.VALID, plain]
    parts += [second if hessian else "", templates.FOOT]
    common = _common(model, name, joint_map, hessian) | fields
    dense = templates.DIRECT if hessian == "exact" else templates.SQUARED
    common["fill"] = Template(templates.DIAGONAL if curvature else dense).substitute(name=name, d=common["d"])
    return Template(_filled(_filled("".join(parts), common), common)).substitute(common)


def c_header(
    model: Surrogate, *, file: str, name: str = "dreba", joint_map: JointMap | None = None, hessian: str | None = None
) -> str:
    """Return the header that declares the functions of `c_source`; `file` is the name of the source."""
    common = _common(model, name, joint_map, hessian)
    return Template(_filled(templates.HEADER, common)).substitute(common, what=f"dREBA ({model.kind})", file=file)


def _filled(text: str, fields: dict[str, Any]) -> str:
    """Return a template in which the fields that are templates themselves are put in."""
    nested = ("interface", "prototypes", "payload", "curvature", "parts_kept", "second_derivatives")
    return Template(text).safe_substitute({key: fields[key] for key in nested if key in fields})


def _common(model: Surrogate, name: str, joint_map: JointMap | None, hessian: str | None) -> dict[str, Any]:
    """Return the fields of what stands around the function of angles."""
    joints = model.joints_ if joint_map is None else joint_map.joints
    unit = "deg" if joint_map is None else joint_map.unit
    fields: dict[str, Any] = {
        "name": name,
        "d": len(model.joints_),
        "m": len(joints),
        "q": "angles" if joint_map is None else "joints",
        "unit": {"deg": "degrees", "rad": "radians"}[unit],
        "one": {"deg": "degree", "rad": "radian"}[unit],
        "joints": ",\n *     ".join(f"{index} {_in_comment(joint)}" for index, joint in enumerate(joints)),
        "held": "",
        "generator": generator(),
        "most": repr(float(HIGHEST_POINTS)),
        "edge_1": repr(LOAD_EDGES[0]),
        "edge_2": repr(LOAD_EDGES[1]),
        "interface": templates.INTERFACE,
        "prototypes": templates.PROTOTYPE + ("\n" + templates.HESSIAN_PROTOTYPE if hessian else ""),
        "hessian_line": f" * {templates.HESSIAN_PROTOTYPE[:-1]}\n" if hessian else "",
        "hessian_note": "",
        "no_factor": "",
    }
    fields["hessian_line"] = Template(fields["hessian_line"]).safe_substitute(fields)
    if hessian:
        kind = "exact" if hessian == "exact" else "Gauss-Newton, positive semidefinite"
        fields["hessian_note"] = f" *   hessian   {len(joints)} x {len(joints)} values, {kind}\n"
    if joint_map is not None:
        held = ", ".join(f"{column} {angle:g}" for column, angle in joint_map.held.items())
        rows, columns = np.nonzero(joint_map.matrix)
        fields |= {
            "held": f" *     held [deg]: {held}\n" if held else "",
            "entries": len(rows),
            "offset_of_map": values(joint_map.offset),
            "map_column": values(rows, whole=True),
            "map_joint": values(columns, whole=True),
            "map_factor": values(joint_map.matrix[rows, columns]),
        }
    return fields


def _in_comment(name: str) -> str:
    """Return a name as text that neither ends nor begins a comment."""
    return re.sub(r"\*(?=/)|/(?=\*)", r"\g<0> ", printable(name))


def _quadratic(model: QuadraticModel) -> dict[str, Any]:
    if model.payload not in PAYLOADS:
        raise ModelError(f"payload {model.payload!r} cannot be exported; expected one of {', '.join(PAYLOADS)}")
    d = len(model.joints_)
    return {
        "what": "dREBA, a sum of quadratics (Busch, Toussaint and Lopes 2018, equation 1)",
        "linear": values(model.linear_),
        "half": values(model.twice_curvature_ / 2.0),
        "constant": repr(model.constant_),
        "payload": "${name}_load_points(load)" if model.payload == "tree" else f"load / {float(model.omega_load)!r}",
        "by_activity": "0.0" if model.payload_only else "1.0",
        "grip": repr(0.0 if model.payload_only else model.coupling_weight_),
        "even": d - d % 2,
        "odd": templates.ODD.replace("LAST", str(d - 1)) if d % 2 else "",
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


def _soft(model: SoftModel, temperature: float | None, hessian: str | None) -> dict[str, Any]:
    """Return the fields of the template `SOFT`; ModelError without all 22 columns or without this temperature."""
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
        "residual": repr(RESIDUAL_OFFSET),
        "no_factor": ", NULL",
        "curvature": CURVATURE if hessian == "exact" else "",
        "parts_kept": PARTS_KEPT if hessian == "gauss-newton" else "",
        "second_derivatives": {"exact": EXACT, "gauss-newton": GAUSS_NEWTON}.get(hessian or "", _UNUSED),
    }


def values(array: ArrayLike, whole: bool = False) -> str:
    """Return numbers as a C initialiser that reads back exactly, `whole` ones as integers."""
    return "{" + ", ".join(str(int(v)) if whole else repr(float(v)) for v in np.asarray(array).ravel()) + "}"
