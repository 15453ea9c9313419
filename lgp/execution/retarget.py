"""Motions that fit the world as it is: one phase moved to where things are, or the whole rest planned anew.

Moving one phase is the greedy re-targeting of Busch, Toussaint & Lopes (2018), section IV.B: a path problem of one
action from the present configuration, with every object at its tracked pose. It may be worse than a new plan, as the
order of actions stays.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import dreba
from lgp.errors import LgpError
from lgp.execution.fixed_path import FixedPathBounds, holding_hands, planned_course
from lgp.execution.replan import brought, plan_rest
from lgp.execution.tracked_scene import atoms_now, carrier, in_hand, on_table, scene_now
from lgp.execution.tracking import TrackedPose, TrackedWorld
from lgp.execution.trajectory import JointTrajectory, robot_columns, time_scaled
from lgp.kinematics.attachments import resting
from lgp.kinematics.features import logarithm
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import World
from lgp.logic.task import Action, Atom
from lgp.motion import Motion
from lgp.path.ergonomics import Ergonomics
from lgp.path.ergonomics import Ergonomics as Cost
from lgp.path.keyframes import Solution
from lgp.plan_record import Plan
from lgp.planner import COST, task_of
from lgp.scene.model import Scene
from reba.arrays import Array, Indices

TOUCH = 1e-3
"""[m] Bodies that reach deeper into each other were not kept apart."""
HASTY = 2.0
"""A motion that robots must slow down by more is a detour of the solver: other ways are tried."""


class Spot(NamedTuple):
    """A place on the top of a table: x, y [m], yaw [rad]."""

    x: float
    y: float
    yaw: float


@dataclass(frozen=True)
class Phase:
    """The motion of one action.

    Attributes:
        segment: configurations of everybody over time; those of the human are a guess.
        cost: of a path that was made anew, on the scale of the plan; None for the planned one.
        scene: the world that it was made for; None for the planned one.
        solution: of its path problem; None for the planned one.
    """

    segment: JointTrajectory
    cost: float | None = None
    scene: Scene | None = None
    solution: Solution | None = None


class Planner:
    """Everything that is planned during a run.

    Args:
        plan: what is followed.
        cost: dREBA model of new motions, None without ergonomics; that of `lgp plan` where the plan has ergonomics.

    Attributes:
        plan, motion: what is followed, and as moving things.
        task: its symbolic task.
        apart: whether bodies are kept apart.
        states: what holds before each action and after the last, as bits of the task.
    """

    def __init__(self, plan: Plan, cost: str | Path | None = COST) -> None:
        self._cost = cost if plan.costs.get("ergonomics", 0.0) > 0.0 else None
        self._prepared: Ergonomics | None = None
        # A plan whose bodies touch was made without keeping them apart; new motions then do not either.
        self.apart = plan.residuals.get("penetration", 0.0) <= TOUCH
        self.use(Motion(plan))

    def use(self, motion: Motion) -> None:
        """Follow the plan of a motion from now on."""
        self.motion, self.plan = motion, motion.plan
        self.task = task_of(motion.plan.scene)
        self.states = [self.task.initial]
        for action in motion.phases.actions:
            self.states.append(action.apply(self.states[-1]))

    def as_it_is(self) -> Planner:
        """Return another planner of the present plan, for whoever still acts by it when this one follows a new plan."""
        self.ergonomics()
        return copy.copy(self)

    @property
    def actions(self) -> tuple[Action, ...]:
        """The actions of the plan."""
        return self.motion.phases.actions

    def planned(self, number: int) -> Phase:
        """Return the motion of an action as it was planned."""
        slices = self.motion.phases.slices
        knots = self.motion.path[number * slices : (number + 1) * slices + 1]
        return Phase(JointTrajectory(knots, self.motion.phases.seconds))

    def deviations(self, number: int, view: TrackedWorld) -> list[str]:
        """Return in words what is not where the planned motion of an action begins."""
        row = number * self.motion.phases.slices
        first = self.motion.path[row]
        off = np.abs(view.now.q - first)
        off[self._human_columns()] = 0.0
        found = []
        if off.max() > view.tolerances.joints:
            found.append(f"{self.motion.world.joints[int(off.argmax())]} is {off.max():.2f} rad off")
        for name in self._things(number):
            away, turned = self._away(name, number, view)
            if away > view.tolerances.moved or turned > view.tolerances.turned:
                found.append(f"{name} is {away:.3f} m and {np.degrees(turned):.0f} deg off")
        return found

    def scene(self, number: int, view: TrackedWorld) -> Scene:
        """Return the world as it is before an action, as a scene.

        Raises:
            OutOfPlace: an object is where no motion can begin.
        """
        believed = self.believed(number)
        return scene_now(self.plan.scene, view, believed, atoms_now(view, self.task, believed))

    def believed(self, number: int) -> frozenset[Atom]:
        """Return what the plan has before an action."""
        return frozenset(self.task.holding(self.states[number]))

    def retarget(
        self, number: int, scene: Scene, start: Array, spot: Spot | None = None, pause: bool = False
    ) -> Phase | str:
        """Return the motion of one action from the world as it is, or why there is none.

        The object ends up as the plan has it if that is possible: in the same grip, at the same place. Hands that hold
        a part stand still; robot arms that take no part and are where they should be move as planned, unless they
        would be in the way.

        Args:
            number: of the action.
            scene: the world, see `scene`.
            start: (nq,) present configuration.
            spot: where a placed object is put instead.
            pause: whether the hands of the action before rest for a slice, as they do within a plan.
        """
        world = self.motion.world.with_scene(scene)
        first = np.clip(start, world.lower, world.upper)
        action, seconds = self.actions[number], self.motion.phases.seconds
        resting = self._acting(number - 1) if pause else None
        still = holding_hands(self.motion.modes, number)
        hands = self.motion.phases.switches[number].hands
        planned = planned_course(world, first, self.planned(number).segment.knots, [*hands, *still])
        shape = self.planned(number).segment.knots, brought(self.motion, number, number + 1)
        best: Phase | None = None
        for there, pins in self._attempts(number, world, first, spot):
            for course in (planned, None) if self.apart and len(planned.columns) else (planned,):
                bounds = self._bounds(
                    there, first, fixed_variables=pins, holding=still, prescribed=course, resting=resting
                )
                bounds.planned_motions[action,] = shape
                found = bounds.solve("sequence", (action,), None)
                bodies = found.feasible
                found = bounds.solve("path", (action,), found) if bodies else found
                if found.feasible:
                    segment = JointTrajectory(np.concatenate([first[None], found.payload.path]), seconds)
                    if best is None or found.cost < (best.cost or 0.0):
                        best = Phase(segment, found.cost, scene, found.payload)
                    if time_scaled(world, segment, robot_columns(world))[1] < HASTY:
                        return best
                if not bodies:
                    # It fails where bodies play no part yet: arms that get out of the way do not help.
                    break
        return found.reason if best is None else best

    def _attempts(
        self, number: int, world: World, first: Array, spot: Spot | None
    ) -> Iterator[tuple[World, dict[str, float]]]:
        """Yield the worlds and variables with which the motion of an action is tried, the best ones first."""
        pins, free = self._pins(number, number, world.scene, spot)
        yield world, pins
        if free and pins and (other := self._other_grip(number, world, first)):
            yield world, other
        if self._by_human(number):
            # Nobody commands the person, who puts a thing down with another turn of the hand than the planner likes.
            yield world.with_free_hands("human"), pins

    def _other_grip(self, number: int, world: World, first: Array) -> dict[str, float]:
        """Return variables of an action with which its object can still be put where it is to be joined, {} if none.

        They come from the configurations of all actions until then, as far as bodies play no part.
        """
        switches = self.motion.phases.switches
        thing = switches[number].thing
        last = next(
            (k for k in range(number, len(switches)) if (switches[k].kind, switches[k].thing) == ("place", thing)),
            number,
        )
        pins = self._pins(last, number, world.scene, None)[0] if last > number else {}
        bounds = self._bounds(world, first, fixed_variables=pins, holding=holding_hands(self.motion.modes, number))
        actions = self.actions[number : last + 1]
        found = bounds.solve("sequence", actions, None)
        if not found.feasible:
            return {}
        names = bounds.problem("sequence", bounds.phases(actions)).modes.names
        return {name: at for name, at in zip(names, found.payload.variables, strict=True) if name.startswith("0.")}

    def _bounds(self, world: World, first: Array, **more: Any) -> FixedPathBounds:
        """Return bounds for new motions from a configuration (nq,), see `FixedPathBounds`."""
        slices = self.motion.phases.slices
        return FixedPathBounds(
            world, self.ergonomics(), initial_configuration=first, slices=slices, collisions=self.apart, **more
        )

    def planned_spot(self, number: int) -> Spot:
        """Return where the plan puts the object of a placement."""
        switch = self.motion.phases.switches[number]
        return self._on(switch.table, self._pose(switch.thing, (number + 1) * self.motion.phases.slices))

    def _pins(self, number: int, since: int, scene: Scene, spot: Spot | None) -> tuple[dict[str, float], bool]:
        """Return the planned variables of an action in a sequence since another, and whether others will do as well.

        How parts that are to be joined lie and stand matters later. One that is to be joined with another that stands
        already is put beside it, wherever that is.
        """
        switch = self.motion.phases.switches[number]
        mine, own = f"{number}.{switch.thing}.", f"{number - since}.{switch.thing}."
        pins = {own + name.removeprefix(mine): at for name, at in self.plan.variables.items() if name.startswith(mine)}
        joints = [joint for joint in self.plan.scene.joints if switch.thing in joint.parts]
        if switch.kind != "place" or (not joints and spot is None):
            return pins if joints else {}, True
        others = [scene.things[joint.parts[joint.parts[0] == switch.thing]] for joint in joints]
        row = (number + 1) * self.motion.phases.slices
        for other in others if spot is None else ():
            if other.on == switch.table and not other.hand:
                x, y, yaw = other.at
                now, place = resting(scene.tables[other.on], other, x, y, np.radians(yaw), other.up)
                was, goal = self._pose(other.name, row), self._pose(switch.thing, row)
                turn = now @ was.rotation.T
                moved = TrackedPose(turn @ goal.rotation, place + turn @ (goal.position - was.position), 0.0)
                spot = self._on(switch.table, moved)
        if spot is not None:
            pins = {own + name: value for name, value in spot._asdict().items()}
        return pins, not joints

    def _acting(self, number: int) -> Indices:
        """Return the columns of q that move the hands of an action."""
        world, hands = self.motion.world, self.plan.scene.hands
        masks = [world.support(name) for name in self.actions[number].arguments if name in hands]
        return np.flatnonzero(np.sum(masks, axis=0))

    def _on(self, table: str, at: TrackedPose) -> Spot:
        x, y, yaw, _ = on_table(self.plan.scene.tables[table], at)
        return Spot(x, y, float(np.radians(yaw)))

    def _pose(self, name: str, row: int) -> TrackedPose:
        """Return where a row of the planned motion has an object."""
        poses = self.motion.thing(name)
        return TrackedPose(poses.rotation[row], poses.position[row], 0.0)

    def anew(self, number: int, scene: Scene, start: Array, seconds: float, thorough: bool = False) -> Plan:
        """Return a new plan from a scene and a configuration; `feasible` says whether there is one.

        Args:
            number: of the action that could not be done.
            scene: the world as it is, see `state.scene_now`.
            start: (nq,) configuration.
            seconds: wall-clock time of the search.
            thorough: whether all of that time is used, see `rest.plan_rest`.
        """
        world, task = self.motion.world.with_scene(scene), task_of(scene)
        first = np.clip(start, world.lower, world.upper)
        in_hand = any(thing.hand.startswith("human.") for thing in scene.things.values())
        # How a part lies in the person's hand is settled: they put it down with whatever turn of the hand that takes.
        for there in (world, world.with_free_hands("human")) if in_hand else (world,):
            bounds = self._bounds(there, first, holding=[hand for hand, _, _ in ModeSequence(there, ()).held_at_first])
            found = plan_rest(self.motion, task, number, bounds, seconds, thorough)
            if found.feasible:
                break
        return found

    def follow(self, plan: Plan) -> None:
        """Follow another plan of the same agents from now on.

        Raises:
            LgpError: it is not feasible.
        """
        self.use(Motion(plan, self.motion.world))

    def ergonomics(self) -> Ergonomics | None:
        """Return the ergonomic cost, prepared once."""
        if self._prepared is None and self._cost is not None and self.plan.scene.human is not None:
            self._prepared = Cost(self.motion.world, dreba.load(self._cost))
        return self._prepared

    def _by_human(self, number: int) -> bool:
        """Return whether the hand that acts is the person's."""
        return self.plan.scene.hands[self.motion.phases.switches[number].hand].agent == "human"

    def _human_columns(self) -> Indices:
        if self.plan.scene.human is None:
            return np.zeros(0, np.intp)
        return self.motion.world.columns("human")

    def _things(self, number: int) -> Iterable[str]:
        return [name for name in self.actions[number].arguments if name in self.plan.scene.things]

    def _away(self, name: str, number: int, view: TrackedWorld) -> tuple[float, float]:
        """Return by how much [m, rad] an object is not where the planned motion of an action begins."""
        row = number * self.motion.phases.slices
        seen = view.mean(name)
        if seen is None:
            return 0.0, 0.0
        rotation, position, _ = vars(self._pose(name, row)).values()
        hand = carrier(view, name, self.believed(number))
        if hand:
            # In a hand it counts how it lies there: the hand itself may be somewhere else.
            frame = self.motion.frames([hand])[hand]
            position = frame.rotation[row].T @ (position - frame.position[row])
            rotation = frame.rotation[row].T @ rotation
            now = in_hand(view.hand(hand), view.now.things[name])
        else:
            now = seen.rotation, seen.position
        turned = logarithm((rotation.T @ now[0])[None])[0]
        return float(np.linalg.norm(now[1] - position)), float(np.linalg.norm(turned))


def load_plan(folder: str | Path) -> Plan:
    """Return a plan that can be followed.

    Raises:
        LgpError: none is there, or it is not feasible.
    """
    found = Plan.load(folder)
    if not found.feasible:
        raise LgpError(f"{folder}: the plan is not feasible ({found.reason}); plan again and run that")
    return found
