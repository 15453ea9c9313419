"""CasADi function of a fitted model, as a symbolic object and as serialised text."""

from __future__ import annotations

from typing import Any

import numpy as np

from dreba.errors import ModelError
from dreba.export.joint_map import JointMap
from dreba.surrogates import soft_tables
from dreba.surrogates.base import Surrogate
from dreba.surrogates.convex import ConvexModel
from dreba.surrogates.graduated import GraduatedModel
from dreba.surrogates.quadratic import QuadraticModel
from dreba.surrogates.soft import SoftModel
from dreba.surrogates.soft_curvature import RESIDUAL_OFFSET
from dreba.surrogates.soft_steps import GROUPS, PAIRED, ROWS, SINGLE
from dreba.surrogates.task_factors import HIGHEST_POINTS
from reba.extras import missing
from reba.method.rules import load_points
from reba.posture.columns import COLUMNS, INDEX
from reba.printable import printable
from reba.provenance import generator


def casadi_function(
    model: Surrogate,
    *,
    temperature: float | None = None,
    name: str = "dreba",
    joint_map: JointMap | None = None,
    hessian: str | None = None,
) -> Any:
    """Return a `casadi.Function` (angles, load, coupling, activity) -> (value, gradient), and hessian on request.

    Where an argument is not finite or a factor is out of range, all results are NaN.

    Raises:
        ModelError: CasADi is not installed, or the kind cannot be exported.
    """
    try:
        import casadi
    except ImportError as error:
        raise missing("casadi", "an export to CasADi") from error
    own = casadi.SX.sym("angles", len(model.joints_))
    load, coupling, activity = casadi.SX.sym("load"), casadi.SX.sym("coupling", 2), casadi.SX.sym("activity")
    value, factor = _value(casadi, model, temperature, own, load, coupling)
    value += activity if "activity" in model.factors_ else 0.0
    gradient = casadi.gradient(value, own)
    results = [value, gradient]
    if hessian is not None:
        exact = hessian == "exact" or factor is None  # for sums over single angles both are the same
        results.append(casadi.hessian(value, own)[0] if exact else factor.T @ factor)
    joints, first = own, "angles"
    if joint_map is not None:
        joints, first = casadi.SX.sym("joints", len(joint_map.joints)), "joints"
        matrix = casadi.DM(joint_map.matrix)
        results[1:] = [matrix.T @ results[1], *(matrix.T @ second @ matrix for second in results[2:])]
        results = casadi.substitute(results, [own], [casadi.DM(joint_map.offset) + matrix @ joints])
    most = float(HIGHEST_POINTS)
    factors = [(load, casadi.inf), (coupling[0], most), (coupling[1], most), (activity, most)]
    bounds = [casadi.logic_and(given >= 0.0, given <= high) for given, high in factors]
    bounds += [load < casadi.inf, casadi.sum1(casadi.fabs(joints) < casadi.inf) == joints.numel()]
    valid = bounds[0]
    for bound in bounds[1:]:
        valid = casadi.logic_and(valid, bound)
    # All elements at once: the gradient of the value stays that of the model.
    results = [casadi.if_else(valid, result, casadi.SX.nan(*result.shape)) for result in results]
    names = [first, "load", "coupling", "activity"], ["value", "gradient", "hessian"][: len(results)]
    return casadi.Function(name, [joints, load, coupling, activity], results, *names)


def casadi_json(
    model: Surrogate,
    *,
    temperature: float | None = None,
    name: str = "dreba",
    joint_map: JointMap | None = None,
    hessian: str | None = None,
) -> str:
    """Return the text of the function for `casadi.Function.deserialize`, which reads to the end of the function.

    The lines after it say the order of the angles or joints, and which version wrote the text.
    """
    function = casadi_function(model, temperature=temperature, name=name, joint_map=joint_map, hessian=hessian)
    unit, names = ("deg", model.joints_) if joint_map is None else (joint_map.unit, joint_map.joints)
    what = "angles" if joint_map is None else "joints"
    return f"{function.serialize()}\n{what} [{unit}]: {', '.join(map(printable, names))}\n{generator()}\n"


