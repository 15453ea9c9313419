"""The factors beside the angles: load, coupling, support, arm support and activity.

A factor is one value for a whole recording or one per frame. What nobody gave is assumed (`ASSUMED`) and named in
every output; only angles carry a range of what is unmeasured.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from reba.arrays import Flags
from reba.method.rules import LOAD_EDGES, Rules
from reba.posture.columns import SIDES
from reba.posture.factors import (
    _FLAGS,
    _GRIPS,
    ACTIVITIES,
    COUPLINGS,
    SUPPORTS,
    Factors,
    Points,
    _choice,
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
        given = (getattr(self, field.name) for field in fields(self))
        return FactorPoints(*(one if one.shape[-1] == 1 else one[..., start:stop] for one in given))


def points(factors: Factors, rules: Rules, n: int) -> FactorPoints:
    """Return the points of n frames.

    Raises:
        PostureError: a value is missing, out of range or has another number of frames.
    """
    load = load_kg(factors.load, n)
    load_points = (load >= LOAD_EDGES[0]).astype(np.uint8) + (load > LOAD_EDGES[1])
    coupling = np.stack(np.broadcast_arrays(*(_choice(name, getattr(factors, name), COUPLINGS, n) for name in _GRIPS)))
    if not rules.coupling_without_load:
        coupling = (coupling * (load > 0)).astype(np.uint8)
    support = _choice("support", factors.support, SUPPORTS, n)
    walking = support == SUPPORTS.index("walking")
    legs = 1 + (support == SUPPORTS.index("unilateral")) + walking * (rules.walking_legs - 1)
    sitting = support == SUPPORTS.index("sitting")
    flags = {name: flag(name, getattr(factors, name), n) for name in _FLAGS}
    return FactorPoints(
        load_force=(load_points + flags["shock"]).astype(np.uint8),
        coupling=coupling,
        arm_supported=np.stack(np.broadcast_arrays(*(flags[f"arm_supported_{side}"] for side in SIDES))),
        legs=legs.astype(np.uint8),
        knees_count=(~sitting | rules.seated_knees).astype(np.uint8),
        activity=np.asarray(sum(flags[name].astype(np.uint8) for name in ACTIVITIES), np.uint8),
    )
