"""How far two bodies must be apart at each moment of a sequence: contacts are declared, all else keeps the margin.

Objects and hands touch only what their actions say, and only around their switches:

    object and the support it rests on     free while it rests, the slice at rest after the switch included; from 0 to
                                           the margin within WINDOW before it is put down and after it is lifted
    object and the hand that acts on it    free while held, and within HAND_WINDOW before and after
    acting hand and the table              no contact: from 0 to the margin within WINDOW around the switch
    parts of one assembly                  as object and support, from when both stand as they are screwed

Only the bodies of the hand are exempt, not the arm. Beyond bodies, the grip points of hands keep away from each other
always, with a margin where they are not at one object; how hands draw back from what they let go is in
`lgp.collision.withdrawals`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from lgp.collision.shapes import CollisionShape
from lgp.kinematics.modes import ModeSequence
from lgp.logic.task import parse_atom
from reba.arrays import Array, Flags, Indices

WINDOW = 0.3
"""[s] Time before and after a contact in which the margin fades (a choice: shorter ones make plans dearer)."""

HAND_WINDOW = 0.25
"""[s] The same of a hand, whose fingers reach around the object: clear of it when `WINDOW` ends, between slices too."""


GRIP_MARGIN = 0.002
"""[m] By which grip points keep more than their distance at the constrained points: between these they come nearer."""


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
    close: Flags | None = None,
) -> Array:
    """Return the distance (n, pairs) [m] that each pair keeps at times (n,) [s]; -inf where contact is free.

    Pairs that are `close` keep no margin.
    """
    sides = np.array(pairs, dtype=np.intp).reshape(-1, 2)
    grips = np.array([shape.kind == "grip" for shape in shapes], bool)[sides]
    only, with_grip = grips.all(axis=1), grips.any(axis=1)
    of_pair = np.where(only, GRIP_MARGIN, np.where(with_grip, -math.inf, margin))
    if close is not None:
        of_pair = np.where(close, np.minimum(of_pair, 0.0), of_pair)
    required = np.tile(of_pair, (len(times), 1))
    agents = {hand.partition(".")[0] for shape in shapes for hand in shape.hands}
    names = [shape.hands | {shape.table if shape.owner in agents else shape.name} for shape in shapes]
    hands = set[str]().union(*(shape.hands for shape in shapes))
    for contact in contacts:
        one, other = (np.array([name in own for own in names], bool)[sides] for name in (contact.first, contact.second))
        meet = one[:, 0] & other[:, 1] | one[:, 1] & other[:, 0]
        touched = meet & (only if hands >= {contact.first, contact.second} else ~with_grip)
        required[:, touched] = np.minimum(required[:, touched], contact.required(times, margin)[:, None])
    return required


DRAW_BACK_SECONDS = 0.6
"""[s] After a switch in which a hand draws back (a choice: 10 cm/s)."""


def draw_back_slices(seconds: float, slices: int) -> int:
    """Return how many slices of a phase of some duration [s] a hand that let go draws back, at most half of them.

    >>> draw_back_slices(2.0, 10), draw_back_slices(0.5, 10)
    (3, 5)
    """
    return max(math.ceil(min(DRAW_BACK_SECONDS / seconds, 0.5) * slices - SAME), 1)


@dataclass(frozen=True)
class Clock:
    """When the actions of a sequence happen.

    Attributes:
        ends: when each number of actions is done [s], (A + 1,).
        begins: of the phase of each action [s], (A,).
        steps: time between slices once each number of actions is done [s], (A + 1,), at the end as before it; hands and
            objects rest for one slice after a switch.
        draw_back: slices in which a hand that let go draws back.

    >>> Clock.of(np.ones(2), 1.0, 4).rested(1)
    1.25
    """

    ends: Array
    begins: Array
    steps: Array
    draw_back: int

    @staticmethod
    def of(durations: Array, seconds: float, slices: int, phase_of: Indices | None = None) -> Clock:
        """Return the clock of phases with some durations [s], of `seconds` each where these are not unknowns.

        Args:
            phase_of: number of the phase that each action ends, (A,); one each by default.
        """
        phase_of = np.arange(len(durations)) if phase_of is None else phase_of
        ends, done = np.concatenate([[0.0], np.cumsum(durations)]), np.concatenate([[0], phase_of + 1])
        steps = (durations / slices)[np.minimum(done, len(durations) - 1)] if len(durations) else np.zeros(1)
        return Clock(ends[done], ends[phase_of], steps, draw_back_slices(seconds, slices))

    @property
    def last(self) -> float:
        """When all is done [s]."""
        return float(self.ends[-1])

    def rested(self, number: int) -> float:
        """Return when a number of actions is done, and the slice at rest that follows [s]."""
        return float(self.ends[number] + (self.steps[number] if self.ends[number] < self.last else 0.0))


def declared_contacts(modes: ModeSequence, clock: Clock) -> tuple[Contact, ...]:
    """Return the contacts of a sequence of actions, each of which ends a phase."""
    touching = (*_attachments(modes, clock), *_holds(modes, clock))
    return (*touching, *_reaches(modes, clock), *_assemblies(modes, clock), *_hands_together(modes, touching))


def _attachments(modes: ModeSequence, clock: Clock) -> Iterator[Contact]:
    """Yield the contacts of objects with the hands and tables that they are attached to."""
    for name in modes.world.scene.objects:
        for parent, first, last in _intervals(modes, name):
            begin = -math.inf if first == 0 else float(clock.ends[first])
            end = math.inf if last == len(modes.switches) else clock.rested(last + 1)
            yield Contact(parent, name, begin, end, free=parent in modes.world.scene.hands)


def _intervals(modes: ModeSequence, name: str) -> Iterator[tuple[str, int, int]]:
    """Yield (parent, first phase, last phase) of an object; the phase after the last action counts."""
    first, last = 0, len(modes.switches)
    for phase in range(last + 1):
        parent = modes.attachment(name, phase).parent
        if phase == last or modes.attachment(name, phase + 1) is not modes.attachment(name, phase):
            yield parent, first, phase
            first = phase + 1


def _holds(modes: ModeSequence, clock: Clock) -> Iterator[Contact]:
    """Yield the contacts of hands that hold an object in place, screw it, or carry it with another hand."""
    for hand, number, last in modes.holding_intervals:
        name = modes.switches[number].object_name
        yield Contact(hand, name, float(clock.ends[number + 1]), clock.rested(last + 1), free=True)
        table = modes.attachment(name, number).parent
        yield Contact(hand, table, float(clock.ends[number + 1]), clock.rested(last + 1), touches=False)
    for hand, number, last in modes.second_intervals:
        name = modes.switches[number].object_name
        yield Contact(hand, name, float(clock.ends[number + 1]), clock.rested(last + 1), free=True)
    for hand, name, last in modes.held_at_first:
        yield Contact(hand, name, -math.inf, clock.rested(last + 1), free=True)
        yield Contact(hand, modes.attachment(name, 0).parent, -math.inf, clock.rested(last + 1), touches=False)
    for number, switch in enumerate(modes.switches):
        if switch.action.screws:
            for name in (switch.object_name, switch.other):
                yield Contact(switch.hand, name, float(clock.ends[number + 1]), clock.rested(number + 1), free=True)


def _hands_together(modes: ModeSequence, contacts: Sequence[Contact]) -> Iterator[Contact]:
    """Yield the hands that are at one object at a time: their grips are where it has them, with no margin to spare."""
    at_object = [contact for contact in contacts if contact.first in modes.world.scene.hands and contact.free]
    for one, other in combinations(at_object, 2):
        begin, end = max(one.begin, other.begin), min(one.end, other.end)
        if one.second == other.second and one.first != other.first and begin <= end:
            yield Contact(one.first, other.first, begin, end, touches=False)


def _reaches(modes: ModeSequence, clock: Clock) -> Iterator[Contact]:
    """Yield the tables that acting hands come near to: where they take an object from, and where they put it."""
    for number, switch in enumerate(modes.switches):
        for phase in (number, number + 1):
            parent = modes.attachment(switch.object_name, phase).parent
            if parent in modes.world.scene.tables:
                for hand in switch.hands:
                    yield Contact(hand, parent, float(clock.ends[number + 1]), clock.rested(number + 1), touches=False)


def _assemblies(modes: ModeSequence, clock: Clock) -> Iterator[Contact]:
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
            begin = -math.inf if first == 0 else float(clock.ends[first])
            end = math.inf if last == len(modes.switches) else clock.rested(last + 1)
            yield Contact(assembly.parts[0], assembly.parts[1], begin, end)
