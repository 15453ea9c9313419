"""Limits of the speed of a person's joints."""

from __future__ import annotations

from fnmatch import fnmatch
from typing import Final

import numpy as np

SPEEDS: Final = {"pelvis_[xyz]": 1.0, "pelvis_*": np.radians(180.0), "middle_*": np.radians(180.0),
                 "*_clavicle_*": np.radians(180.0), "*": np.radians(360.0)}  # fmt: skip
"""Limits [rad/s, m/s] by name of a joint, the first pattern that fits.

A choice for calm work: walking pace for the pelvis, half a turn a second for the spine, one for the limbs. It is far
below what athletes reach: 28 rad/s in the knee and 50 rad/s in the wrist (Jessop & Pain 2016, J Hum Kinet 50:37-44)."""


def speed_limit(joint: str) -> float:
    """Return the limit of a joint of the person [rad/s, m/s].

    >>> round(speed_limit("middle_lumbar_X"), 3)
    3.142
    """
    return float(next(limit for pattern, limit in SPEEDS.items() if fnmatch(joint, pattern)))
