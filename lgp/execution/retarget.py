"""Motions and plans from the tracked world: one phase retargeted, or the remaining actions replanned.

Retargeting is the greedy re-targeting of Busch, Toussaint & Lopes (2018), section IV.B: a path problem of one action
from the present configuration, with every object at its tracked pose. The order of actions stays, so the cost may be
above that of a new plan.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import dreba
from lgp.defaults import SCENE_COST
from lgp.errors import LgpError, WorldError
from lgp.execution.fixed_path import FixedPathBounds, holding_hands, planned_course
from lgp.execution.replan import phase_variables, replan_remaining
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
from lgp.path.keyframes import Solution
from lgp.path.partial_order import one_at_a_time
from lgp.plan_record import Plan
from lgp.planner import task_of
from lgp.scene.model import Scene, Table
from reba.arrays import Array, Indices

MAX_PENETRATION = 1e-3
"""[m] Plans with a deeper penetration were made without collision constraints."""
MAX_TIME_SCALE = 2.0
"""Factor of the duration above which a motion is a poor local minimum: other alternatives are tried."""


class TablePose(NamedTuple):
    """The pose of an object on the top of a table: x, y [m], yaw [rad]."""

    x: float
    y: float
    yaw: float


@dataclass(frozen=True)
class ActionMotion:
    """The motion of one action.

    Attributes:
        trajectory: of persons and robots; that of persons is a prediction.
        cost: of a retargeted motion, on the scale of the plan; None for the planned motion.
        scene: for which it was retargeted, with the solution of the path problem; both None for the planned motion.
    """

    trajectory: JointTrajectory
    cost: float | None = None
    scene: Scene | None = None
    solution: Solution | None = None


class Planner:
    """The plan in force with its motion and task, and new motions and plans from the tracked world.

    Args:
        cost: dREBA model of new motions, by default that of the scene; ignored if the plan was made without ergonomics.

    Attributes:
        collision_free: whether new motions have collision constraints.
        states: planned state before each action and after the last, as bits of the task.
    """

    def __init__(self, plan: Plan, cost: str | Path | None = SCENE_COST) -> None:
        given = plan.scene.cost_model(cost)
        model = None if given is None else dreba.load(given)  # a wrong file is reported before a run starts
        self._cost = model if plan.costs.get("ergonomics", 0.0) > 0.0 else None
        self._ergonomics: Ergonomics | None = None
        # A plan with penetrations was made without collision constraints; new motions are then made without them too.
        self.collision_free = plan.residuals.get("penetration", 0.0) <= MAX_PENETRATION
        self.use(Motion(plan))

    def use(self, motion: Motion) -> None:
        """Set the plan in force."""
        self.motion, self.plan = motion, motion.plan
        self.task = task_of(motion.plan.scene)
        self.states = [self.task.initial]
        for action in motion.phases.actions:
            self.states.append(action.apply(self.states[-1]))

    def snapshot(self) -> Planner:
        """Return a copy that keeps the present plan when this planner follows a new one."""
        self.ergonomics()
        return copy.copy(self)

    @property
    def actions(self) -> tuple[Action, ...]:
        """The actions of the plan."""
        return self.motion.phases.actions

    def step(self, number: int) -> range:
        """Return the numbers of the actions that happen at the same time as one; empty after the last."""
        phase_of = [*self.motion.phases.phase_of.tolist(), -1]
        first = phase_of.index(phase_of[number])
        return range(first, first + phase_of.count(phase_of[number]) if number < len(self.actions) else first)

    def planned(self, number: int) -> ActionMotion:
        """Return the planned motion of all agents in an action."""
        path = self.motion.path
        first, last = self._row(number), self._row(number, 1)
        beside = path[max(first - 1, 0)], path[min(last + 1, len(path) - 1)]
        return ActionMotion(JointTrajectory(path[first : last + 1], self._seconds(number), beside=beside))

    def _seconds(self, number: int) -> float:
        """Return the planned duration of an action [s]."""
        phases = self.motion.phases
        return float(phases.phase_durations[phases.phase_of[number]])

    def _row(self, number: int, more: int = 0) -> int:
        """Return the row of the motion at which the phase of an action begins, or one that many phases later."""
        phases = self.motion.phases
        return int(phases.phase_of[number] + more) * phases.slices

    def deviations(self, number: int, view: TrackedWorld) -> list[str]:
        """Return, in words, joints and objects that are away from the start of the planned motion of an action."""
        first = self.motion.path[self._row(number)]
        off, robots = np.zeros(len(first)), robot_columns(self.motion.world)
        off[robots] = np.abs(view.now.q - first)[robots]
        deviations = []
        if off.max() > view.tolerances.joints:
            world = self.motion.world
            joint = world.joints[int(off.argmax())]
            deviations.append(f"{joint} is {off.max():.2f} {world.units[joint].si} off")
        for name in dict.fromkeys(name for one in self.step(number) for name in self._object_names(one)):
            distance, turn = self._deviation(name, number, view)
            if distance > view.tolerances.moved or turn > view.tolerances.turned:
                deviations.append(f"{name} is {distance:.3f} m and {np.degrees(turn):.0f} deg off")
        return deviations

    def scene(self, number: int, view: TrackedWorld) -> Scene:
        """Return the tracked world before an action as a scene.

        Raises:
            ObjectUnavailable: an object is lost, moves, or is neither in a hand nor on a table.
        """
        nominal = self.nominal(number)
        return scene_now(self.plan.scene, view, nominal, atoms_now(view, self.task, nominal))

    def nominal(self, number: int) -> frozenset[Atom]:
        """Return the atoms that hold before an action by the plan."""
        return frozenset(self.task.holding(self.states[self.step(number).start]))

    def retarget(
        self,
        number: int,
        scene: Scene,
        start: Array,
        target: TablePose | None = None,
        pause: bool = False,
        still: Sequence[str] = (),
    ) -> ActionMotion | str:
        """Return the motion of one action retargeted from `start` (nq,) [rad, m], or the reason why there is none.

        The object keeps its planned grip and placement if possible. Hands that hold a part stand still; robot arms
        that take no part in the action and are as planned move as planned, unless that leaves no motion.

        Args:
            scene: the tracked world, see the method `scene`.
            target: placement of the object instead of the planned one.
            pause: whether the hands of the action before rest for a slice, as they do within a plan.
            still: further hands that stand still.
        """
        # One action takes as long as it was planned to take.
        scene = replace(scene, durations="fixed", phase_seconds=self._seconds(number))
        world = self.motion.world.with_scene(scene)
        first = np.clip(start, world.lower, world.upper)
        action, seconds = replace(self.actions[number], together=False), self._seconds(number)
        try:
            ModeSequence(world, self.motion.phases.switches[number : number + 1])
        except WorldError as error:
            return str(error)
        resting = self._acting(number - 1) if pause else None
        holding = (*holding_hands(self.motion.modes, number), *still)
        hands = self.motion.phases.switches[number].hands
        planned = planned_course(world, first, self.planned(number).trajectory.knots, [*hands, *holding])
        initial_guess = self.planned(number).trajectory.knots, phase_variables(self.motion, number, number + 1)
        best: ActionMotion | None = None
        for attempt_world, fixed_variables in self._attempts(number, world, first, target):
            for course in (planned, None) if self.collision_free and len(planned.columns) else (planned,):
                bounds = self._bounds(
                    attempt_world,
                    first,
                    fixed_variables=fixed_variables,
                    holding=holding,
                    prescribed=course,
                    resting=resting,
                )
                bounds.planned_motions[action,] = initial_guess
                result = bounds.solve("sequence", (action,), None)
                sequence_feasible = result.feasible
                result = bounds.solve("path", (action,), result) if sequence_feasible else result
                if result.feasible:
                    trajectory = JointTrajectory(np.concatenate([first[None], result.payload.path]), seconds)
                    if best is None or result.cost < (best.cost or 0.0):
                        best = ActionMotion(trajectory, result.cost, scene, result.payload)
                    if time_scaled(world, trajectory, robot_columns(world))[1] < MAX_TIME_SCALE:
                        return best
                if not sequence_feasible:
                    # The sequence level has no collision constraints: other arms are not the cause.
                    break
        return result.reason if best is None else best

    def _attempts(
        self, number: int, world: World, first: Array, target: TablePose | None
    ) -> Iterator[tuple[World, dict[str, float]]]:
        """Yield worlds and fixed variables of the alternatives for the motion of an action, preferred ones first."""
        fixed_variables, optional = self._fixed_variables(number, number, world.scene, target)
        yield world, fixed_variables
        if optional and fixed_variables and (other := self._other_grip(number, world, first)):
            yield world, other
        if self._by_human(number):
            # A person is not commanded and may place an object with any rotation of the hand.
            yield world.without_tilt_limits(*world.scene.humans), fixed_variables

    def _other_grip(self, number: int, world: World, first: Array) -> dict[str, float]:
        """Return a grip with which the object can still be placed at the part that it is joined with, {} if none.

        It comes from the sequence problem of all actions until then, without collision constraints.
        """
        switches = self.motion.phases.switches
        object_name = switches[number].object_name
        later = (k for k in range(number, len(switches)) if switches[k].object_name == object_name)
        last = next((k for k in later if switches[k].action.attaches_to == "table"), number)
        fixed_variables = self._fixed_variables(last, number, world.scene, None)[0] if last > number else {}
        bounds = self._bounds(
            world, first, fixed_variables=fixed_variables, holding=holding_hands(self.motion.modes, number)
        )
        actions = one_at_a_time(self.actions[number : last + 1])
        result = bounds.solve("sequence", actions, None)
        if not result.feasible:
            return {}
        names = bounds.problem("sequence", bounds.phases(actions)).modes.names
        return {name: at for name, at in zip(names, result.payload.variables, strict=True) if name.startswith("0.")}

    def _bounds(self, world: World, first: Array, **options: Any) -> FixedPathBounds:
        """Return the bounds of motions from a configuration (nq,), see `FixedPathBounds`."""
        slices = self.motion.phases.slices
        return FixedPathBounds(
            world,
            self.ergonomics(),
            initial_configuration=first,
            slices=slices,
            collisions=self.collision_free,
            **options,
        )

    def planned_placement(self, number: int) -> TablePose:
        """Return the planned pose of the object that an action places."""
        switch = self.motion.phases.switches[number]
        row = self._row(number, 1)
        return self._on(switch.table, self._pose(switch.object_name, row), row)

    def _fixed_variables(
        self, number: int, since: int, scene: Scene, target: TablePose | None
    ) -> tuple[dict[str, float], bool]:
        """Return the fixed variables of an action in the sequence from `since`, and whether they are only preferred.

        The planned grips and placements of parts that are joined later are kept. A part whose counterpart already
        stands on the table is placed beside it, at their planned relative pose.
        """
        switch = self.motion.phases.switches[number]
        planned_prefix, prefix = f"{number}.{switch.object_name}.", f"{number - since}.{switch.object_name}."
        fixed_variables = {
            prefix + name.removeprefix(planned_prefix): value
            for name, value in self.plan.variables.items()
            if name.startswith(planned_prefix)
        }
        joints = [joint for joint in self.plan.scene.assemblies if switch.object_name in joint.parts]
        if switch.action.attaches_to != "table" or (not joints and target is None):
            return fixed_variables if joints else {}, True
        others = [scene.objects[joint.parts[joint.parts[0] == switch.object_name]] for joint in joints]
        row = self._row(number, 1)
        for other in others if target is None else ():
            if other.on == switch.table and not other.hand:
                x, y, yaw = other.at
                table = self._table(other.on, row)
                rotation, position = resting(table, other, x, y, np.radians(yaw), other.up)
                was, goal = self._pose(other.name, row), self._pose(switch.object_name, row)
                turn = rotation @ was.rotation.T
                moved = TrackedPose(turn @ goal.rotation, position + turn @ (goal.position - was.position), 0.0)
                target = self._on(switch.table, moved, row)
        if target is not None:
            fixed_variables = {prefix + name: value for name, value in target._asdict().items()}
        return fixed_variables, not joints

    def _acting(self, number: int) -> Indices:
        """Return the columns of q that move the hands of an action (k,)."""
        world, hands = self.motion.world, self.plan.scene.hands
        masks = [world.support(name) for name in self.actions[number].arguments if name in hands]
        return np.flatnonzero(np.sum(masks, axis=0))

    def _on(self, table: str, at: TrackedPose, row: int) -> TablePose:
        x, y, yaw, _ = on_table(self._table(table, row), at)
        return TablePose(x, y, float(np.radians(yaw)))

    def _table(self, name: str, row: int) -> Table:
        """Return a table as it stands at a row of the motion."""
        carried = [name] if self.plan.scene.tables[name].frame else []
        return self.motion.world.at(self.motion.path[row][None], carried).table(name)

    def _pose(self, name: str, row: int) -> TrackedPose:
        """Return the planned pose of an object at a row of the motion."""
        poses = self.motion.object_poses(name)
        return TrackedPose(poses.rotation[row], poses.position[row], 0.0)

    def replan(self, number: int, scene: Scene, start: Array, seconds: float, thorough: bool = False) -> Plan:
        """Return a new plan of the remaining actions from `start` (nq,) [rad, m]; it may be infeasible.

        Args:
            number: of the action that failed.
            scene: the tracked world, see the method `scene`.
            seconds: wall-clock time of the search.
            thorough: whether all of that time is used, see `replan.replan_remaining`.
        """
        world, task = self.motion.world.with_scene(scene), task_of(scene)
        first = np.clip(start, world.lower, world.upper)
        in_hand = any(one.hand and scene.hands[one.hand].human for one in scene.objects.values())
        # The grip of a part in the hand of a person is given: they may need any rotation of the hand to place it.
        for attempt_world in (world, world.without_tilt_limits(*scene.humans)) if in_hand else (world,):
            holding = [hand for hand, _, _ in ModeSequence(attempt_world, ()).held_at_first]
            bounds = self._bounds(attempt_world, first, holding=holding)
            plan = replan_remaining(self.motion, task, number, bounds, seconds, thorough)
            if plan.feasible:
                break
        return plan

    def follow(self, plan: Plan) -> None:
        """Set another plan of the same agents in force.

        Raises:
            LgpError: it is not feasible.
        """
        self.use(Motion(plan, self.motion.world))

    def ergonomics(self) -> Ergonomics | None:
        """Return the ergonomic cost term, built once; None without ergonomics."""
        if self._ergonomics is None and self._cost is not None and self.plan.scene.humans:
            self._ergonomics = Ergonomics(self.motion.world, self._cost)
        return self._ergonomics

    def _by_human(self, number: int) -> bool:
        """Return whether a human hand acts."""
        return self.plan.scene.hands[self.motion.phases.switches[number].hand].human

    def _object_names(self, number: int) -> Iterable[str]:
        """Return the objects of an action, and those on the table that it is joined with where it is placed."""
        switch, modes = self.motion.phases.switches[number], self.motion.modes
        joined = {
            name for joint in self.plan.scene.assemblies if switch.object_name in joint.parts for name in joint.parts
        }
        beside = {name for name in joined if switch.table and modes.attachment(name, number).parent == switch.table}
        return [name for name in self.plan.scene.objects if name in {*self.actions[number].arguments, *beside}]

    def _deviation(self, name: str, number: int, view: TrackedWorld) -> tuple[float, float]:
        """Return the deviation [m, rad] of an object from the start of the planned motion of an action."""
        row = self._row(number)
        seen = view.mean(name)
        if seen is None:
            return 0.0, 0.0
        rotation, position, _ = vars(self._pose(name, row)).values()
        hand = carrier(view, name, self.nominal(number)) or view.carried_under(name)
        if hand:
            # For an object in a hand its pose in the hand counts: the hand itself may be elsewhere. So may a robot be.
            frame = self.motion.frames([hand])[hand]
            position = frame.rotation[row].T @ (position - frame.position[row])
            rotation = frame.rotation[row].T @ rotation
            now = in_hand(view.hand(hand), view.now.objects[name])
        else:
            now = seen.rotation, seen.position
        turn = logarithm((rotation.T @ now[0])[None])[0]
        return float(np.linalg.norm(now[1] - position)), float(np.linalg.norm(turn))


def load_plan(folder: str | Path) -> Plan:
    """Return the feasible plan in a folder.

    Raises:
        LgpError: there is no plan, or it is not feasible.
    """
    plan = Plan.load(folder)
    if not plan.feasible:
        raise LgpError(f"{folder}: the plan is not feasible ({plan.reason}); plan again and run that")
    return plan
