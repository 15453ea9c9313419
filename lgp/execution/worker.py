"""Simulated persons: each acts as the page shows, with delays, pace, sway and placements of their own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lgp.errors import LgpError
from lgp.execution.fixed_path import holding_hands
from lgp.execution.retarget import ActionMotion, Planner, TablePose
from lgp.execution.simulation import GRASP, SimulatedWorld
from lgp.execution.trajectory import JointTrajectory
from lgp.logic.task import Action
from lgp.path.phases import switch_of
from reba.arrays import Flags

CORRECTIONS = 3
"""Number of further attempts of a hand that missed an object."""
SWAY_WAVES = 3
"""Number of sine waves, of 1, 2 ... half periods, in the sway of a motion."""


@dataclass(frozen=True)
class WorkerBehaviour:
    """Deviations of a person from the plan.

    Attributes:
        delay: median reaction time [s]; its logarithm has a standard deviation of 0.3.
        pace: standard deviation of the logarithm of the duration of a motion.
        sway: standard deviation of each joint on the way [rad]; zero at both ends of a motion.
        placement: standard deviation of placements from the planned ones, in x and y [m].
        help: time after which an object on the floor is put back [s].
    """

    delay: float = 0.4
    pace: float = 0.1
    sway: float = 0.015
    placement: float = 0.03
    help: float = 3.0


EXACT = WorkerBehaviour(0.0, 0.0, 0.0, 0.0)
"""A person who moves as planned, without delay."""


class Worker:
    """A person in a simulated world.

    Args:
        name: of the person in the scene.

    Attributes:
        stuck: they do not move, see the fault of that name.
        moving: whether a motion is under way.
        others: the other persons.
    """

    def __init__(
        self, simulation: SimulatedWorld, name: str, behaviour: WorkerBehaviour, rng: np.random.Generator
    ) -> None:
        self.simulation, self.name, self.behaviour, self.rng = simulation, name, behaviour, rng
        self.columns = simulation.world.columns(name)
        self.stuck = self.moving = False
        self.others: tuple[Worker, ...] = ()
        self._planner: Planner | None = None
        self._number = -1
        self._displayed: Action | None = None
        self._trajectory: JointTrajectory | None = None
        self._next: tuple[Planner, int, ActionMotion] | None = None
        self._floor_since: dict[str, float] = {}

    def on_action(self, planner: Planner, number: int, phase: ActionMotion) -> None:
        """React to the current action on the page, after an action of their own that is under way.

        Of those that happen at the same time it is their own.
        """
        number = next((one for one in planner.step(number) if self._hand(planner.actions[one])), number)
        action, self._displayed = self._action(), planner.actions[number]
        if self._trajectory is not None and action is not None and self._hand(action) and not self.stuck:
            self._next = planner.snapshot(), number, phase
            return
        # The plan may be replaced before this action ends.
        self._planner, self._number = planner.snapshot(), number
        spread = np.exp(self.rng.normal(0.0, 0.3))
        self._tries = 0
        self._begin(self._own(phase).trajectory, self.behaviour.delay * spread)

    def step(self, time: float) -> None:
        """Write the joints of the person at a time [s] into the simulation; take or release at the end of a motion."""
        self._help(time)
        if self.stuck:
            return
        self._catch()
        if self._trajectory is None:
            return
        part = min(max((time - self._start) / self._duration, 0.0), 1.0)
        self.moving = part < 1.0
        fade = 1.0 - part**3 * (part * (6.0 * part - 15.0) + 10.0)
        waves = np.sin(np.pi * part * np.arange(1, SWAY_WAVES + 1)) @ self._sway
        q = self._trajectory.at(part * self._trajectory.duration)[self.columns] + fade * self._offset + waves
        world = self.simulation.world
        self.simulation.q[self.columns] = np.clip(q, world.lower[self.columns], world.upper[self.columns])
        if not self.moving and not self._others_move():
            self._trajectory = None
            self._arrive()
            if self._next is not None and self._trajectory is None:
                waiting, self._next = self._next, None
                self.on_action(*waiting)

    def _begin(self, trajectory: JointTrajectory, delay: float) -> None:
        self._trajectory, self.moving = trajectory, True
        self._start = self.simulation.time + delay
        self._duration = trajectory.duration * np.exp(self.rng.normal(0.0, self.behaviour.pace))
        self._offset = self.simulation.q[self.columns] - trajectory.knots[0][self.columns]
        sways = self.rng.normal(0.0, self.behaviour.sway / SWAY_WAVES, (SWAY_WAVES, len(self.columns)))
        self._sway = np.where(self._holding_columns(), 0.0, sways)

    def _own(self, phase: ActionMotion) -> ActionMotion:
        """Return the motion to the true poses of the objects, with a placement that deviates from the plan."""
        planner, action = self._planner, self._action()
        if planner is None or action is None or not self._hand(action) or self._other_hands():
            return phase  # where the person and another agent meet, they do so where the motion says
        target = None
        if (
            switch_of(action).action.attaches_to == "table"
            and self.behaviour.placement > 0.0
            and not self._joined(switch_of(action).object_name)
        ):
            x, y, yaw = planner.planned_placement(self._number)
            x, y = self.rng.normal((x, y), self.behaviour.placement)
            target = TablePose(float(x), float(y), yaw)
        if target is None and not planner.deviations(self._number, self.simulation.view):
            return phase
        return self._retargeted(target) or phase

    def _joined(self, object_name: str) -> bool:
        """Return whether a part is placed beside the one that it is joined with: its placement is then exact."""
        scene, under = self.simulation.world.scene, self.simulation.view.table_under
        others = [
            name
            for joint in scene.assemblies
            if object_name in joint.parts
            for name in joint.parts
            if name != object_name
        ]
        return any(under(name) not in ("", scene.objects[name].on) for name in others)

    def _arrive(self) -> None:
        """Take or release the object of the action, or reach for it again."""
        action = self._action()
        if action is None or not self._hand(action):
            return
        switch, simulation = switch_of(action), self.simulation
        name, done = switch.object_name, True
        if switch.action.attaches_to == "hand":
            done = simulation.gap(switch.hand, name) <= GRASP
            if done and self._is_own(switch.hand) and simulation.objects[name].hand not in simulation.robots.closed:
                simulation.take(switch.hand, name)
        elif switch.action.attaches_to == "table" and simulation.objects[name].hand == switch.hand:
            simulation.put(name)
        if not done and self._next is None and self._tries < CORRECTIONS:
            self._tries += 1
            phase = self._retargeted()
            if phase is not None:
                self._begin(phase.trajectory, self.behaviour.delay)

    def _retargeted(self, target: TablePose | None = None) -> ActionMotion | None:
        """Return the motion to the true poses of the objects, None if there is none."""
        planner = self._planner
        if planner is None:
            return None
        try:
            scene = planner.scene(self._number, self.simulation.view)
        except LgpError:
            return None
        phase = planner.retarget(self._number, scene, self.simulation.q, target, still=self._other_hands())
        return phase if isinstance(phase, ActionMotion) else None

    def _catch(self) -> None:
        """Take the object of the action on the page from a gripper that has opened."""
        action, simulation = self._displayed, self.simulation
        if action is None or not self._hand(action):
            return
        switch = switch_of(action)
        giver = simulation.objects[switch.object_name].hand
        by_gripper = giver and not simulation.world.scene.hands[giver].human
        opened = by_gripper and giver not in simulation.robots.closed
        if opened and switch.action.attaches_to == "hand" and self._is_own(switch.hand):
            simulation.take(switch.hand, switch.object_name)

    def _help(self, time: float) -> None:
        """Put objects that have lain on the floor for a while back onto the table of the initial scene."""
        simulation = self.simulation
        for name, scene_object in simulation.world.scene.objects.items():
            if simulation.objects[name].hand or simulation.view.table_under(name) or not simulation.world.scene.tables:
                self._floor_since.pop(name, None)
            elif time - self._floor_since.setdefault(name, time) > self.behaviour.help and not self.stuck:
                table = scene_object.on or next(iter(simulation.world.scene.tables))
                simulation.lay(name, table, *scene_object.at[:2])

    def _action(self) -> Action | None:
        return None if self._planner is None else self._planner.actions[self._number]

    def _hand(self, action: Action) -> str:
        """Return the hand of the person that takes part in an action, "" if none."""
        return next(filter(self._is_own, action.arguments), "")

    def _is_own(self, name: str) -> bool:
        hands = self.simulation.world.scene.hands
        return name in hands and hands[name].agent == self.name

    def _holding_columns(self) -> Flags:
        """Return which of the columns move a hand that holds a part still."""
        world, modes = self.simulation.world, None if self._planner is None else self._planner.motion.modes
        hands = () if modes is None else holding_hands(modes, self._number)
        supports = [world.support(hand)[self.columns] > 0.0 for hand in hands if self._is_own(hand)]
        return np.any([np.zeros(len(self.columns), bool), *supports], axis=0)

    def _other_hands(self) -> tuple[str, ...]:
        """Return the hands of other agents that take part in the action."""
        action, hands = self._action(), self.simulation.world.scene.hands
        names = () if action is None else action.arguments
        return tuple(name for name in names if name in hands and not self._is_own(name))

    def _others_move(self) -> bool:
        """Return whether a robot or another person is still on its way to the person."""
        hands = self.simulation.world.scene.hands
        agents = {hands[name].agent for name in self._other_hands()}
        robots = agents & set(self.simulation.world.scene.robots)
        persons = [one for one in self.others if one.name in agents]
        return bool(robots and np.any(self.simulation.robots.speed != 0.0)) or any(one.moving for one in persons)


def workers(simulation: SimulatedWorld, behaviour: WorkerBehaviour, rng: np.random.Generator) -> tuple[Worker, ...]:
    """Return a worker for each person of a scene."""
    names = tuple(simulation.world.scene.humans)
    rngs = [rng, *rng.spawn(max(len(names) - 1, 0))]
    every = tuple(Worker(simulation, name, behaviour, own) for name, own in zip(names, rngs, strict=False))
    for worker in every:
        worker.others = tuple(one for one in every if one is not worker)
    return every
