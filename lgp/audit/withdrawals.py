"""Whether a hand that has let go is out of the way: before another one comes near, and before one moves off with it.

    given to another hand    the one that gave it is `BACK` from the object before this moves off
    put down                 the one that put it is `BACK` from it before a hand of another agent, or the one that takes
                             it next, is within `NEAR`; hands that hold something still, or put it down too, may be

Distances are those of grip points to the body of the object.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Final

import numpy as np

from lgp.audit.faults import LEVEL, TOUCHING, Fault
from lgp.audit.replay import Replay, Span
from reba.arrays import Array

BACK: Final = 0.06
"""[m] How far a hand draws back (a choice: as far as grip points of two hands are apart)."""
NEAR: Final = 0.20
"""[m] From where on another hand is near (a choice: the length of a hand)."""


def in_the_way(run: Replay) -> Iterator[Fault]:
    """Yield hands that have let go and are still at an object when another one comes, or moves off with it."""
    for name, spans in run.spans.items():
        for given, after in pairwise(spans):
            if given.first not in run.scene.hands or given.end is None:
                continue
            if after.first in run.scene.hands:
                yield from _given(run, given, after)
            elif after.first in run.scene.tables:
                yield from _put_down(run, name, given, after)


def _given(run: Replay, given: Span, after: Span) -> Iterator[Fault]:
    """Yield a giver that is not away when an object moves off."""
    rotation, position = (values[given.end :] for values in run.poses[given.second])
    cosine = (np.einsum("tij,ij->t", rotation, rotation[0]) - 1.0) / 2.0
    moved = np.linalg.norm(position - position[0], axis=1) > TOUCHING
    moved |= np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))) > LEVEL
    if not moved.any():
        return
    at = (given.end or 0) + int(moved.argmax())
    distance = float(_distances(run, given.first, given.second)[at])
    if distance < BACK - TOUCHING:
        what = (
            f"{after.first} moves off with {given.second} while {given.first} is {100 * distance:.1f} cm from it, "
            f"expected {100 * BACK:g} cm"
        )
        yield Fault("withdrawal", what, distance, float(run.samples.times[at]))


def _put_down(run: Replay, name: str, given: Span, after: Span) -> Iterator[Fault]:
    """Yield hands that come near to an object before the one that put it down is away."""
    first, last = given.end or 0, run.samples.count if after.end is None else after.end + 1
    away = _distances(run, given.first, name)[first:last] >= BACK - TOUCHING
    back = first + (int(away.argmax()) if away.any() else len(away))
    still = {hold.first for hold in run.holds if (hold.begin or 0) <= first and (hold.end is None or hold.end > first)}
    still |= {
        touch.first for touch in (*run.touches, *run.helps) if touch.second == name and touch.end in (None, first)
    }
    takes_next = next((span.first for span in run.spans[name] if span.begin == after.end), "")
    for hand, one in run.scene.hands.items():
        other = one.agent != run.scene.hands[given.first].agent or hand == takes_next
        if hand == given.first or hand in still or not other:
            continue
        distance = _distances(run, hand, name)[first:back]
        if len(distance) and distance.min() < NEAR - TOUCHING:
            at = int(distance.argmin())
            what = (
                f"{hand} is {100 * distance[at]:.1f} cm from {name} while {given.first}, which put it down, is not yet "
                f"{100 * BACK:g} cm away, expected {100 * NEAR:g} cm"
            )
            yield Fault("withdrawal", what, float(distance[at]), float(run.samples.times[first + at]))


def _distances(run: Replay, hand: str, name: str) -> Array:
    """Return the distance (T,) [m] of a grip point to the body of an object, 0 inside."""
    rotation, position = run.poses[name]
    place = np.einsum("tji,tj->ti", rotation, run.samples.hands[hand][1] - position)
    beyond = np.maximum(np.abs(place) - np.array(run.scene.objects[name].size) / 2.0, 0.0)
    return np.asarray(np.linalg.norm(beyond, axis=1))
