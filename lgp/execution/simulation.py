"""A simulated world: what objects do when hands take them, carry them and let go."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lgp.execution.observation import Observation, Sighting, View, box_gap, half_height, on_top
from lgp.execution.robots import SimulatedRobots
from lgp.execution.state import in_hand, on_table
from lgp.world.holders import resting
from lgp.world.model import World

Array = NDArray[np.float64]

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
        self.view = View(world)
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

    def pose(self, name: str) -> Sighting:
        """Return where an object is now."""
        at = self.things[name]
        if not at.hand:
            return Sighting(at.rotation, at.position, self.time)
        hand = self._hand(at.hand)
        return Sighting(hand.rotation @ at.rotation, hand.position + hand.rotation @ at.position, self.time)

    def gap(self, hand: str, name: str) -> float:
        """Return the distance [m] of a hand's grasping point from the box of an object."""
        return box_gap(self._hand(hand).position, self.pose(name), self.world.scene.things[name])

    def take(self, hand: str, name: str) -> bool:
        """Let a hand take an object, from whoever has it; return whether it got hold of it."""
        if self.gap(hand, name) > GRASP:
            return False
        self.things[name] = Attachment(hand, *in_hand(self._hand(hand), self.pose(name)))
        return True

    def put(self, name: str) -> None:
        """Let go of an object: it comes to rest, with its nearest side down, on what is under it."""
        pose, scene = self.pose(name), self.world.scene
        thing = scene.things[name]
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
        top, thing = self.world.scene.tables[table], self.world.scene.things[name]
        _, _, yaw, up = on_table(top, self.pose(name))
        self.things[name] = Attachment("", *resting(top, thing, x, y, np.radians(yaw), up))

    def _grippers(self) -> None:
        """Let closed grippers take what is in them, open ones let go."""
        scene = self.world.scene
        grippers = [hand for hand in scene.hands if scene.hands[hand].agent != "human"]
        for name in scene.things:
            owner = self.things[name].hand
            if owner in grippers and owner not in self.robots.closed:
                near = [hand for hand in scene.hands if hand not in grippers and self.gap(hand, name) <= GRASP]
                if not near or not self.take(near[0], name):
                    self.put(name)
        for hand in grippers:
            if hand in self.robots.closed and all(at.hand != hand for at in self.things.values()):
                gaps = {name: self.gap(hand, name) for name in scene.things}
                nearest = min(gaps, key=lambda name: gaps[name], default="")
                if nearest and self.things[nearest].hand not in grippers:
                    self.take(hand, nearest)

    def _hand(self, name: str) -> Sighting:
        at = self.world.at(self.q[None], [name])
        return Sighting(at.rotation[0, 0], at.position[0, 0], self.time)

    def _first(self) -> dict[str, Attachment]:
        from lgp.world.switches import Modes

        modes = Modes(self.world, ())
        kinematics = self.world.at(self.q[None], modes.frames)
        found = {}
        for name, thing in self.world.scene.things.items():
            pose = modes.pose(name, 0, kinematics, np.zeros(0))
            at = Sighting(pose.rotation[0], pose.position[0], 0.0)
            held = in_hand(self._hand(thing.hand), at) if thing.hand else (at.rotation, at.position)
            found[name] = Attachment(thing.hand, *held)
        return found
