"""What solved problems tell about others of one search: poses that are asked for again, and where to start from.

A pose depends on the last action, on what has its objects before, and on the number of phases, not on the order of what
came before. Sequences of the same actions in another order end in similar motions: the best one found is where the
others start as well, so that orders are compared by their best motions and not by luck.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import World
from lgp.path.costs import Costs
from lgp.path.phases import Phases
from lgp.sqp.result import Result
from reba.arrays import Array

Key = tuple[str, int]


@dataclass(frozen=True)
class CachedPose:
    """A pose (1, nq) that ends `count` phases, its costs without carried loads, and what the solver said."""

    count: int
    pose: Array
    costs: Costs
    result: Result


@dataclass(frozen=True)
class CachedMotion:
    """The best motion of a set of actions: its cost, configurations (nq,) and variables (m,) of every action."""

    cost: float
    keys: dict[Key, Array]
    variables: dict[Key, Array]


class WarmStartCache:
    """What is known of the sequences of a scene.

    Args:
        world: the kinematics.
    """

    def __init__(self, world: World) -> None:
        self.world = world
        self._poses: dict[Hashable, CachedPose] = {}
        self._refused: dict[Hashable, str] = {}
        self._best: dict[frozenset[Key], CachedMotion] = {}

    def pose(self, phases: Phases) -> CachedPose | str | None:
        """Return the pose at the end of a sequence, or the same after another number of phases, or why there is none.

        None if nothing is known.
        """
        key = self._key(phases)
        if key in self._refused:
            return f"phase {phases.count}, {phases.label(phases.count - 1)}: {self._refused[key]}"
        return self._poses.get(key)

    def note(self, phases: Phases, pose: Array, costs: Costs, result: Result) -> CachedPose:
        """Remember the pose (1, nq) at the end of a sequence, its costs without loads, and what the solver said."""
        found = CachedPose(phases.count, pose, costs, result)
        self._poses[self._key(phases)] = found
        return found

    def refuse(self, phases: Phases, why: str) -> None:
        """Remember that the last action of a sequence has no pose: no number of phases changes that."""
        self._refused[self._key(phases)] = why.partition(": ")[2] or why

    def _key(self, phases: Phases) -> Hashable:
        """Return what the constraints on the pose after the last action depend on, and the load in it."""
        last, number = phases.switches[-1], phases.count - 1
        modes = ModeSequence(self.world, phases.switches)
        parts = (last.object_name, last.other) if last.other else (last.object_name,)
        before = tuple(
            (modes.attachment(part, number).parent, modes.attachment(part, number).size > 0) for part in parts
        )
        return last, before, float(phases.loads()[-1])

    def keep(self, phases: Phases, cost: float, keys: Array, variables: Array) -> None:
        """Remember the configurations (K, nq) and variables (nz,) of a solved sequence if none was better."""
        names = _names(phases)
        known = self._best.get(frozenset(names))
        if known is not None and known.cost <= cost:
            return
        own = _own(ModeSequence(self.world, phases.switches), names)
        self._best[frozenset(names)] = CachedMotion(
            cost, dict(zip(names, keys.copy(), strict=True)), {name: variables[part] for name, part in own.items()}
        )

    def start(self, phases: Phases, first: Array) -> tuple[Array, Array] | None:
        """Return configurations (K, nq) and variables (nz,) from the best motion of the same actions, None without one.

        Each limb is where it was at its own actions, and on the way between them in other phases.

        Args:
            phases: the sequence.
            first: (nq,) configuration before it.
        """
        names = _names(phases)
        known = self._best.get(frozenset(names))
        if known is None:
            return None
        modes = ModeSequence(self.world, phases.switches)
        keys = np.tile(first, (phases.count, 1))
        for hand in dict.fromkeys(hand for switch in phases.switches for hand in switch.hands):
            limb = np.flatnonzero(self.world.support(hand))
            acts = [number for number, switch in enumerate(phases.switches) if hand in switch.hands]
            values = [first[limb], *(known.keys[names[number]][limb] for number in acts)]
            for column, series in zip(limb, np.transpose(values), strict=True):
                keys[:, column] = np.interp(np.arange(phases.count), [-1, *acts], series)
        variables = np.zeros(modes.size)
        for name, part in _own(modes, names).items():
            variables[part] = known.variables[name]
        return keys, variables


def _names(phases: Phases) -> list[Key]:
    """Return each action with how often it was done before."""
    seen: Counter[str] = Counter()
    names = []
    for action in phases.actions:
        names.append((str(action), seen[str(action)]))
        seen[str(action)] += 1
    return names


def _own(modes: ModeSequence, names: Sequence[Key]) -> dict[Key, slice]:
    """Return the variables that each action brought."""
    sides = {name: modes.contact(number) for number, name in enumerate(names)}
    return {name: found[0].variables for name, found in sides.items() if found is not None}
