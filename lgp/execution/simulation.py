"""A simulated world: what objects do when hands take them, carry them and let go."""

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
from reba.arrays import Array

GRASP = 0.025
"""[m] A hand gets hold of an object whose box is this near to its grasping point."""
LEVEL = 0.03
"""[m] An object let go of this near above a table stands on it without falling."""


@dataclass(frozen=True)
class Attachment:
    """Where an object is: in a hand (pose in its frame), or with `hand` "" at rest in the world."""

    hand: str
    rotation: Array
    position: Array


class SimulatedWorld:
    """Robots, the human's body and the objects, as they truly are.

    Args:
        world: kinematics and scene.
        robots: what moves by command.
        q: (nq,) first configuration of everybody.
        things: object -> where it is; from the scene by default.

    Attributes:
        time: [s] since the run began.
        q: (nq,) configuration of everybody; whoever simulates the human writes those columns.
        things: object -> where it is.
        view: the true world as if it were tracked without error.
    """

    def __init__(
        self, world: World, robots: SimulatedRobots, q: Array, things: Mapping[str, Attachment] | None = None
    ) -> None:
        self.world, self.robots = world, robots
        self.time, self.q = 0.0, np.array(q, dtype=float)
        self.things = dict(things) if things is not None else self._first()
        self.view = TrackedWorld(world)
        self.look()

    def step(self, time: float) -> None:
        """Go on to a time [s]; the human's columns of q are to be written before."""
        self.time = time
        self.robots.step(time)
        self.q[self.robots.columns] = self.robots.q[self.robots.columns]
        self._grippers()
        self.look()

    def look(self) -> None:
        """Take the present into the true view."""
        poses = {name: self.pose(name) for name in self.things}
        self.view.add(Observation(self.time, self.q.copy(), poses, frozenset(self.robots.closed)))

    def pose(self, name: str) -> TrackedPose:
        """Return where an object is now."""
        at = self.things[name]
        if not at.hand:
            return TrackedPose(at.rotation, at.position, self.time)
        hand = self._hand(at.hand)
        return TrackedPose(hand.rotation @ at.rotation, hand.position + hand.rotation @ at.position, self.time)

    def gap(self, hand: str, name: str) -> float:
        """Return the distance [m] of a hand's grasping point from the box of an object."""
        return box_gap(self._hand(hand).position, self.pose(name), self.world.scene.objects[name])

    def take(self, hand: str, name: str) -> bool:
        """Let a hand take an object, from whoever has it; return whether it got hold of it."""
        if self.gap(hand, name) > GRASP:
            return False
        self.things[name] = Attachment(hand, *in_hand(self._hand(hand), self.pose(name)))
        return True

    def put(self, name: str) -> None:
        """Let go of an object: it comes to rest, with its nearest side down, on what is under it."""
        pose, scene = self.pose(name), self.world.scene
        thing = scene.objects[name]
        low = pose.position[2] - half_height(thing, pose.rotation)
        under = [
            table for table in scene.tables.values() if on_top(table, pose.position) and table.height <= low + LEVEL
        ]
        if under:
            table = max(under, key=lambda one: one.height)
            x, y, yaw, up = on_table(table, pose)
            rotation, position = resting(table, thing, x, y, np.radians(yaw), up)
        else:
            rotation, position = pose.rotation, pose.position.copy()
            position[2] = half_height(thing, rotation)
        self.things[name] = Attachment("", rotation, position)

    def lay(self, name: str, table: str, x: float, y: float) -> None:
        """Put an object on a table at x, y [m] of its top, turned as it is."""
        top, thing = self.world.scene.tables[table], self.world.scene.objects[name]
        _, _, yaw, up = on_table(top, self.pose(name))
        self.things[name] = Attachment("", *resting(top, thing, x, y, np.radians(yaw), up))

    def _grippers(self) -> None:
        """Let closed grippers take what is in them, open ones let go."""
        scene = self.world.scene
        grippers = [hand for hand in scene.hands if scene.hands[hand].agent != "human"]
        for name in scene.objects:
            owner = self.things[name].hand
            if owner in grippers and owner not in self.robots.closed:
                near = [hand for hand in scene.hands if hand not in grippers and self.gap(hand, name) <= GRASP]
                if not near or not self.take(near[0], name):
                    self.put(name)
        for hand in grippers:
            if hand in self.robots.closed and all(at.hand != hand for at in self.things.values()):
                gaps = {name: self.gap(hand, name) for name in scene.objects}
                nearest = min(gaps, key=lambda name: gaps[name], default="")
                if nearest and self.things[nearest].hand not in grippers:
                    self.take(hand, nearest)

    def _hand(self, name: str) -> TrackedPose:
        at = self.world.at(self.q[None], [name])
        return TrackedPose(at.rotation[0, 0], at.position[0, 0], self.time)

    def _first(self) -> dict[str, Attachment]:

        modes = ModeSequence(self.world, ())
        kinematics = self.world.at(self.q[None], modes.frames)
        found = {}
        for name, thing in self.world.scene.objects.items():
            pose = modes.pose(name, 0, kinematics, np.zeros(0))
            at = TrackedPose(pose.rotation[0], pose.position[0], 0.0)
            held = in_hand(self._hand(thing.hand), at) if thing.hand else (at.rotation, at.position)
            found[name] = Attachment(thing.hand, *held)
        return found


