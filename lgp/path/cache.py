"""Warm starts within one search: poses solved before, and the best motion of each set of actions.

A pose depends on the last action, on what its objects are attached to before, and on the number of phases, not on the
order of earlier actions. Sequences of the same actions in another order end in similar motions: the best one is an
initial guess of the others, so that orders are compared by their best motions and not by chance.
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

Occurrence = tuple[str, int]
"""An action as text, and how often it occurred before in its sequence."""


@dataclass(frozen=True)
class CachedPose:
    """A pose (1, nq) [rad, m] that ends `count` phases, its costs without carried loads, and the solver's result."""

    count: int
    pose: Array
    costs: Costs
    result: Result


@dataclass(frozen=True)
class CachedMotion:
    """The best motion of a set of actions: its cost, configurations (nq,) and variables (m,) of every action."""

    cost: float
    keyframes: dict[Occurrence, Array]
    variables: dict[Occurrence, Array]


class WarmStartCache:
    """Poses and motions of the sequences of a scene."""

    def __init__(self, world: World) -> None:
        self.world = world
        self._poses: dict[Hashable, CachedPose] = {}
        self._infeasible: dict[Hashable, str] = {}
        self._best: dict[frozenset[Occurrence], CachedMotion] = {}

    def pose(self, phases: Phases) -> CachedPose | str | None:
        """Return the pose at the end of a sequence, perhaps after another number of phases; or why it is infeasible.

        None where it is not solved yet.
        """
        key = self._key(phases)
        if key in self._infeasible:
            return f"{phases.title(phases.count - 1)}: {self._infeasible[key]}"
        return self._poses.get(key)

    def store_pose(self, phases: Phases, pose: Array, costs: Costs, result: Result) -> CachedPose:
        """Store the pose (1, nq) at the end of a sequence, its costs without loads, and the solver's result."""
        cached = CachedPose(phases.count, pose, costs, result)
        self._poses[self._key(phases)] = cached
        return cached

    def store_infeasible(self, phases: Phases, reason: str) -> None:
        """Store that the last action of a sequence has no pose, whatever the number of phases."""
        self._infeasible[self._key(phases)] = reason.partition(": ")[2] or reason

    def _key(self, phases: Phases) -> Hashable:
        """Return what the constraints on the pose after the last action depend on, and the load in it."""
        last, number = phases.switches[-1], len(phases.switches) - 1
        modes = ModeSequence(self.world, phases.switches)
        parts = tuple(name for name in (last.object_name, last.other) if name)
        parts = tuple(self.world.scene.objects) if last.action.constraints else parts
        before = tuple(
            (modes.attachment(part, number).parent, modes.attachment(part, number).size > 0) for part in parts
        )
        return last, before, tuple(phases.loads()[-1].tolist())

    def store_motion(self, phases: Phases, cost: float, keyframes: Array, variables: Array) -> None:
        """Store the keyframes (K, nq) and variables (nz,) of a sequence unless its actions have a cheaper motion."""
        names = _occurrences(phases)
        cached = self._best.get(frozenset(names))
        if cached is not None and cached.cost <= cost:
            return
        own = _variables_of(ModeSequence(self.world, phases.switches), names)
        self._best[frozenset(names)] = CachedMotion(
            cost,
            dict(zip(names, keyframes[phases.phase_of], strict=True)),
            {name: variables[part] for name, part in own.items()},
        )

    def initial_guess(self, phases: Phases, initial_configuration: Array) -> tuple[Array, Array] | None:
        """Return keyframes (K, nq) and variables (nz,) from the best motion of the same actions, None without one.

        Each limb is where it was at its own actions, interpolated between them in other phases.
        """
        names = _occurrences(phases)
        cached = self._best.get(frozenset(names))
        if cached is None:
            return None
        modes = ModeSequence(self.world, phases.switches)
        keyframes = np.tile(initial_configuration, (phases.count, 1))
        for hand in dict.fromkeys(hand for switch in phases.switches for hand in switch.hands):
            limb = np.flatnonzero(self.world.support(hand))
            acts = [number for number, switch in enumerate(phases.switches) if hand in switch.hands]
            ends = phases.phase_of[acts].tolist()
            values = [initial_configuration[limb], *(cached.keyframes[names[number]][limb] for number in acts)]
            for column, series in zip(limb, np.transpose(values), strict=True):
                keyframes[:, column] = np.interp(np.arange(phases.count), [-1, *ends], series)
        variables = np.zeros(modes.size)
        for name, part in _variables_of(modes, names).items():
            variables[part] = cached.variables[name]
        return keyframes, variables


def _occurrences(phases: Phases) -> list[Occurrence]:
    """Return each action with how often it was done before."""
    seen: Counter[str] = Counter()
    names = []
    for action in phases.actions:
        names.append((str(action), seen[str(action)]))
        seen[str(action)] += 1
    return names


def _variables_of(modes: ModeSequence, names: Sequence[Occurrence]) -> dict[Occurrence, slice]:
    """Return the variables that each action adds."""
    sides = {name: modes.contact(number) for number, name in enumerate(names)}
    return {name: contact[0].variables for name, contact in sides.items() if contact is not None}
