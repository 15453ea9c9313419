"""Python source of a fitted model for PyTorch or JAX: one function of batches, differentiated by the library itself."""

from __future__ import annotations

from string import Template
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from dreba.errors import ModelError
from dreba.export.joint_map import JointMap
from dreba.surrogates import soft_tables
from dreba.surrogates.base import Surrogate
from dreba.surrogates.convex import ConvexModel
from dreba.surrogates.graduated import GraduatedModel
from dreba.surrogates.quadratic import QuadraticModel
from dreba.surrogates.soft import SoftModel
from dreba.surrogates.soft_steps import GROUPS, PAIRED, ROWS, SINGLE
from dreba.surrogates.task_factors import HIGHEST_POINTS
from reba.method.rules import LOAD_EDGES
from reba.posture.columns import COLUMNS, INDEX
from reba.provenance import generator

LIBRARIES: Final[dict[str, str]] = {
    "torch": """\
import torch as _lib


def _array(values, like):
    return _lib.as_tensor(values, dtype=like.dtype, device=like.device)


def _index(values, like):
    return _lib.as_tensor(values, dtype=_lib.long, device=like.device)


def _start(joints):
    joints = _lib.as_tensor(joints)
    return joints if joints.is_floating_point() else joints.to(_lib.get_default_dtype())


def _whole(values):
    return values.detach().long()
""",
    "jax": """\
import jax.numpy as _lib


def _array(values, like):
    return _lib.asarray(values, dtype=like.dtype)


def _index(values, like):
    return _lib.asarray(values)


def _start(joints):
    joints = _lib.asarray(joints)
    return joints if _lib.issubdtype(joints.dtype, _lib.floating) else joints.astype(float)


def _whole(values):
    return values.astype(int)
""",
}
_TITLES: Final = {"torch": "PyTorch", "jax": "JAX"}


def torch_source(model: Surrogate, **options: Any) -> str:
    """Return the PyTorch source of a model; options as in `python_source`."""
    return python_source(model, "torch", **options)


def jax_source(model: Surrogate, **options: Any) -> str:
    """Return the JAX source of a model; options as in `python_source`."""
    return python_source(model, "jax", **options)


def python_source(
    model: Surrogate,
    library: str,
    *,
    temperature: float | None = None,
    name: str = "dreba",
    joint_map: JointMap | None = None,
    hessian: str | None = None,
) -> str:
    """Return the source of `NAME(joints, load, coupling, activity)` for a library, "torch" or "jax".

    Raises:
        ModelError: the kind cannot be exported, or a Hessian is asked for, which the library itself gives.
    """
    if hessian is not None:
        raise ModelError(f"a {_TITLES[library]} export has no Hessian of its own; leave it out, the library has it")
    body, fields = _body(model, temperature)
    unit, joints = ("deg", model.joints_) if joint_map is None else (joint_map.unit, joint_map.joints)
    mapping = ""
    if joint_map is not None:
        offset, matrix = _text(joint_map.offset), _text(joint_map.matrix.T)
        mapping = f"    angles = _array({offset}, angles) + angles @ _array({matrix}, angles)\n"
    held = {} if joint_map is None else joint_map.held
    return Template(_FILE.replace("BODY", body)).substitute(
        fields,
        generator=generator(),
        title=_TITLES[library],
        library=LIBRARIES[library],
        name=name,
        m=len(joints),
        unit={"deg": "degrees", "rad": "radians"}[unit],
        joints=_names(joints),
        held="".join(f"# Held: {column} at {angle:g} degrees.\n" for column, angle in held.items()),
        mapping=mapping,
        edge_1=repr(LOAD_EDGES[0]),
        edge_2=repr(LOAD_EDGES[1]),
        most=HIGHEST_POINTS,
    )


def _body(model: Surrogate, temperature: float | None) -> tuple[str, dict[str, Any]]:
    """Return the template of the value and its fields."""
    soft = model.soft_ if isinstance(model, GraduatedModel) else model
    if isinstance(model, QuadraticModel):
        return _QUADRATIC, {
            "what": "a sum of quadratics (Busch, Toussaint and Lopes 2018, equation 1)",
            "linear": _text(model.linear_),
            "half": _text(model.twice_curvature_ / 2.0),
            "constant": repr(model.constant_),
            "payload": "points" if model.payload == "tree" else f"load / {float(model.omega_load)!r}",
            "rest": "" if model.payload_only else f" + activity + {model.coupling_weight_!r} * worse",
        }
    if isinstance(model, ConvexModel):
        hinges = model.hinges()
        return _CONVEX, {
            "what": "a convex sum of rounded hinges",
            "joint": hinges.joint.tolist(),
            "scale": _text(hinges.scale),
            "offset": _text(hinges.offset),
            "weight": _text(hinges.weight),
            "constant": repr(model.constant_),
            "by_load": repr(float(model.points_[0])),
            "grip": repr(float(model.points_[1])),
        }
    if isinstance(soft, SoftModel) and soft.joints_ == COLUMNS:
        return _SOFT, _soft(soft.tables(temperature))
    if isinstance(soft, SoftModel):
        count = len(soft.joints_)
        raise ModelError(
            f"soft tables of {count} columns cannot be exported; fit on all 22, in the order of reba.COLUMNS"
        )
    raise ModelError(f"kind {model.kind!r} cannot be exported; expected quadratic, convex, soft or graduated")


