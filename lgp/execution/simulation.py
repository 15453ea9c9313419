"""Simulation of the world: robots that follow commands, objects that hands take, carry and release, a noisy tracker."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lgp.execution.tracked_scene import in_hand, on_table
from lgp.execution.tracking import Observation, TrackedPose, TrackedWorld, box_gap, half_height, on_top
from lgp.execution.trajectory import Move, robot_columns
from lgp.kinematics.attachments import resting
from lgp.kinematics.features import exponential
from lgp.kinematics.modes import ModeSequence
from lgp.kinematics.world import World
from lgp.scene.model import Table
from reba.arrays import Array

GRASP = 0.035
"""[m] Largest distance of the grasping point of a hand from the box of an object that it can take.

Above `Tolerances.reach`: what the predicates see at a hand, it takes."""
LEVEL = 0.03
"""[m] Largest height above a table from which a released object comes to rest on it."""

ROTATION_NOISE = 0.003
"""[rad] Standard deviation of the tracked rotation about each axis: a millimetre at the ends of a tool of 0.6 m."""


@dataclass(frozen=True)
class Placement:
    """The pose of an object: in the frame of a hand or of a table that a robot carries; else at rest in the world."""

    hand: str
    rotation: Array
    position: Array
    table: str = ""


class SimulatedWorld:
    """The true state of robots, persons and objects.

    Args:
        q: (nq,) initial configuration of persons and robots [rad, m].
        objects: object -> placement; from the scene by default.

    Attributes:
        time: [s] since the run began.
        q: (nq,) configuration; each `Worker` writes the columns of its person.
        view: the world as a tracker without error sees it.
    """

    def __init__(
        self, world: World, robots: SimulatedRobots, q: Array, objects: Mapping[str, Placement] | None = None
    ) -> None:
        self.world, self.robots = world, robots
        self.time, self.q = 0.0, np.array(q, dtype=float)
        self.objects = dict(objects) if objects is not None else self._initial_placements()
        self._closed = set(robots.closed)
        self.view = TrackedWorld(world)
        self.observe()

    def step(self, time: float) -> None:
        """Advance to a time [s]; the columns of persons in q are written before."""
        self.time = time
        self.robots.step(time)
        self.q[self.robots.columns] = self.robots.q[self.robots.columns]
        self._grippers()
        self.observe()

    def observe(self) -> None:
        """Append the true state to `view`."""
        poses = {name: self.pose(name) for name in self.objects}
        self.view.add(Observation(self.time, self.q.copy(), poses, frozenset(self.robots.closed)))

    def pose(self, name: str) -> TrackedPose:
        """Return the true pose of an object."""
        at = self.objects[name]
        if not (at.hand or at.table):
            return TrackedPose(at.rotation, at.position, self.time)
        carrier = self._frame(at.hand or at.table)
        position = carrier.position + carrier.rotation @ at.position
        return TrackedPose(carrier.rotation @ at.rotation, position, self.time)

    def gap(self, hand: str, name: str) -> float:
        """Return the distance [m] of a hand's grasping point from the box of an object."""
        return box_gap(self._frame(hand).position, self.pose(name), self.world.scene.objects[name])

    def take(self, hand: str, name: str) -> bool:
        """Attach an object to a hand that reaches it, from any other hand; return whether it does."""
        if self.gap(hand, name) > GRASP:
            return False
        self.objects[name] = Placement(hand, *in_hand(self._frame(hand), self.pose(name)))
        return True

    def put(self, name: str) -> None:
        """Release an object: it comes to rest on its nearest side, on the table or the floor below it."""
        pose, scene = self.pose(name), self.world.scene
        scene_object = scene.objects[name]
        low = pose.position[2] - half_height(scene_object, pose.rotation)
        tables = self._tables()
        under = [one for one in tables.values() if on_top(one, pose.position) and one.height <= low + LEVEL]
        if under:
            table = max(under, key=lambda one: one.height)
            self.objects[name] = self._resting(table, name, *on_table(table, pose))
        else:
            rotation, position = pose.rotation, pose.position.copy()
            position[2] = half_height(scene_object, rotation)
            self.objects[name] = Placement("", rotation, position)

    def lay(self, name: str, table: str, x: float, y: float) -> None:
        """Put an object on a table at x, y [m] of its top, with its present yaw and upward side."""
        top = self._tables()[table]
        _, _, yaw, up = on_table(top, self.pose(name))
        self.objects[name] = self._resting(top, name, x, y, yaw, up)

    def _resting(self, table: Table, name: str, x: float, y: float, yaw: float, up: str) -> Placement:
        """Return an object at rest on a table at x, y [m] and yaw [deg] of its top; a carried one takes it along."""
        own = table.top if table.frame else table
        pose = resting(own, self.world.scene.objects[name], x, y, np.radians(yaw), up)
        return Placement("", *pose, table=table.full if table.frame else "")

    def _tables(self) -> dict[str, Table]:
        """Return every table as it stands now."""
        at = self.world.at(self.q[None], self.world.scene.carried_tables)
        return {name: at.table(name) for name in self.world.scene.tables}

    def _grippers(self) -> None:
        """Attach objects to grippers that close on them; what one lets go stays in another closed one or falls."""
        hands, closed = self.world.scene.hands, self.robots.closed
        for hand in sorted(closed - self._closed):
            gaps = {name: self.gap(hand, name) for name in self.objects}
            nearest = min(gaps, key=lambda name: gaps[name], default="")
            if nearest and self.objects[nearest].hand not in closed:
                self.take(hand, nearest)
        self._closed = set(closed)
        for name, at in list(self.objects.items()):
            if at.hand and at.hand not in closed and not hands[at.hand].human:
                empty = sorted(closed - {one.hand for one in self.objects.values()})
                if not any(self.take(hand, name) for hand in empty):
                    self.put(name)

    def _frame(self, name: str) -> TrackedPose:
        at = self.world.at(self.q[None], [name])
        return TrackedPose(at.rotation[0, 0], at.position[0, 0], self.time)

    def _initial_placements(self) -> dict[str, Placement]:
        modes = ModeSequence(self.world, ())
        kinematics = self.world.at(self.q[None], modes.frames)
        placements = {}
        for name, scene_object in self.world.scene.objects.items():
            pose = modes.pose(name, 0, kinematics, np.zeros(0))
            at = TrackedPose(pose.rotation[0], pose.position[0], 0.0)
            table = scene_object.on if scene_object.on in self.world.scene.carried_tables else ""
            carrier = scene_object.hand or table
            local = in_hand(self._frame(carrier), at) if carrier else (at.rotation, at.position)
            placements[name] = Placement(scene_object.hand, *local, table=table)
        return placements