class Robots(Protocol):
    """All robots of a scene; the human is not among them."""

    def follow(self, move: Move) -> None:
        """Move from now on; of the configurations of everybody, robots take their own joints."""
        ...

    def grip(self, hand: str, closed: bool) -> None:
        """Close or open a gripper."""
        ...


class SimulatedRobots:
    """Robots that follow exactly.

    Args:
        world: whose robots.
        q: (nq,) first configuration of everybody.
        closed: hands whose grippers are closed at first.

    Attributes:
        columns: of q that belong to robots.
        q: (nq,) present configuration; only `columns` mean anything.
        speed: (nq,) present velocity.
        closed: hands whose grippers are closed.
        stuck: hands whose grippers do not obey, for trying faults.
    """

    def __init__(self, world: World, q: Array, closed: frozenset[str] = frozenset()) -> None:
        self.columns = robot_columns(world)
        self.q, self.speed = np.array(q, dtype=float), np.zeros(len(q))
        self.closed = set(closed)
        self.stuck: set[str] = set()
        self._time = self._began = 0.0
        self._move: Move | None = None

    def follow(self, move: Move) -> None:
        """Move from now on."""
        self._move, self._began = move, self._time

    def grip(self, hand: str, closed: bool) -> None:
        """Close or open a gripper, unless it is stuck."""
        if hand not in self.stuck:
            (self.closed.add if closed else self.closed.discard)(hand)

    def step(self, time: float) -> None:
        """Go on to a time [s]."""
        self._time = time
        if self._move is not None:
            since = time - self._began
            self.q[self.columns] = self._move.at(since)[self.columns]
            self.speed[self.columns] = self._move.velocity(since)[self.columns]


class SimulatedTracker:
    """Observations of a simulated world.

    Args:
        simulation: what is tracked.
        rng: of the noise.
        noise: standard deviation of each coordinate [m].
        turn: standard deviation about each axis [rad].

    Attributes:
        lost: object -> time until which it is not seen [s].
    """

    def __init__(
        self, simulation: SimulatedWorld, rng: np.random.Generator, noise: float = 0.001, turn: float = 0.003
    ) -> None:
        self.simulation, self.rng = simulation, rng
        self.noise, self.turn = noise, turn
        self.lost: dict[str, float] = {}
        self._seen: dict[str, TrackedPose] = {}

    def observe(self) -> Observation:
        """Return the present moment; an object that is lost keeps its last sighting."""
        truth = self.simulation
        for name in truth.things:
            pose = truth.pose(name)
            shift = self.rng.normal(0.0, self.noise, 3)
            turn = exponential(self.rng.normal(0.0, self.turn, 3))
            if truth.time >= self.lost.get(name, 0.0):
                self._seen[name] = TrackedPose(pose.rotation @ turn, pose.position + shift, truth.time)
        return Observation(truth.time, truth.q.copy(), dict(self._seen), frozenset(truth.robots.closed))