def _soft(tables: soft_tables.SoftTables) -> dict[str, Any]:
    into = np.zeros((len(ROWS.step), len(GROUPS)))
    into[np.arange(len(ROWS.step)), ROWS.group] = tables.heights[ROWS.step] / 2.0
    return {
        "what": f"soft REBA tables at {tables.temperature:g} degrees",
        "knee": INDEX["knee_flexion_left"],
        "knee_width": repr(soft_tables.KNEE_WIDTH * tables.temperature),
        "side_width": repr(soft_tables.SIDE_WIDTH * tables.temperature),
        "column": ROWS.column.tolist(),
        "scale": _text(ROWS.sense / (2.0 * tables.temperature)),
        "offset": _text(tables.thresholds[ROWS.step] / (2.0 * tables.temperature)),
        "into": _text(into),
        "overlap": _text(tables.overlap[[0, 1, 2, 2]]),
        # Part k is entry k of the four paired groups followed by the five single ones, put in order.
        "order": np.argsort([*PAIRED, *SINGLE]).tolist(),
        "a": _text(tables.table_a),
        "b": _text(tables.table_b),
        "c": _text(tables.table_c),
    }


def _text(values: ArrayLike) -> str:
    """Return numbers as nested lists that read back exactly."""
    return repr(np.asarray(values, np.float64).tolist())


def _names(joints: tuple[str, ...]) -> str:
    return "(\n" + "".join(f"    {joint!r},\n" for joint in joints) + ")"


_FILE: Final = '''\
"""$what, in $title, without other dependencies.

Written by $generator.
"""

$library

JOINTS = $joints
"""Order of the joints, $unit."""
$held

def $name(joints, load=0.0, coupling=(0.0, 0.0), activity=0.0):
    """Return the value (...) of joints (..., $m) [$unit], to be differentiated by the library.

    load [kg], coupling of the left and right hand (points from 0, good, to 3) and activity (points from 0 to 3) are one
    value or one for each pose. Joints that are not finite, and factors out of range, give NaN. The type of the joints
    is that of the result: single precision has about six digits. Another number of joints is a ValueError.
    """
    angles = joints = _start(joints)
    if joints.shape[-1:] != (len(JOINTS),):
        raise ValueError(f"joints have shape {tuple(joints.shape)}; expected (..., {len(JOINTS)})")
    load, activity = _array(load, angles), _array(activity, angles)
    left, right = (_array(side, angles) for side in coupling)
    valid = _lib.isfinite(joints).all(-1) & (load >= 0.0) & _lib.isfinite(load)
    for factor in (left, right, activity):
        valid = valid & (factor >= 0.0) & (factor <= $most)
    points = _array(load >= $edge_1, angles) + _array(load > $edge_2, angles)
$mapping
BODY
    return _lib.where(valid, value, float("nan"))
'''
_QUADRATIC: Final = """\
    worse = _lib.maximum(left, right)
    linear, half = _array($linear, angles), _array($half, angles)
    value = (angles * (linear + half * angles)).sum(-1) + $constant + $payload$rest"""
_CONVEX: Final = """\
    worse = _lib.maximum(left, right)
    past = angles[..., _index($joint, angles)] * _array($scale, angles) - _array($offset, angles)
    inside = _lib.clip(past, 0.0, 1.0)
    hinges = (_array($weight, angles) * inside * (past - 0.5 * inside)).sum(-1)
    value = hinges + $constant + $by_load * points + $grip * worse + activity"""
_SOFT: Final = """\

    def smooth_max(one, other, width):
        return 0.5 * (one + other + _lib.sqrt((one - other) ** 2 + width * width) - width)

    def interpolate(table, scores):
        places, corners = [], []
        for score, size in zip(scores, table.shape):
            held = _lib.clip(score, 0.0, size - 1.0)
            corner = _lib.clip(_whole(_lib.nan_to_num(held)), 0, size - 2)
            corners.append(corner)
            places.append(held - corner)
        total = 0.0
        for number in range(2 ** len(scores)):
            weight, index = 1.0, []
            for axis, place in enumerate(places):
                upper = number >> axis & 1
                weight = weight * (place if upper else 1.0 - place)
                index.append(corners[axis] + upper)
            total = total + weight * table[tuple(index)]
        return total

    knee = smooth_max(angles[..., $knee], angles[..., $knee + 1], $knee_width)
    seen = _lib.concatenate([angles, knee[..., None]], -1)
    step = _lib.tanh(seen[..., _index($column, angles)] * _array($scale, angles) - _array($offset, angles))
    groups = (1.0 + step) @ _array($into, angles)
    one, other = groups[..., 4:8], groups[..., 8:12]
    paired = groups[..., :4] + one + other - _array($overlap, angles) * one * other
    parts = _lib.concatenate([paired, groups[..., 12:]], -1)[..., _index($order, angles)]
    own = [[parts[..., table], parts[..., 3 + table], parts[..., 6 + table]] for table in range(3)]
    table_a, table_b, table_c = _array($a, angles), _array($b, angles), _array($c, angles)
    score_a = interpolate(table_a, own[0]) + points
    score_b = smooth_max(interpolate(table_b, own[1]) + left, interpolate(table_b, own[2]) + right, $side_width)
    value = interpolate(table_c, [score_a - 1.0, score_b - 1.0]) + activity"""
