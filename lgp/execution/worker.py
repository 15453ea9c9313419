"""The simulated human: does what the page shows, in their own time and way; nobody commands them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lgp.errors import LgpError
from lgp.execution.retarget import Phase, Planner, Spot
from lgp.execution.simulation import SimulatedWorld
from lgp.execution.trajectory import JointTrajectory
from lgp.kinematics.modes import ACTIONS
from lgp.logic.task import Action

CORRECTIONS = 3
"""A hand that missed an object reaches for it this often again."""
SWINGS = 3
"""Waves that the sway of a motion is made of."""


@dataclass(frozen=True)
class WorkerBehaviour:
    """How a person departs from the plan.

    Attributes:
        delay: median time until they begin [s]; spread by a third.
        pace: standard deviation of the logarithm of their pace.
        sway: of each joint on the way [rad]; it vanishes where a motion begins and ends.
        spot: standard deviation of where they put things from where it was planned, in x and y [m].
        help: time after which they pick up what lies on the floor [s].
    """

    delay: float = 0.4
    pace: float = 0.1
    sway: float = 0.015
    spot: float = 0.03
    help: float = 3.0


EXACT = WorkerBehaviour(0.0, 0.0, 0.0, 0.0)
"""Somebody who moves as planned."""


class Worker:
    """A person in a simulated world.

    Args:
        simulation: the world they act in.
        habits: how they depart from the plan.
        rng: of their delays, pace, sway and spots.

    Attributes:
        stuck: whether they do nothing, for trying faults.
    """

    def __init__(self, simulation: SimulatedWorld, habits: WorkerBehaviour, rng: np.random.Generator) -> None:
        self.simulation, self.habits, self.rng = simulation, habits, rng
        self.columns = simulation.world.columns("human")
        self.stuck = False
        self._planner: Planner | None = None
        self._number = -1
        self._segment: JointTrajectory | None = None
        self._next: tuple[Planner, int, Phase] | None = None
        self._floor_since: dict[str, float] = {}

    def told(self, planner: Planner, number: int, phase: Phase) -> None:
        """See the current action and its motion on the page; begin after a while, and after what is in hand is done.

        Args:
            planner: what is followed.
            number: of the action.
            phase: its motion.
        """
        action = self._action()
        if self._segment is not None and action is not None and self._hand(action) and not self.stuck:
            self._next = planner.as_it_is(), number, phase
            return
        # The plan may be replaced by another one while this is still done.
        self._planner, self._number = planner.as_it_is(), number
        spread = np.exp(self.rng.normal(0.0, 0.3))
        self._tries = 0
        self._begin(self._own(phase).segment, self.habits.delay * spread)

    def step(self, time: float) -> None:
        """Write the human's joints of a time [s] into the world, and act on arriving."""
        self._help(time)
        if self._segment is None or self.stuck:
            return
        part = min(max((time - self._start) / self._duration, 0.0), 1.0)
        fade = 1.0 - part**3 * (part * (6.0 * part - 15.0) + 10.0)
        waves = np.sin(np.pi * part * np.arange(1, SWINGS + 1)) @ self._sway
        q = self._segment.at(part * self._segment.duration)[self.columns] + fade * self._offset + waves
        world = self.simulation.world
        self.simulation.q[self.columns] = np.clip(q, world.lower[self.columns], world.upper[self.columns])
        if part >= 1.0:
            self._segment = None
            self._arrive()
            if self._next is not None and self._segment is None:
                waiting, self._next = self._next, None
                self.told(*waiting)

    def _begin(self, segment: JointTrajectory, delay: float) -> None:
        self._segment = segment
        self._start = self.simulation.time + delay
        self._duration = segment.duration * np.exp(self.rng.normal(0.0, self.habits.pace))
        self._offset = self.simulation.q[self.columns] - segment.knots[0][self.columns]
        self._sway = self.rng.normal(0.0, self.habits.sway / SWINGS, (SWINGS, len(self.columns)))

    def _own(self, phase: Phase) -> Phase:
        """Return the motion with the person's own idea of where to put a thing, and to where things truly are."""
        planner, action = self._planner, self._action()
        if planner is None or action is None or not self._hand(action):
            return phase
        spot = None
        if (
            ACTIONS[action.name].attaches_to == "table"
            and self.habits.spot > 0.0
            and not self._joined(action.arguments[1])
        ):
            x, y, yaw = planner.planned_spot(self._number)
            x, y = self.rng.normal((x, y), self.habits.spot)
            spot = Spot(float(x), float(y), yaw)
        if spot is None and not planner.deviations(self._number, self.simulation.view):
            return phase
        return self._again(spot) or phase

    def _joined(self, thing: str) -> bool:
        """Return whether a thing is put beside one that it is to be joined with, which leaves no choice."""
        scene, under = self.simulation.world.scene, self.simulation.view.table_under
        others = [name for joint in scene.assemblies if thing in joint.parts for name in joint.parts if name != thing]
        return any(under(name) not in ("", scene.objects[name].on) for name in others)

    def _arrive(self) -> None:
        """Do with the hand what the action wants of it, or reach again."""
        action = self._action()
        hand = "" if action is None else self._hand(action)
        if action is None or not hand:
            return
        done, kind = True, ACTIONS[action.name]
        if kind.attaches_to == "hand" and not kind.given_by:
            done = self.simulation.take(hand, action.arguments[1])
        elif kind.attaches_to == "table":
            if self.simulation.things[action.arguments[1]].hand == hand:
                self.simulation.put(action.arguments[1])
        elif kind.attaches_to == "hand":
            done = self.simulation.gap(hand, action.arguments[1]) <= self.simulation.view.tolerances.reach
        if not done and self._tries < CORRECTIONS:
            self._tries += 1
            phase = self._again()
            if phase is not None:
                self._begin(phase.segment, self.habits.delay)

    def _again(self, spot: Spot | None = None) -> Phase | None:
        """Return the motion to where things truly are, None if there is none."""
        planner = self._planner
        if planner is None:
            return None
        try:
            scene = planner.scene(self._number, self.simulation.view)
        except LgpError:
            return None
        found = planner.retarget(self._number, scene, self.simulation.q, spot)
        return found if isinstance(found, Phase) else None

    def _help(self, time: float) -> None:
        """Put back what has lain on the floor for a while, onto the table where it lay at first."""
        simulation = self.simulation
        for name, thing in simulation.world.scene.objects.items():
            if simulation.things[name].hand or simulation.view.table_under(name):
                self._floor_since.pop(name, None)
            elif time - self._floor_since.setdefault(name, time) > self.habits.help and not self.stuck:
                simulation.lay(name, thing.on, *thing.at[:2])

    def _action(self) -> Action | None:
        return None if self._planner is None else self._planner.actions[self._number]

    def _hand(self, action: Action) -> str:
        """Return the human hand that takes part in an action, "" if none."""
        hands = self.simulation.world.scene.hands
        return next((name for name in action.arguments if name in hands and hands[name].agent == "human"), "")
