"""CasADi function of a fitted model, as a symbolic object and as serialised text."""

from __future__ import annotations

from typing import Any

import numpy as np

from dreba.errors import ModelError
from dreba.surrogates import soft_tables
from dreba.surrogates.base import Surrogate
from dreba.surrogates.convex import ConvexModel
from dreba.surrogates.graduated import GraduatedModel
from dreba.surrogates.quadratic import QuadraticModel
from dreba.surrogates.soft import SoftModel
from dreba.surrogates.soft_steps import GROUPS, PAIRED, ROWS, SINGLE
from reba.extras import missing
from reba.method.rules import load_points
from reba.posture.columns import COLUMNS, INDEX
from reba.provenance import generator


def casadi_function(model: Surrogate, *, temperature: float | None = None, name: str = "dreba") -> Any:
    """Return a `casadi.Function` (angles, load, coupling, activity) -> (value, gradient).

    Raises:
        ModelError: CasADi is not installed, or the kind cannot be exported.
    """
    try:
        import casadi
    except ImportError as error:
        raise missing("casadi", "an export to CasADi") from error
    angles = casadi.SX.sym("angles", len(model.joints_))
    load, coupling, activity = casadi.SX.sym("load"), casadi.SX.sym("coupling", 2), casadi.SX.sym("activity")
    points = load_points(load)
    soft = model.soft_ if isinstance(model, GraduatedModel) else model
    if isinstance(model, QuadraticModel):
        payload = points if model.payload == "tree" else load / float(model.omega_load)
        value = model.constant_ + payload + model.coupling_weight_ * casadi.fmax(coupling[0], coupling[1])
        value += casadi.dot(angles, casadi.DM(model.linear_) + casadi.DM(model.twice_curvature_) * angles / 2.0)
    elif isinstance(model, ConvexModel):
        value = model.constant_ + float(model.points_[0]) * points
        value += float(model.points_[1]) * casadi.fmax(coupling[0], coupling[1]) + _convex(casadi, model, angles)
    elif isinstance(soft, SoftModel) and soft.joints_ == COLUMNS:
        value = _soft(casadi, soft.tables(temperature), angles, (points, coupling[0], coupling[1]))
    elif isinstance(soft, SoftModel):
        count = len(soft.joints_)
        raise ModelError(
            f"soft tables of {count} columns cannot be exported; fit on all 22, in the order of reba.COLUMNS"
        )
    else:
        raise ModelError(f"kind {model.kind!r} cannot be exported; expected quadratic, convex, soft or graduated")
    value += activity
    names = ["angles", "load", "coupling", "activity"], ["value", "gradient"]
    return casadi.Function(name, [angles, load, coupling, activity], [value, casadi.gradient(value, angles)], *names)


def casadi_json(model: Surrogate, *, temperature: float | None = None, name: str = "dreba") -> str:
    """Return the text of the function for `casadi.Function.deserialize`, which reads to the end of the function.

    The lines after it say the order of the angles, and which version wrote the text.
    """
    function = casadi_function(model, temperature=temperature, name=name)
    return f"{function.serialize()}\nangles [deg]: {', '.join(model.joints_)}\n{generator()}\n"


def _convex(casadi: Any, model: ConvexModel, angles: Any) -> Any:
    """Return the sum of hinges as a symbolic expression."""
    total = casadi.SX(0)
    for joint, scale, offset, weight in zip(*model.hinges(), strict=True):
        past = float(scale) * angles[int(joint)] - float(offset)
        inside = casadi.fmin(casadi.fmax(past, 0.0), 1.0)
        total += float(weight) * inside * (past - 0.5 * inside)
    return total


def _soft(casadi: Any, tables: soft_tables.SoftTables, angles: Any, added: tuple[Any, Any, Any]) -> Any:
    """Return the value of soft tables without activity, `added` points on Score A and both Scores B."""
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
    scores = [
        _interpolate(casadi, table, parts[number::3]) + extra
        for number, (table, extra) in enumerate(
            zip((tables.table_a, tables.table_b, tables.table_b), added, strict=True)
        )
    ]
    score_b = _smooth_max(casadi, scores[1], scores[2], soft_tables.SIDE_WIDTH * tables.temperature)
    return _interpolate(casadi, tables.table_c, [scores[0] - 1.0, score_b - 1.0])


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
