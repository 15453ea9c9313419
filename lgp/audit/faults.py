"""What an audit finds: faults, contacts of bodies, and the record of all of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

HANDS_ROUNDING: Final = 1e-4
"""[m] By which grip points may be nearer than the scene says: constraints hold to a micrometre."""
TOUCHING: Final = 0.001
"""[m] Bodies that are in each other by this or less touch; errors of attachment up to this are none."""
LEVEL: Final = 1.0
"""[deg] Directions that differ by this or less are the same."""


@dataclass(frozen=True)
class Fault:
    """One fault: what, how much and when.

    Attributes:
        kind: contact, attachment, resting, goal, hands, withdrawal, speed, limit, feet, start, or unknown for what has
            no audit.
        what: in words, with the amount.
        amount: [m], [deg], or a share; 0 where there is none.
        time: [s].
    """

    kind: str
    what: str
    amount: float
    time: float

    def __str__(self) -> str:
        return f"{self.what} at {self.time:.2f} s"


@dataclass(frozen=True)
class Depth:
    """Two bodies at the time when they are deepest in each other.

    Attributes:
        pair_class: `person/table`, `robot/robot`, `robot with itself` ...
        pair: their names.
        depth: [m] by which one has to move to be clear of the other.
        time: [s].
    """

    pair_class: str
    pair: tuple[str, str]
    depth: float
    time: float

    def plain(self) -> dict[str, Any]:
        """Return it as in `lgp plan --json`."""
        return {"class": self.pair_class, "pair": list(self.pair), "depth": self.depth, "time": self.time}


@dataclass(frozen=True)
class Extreme:
    """The smallest or largest of something: its value, what it is of, and when; value None where there is none."""

    value: float | None = None
    of: tuple[str, ...] = ()
    time: float = 0.0


@dataclass(frozen=True)
class Audit:
    """What the audit of a plan found.

    Attributes:
        samples: number of configurations that were looked at.
        contacts: every pair of bodies that are in each other beyond declared contact, deepest first.
        hands: least distance of the grip points of two hands [m]; no value with fewer than two hands.
        speed: largest share of the speed limit of a joint.
        faults: in the order of contacts, actions, hands, joints.
        unaudited: what it could not look at.
    """

    samples: int
    contacts: tuple[Depth, ...]
    hands: Extreme
    speed: Extreme
    faults: tuple[Fault, ...]
    unaudited: tuple[str, ...] = ()

    @property
    def clean(self) -> bool:
        """Whether there is no fault."""
        return not self.faults

    @property
    def deepest(self) -> tuple[Depth, ...]:
        """The deepest pair of each class, deepest first."""
        first: dict[str, Depth] = {}
        for depth in self.contacts:
            first.setdefault(depth.pair_class, depth)
        return tuple(first.values())

    def _pairs(self, pair_class: str) -> int:
        """Return how many pairs of a class are deeper in each other than touching."""
        return sum(one.pair_class == pair_class and one.depth > TOUCHING for one in self.contacts)

    def summary(self) -> dict[str, Any]:
        """Return plain data, as in `lgp plan --json` and in a saved plan."""
        return {
            "clean": self.clean,
            "samples": self.samples,
            "touching": TOUCHING,
            "deepest": [depth.plain() | {"pairs": self._pairs(depth.pair_class)} for depth in self.deepest],
            "hands": self.hands.value,
            "hands_pair": list(self.hands.of),
            "hands_time": self.hands.time,
            "speed": self.speed.value,
            "speed_joint": "".join(self.speed.of),
            "speed_time": self.speed.time,
            "faults": [{"kind": one.kind, "what": one.what, "amount": one.amount, "time": one.time}
                       for one in self.faults],
            "unaudited": list(self.unaudited),
        }  # fmt: skip
