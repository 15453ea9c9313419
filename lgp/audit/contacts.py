"""Which bodies may touch, when and how deep: what the replayed actions declare, and nothing else.

    hand and the object that it has, holds still or screws     any depth, and within `WINDOW` before and after
    object and the table it rests on                           `TOUCH`, and within `WINDOW` before and after
    parts of an assembly that stand as they are screwed        any depth; `TOUCH` within `WINDOW` before and after
    all else                                                   not at all

Only the bodies of a hand count as the hand, not the arm. A hand that has let go has not left yet as long as it rests at
the object, and one that comes is there once it does.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from lgp.audit.faults import TOUCHING
from lgp.audit.replay import Replay, Span
from lgp.audit.shapes import Body
from reba.arrays import Array

WINDOW: Final = 0.3
"""[s] Before a contact begins and after it ends in which the two may be at each other."""
TOUCH: Final = 0.003
"""[m] What a motion between slices may dip into a table while an object is put down or lifted."""
ROUNDING: Final = 1e-9
"""[s] Times that differ by less are one."""

Allowed = dict[tuple[int, int], Array]
"""Pair of bodies -> depth (T,) [m] that it may have."""


def allowed_depths(run: Replay, bodies: Sequence[Body]) -> Allowed:
    """Return the depth (T,) [m] that pairs of bodies may have, of those that may touch at some time."""
    depths: Allowed = {}
    for span, inside, around in _declared(run):
        depth = _profile(run.samples.times, *_lasts(run, span), inside, around)
        for one in (*_bodies(bodies, span.first), *_below(run, bodies, span.first)):
            for other in _bodies(bodies, span.second):
                pair = (min(one, other), max(one, other))
                depths[pair] = np.maximum(depths.get(pair, 0.0), depth)
    return depths


def _declared(run: Replay) -> Iterator[tuple[Span, float, float]]:
    """Yield each declared contact with the depth [m] that it may have while it lasts, and around."""
    for spans in run.spans.values():
        for span in spans:
            yield (span, np.inf, np.inf) if span.first in run.scene.hands else (span, TOUCH, TOUCH)
    for span in (*run.holds, *run.helps, *run.touches):
        yield span, np.inf, np.inf
    for span in run.assemblies:
        yield span, np.inf, TOUCH


def _lasts(run: Replay, span: Span) -> tuple[float, float]:
    """Return when a contact begins and ends [s]; of a hand, as long as it rests where it is in the switch."""
    times, ends = run.samples.times, [span.begin, span.end]
    if span.first in run.scene.hands:
        rotation, position = run.poses[span.second]
        place = np.einsum("tji,tj->ti", rotation, run.samples.hands[span.first][1] - position)
        for number, (at, sense) in enumerate(zip(ends, (-1, 1), strict=True)):
            if at is not None:
                rests = np.linalg.norm(place[at::sense] - place[at], axis=1) <= TOUCHING
                ends[number] = at + sense * (len(rests) if rests.all() else int(rests.argmin())) - sense
    begin, end = ends
    return -np.inf if begin is None else float(times[begin]), np.inf if end is None else float(times[end])


def _profile(times: Array, begin: float, end: float, inside: float, around: float) -> Array:
    """Return the depth (T,) [m] that a contact from `begin` to `end` [s] may have."""
    away = np.maximum(begin - times, times - end)
    return np.where(away <= ROUNDING, inside, np.where(away <= WINDOW + ROUNDING, around, 0.0))


def _below(run: Replay, bodies: Sequence[Body], name: str) -> list[int]:
    """Return the numbers of the bodies of the link that carries a table; none where it stands on the floor."""
    table = run.scene.carried_tables.get(name)
    return [] if table is None else [number for number, body in enumerate(bodies) if body.name == table.frame]


def _bodies(bodies: Sequence[Body], name: str) -> list[int]:
    """Return the numbers of the bodies of a hand, a table or an object."""
    return [number for number, body in enumerate(bodies) if body.name == name or name in body.hands]
