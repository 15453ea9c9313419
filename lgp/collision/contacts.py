"""How far two bodies must be apart at each moment of a sequence: contacts are declared, all else keeps the margin.

Objects and hands touch only what their actions say, and only around their switches:

    object and the support it rests on     free while it rests, the slice at rest after the switch included; from 0 to
                                           the margin within WINDOW before it is put down and after it is lifted
    object and the hand that acts on it    free while held, and within HAND_WINDOW before and after
    acting hand and the table              no contact: from 0 to the margin within WINDOW around the switch
    parts of one assembly                  as object and support, from when both stand as they are screwed

Only the bodies of the hand are exempt, not the arm. Beyond bodies, hands keep away from each other: their grip points
always, and after a hand has let go it draws back from the object before another one comes near.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from lgp.collision.shapes import CollisionShape
from lgp.kinematics.modes import KinematicSwitch, ModeSequence
from lgp.logic.task import parse_atom
from reba.arrays import Array

WINDOW = 0.3
"""[s] Time before and after a contact in which the margin fades (a choice: shorter ones make plans dearer)."""

HAND_WINDOW = 0.25
"""[s] The same of a hand, whose fingers reach around the object: clear of it when `WINDOW` ends, between slices too."""


@dataclass(frozen=True)
class Contact:
    """A declared contact of two sets of bodies.

    Attributes:
        first, second: names of what touches: "table.left", an object, or a hand, which stands for its bodies.
        begin, end: of the contact [s]; infinite where it holds from the start on or to the end.
        touches: whether they may touch in between; otherwise they keep a distance of 0.
        free: whether the time within `HAND_WINDOW` before and after is free as well; no margin fades then.
    """

    first: str
    second: str
    begin: float
    end: float
    touches: bool = True
    free: bool = False

    def required(self, times: Array, margin: float) -> Array:
        """Return the distance (n,) [m] to keep at times (n,) [s], -inf where contact is free."""
        away = np.maximum(np.maximum(self.begin - times, times - self.end), 0.0)
        if self.free:
            away = np.where(away <= HAND_WINDOW + SAME, 0.0, math.inf)
        fading = margin * np.minimum(away / WINDOW, 1.0)
        return np.where(away <= SAME, -math.inf if self.touches else 0.0, fading)


SAME = 1e-9
"""[s] Times that differ by less are one."""


def required_distances(
    shapes: Sequence[CollisionShape],
    pairs: Sequence[tuple[int, int]],
    contacts: Sequence[Contact],
    times: Array,
    margin: float,
) -> Array:
    """Return the distance (n, pairs) [m] that each pair keeps at times (n,) [s]; -inf where contact is free."""
    kinds = [{shapes[one].kind, shapes[other].kind} for one, other in pairs]
    of_pair = [0.0 if kind == {"grip"} else -math.inf if "grip" in kind else margin for kind in kinds]
    required = np.tile(of_pair, (len(times), 1))
    agents = {hand.partition(".")[0] for shape in shapes for hand in shape.hands}
    names = [shape.hands if shape.owner in agents else shape.hands | {shape.name} for shape in shapes]
    for contact in contacts:
        both = {contact.first}, {contact.second}
        touched = [
            number
            for number, (one, other) in enumerate(pairs)
            if "grip" not in kinds[number]
            and any(first & names[one] and second & names[other] for first, second in (both, both[::-1]))
        ]
        required[:, touched] = np.minimum(required[:, touched], contact.required(times, margin)[:, None])
    return required


@dataclass(frozen=True)
class Withdrawal:
    """A hand keeps its grip point away from an object for some time.

    Attributes:
        distance: [m].
        begin, end: [s].
    """

    hand: str
    object_name: str
    distance: float
    begin: float
    end: float


DRAWN_BACK = 0.06
"""[m] How far a hand that has let go draws back (a choice: as far as grip points of two hands are apart)."""
NOT_YET = 0.20
"""[m] How far another hand stays away from an object until then (a choice: the length of a hand)."""
DRAW_BACK_SECONDS = 0.6
"""[s] After a switch in which a hand draws back (a choice: 10 cm/s)."""


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
        during = (times > each.begin + SAME) & (times < each.end - SAME)
        required[during, number] = np.maximum(required[during, number], each.distance - radius[grip])


def declared_withdrawals(modes: ModeSequence, seconds: float) -> Iterator[Withdrawal]:
    """Yield which hand keeps away from which object until when, for a sequence of actions of `seconds` each.

    A hand that has let go stays away until it acts on the object again, except while it is busy: within
    `DRAW_BACK_SECONDS` after letting go, and in the phases in which it acts on something else, which may be beside the
    object. While it is busy no other hand that takes the object next comes near.
    """
    for number, switch in enumerate(modes.switches):
        giver = switch.giver or (switch.hand if switch.action.attaches_to == "table" else "")
        later = [
            k for k in range(number + 1, len(modes.switches)) if switch.object_name in _acted_on(modes.switches[k])
        ]
        if not giver or not later:
            continue
        following = modes.switches[later[0]]
        again = next((k for k in later if giver in modes.switches[k].hands), len(modes.switches))
        until = math.inf if again == len(modes.switches) else again * seconds
        begin = (number + 1) * seconds
        for busy, free in _busy(modes, giver, range(number + 1, again), begin, seconds):
            if giver not in following.hands:
                yield Withdrawal(giver, switch.object_name, DRAWN_BACK, begin, min(busy, until))
            if not switch.giver and busy < later[0] * seconds + DRAW_BACK_SECONDS:
                for hand in following.hands:
                    if hand != giver:
                        yield Withdrawal(hand, switch.object_name, NOT_YET, busy, free)
            begin = free
        if giver not in following.hands:
            yield Withdrawal(giver, switch.object_name, DRAWN_BACK, begin, until)


def _busy(
    modes: ModeSequence, hand: str, phases: Sequence[int], let_go: float, seconds: float
) -> Iterator[tuple[float, float]]:
    """Yield from when to when [s] a hand that lets go at some time is busy: drawing back, or acting in some phases."""
    draws_back = min(DRAW_BACK_SECONDS, seconds / 2.0)
    yield let_go, let_go + draws_back
    for phase in phases:
        if hand in modes.switches[phase].hands:
            yield phase * seconds, (phase + 1) * seconds + draws_back


def _acted_on(switch: KinematicSwitch) -> tuple[str, ...]:
    return switch.object_name, switch.other


def declared_contacts(modes: ModeSequence, phase_seconds: float, tau: float) -> tuple[Contact, ...]:
    """Return the contacts of a sequence of actions, each of which ends a phase.

    Args:
        phase_seconds: duration of a phase [s].
        tau: time between slices [s]; hands and objects rest for one slice after a switch.
    """
    return (
        *_attachments(modes, phase_seconds, tau),
        *_holds(modes, phase_seconds, tau),
        *_reaches(modes, phase_seconds, tau),
        *_assemblies(modes, phase_seconds, tau),
    )


def _attachments(modes: ModeSequence, seconds: float, tau: float) -> Iterator[Contact]:
    """Yield the contacts of objects with the hands and tables that they are attached to."""
    for name in modes.world.scene.objects:
        for parent, first, last in _intervals(modes, name):
            begin = -math.inf if first == 0 else first * seconds
            end = math.inf if last == len(modes.switches) else (last + 1) * seconds + tau
            yield Contact(parent, name, begin, end, free=parent in modes.world.scene.hands)


def _intervals(modes: ModeSequence, name: str) -> Iterator[tuple[str, int, int]]:
    """Yield (parent, first phase, last phase) of an object; the phase after the last action counts."""
    first, last = 0, len(modes.switches)
    for phase in range(last + 1):
        parent = modes.attachment(name, phase).parent
        if phase == last or modes.attachment(name, phase + 1) is not modes.attachment(name, phase):
            yield parent, first, phase
            first = phase + 1


def _holds(modes: ModeSequence, seconds: float, tau: float) -> Iterator[Contact]:
    """Yield the contacts of hands that hold an object in place, screw it, or carry it with another hand."""
    for hand, number, last in modes.holding_intervals:
        name = modes.switches[number].object_name
        yield Contact(hand, name, (number + 1) * seconds, (last + 1) * seconds + tau, free=True)
        table = modes.attachment(name, number).parent
        yield Contact(hand, table, (number + 1) * seconds, (last + 1) * seconds + tau, touches=False)
    for hand, number, last in modes.second_intervals:
        name = modes.switches[number].object_name
        yield Contact(hand, name, (number + 1) * seconds, (last + 1) * seconds + tau, free=True)
    for hand, name, last in modes.held_at_first:
        yield Contact(hand, name, -math.inf, (last + 1) * seconds + tau, free=True)
        yield Contact(hand, modes.attachment(name, 0).parent, -math.inf, (last + 1) * seconds + tau, touches=False)
    for number, switch in enumerate(modes.switches):
        if switch.action.screws:
            for name in (switch.object_name, switch.other):
                yield Contact(switch.hand, name, (number + 1) * seconds, (number + 1) * seconds + tau, free=True)


def _reaches(modes: ModeSequence, seconds: float, tau: float) -> Iterator[Contact]:
    """Yield the tables that acting hands come near to: where they take an object from, and where they put it."""
    for number, switch in enumerate(modes.switches):
        for phase in (number, number + 1):
            parent = modes.attachment(switch.object_name, phase).parent
            if parent in modes.world.scene.tables:
                for hand in switch.hands:
                    yield Contact(hand, parent, (number + 1) * seconds, (number + 1) * seconds + tau, touches=False)


def _assemblies(modes: ModeSequence, seconds: float, tau: float) -> Iterator[Contact]:
    """Yield the contacts of parts that stand as their assembly says: from when both are put down until one is taken."""
    scene = modes.world.scene
    screwed = {frozenset(atom.arguments) for atom in map(parse_atom, scene.initial) if atom.predicate == "screwed"}
    screws = [
        (number, frozenset((switch.object_name, switch.other)))
        for number, switch in enumerate(modes.switches)
        if switch.action.screws
    ]
    for assembly in scene.assemblies:
        parts = frozenset(assembly.parts)
        numbers = [number for number, screw in screws if screw == parts]
        if parts in screwed:
            numbers.append(-1)
        for number in numbers:
            phase = max(number, 0)
            spans = [next(span for span in _intervals(modes, part) if span[1] <= phase <= span[2]) for part in parts]
            first, last = max(span[1] for span in spans), min(span[2] for span in spans)
            begin = -math.inf if first == 0 else first * seconds
            end = math.inf if last == len(modes.switches) else (last + 1) * seconds + tau
            yield Contact(assembly.parts[0], assembly.parts[1], begin, end)
