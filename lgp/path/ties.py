"""Slices that are equal for some joints: limbs rest after an action, hands that hold stand still until the next one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lgp.path.phases import Phases
from lgp.world.model import World
from lgp.world.switches import Modes

Slices = NDArray[np.intp]
Pair = tuple[int, int]


def ties(
    world: World, phases: Phases, modes: Modes, limbs: dict[int, Slices], kept: Slices
) -> tuple[dict[Pair, Slices], dict[Pair, Slices]]:
    """Return pairs of slices (first, second) -> joints that are equal in both: pairs of kept slices, and others.

    In every other pair the first slice is kept and the second is not.

    Args:
        world: the kinematics.
        phases: the sequence.
        modes: its attachments.
        limbs: switch whose rows are kept -> joints that rest after it.
        kept: (P,) slices that are unknowns, rising.
    """
    known = {int(slice_) for slice_ in kept}
    horizon = int(kept[-1]) + 1
    joints: dict[Pair, set[int]] = {}
    for number, limb in limbs.items():
        key = int(phases.keys[number])
        if key + 1 < horizon:
            joints.setdefault((key, key + 1), set()).update(limb.tolist())
    for hand, number, end in modes.stills:
        if number not in limbs:
            continue
        standing = np.flatnonzero(world.support(hand)).tolist()
        first = int(phases.keys[number])
        for second in range(first + 1, min(int(phases.keys[end]) + 1, horizon)):
            joints.setdefault((first, second), set()).update(standing)
            first = second if second in known else first
    found: tuple[dict[Pair, Slices], dict[Pair, Slices]] = {}, {}
    for pair in sorted(joints):
        found[pair[1] not in known][pair] = np.array(sorted(joints[pair]), dtype=np.intp)
    return found
