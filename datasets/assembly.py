"""Simulated assembly at a bench and above the head, as a posture table in degrees.

No person was measured. The table has no wrist columns, as that of a camera that does not see the hands.
"""

from __future__ import annotations

import numpy as np
from smooth_motion import Array, minimum_jerk, tremor

RATE = 10.0
"""Samples per second."""
COLUMNS: tuple[str, ...] = (
    "trunk_flexion",
    "trunk_side_bend",
    "trunk_twist",
    "neck_flexion",
    "neck_side_bend",
    "neck_twist",
    "knee_flexion_left",
    "knee_flexion_right",
    "upper_arm_flexion_left",
    "upper_arm_flexion_right",
    "upper_arm_abduction_left",
    "upper_arm_abduction_right",
    "shoulder_elevation_left",
    "shoulder_elevation_right",
    "lower_arm_flexion_left",
    "lower_arm_flexion_right",
)
"""Angle columns of the posture table [deg]."""
#         trunk f/b/t    neck f/b/t   knees  arm flexion  abduction  raised  elbows
STAND = (3, 0, 0, 8, 0, 0, 4, 5, 8, 9, 8, 8, 0, 0, 20, 22)
BENCH = (18, 2, 0, 26, 0, 2, 5, 6, 38, 42, 14, 16, 1, 2, 78, 84)
PRESS = (27, 4, 5, 30, 2, 0, 7, 8, 46, 52, 18, 22, 3, 4, 58, 66)
PICK = (24, -8, 32, 12, -4, 14, 8, 6, 64, 30, 34, 12, 4, 0, 32, 74)
OVERHEAD = (-6, 0, 2, -24, 0, 3, 3, 3, 122, 128, 26, 30, 14, 16, 46, 40)
REACH = (-4, 10, -6, -20, 5, -8, 4, 3, 96, 148, 22, 36, 9, 22, 62, 22)
STEPS: tuple[tuple[float, tuple[int, ...], float], ...] = (
    (2.0, STAND, 0.0),
    (1.6, BENCH, 0.4),
    (9.0, BENCH, 0.4),
    (1.2, PICK, 0.4),
    (1.4, BENCH, 1.8),
    (4.0, PRESS, 1.8),
    (3.0, BENCH, 1.8),
    (1.5, STAND, 1.8),
    (2.0, OVERHEAD, 2.6),
    (7.0, OVERHEAD, 2.6),
    (1.5, REACH, 2.6),
    (5.0, REACH, 2.6),
    (1.8, STAND, 0.0),
    (1.5, PICK, 0.4),
    (1.4, BENCH, 1.8),
    (8.0, BENCH, 1.8),
    (2.5, PRESS, 1.8),
    (2.0, STAND, 1.8),
    (1.8, REACH, 2.6),
    (5.0, OVERHEAD, 2.6),
    (6.0, REACH, 2.6),
    (2.0, STAND, 0.0),
    (5.0, STAND, 0.0),
)
"""(seconds of the movement, angles of `COLUMNS` at its end, load [kg] after it)."""


def simulate(rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Time (n,) [s], angles (n, 16) [deg, one decimal] and load (n,) [kg]."""
    keyframes = np.array([STAND, *(angles for _, angles, _ in STEPS)], dtype=float)
    keyframes += rng.normal(scale=1.5, size=keyframes.shape)
    seconds = np.array([duration for duration, _, _ in STEPS])
    angles = minimum_jerk(keyframes, seconds, RATE)
    angles += tremor(rng, angles.shape, 0.4, width=3)
    time = np.arange(len(angles)) / RATE
    arrived = np.searchsorted(np.cumsum(seconds), time, side="right") - 1
    load = np.where(arrived >= 0, np.array([kg for _, _, kg in STEPS])[arrived], 0.0)
    # Knees and elbows have no negative flexion.
    hinges = [index for index, name in enumerate(COLUMNS) if name.startswith(("knee", "lower_arm"))]
    angles[:, hinges] = np.maximum(angles[:, hinges], 0.0)
    return time, np.round(angles, 1) + 0.0, load
