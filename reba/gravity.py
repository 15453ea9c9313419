"""Upper arm angles against the vertical, from the posture table's own columns.

The posture table holds the upper arm against the trunk line. Tools that measure the arm against gravity get the same
from the inclination of the trunk: the direction of the arm in the trunk's frame is turned to a frame whose vertical
is gravity, and flexion and abduction are read there again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from reba.posture import INDEX, SIDES


def against_gravity(columns: NDArray[np.float64]) -> None:
    """Replace the upper arm columns of `columns` (22, m) [deg] by their angles against gravity, in place.

    The frame keeps the trunk's right axis as nearly as a horizontal axis can. NaN in the trunk or the arm gives NaN.

    Example: a trunk 60 deg forward with the arms hanging (60 deg of flexion against the trunk line) gives 0 deg.
    """
    flexion, bend, twist = (
        np.radians(columns[INDEX[name]]) for name in ("trunk_flexion", "trunk_side_bend", "trunk_twist")
    )
    # The vertical in trunk axes (x forward, y up, z right): inclined by flexion, then bend, then twist about y.
    x, y, z = -np.sin(flexion), np.cos(bend) * np.cos(flexion), -np.sin(bend) * np.cos(flexion)
    up = np.stack([np.cos(twist) * x - np.sin(twist) * z, y, np.sin(twist) * x + np.cos(twist) * z])
    right = np.array([0.0, 0.0, 1.0])[:, None] - up * up[2]
    right /= np.maximum(np.linalg.norm(right, axis=0), 1e-12)
    forward = np.cross(up, right, axis=0)
    for side, name in enumerate(SIDES):
        outward = -1.0 if name == "left" else 1.0
        flex = columns[INDEX["upper_arm_flexion_left"] + side]
        abduct = columns[INDEX["upper_arm_abduction_left"] + side]
        a, f = np.radians(abduct), np.radians(flex)
        arm = np.stack([np.cos(a) * np.sin(f), -np.cos(a) * np.cos(f), outward * np.sin(a)])
        along, down, across = (np.einsum("im,im->m", arm, axis) for axis in (forward, -up, right))
        flex[:] = np.degrees(np.arctan2(along, down))
        abduct[:] = np.degrees(np.arcsin(np.clip(outward * across, -1.0, 1.0)))
