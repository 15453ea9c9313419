"""The simulated human: does what the page shows, in their own time and way; nobody commands them."""

from __future__ import annotations

import copy
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lgp.errors import LgpError
from lgp.execution.planner import Phase, Planner
from lgp.execution.segment import Segment
from lgp.execution.simulation import SimulatedWorld
from lgp.logic import Action
from lgp.world.scene import Scene
from lgp.world.scene_file import read_scene

Array = NDArray[np.float64]

CORRECTIONS = 3
"""A hand that missed an object reaches for it this often again."""
SWINGS = 3
"""Waves that the sway of a motion is made of."""
SPOT = 0.01
"""[m] Size of the top that stands for one spot on a table."""


@dataclass(frozen=True)
class Habits:
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


EXACT = Habits(0.0, 0.0, 0.0, 0.0)
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

    def __init__(self, simulation: SimulatedWorld, habits: Habits, rng: np.random.Generator) -> None:
        self.simulation, self.habits, self.rng = simulation, habits, rng
        self.columns = simulation.world.columns("human")
        self.stuck = False
        self._planner: Planner | None = None
        self._number = -1
        self._segment: Segment | None = None
        self._floor_since: dict[str, float] = {}

    def told(self, planner: Planner, number: int, phase: Phase) -> None:
        """See the current action and its motion on the page; begin after a while.

        Args:
            planner: what is followed.
            number: of the action.
            phase: its motion.
        """
        self._planner, self._number = planner, number
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
            self._arrive(time)

    def _begin(self, segment: Segment, delay: float) -> None:
        self._segment = segment
        self._start = self.simulation.time + delay
        self._duration = segment.duration * np.exp(self.rng.normal(0.0, self.habits.pace))
        self._offset = self.simulation.q[self.columns] - segment.knots[0][self.columns]
        self._sway = self.rng.normal(0.0, self.habits.sway / SWINGS, (SWINGS, len(self.columns)))

    def _own(self, phase: Phase) -> Phase:
        """Return the motion with the person's own idea of where to put a thing."""
        action = self._action()
        if action is None or action.name != "place" or self._hand(action) == "" or self.habits.spot <= 0.0:
            return phase
        thing, table = action.arguments[1:3]
        try:
            there = self._planner.scene(self._number, self.simulation.view) if self._planner is not None else None
        except LgpError:
            there = None
        return phase if there is None else self._again(self._around(there, action, phase, thing, table)) or phase

    def _arrive(self, time: float) -> None:
        """Do with the hand what the action wants of it, or reach again."""
        action = self._action()
        hand = "" if action is None else self._hand(action)
        if action is None or not hand:
            return
        done = True
        if action.name == "grasp":
            done = self.simulation.take(hand, action.arguments[1])
        elif action.name == "place":
            if self.simulation.things[action.arguments[1]].hand == hand:
                self.simulation.put(action.arguments[1])
        elif action.name == "handover":
            done = self.simulation.gap(hand, action.arguments[1]) <= self.simulation.view.tolerances.reach
        if not done and self._tries < CORRECTIONS:
            self._tries += 1
            phase = self._again(None)
            if phase is not None:
                self._begin(phase.segment, self.habits.delay)

    def _again(self, scene: Scene | None) -> Phase | None:
        """Return the motion to where things truly are, None if there is none."""
        if self._planner is None:
            return None
        try:
            there = self._planner.scene(self._number, self.simulation.view) if scene is None else scene
        except LgpError:
            return None
        found = self._planner.retarget(self._number, there, self.simulation.q)
        return found if isinstance(found, Phase) else None

    def _around(self, scene: Scene, action: Action, phase: Phase, thing: str, table: str) -> Scene:
        """Return the scene in which a table is only as large as the spot where the person puts a thing.

        The spot lies around the one where the given motion puts it.
        """
        values = copy.deepcopy(dict(scene.values))
        key = table.partition(".")[2]
        top = scene.tables[table]
        at = self.simulation.things[thing]
        end = self.simulation.world.at(phase.segment.knots[-1:], [action.arguments[0]])
        goal = end.position[0, 0] + end.rotation[0, 0] @ at.position
        yaw = np.radians(top.yaw)
        turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
        spot = turn.T @ (goal[:2] - np.array(top.position)) + self.rng.normal(0.0, self.habits.spot, 2)
        room = np.array(top.size) / 2.0 - min(scene.things[thing].size[:2]) / 2.0
        centre = np.array(top.position) + turn @ np.clip(spot, -np.maximum(room, 0.0), np.maximum(room, 0.0))
        values["tables"][key] |= {"position": centre.tolist(), "size": [SPOT, SPOT]}
        for other in values["objects"].values():
            if other["on"] == table:
                other["at"] = [0.0, 0.0, 0.0]
        return read_scene(values, scene.name)

    def _help(self, time: float) -> None:
        """Put back what has lain on the floor for a while, onto the table where it lay at first."""
        simulation = self.simulation
        for name, thing in simulation.world.scene.things.items():
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
