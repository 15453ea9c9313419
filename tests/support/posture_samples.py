"""Postures for tests: class representatives, edge values and random mixtures of both."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

import reba
from reba.method.scoring import SCORE_COLUMNS
from reba.posture.columns import INDEX
from tests.support import reference_reba as reference

MEASURED = reba.PRESETS["measured"]
KNOWN = SCORE_COLUMNS[: SCORE_COLUMNS.index("reba_low")]
"""Columns of the score table but the range."""

CLASS_ANGLES: dict[str, tuple[float, ...]] = {
    "trunk_flexion": (0.0, 12.0, -12.0, 40.0, -40.0, 75.0),
    "trunk_side_bend": (0.0, 35.0, -35.0),
    "trunk_twist": (0.0, 35.0, -35.0),
    "neck_flexion": (8.0, 40.0, -40.0),
    "neck_side_bend": (0.0, 35.0, -35.0),
    "neck_twist": (0.0, 35.0, -35.0),
    "knee_flexion": (0.0, 45.0, 90.0),
    "upper_arm_flexion": (0.0, -40.0, 30.0, 70.0, 120.0),
    "upper_arm_abduction": (0.0, 60.0),
    "shoulder_elevation": (0.0, 30.0),
    "lower_arm_flexion": (80.0, 20.0, 130.0),
    "wrist_flexion": (0.0, 40.0, -40.0),
    "wrist_deviation": (0.0, 35.0, -35.0),
    "wrist_twist": (0.0, 50.0, -50.0),
}
"""Angles that stand for every class under both presets, by column name without a side."""

EDGES = (0.0, 5.0, 10.0, 15.0, 20.0, 30.0, 45.0, 60.0, 90.0, 100.0)
"""[deg] Every printed edge and preset threshold."""


def class_angles(column: str) -> tuple[float, ...]:
    """Return the representatives of a column of `reba.COLUMNS`."""
    return CLASS_ANGLES[column.removesuffix("_left").removesuffix("_right")]


def random_angles(rng: np.random.Generator, n: int) -> NDArray[np.float64]:
    """Return (n, 22) postures: uniform angles, values at and beside edges, and class representatives, mixed."""
    shape = (n, len(reba.COLUMNS))
    uniform = rng.uniform(-180.0, 180.0, shape)
    edge = rng.choice(EDGES, shape) * rng.choice([-1.0, 1.0], shape) + rng.choice([0.0, 0.0, 1e-9, -1e-9], shape)
    kinds = rng.integers(0, 3, shape)
    typical = np.column_stack([rng.choice(class_angles(column), n) for column in reba.COLUMNS])
    return np.choose(kinds, [uniform, edge, typical])


def random_factors(rng: np.random.Generator, n: int) -> dict[str, NDArray[np.generic]]:
    """Return every factor with n values."""
    flags = ("shock", "arm_supported_left", "arm_supported_right", "static", "repeated", "unstable")
    couplings = ["good", "fair", "poor", "unacceptable"]
    return {
        "load": rng.choice([0.0, 3.0, 5.0 - 1e-9, 5.0, 7.0, 10.0, 10.0 + 1e-9, 30.0], n),
        "coupling_left": rng.choice(couplings, n),
        "coupling_right": rng.choice(couplings, n),
        "support": rng.choice(["bilateral", "unilateral", "walking", "sitting"], n),
        **{name: rng.random(n) < 0.5 for name in flags},
    }


def frame_factors(factors: dict[str, NDArray[np.generic]], frame: int) -> dict[str, object]:
    """Return the factors of one frame as plain Python values."""
    return {name: values[frame].item() for name, values in factors.items()}


rule_sets = st.builds(
    reba.Rules,
    **dict.fromkeys(("trunk_upright", "neck_upright"), st.sampled_from([0.0, 5.0, 10.0])),
    **dict.fromkeys(
        ("trunk_twist", "trunk_side_bend", "neck_twist", "neck_side_bend", "wrist_deviation", "wrist_twist"),
        st.sampled_from([0.0, 10.0, 30.0]),
    ),
    **dict.fromkeys(("abduction", "shoulder_elevation"), st.sampled_from([0.0, 10.0, 45.0])),
    edges=st.sampled_from(["lower", "upper"]),
    twist_and_bend=st.sampled_from(["one", "two"]),
    two_sides=st.sampled_from(["worse", "left", "right"]),
    walking_legs=st.sampled_from([1, 2]),
    seated_knees=st.booleans(),
    coupling_without_load=st.booleans(),
)
seeds = st.integers(0, 2**32 - 1)


def posture(**angles: float) -> np.ndarray:
    """Return one neutral posture (elbows at 80 deg) with some angles set; names without a side set both."""
    row = np.zeros((1, len(reba.COLUMNS)))
    for name, value in {"lower_arm_flexion": 80.0, **angles}.items():
        for column in reba.COLUMNS:
            if column in (name, f"{name}_left", f"{name}_right"):
                row[0, INDEX[column]] = value
    return row


def one(row: np.ndarray, rules: reba.Rules = MEASURED, **factors: object) -> dict[str, int]:
    """Return the scores of one posture by column."""
    arrays = reba.score_array(row, factors, rules)
    return {name: int(arrays[name][0]) for name in SCORE_COLUMNS}


def restated(row: np.ndarray, rules: reba.Rules, **factors: object) -> dict[str, int]:
    return reference.score(dict(zip(reba.COLUMNS, row.tolist(), strict=True)), rules, **factors)
