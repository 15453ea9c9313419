"""Actions -> phases: which object is attached to what in which slices, and the keyframes of the switches.

Action k ends a phase: its kinematic switch happens in the last slice of that phase, `keyframes[k]`. Actions that are
`together` end the same one, all others one each. Slices count from 0; before the first one all agents rest in the
initial configuration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lgp.errors import LgpError
from lgp.kinematics.actions import kind_of, registered_actions
from lgp.kinematics.modes import KinematicSwitch
from lgp.logic.task import Action
from lgp.scene.model import Scene
from reba.arrays import Array, Indices


@dataclass(frozen=True)
class Phases:
    """A sequence of actions laid out in time, each with its kinematic switch.

    Attributes:
        slices: per phase.
        seconds: duration of each phase [s] unless it has its own.
        durations: of each phase [s], () where all take `seconds`.

    Example:
        >>> from lgp.scene.scene_file import load_scene
        >>> Phases.of(load_scene("screwdriver"), []).total
        0
    """

    scene: Scene
    actions: tuple[Action, ...]
    switches: tuple[KinematicSwitch, ...]
    slices: int
    seconds: float
    durations: tuple[float, ...] = ()

    @staticmethod
    def of(
        scene: Scene, actions: Sequence[Action], slices: int | None = None, durations: Sequence[float] = ()
    ) -> Phases:
        """Return the phases of a sequence of ground actions.

        Args:
            slices: per phase, at least 2; those of the scene by default.
            durations: of each phase [s]; those of the scene by default.

        Raises:
            LgpError: an action has no geometry, or there are too few slices.
        """
        chosen = scene.slices if slices is None else slices
        if chosen < 2:
            raise LgpError(f"{chosen} slices per phase given, expected 2 or more")
        switches = tuple(switch_of(action) for action in actions)
        return Phases(scene, tuple(actions), switches, chosen, scene.phase_seconds, tuple(map(float, durations)))

    @cached_property
    def count(self) -> int:
        """Number of phases K; there are A actions."""
        return sum(not action.together for action in self.actions)

    @cached_property
    def phase_of(self) -> Indices:
        """Number of the phase that each action ends, (A,)."""
        return np.cumsum([not action.together for action in self.actions], dtype=np.intp) - 1

    @cached_property
    def switched(self) -> Indices:
        """Number of actions before each phase, (K,): the number of its first action, and of its modes."""
        return np.flatnonzero([not action.together for action in self.actions])

    @property
    def total(self) -> int:
        """Number of slices."""
        return self.count * self.slices

    @property
    def tau(self) -> float:
        """Time between slices [s] of a phase of `seconds`."""
        return self.seconds / self.slices

    @property
    def phase_durations(self) -> Array:
        """Duration of each phase [s], (K,)."""
        return np.array(self.durations) if self.durations else np.full(self.count, self.seconds)

    @property
    def steps(self) -> Array:
        """Time from the slice before to each slice [s], (T,)."""
        return np.repeat(self.phase_durations / self.slices, self.slices)

    @property
    def ends(self) -> Indices:
        """Last slice of each phase (K,)."""
        return (np.arange(self.count) + 1) * self.slices - 1

    @property
    def keyframes(self) -> Indices:
        """Slices in which the switches happen (A,)."""
        return self.ends[self.phase_of]

    def times(self) -> Array:
        """Return the time of each slice [s], (T,)."""
        if not self.durations:
            return np.asarray((np.arange(self.total) + 1) * self.tau, dtype=np.float64)
        return np.cumsum(self.steps)

    def loads(self) -> Array:
        """Return the mass in the hands of each of the H persons in each slice [kg], (T, H)."""
        held = {name: part.hand for name, part in self.scene.objects.items() if part.hand}
        people = {name: at for at, name in enumerate(self.scene.humans)}
        masses = np.zeros((self.count, len(people)))
        for number, (phase, switch) in enumerate(zip(self.phase_of, self.switches, strict=True)):
            for name, hand in held.items() if number in self.switched else ():
                if self.scene.hands[hand].human:
                    masses[phase, people[self.scene.hands[hand].agent]] += self.scene.objects[name].mass
            if switch.action.attaches_to == "hand":
                held[switch.object_name] = switch.hand
            elif switch.action.attaches_to == "table":
                held.pop(switch.object_name, None)
        return np.repeat(masses, self.slices, axis=0)

    @property
    def action_cost(self) -> float:
        """What the actions cost in the PDDL domain."""
        return sum(action.cost for action in self.actions)

    def label(self, number: int) -> str:
        """Return an action as the paper prints it, with the number of its phase from 1."""
        return self.actions[number].at(int(self.phase_of[number]) + 1)

    def title(self, phase: int) -> str:
        """Return a phase with its number from 1 and its actions: `phase 1, grasp(1, baxter.right, box)`."""
        actions = " and ".join(self.label(number) for number in np.flatnonzero(self.phase_of == phase).tolist())
        return f"phase {phase + 1}, {actions}"


def switch_of(action: Action) -> KinematicSwitch:
    """Return the kinematic switch that an action implies.

    Raises:
        LgpError: no geometry is known for its name or number of arguments.
    """
    kind = kind_of(action.name)
    if kind is not None and len(kind.roles) != len(action.arguments):
        raise LgpError(
            f"action {action} has {len(action.arguments)} arguments, expected {action.name}({kind.signature}), as its "
            "geometry says; give its PDDL action these parameters in this order, or another name and its own record"
        )
    if kind is None:
        known = "; ".join(f"{name}({one.signature})" for name, one in registered_actions().items())
        raise LgpError(
            f"action {action} has no geometry; expected one of {known}; register yours with "
            "lgp.register_action, or give its file with --extension"
        )
    return KinematicSwitch.of(action.name, kind.roles, action.arguments)
