"""Links of one robot that are never checked against each other, because they are joined.

So are links that are in each other in `DRAWN` of all positions of the robot, or in one of them where no third body is
between, and the jaws of one hand: what a URDF draws there is no measure of distance. All others are checked; those that
are nearer than `NEAR` in as many positions keep no margin.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from lgp.collision.shapes import CollisionShape
from lgp.kinematics.world import World
from reba.arrays import Array, Indices

NEAR: Final = 0.01
"""[m] Margin of collision constraints."""
DRAWN: Final = 0.5
"""Share of the positions in which links are in each other that are joined."""
POSITIONS: Final = 200
"""Random positions that decide it."""
AT_ONCE: Final = 20
"""Of so many positions distances are computed before it is looked at which pairs are decided."""

Pair = tuple[int, int]
Nearer = Callable[[Sequence[Pair], Array], tuple[Indices, Indices, Callable[[Indices], Array]]]


@dataclass(frozen=True)
class JoinedLinks:
    """The names of links of one robot, two each: those that are joined, and those that are close without it."""

    joined: frozenset[frozenset[str]]
    close: frozenset[frozenset[str]]


_KNOWN: dict[tuple[str, bytes], JoinedLinks] = {}
"""By agents, bodies and joint limits: the tables and objects of a world change nothing."""
MOST_KNOWN: Final = 64
"""Agents that are remembered; the first are forgotten first."""


def joined_links(world: World, shapes: Sequence[CollisionShape], nearer: Nearer) -> JoinedLinks:
    """Return which links of one robot are joined.

    Args:
        nearer: (pairs of shapes, configurations (n, nq)) -> near rows (m,) and the function that gives their distances.
    """
    links = [number for number, shape in enumerate(shapes) if _of_robot(world, shape)]
    # A file of a robot may have changed since it was read, so its bodies are part of the key, not its path alone.
    bodies = [(shapes[number].name, *(part.tolist() for part in _geometry(shapes[number]))) for number in links]
    key = repr((world.scene.agents, bodies)), np.concatenate([world.lower, world.upper]).tobytes()
    if key not in _KNOWN:
        pairs = [
            (one, other)
            for at, one in enumerate(links)
            for other in links[at + 1 :]
            if shapes[one].owner == shapes[other].owner and "link" in (shapes[one].kind, shapes[other].kind)
        ]
        low, high = np.maximum(world.lower, -np.pi), np.minimum(world.upper, np.pi)
        positions = np.random.default_rng(0).uniform(low, high, (POSITIONS, world.nq))
        beside = _next_to_each_other(world, [shapes[number] for number in links])
        names = [(shapes[one].name, shapes[other].name) for one, other in pairs]
        enough = np.array([1 if beside(*pair) else DRAWN * POSITIONS for pair in names])
        meet, near = _counts(*nearer(pairs, positions), enough) if pairs else (np.zeros(0, np.intp),) * 2
        joined = {frozenset(pair) for pair, is_so in zip(names, meet >= enough, strict=True) if is_so}
        close = {frozenset(pair) for pair, most in zip(names, near, strict=True) if most >= DRAWN * POSITIONS}
        if len(_KNOWN) == MOST_KNOWN:
            del _KNOWN[next(iter(_KNOWN))]
        _KNOWN[key] = JoinedLinks(frozenset(joined | _jaws(shapes)), frozenset(close - joined))
    return _KNOWN[key]


def _geometry(shape: CollisionShape) -> tuple[Array, ...]:
    return shape.rotation, shape.position, shape.half, np.array(shape.rim)


def _counts(
    positions: Indices, pairs: Indices, distances: Callable[[Indices], Array], enough: Array
) -> tuple[Indices, Indices]:
    """Return in how many positions each pair is in each other and nearer than `NEAR`, as far as it decides something.

    Args:
        positions, pairs: (m,) of the rows that may be nearer.
        distances: (k,) of some rows [m].
        enough: of each pair, positions in each other in which it is joined.
    """
    count = len(enough)
    meet, near, left = np.zeros(count, np.intp), np.zeros(count, np.intp), np.bincount(pairs, minlength=count)
    for first in range(0, POSITIONS, AT_ONCE):
        open_ = (meet < enough) & (meet + left >= enough) | (meet < enough) & (near + left >= DRAWN * POSITIONS)
        now = np.flatnonzero((positions >= first) & (positions < first + AT_ONCE))
        left -= np.bincount(pairs[now], minlength=count)
        now = now[open_[pairs[now]]]
        value = distances(now)
        meet += np.bincount(pairs[now[value < 0.0]], minlength=count)
        near += np.bincount(pairs[now[value < NEAR]], minlength=count)
    return meet, near


def _jaws(shapes: Sequence[CollisionShape]) -> set[frozenset[str]]:
    jaws = [(shape.name, shape.jaw.hand) for shape in shapes if shape.jaw is not None]
    return {frozenset((one, other)) for one, hand in jaws for other, same in jaws if hand == same}


def _of_robot(world: World, shape: CollisionShape) -> bool:
    return shape.owner in world.scene.robots and shape.kind in ("link", "base")


def _next_to_each_other(world: World, links: Sequence[CollisionShape]) -> Callable[[str, str], bool]:
    """Return whether two links have no third body between them."""
    model, by_name = world.model, {link.name: link for link in links}
    chains = {
        link.name: [str(model.names[joint]) for joint in model.supports[model.getJointId(link.frame)][1:]]
        if link.frame
        else []
        for link in links
    }
    carrying = {link.frame for link in links}

    def beside(one: str, other: str) -> bool:
        first, second = by_name[one], by_name[other]
        shared = sum(a == b for a, b in zip(chains[one], chains[other], strict=False))
        # Down from where the chains part: the joint that both have carries a body between them, too.
        parting = chains[one][shared - 1 : shared] or [""]
        between = {*parting, *chains[one][shared:], *chains[other][shared:]}
        return not (between & carrying) - {first.frame, second.frame}

    return beside
