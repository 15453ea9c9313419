"""How hands draw back from what they let go: before another one comes near, and before the taker moves off with it.

    the hand that let go     grip point `DRAWN_BACK` away once it had `DRAW_BACK_SECONDS`, and from then on while it
                             acts on nothing else, which may be beside the object, until it acts on it again
    hands of other agents    grip point `NOT_YET` away until then, unless they hold something still or put it down too;
                             the one that takes the object next, also while the first one acts on something else
    the hand that took it    at rest until then, with all joints that move it (`Clock.draw_back`)

Distances are those of grip points to the body of the object.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from lgp.collision.contacts import DRAW_BACK_SECONDS, SAME, Clock
from lgp.collision.shapes import CollisionShape
from lgp.kinematics.modes import KinematicSwitch, ModeSequence
from reba.arrays import Array

DRAWN_BACK: Final = 0.06
"""[m] How far a hand that has let go draws back (a choice: as far as grip points of two hands are apart)."""
NOT_YET: Final = 0.20
"""[m] How far another hand stays away from an object until then (a choice: the length of a hand)."""


@dataclass(frozen=True)
class Withdrawal:
    """A hand keeps its grip point away from an object for some time.

    Attributes:
        distance: [m].
        begin, end: [s]; the end is not part of it.
    """

    hand: str
    object_name: str
    distance: float
    begin: float
    end: float


def require_withdrawals(
    required: Array,
    shapes: Sequence[CollisionShape],
    pairs: Sequence[tuple[int, int]],
    withdrawals: Sequence[Withdrawal],
    times: Array,
) -> None:
    """Raise the distances (n, pairs) of grip points and objects in place, at times (n,) [s]."""
    column = {frozenset((shapes[one].name, shapes[other].name)): number for number, (one, other) in enumerate(pairs)}
    radius = {shape.name: shape.radius for shape in shapes}
    for each in withdrawals:
        grip = f"grip point of {each.hand}"
        number = column[frozenset((grip, each.object_name))]
        during = (times > each.begin - SAME) & (times < each.end - SAME)
        required[during, number] = np.maximum(required[during, number], each.distance - radius[grip])


def declared_withdrawals(modes: ModeSequence, clock: Clock) -> Iterator[Withdrawal]:
    """Yield which hand keeps away from which object until when, for a sequence of actions."""
    count = len(modes.switches)
    for number, switch in enumerate(modes.switches):
        giver = switch.giver or (switch.hand if switch.action.attaches_to == "table" else "")
        if not giver:
            continue
        later = [k for k in range(number + 1, count) if switch.object_name in _acted_on(modes.switches[k])]
        next_hands = modes.switches[later[0]].hands if later else ()
        again = next((k for k in later if giver in modes.switches[k].hands), count)
        until = math.inf if again == count else float(clock.begins[again])
        let_go = float(clock.ends[number + 1])
        at_last = let_go >= clock.last  # where only the others stay away, as it ends there
        back = let_go if at_last else _drawn_back(clock, number + 1)
        if not switch.giver:
            others = {hand for hand in modes.world.scene.hands if _agent(hand) != _agent(giver)} | set(next_hands)
            for hand in sorted(others - {*switch.hands} - _standing_still(modes, number)):
                yield Withdrawal(hand, switch.object_name, NOT_YET, let_go, back + 2.0 * SAME)
        if at_last:
            continue
        if until > let_go:
            yield Withdrawal(giver, switch.object_name, DRAWN_BACK, back, back + float(clock.steps[number + 1]) / 2.0)
        begin = back
        for phase in range(number + 1, again):
            if giver not in modes.switches[phase].hands:
                continue
            busy, free = float(clock.begins[phase]), _drawn_back(clock, phase + 1)
            if giver not in next_hands:
                yield Withdrawal(giver, switch.object_name, DRAWN_BACK, begin, busy)
            if not switch.giver and later and busy < clock.begins[later[0]] + DRAW_BACK_SECONDS:
                for hand in sorted({*next_hands} - {giver}):
                    # Where it acted just before, it may still be near.
                    yield Withdrawal(hand, switch.object_name, NOT_YET, busy + 2.0 * SAME, free)
            begin = free
        if giver not in next_hands:
            yield Withdrawal(giver, switch.object_name, DRAWN_BACK, begin, until)


def _agent(hand: str) -> str:
    return hand.partition(".")[0]


def _standing_still(modes: ModeSequence, number: int) -> set[str]:
    """Return the hands that hold something still in a switch and after it."""
    holding = {hand for hand, begin, last in modes.holding_intervals if begin <= number < last}
    return holding | {hand for hand, _, last in modes.held_at_first if number < last}


def _drawn_back(clock: Clock, number: int) -> float:
    """Return when [s] a hand has drawn back that lets go as the last one of a number of actions."""
    return float(clock.ends[number] + clock.draw_back * clock.steps[number])


def _acted_on(switch: KinematicSwitch) -> tuple[str, ...]:
    return switch.object_name, switch.other
