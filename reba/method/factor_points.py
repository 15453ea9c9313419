"""Factors of a recording as points: load, coupling, support of the legs, arm support, activity."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from reba.arrays import Flags
from reba.method.rules import Rules, load_points
from reba.posture.columns import SIDES
from reba.posture.factors import (
    ACTIVITIES,
    COUPLINGS,
    FLAGS,
    GRIPS,
    SUPPORTS,
    Factors,
    Points,
    codes,
    flag,
    load_kg,
)


@dataclass(frozen=True)
class FactorPoints:
    """Factors turned into points: uint8 arrays that broadcast over the frames.

    Of shape (n,) or (1,); `coupling` and `arm_supported` (2, n) or (2, 1), left and right.
    """

    load_force: Points
    coupling: Points
    arm_supported: Flags
    legs: Points
    knees_count: Points
    activity: Points

    def rows(self, start: int, stop: int) -> FactorPoints:
        """Return the points of frames start to stop."""
        arrays = (getattr(self, field.name) for field in fields(self))
        return FactorPoints(*(one if one.shape[-1] == 1 else one[..., start:stop] for one in arrays))


def points(factors: Factors, rules: Rules, n: int) -> FactorPoints:
    """Return the points of n frames."""
    load = load_kg(factors.load, n)
    coupling = np.stack(np.broadcast_arrays(*(codes(name, getattr(factors, name), COUPLINGS, n) for name in GRIPS)))
    if not rules.coupling_without_load:
        coupling = (coupling * (load > 0)).astype(np.uint8)
    support = codes("support", factors.support, SUPPORTS, n)
    flags = {name: flag(name, getattr(factors, name), n) for name in FLAGS}
    return FactorPoints(
        load_force=(load_points(load) + flags["shock"]).astype(np.uint8),
        coupling=coupling,
        arm_supported=np.stack(np.broadcast_arrays(*(flags[f"arm_supported_{side}"] for side in SIDES))),
        legs=leg_points(support, rules),
        knees_count=knees_count(support, rules).astype(np.uint8),
        activity=np.asarray(sum(flags[name].astype(np.uint8) for name in ACTIVITIES), np.uint8),
    )


def leg_points(support: Any, rules: Rules) -> Any:
    """Return the points 1 or 2 of places in `SUPPORTS`, one or an array, before those of bent knees.

    >>> int(leg_points(SUPPORTS.index("unilateral"), Rules()))
    2
    """
    return np.array([1, 2, rules.walking_legs, 1], np.uint8)[support]


def knees_count(support: Any, rules: Rules) -> Any:
    """Return whether bent knees add points; `support` as in `leg_points`. Printed: "not for sitting" [H2005]."""
    return np.array([True, True, True, rules.seated_knees])[support]