class Robots(Protocol):
    """Interface to all robots of a scene."""

    def follow(self, move: Move) -> None:
        """Follow a motion from now on; its columns of persons are ignored."""
        ...

    def grip(self, hand: str, closed: bool) -> None:
        """Close or open a gripper."""
        ...


class SimulatedRobots:
    """Robots that follow their commands without error.

    Attributes:
        columns: of q that belong to robots.
        q: (nq,) configuration [rad, m]; only `columns` are up to date.
        speed: (nq,) velocity.
        closed: hands whose grippers are closed.
        stuck: hands whose grippers ignore commands, see the fault `stuck`.
    """

    def __init__(self, world: World, q: Array, closed: frozenset[str] = frozenset()) -> None:
        self.columns = robot_columns(world)
        self.q, self.speed = np.array(q, dtype=float), np.zeros(len(q))
        self.closed = set(closed)
        self.stuck: set[str] = set()
        self._time = self._began = 0.0
        self._move: Move | None = None

    def follow(self, move: Move) -> None:
        """Follow a motion from now on."""
        self._move, self._began = move, self._time

    def grip(self, hand: str, closed: bool) -> None:
        """Close or open a gripper, unless it is stuck."""
        if hand not in self.stuck:
            (self.closed.add if closed else self.closed.discard)(hand)

    def step(self, time: float) -> None:
        """Advance to a time [s]."""
        self._time = time
        if self._move is not None:
            since = time - self._began
            self.q[self.columns] = self._move.at(since)[self.columns]
            self.speed[self.columns] = self._move.velocity(since)[self.columns]


class SimulatedTracker:
    """A tracker of the simulated world; each coordinate has a normal error of standard deviation `noise` [m].

    Attributes:
        lost: object -> time until which it is not seen [s].
    """

    def __init__(self, simulation: SimulatedWorld, rng: np.random.Generator, noise: float = 0.001) -> None:
        self.simulation, self.rng, self.noise = simulation, rng, noise
        self.lost: dict[str, float] = {}
        self._seen: dict[str, TrackedPose] = {}

    def observe(self) -> Observation:
        """Return the current observation; a lost object keeps its last tracked pose."""
        truth = self.simulation
        for name in truth.objects:
            pose = truth.pose(name)
            shift = self.rng.normal(0.0, self.noise, 3)
            turn = exponential(self.rng.normal(0.0, ROTATION_NOISE, 3))
            if truth.time >= self.lost.get(name, 0.0):
                self._seen[name] = TrackedPose(pose.rotation @ turn, pose.position + shift, truth.time)
        return Observation(truth.time, truth.q.copy(), dict(self._seen), frozenset(truth.robots.closed))