def _value(
    casadi: Any, model: Surrogate, temperature: float | None, angles: Any, load: Any, coupling: Any
) -> tuple[Any, Any]:
    """Return the value without activity, and a Gauss-Newton factor where it differs from the Hessian."""
    points = load_points(load)
    soft = model.soft_ if isinstance(model, GraduatedModel) else model
    if isinstance(model, QuadraticModel):
        payload = points if model.payload == "tree" else load / float(model.omega_load)
        value = model.constant_ + payload
        if not model.payload_only:
            value += model.coupling_weight_ * casadi.fmax(coupling[0], coupling[1])
        value += casadi.dot(angles, casadi.DM(model.linear_) + casadi.DM(model.twice_curvature_) * angles / 2.0)
        return value, None
    if isinstance(model, ConvexModel):
        value = model.constant_ + float(model.points_[0]) * points
        value += float(model.points_[1]) * casadi.fmax(coupling[0], coupling[1]) + _convex(casadi, model, angles)
        return value, None
    if isinstance(soft, SoftModel) and soft.joints_ == COLUMNS:
        return _soft(casadi, soft.tables(temperature), angles, (points, coupling[0], coupling[1]))
    if isinstance(soft, SoftModel):
        count = len(soft.joints_)
        raise ModelError(
            f"soft tables of {count} columns cannot be exported; fit on all 22, in the order of reba.COLUMNS"
        )
    raise ModelError(f"kind {model.kind!r} cannot be exported; expected quadratic, convex, soft or graduated")


def _convex(casadi: Any, model: ConvexModel, angles: Any) -> Any:
    """Return the sum of hinges as a symbolic expression."""
    total = casadi.SX(0)
    for joint, scale, offset, weight in zip(*model.hinges(), strict=True):
        past = float(scale) * angles[int(joint)] - float(offset)
        inside = casadi.fmin(casadi.fmax(past, 0.0), 1.0)
        total += float(weight) * inside * (past - 0.5 * inside)
    return total


def _soft(casadi: Any, tables: soft_tables.SoftTables, angles: Any, added: tuple[Any, Any, Any]) -> tuple[Any, Any]:
    """Return the value of soft tables without activity and their Gauss-Newton factor (9, 22).

    `added` are points on Score A and both Scores B.
    """
    knee = INDEX["knee_flexion_left"]
    worse = _smooth_max(casadi, angles[knee], angles[knee + 1], soft_tables.KNEE_WIDTH * tables.temperature)
    seen = casadi.vertcat(angles, worse)
    groups = [casadi.SX(0)] * len(GROUPS)
    for step, column, sense, group in zip(*ROWS, strict=True):
        argument = (sense * seen[int(column)] - tables.thresholds[step]) / (2.0 * tables.temperature)
        groups[group] += tables.heights[step] / 2.0 * (1.0 + casadi.tanh(argument))
    parts: list[Any] = [None] * 9
    for k, (place, shared) in enumerate(zip(PAIRED, tables.overlap[[0, 1, 2, 2]], strict=True)):
        one, other = groups[4 + k], groups[8 + k]
        parts[place] = groups[k] + one + other - shared * one * other
    for k, place in enumerate(SINGLE):
        parts[place] = groups[12 + k]
    given = casadi.SX.sym("parts", 9)
    scores = [
        _interpolate(casadi, table, [given[number], given[number + 3], given[number + 6]]) + extra
        for number, (table, extra) in enumerate(
            zip((tables.table_a, tables.table_b, tables.table_b), added, strict=True)
        )
    ]
    score_b = _smooth_max(casadi, scores[1], scores[2], soft_tables.SIDE_WIDTH * tables.temperature)
    through = _interpolate(casadi, tables.table_c, [scores[0] - 1.0, score_b - 1.0])
    known = casadi.vertcat(*parts)
    value, by_part = casadi.substitute([through, casadi.gradient(through, given)], [given], [known])
    weight = casadi.sqrt(casadi.fmax(by_part, 0.0) / (2.0 * (casadi.fmax(known, 0.0) + RESIDUAL_OFFSET)))
    return value, casadi.diag(weight) @ casadi.jacobian(known, angles)


def _interpolate(casadi: Any, table: np.ndarray[Any, np.dtype[np.float64]], scores: list[Any]) -> Any:
    """Return the multilinear interpolation of a table at scores from 0, clipped to its ends: a sum of hat functions."""
    clipped = casadi.fmin(casadi.fmax(scores[0], 0.0), float(len(table) - 1))
    out = casadi.SX(0)
    for number, below in enumerate(table):
        hat = casadi.fmax(0.0, 1.0 - casadi.fabs(clipped - number))
        out += hat * (float(below) if below.ndim == 0 else _interpolate(casadi, below, scores[1:]))
    return out


def _smooth_max(casadi: Any, left: Any, right: Any, width: float) -> Any:
    return 0.5 * (left + right + casadi.sqrt((left - right) ** 2 + width**2) - width)
