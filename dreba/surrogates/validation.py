"""Checks of a model's weights, column names and parameters; those of angles are in `reba.posture.named_angles`."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from dreba.errors import ModelError
from reba.arrays import Array
from reba.checks import TEXT, Allowed, at_most, count_to, items_of, shown
from reba.errors import did_you_mean
from reba.posture.columns import COLUMNS


def checked_weights(sample_weight: ArrayLike | None, n: int) -> Array:
    """Return the weights (n,) of n poses, ones for None; ModelError unless finite, not negative and not all 0."""
    try:
        weights = np.ones(n) if sample_weight is None else np.asarray(sample_weight, np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise ModelError(f"sample_weight has a value that is not a number; expected ({n},) weights") from error
    if weights.ndim == 0:
        weights = np.full(n, float(weights))
    if weights.shape != (n,):
        raise ModelError(f"sample_weight has shape {weights.shape}; expected ({n},), one weight per pose")
    if not (np.isfinite(weights).all() and (weights >= 0).all() and weights.any()):
        raise ModelError(
            "sample_weight has negative or infinite values, or only zeros; expected finite weights, 0 or more"
        )
    return weights


def check_sample_count(n: int) -> None:
    """Refuse a single pose (ModelError), to which no model can be fitted."""
    if n < 2:
        raise ModelError(f"{n} sample is too few for a fit; expected 1000 or more poses")


def unnamed_joints(columns: int) -> tuple[str, ...]:
    """Return the names x0, x1 ... of d columns without names."""
    return tuple(f"x{index}" for index in range(columns))


def checked_joints(named: Any, columns: int, kind: str, any_columns: bool) -> tuple[str, ...]:
    """Return the names of d columns: `named`, or by default those of the posture table for d = 22, else x0, x1 ...

    Names outside the posture table are admissible for `any_columns` only; `kind` is for the error.

    Raises:
        ModelError: another number of names, an unknown name, or one twice.
    """
    if named is None:
        joints = COLUMNS if columns == len(COLUMNS) else unnamed_joints(columns)
    elif isinstance(named, str) or not isinstance(named, Sequence | np.ndarray):
        raise ModelError(f"joints is {named!r}; expected column names such as ('trunk_flexion', 'neck_flexion')")
    else:
        joints = tuple(str(name) for name in named)
    if len(joints) != columns:
        raise ModelError(
            f"{len(joints)} joints are named; expected one name for each of the {columns} columns of the poses"
        )
    unknown = [name for name in joints if name not in COLUMNS]
    if unknown and not any_columns:
        raise ModelError(
            f"column {unknown[0]!r} is not in the posture table{did_you_mean(unknown[0], COLUMNS)}; "
            f"kind {kind!r} expects the columns of reba.COLUMNS, all {len(COLUMNS)} or those named by joints="
        )
    if len(set(joints)) != len(joints):
        raise ModelError(f"joints are {', '.join(joints)}; expected each column once")
    return joints


JOINTS: Final = Allowed(
    "column names such as ('trunk_flexion', 'neck_flexion'), or None",
    lambda value: (
        value is None
        or (isinstance(value, tuple | list | np.ndarray) and all(map(TEXT.fits, items_of(value) or (None,))))
    ),
)
COUNTS: Final = Allowed(
    "1 to 32 whole numbers above 0, at most 4096, such as (124, 7)",
    lambda value: isinstance(value, tuple | list) and 0 < len(value) <= 32 and all(map(count_to(4096).fits, value)),
)
LARGEST_TEMPERATURE: Final = 10_000
"""[deg] Far above every angle: all scores are one there."""
TEMPERATURE: Final = at_most(LARGEST_TEMPERATURE)
FALLING: Final = Allowed(
    f"falling temperatures above 0 [deg], at most {LARGEST_TEMPERATURE}, such as (16.0, 8.0, 4.0, 2.0, 1.0)",
    lambda value: (
        isinstance(value, tuple | list)
        and len(value) > 0
        and all(map(TEMPERATURE.fits, value))
        and all(blunt > sharp for blunt, sharp in pairwise(value))
    ),
)


def check_parameters(allowed: dict[str, Allowed], parameters: dict[str, Any]) -> None:
    """Refuse parameters whose values `allowed` does not admit (ModelError)."""
    for name, rule in allowed.items():
        if not rule.fits(parameters[name]):
            raise ModelError(f"{name} is {shown(parameters[name])}; expected {rule.expected}")
