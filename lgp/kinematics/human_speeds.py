"""Limits of the speed of a person's joints."""

from __future__ import annotations

from fnmatch import fnmatch
from typing import Final

import numpy as np

from lgp.scene.joint_units import TURN
from lgp.scene.model import Human

SPEEDS: Final = {"pelvis_[xyz]": 1.0, "pelvis_*": np.radians(180.0), "middle_*": np.radians(180.0),
                 "*_clavicle_*": np.radians(180.0), "*": np.radians(360.0)}  # fmt: skip
"""Limits [rad/s, m/s] by name of a joint, the first pattern that fits.

A choice for calm work: walking pace for the pelvis, half a turn a second for the spine, one for the limbs. It is far
below what athletes reach: 28 rad/s in the knee and 50 rad/s in the wrist (Jessop & Pain 2016, J Hum Kinet 50:37-44)."""


def speed_limit(joint: str, person: Human | None = None) -> float:
    """Return the limit of a joint of the person [rad/s, m/s].

    >>> round(speed_limit("middle_lumbar_X"), 3)
    3.142
    """
    if person is not None and person.step is not None and joint.startswith("base_"):
        return TURN.to_si(person.step.turn) if joint == "base_yaw" else person.step.speed
    return float(next(limit for pattern, limit in SPEEDS.items() if fnmatch(joint, pattern)))
