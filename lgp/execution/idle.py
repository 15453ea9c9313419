"""What arms without a part in an action do meanwhile: hands that hold stand still, robot arms move as planned."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lgp.execution.pinned import Course
from lgp.world.model import World
from lgp.world.switches import Modes

Array = NDArray[np.float64]

OFF = 0.02
"""[rad] An arm with a joint farther from the plan than this does not move as planned."""


def still_hands(modes: Modes, number: int) -> tuple[str, ...]:
    """Return the hands that stand still during an action, as they hold a part until their next action.

    Args:
        modes: of the whole sequence.
        number: of the action.
    """
    found = [hand for hand, since, end in modes.stills if since < number <= end]
    found += [hand for hand, _, end in modes.held_at_first if number <= end]
    return tuple(dict.fromkeys(found))


def planned_course(world: World, first: Array, planned: Array, hands: Sequence[str]) -> Course:
    """Return the planned motion of those robot arms that have no part in an action and start as planned.

    An arm moves as planned as a whole or not at all: some of its joints alone would take the hand anywhere.

    Args:
        world: the kinematics.
        first: (nq,) present configuration.
        planned: (slices + 1, nq) planned motion of the action.
        hands: that have a part in the action or stand still.
    """
    off = np.abs(first - planned[0]) >= OFF
    busy, moving = _columns(world, hands), np.zeros(world.nq, bool)
    for robot in world.scene.robots:
        own = np.zeros(world.nq, bool)
        own[world.columns(robot)] = True
        arms = [_columns(world, [name]) & own for name, hand in world.scene.hands.items() if hand.agent == robot]
        rest = own & ~np.any(arms, axis=0) if arms else own
        for part in (*arms, rest):
            part = part & ~busy
            moving |= part & (not np.any(off & part))
    columns = np.flatnonzero(moving)
    return Course(columns, planned[1:, columns])


def _columns(world: World, hands: Sequence[str]) -> NDArray[np.bool_]:
    """Return (nq,) which joints move any of some hands."""
    return np.asarray(np.sum([np.zeros(world.nq), *map(world.support, hands)], axis=0) > 0.0)
