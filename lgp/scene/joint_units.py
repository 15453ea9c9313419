"""Units of joints: scene files and messages state turns in degrees, everything else in radians; slides are in metres.

The one place that converts between both. Whether a joint slides is a matter of its model (`World.units`, the type of
the joint in a URDF), never of its name.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class JointUnit:
    """The unit of a joint.

    Attributes:
        written: of scene files and messages, "deg" or "m".
        si: of configurations and plans, "rad" or "m".
        factor: one written unit in the other.

    >>> SLIDE.to_si(0.3), TURN.to_si(180.0) == math.pi
    (0.3, True)
    """

    written: str
    si: str
    factor: float

    def to_si(self, value: float) -> float:
        """Return a value of a scene file [deg, m] as configurations have it [rad, m]."""
        return value * self.factor

    def from_si(self, value: float) -> float:
        """Return a value of a configuration [rad, m] as scene files and messages state it [deg, m]."""
        return value / self.factor


TURN: Final = JointUnit("deg", "rad", math.pi / 180.0)
SLIDE: Final = JointUnit("m", "m", 1.0)


def unit_of(slides: bool) -> JointUnit:
    """Return the unit of a joint that slides or turns."""
    return SLIDE if slides else TURN
