"""Observed poses and the recent past of the world: `TrackedWorld` answers what geometry can say about them."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from lgp.kinematics.world import World
from lgp.scene.model import SceneObject, Table
from reba.arrays import Array


@dataclass(frozen=True)
class TrackedPose:
    """A pose in the world: rotation (3, 3), position (3,) [m], and when it was seen [s]."""

    rotation: Array
    position: Array
    time: float


@dataclass(frozen=True)
class Observation:
    """One moment.

    Attributes:
        time: [s] since the run began.
        q: (nq,) joints of everybody: encoders of the robots, motion capture of the human [rad, m].
        things: last sighting of each object that was ever seen.
        closed: robot hands whose grippers are closed.
    """

    time: float
    q: Array
    things: Mapping[str, TrackedPose]
    closed: frozenset[str] = frozenset()


class ObservationSource(Protocol):
    """Where observations come from: a simulated tracker, a recording, a real one."""

    def observe(self) -> Observation:
        """Return the present moment."""
        ...


@dataclass(frozen=True)
class Tolerances:
    """What counts as met; generous against the noise of optical trackers (about 1 mm).

    Attributes:
        reach: largest gap between the point of a hand that grasps and the box of an object in it [m].
        still: objects that move less within the window are at rest, or move with the hand [m].
        level: largest gap between the underside of an object and the table it lies on [m].
        moved, turned: an object farther from where it was planned is somewhere else [m, rad].
        joints: robots farther from where a motion starts are somewhere else [rad].
        window: time that is looked back [s].
        fresh: sightings that are older say nothing about movement [s].
        stale: objects not seen for longer are lost [s].
    """

    reach: float = 0.03
    still: float = 0.01
    level: float = 0.02
    moved: float = 0.015
    turned: float = 0.15
    joints: float = 0.02
    window: float = 0.3
    fresh: float = 0.1
    stale: float = 0.4


class TrackedWorld:
    """The last moments of the world, and what can be said about them.

    Args:
        world: kinematics and scene.
        tolerances: what counts as met.

    Attributes:
        world, tolerances: as given.
        now: the last observation.

    Example:
        >>> view = View(world)                                      # doctest: +SKIP
        >>> view.add(source.observe())                              # doctest: +SKIP
        >>> view.gap("baxter.right", "screwdriver")                 # doctest: +SKIP
        0.21
    """

    def __init__(self, world: World, tolerances: Tolerances | None = None) -> None:
        self.world = world
        self.tolerances = Tolerances() if tolerances is None else tolerances
        self._past: deque[tuple[Observation, dict[str, TrackedPose]]] = deque()

    @property
    def now(self) -> Observation:
        """The last observation."""
        return self._past[-1][0]

    def add(self, observation: Observation) -> None:
        """Take in one more moment and forget what is older than the window."""
        hands = tuple(self.world.scene.hands)
        at = self.world.at(observation.q[None], hands)
        found = {
            name: TrackedPose(at.rotation[0, number], at.position[0, number], observation.time)
            for name, number in at.index.items()
        }
        self._past.append((observation, found))
        while self.now.time - self._past[0][0].time > self.tolerances.window + 1e-6:
            self._past.popleft()

    def settled(self) -> bool:
        """Return whether the window is full, so that rest can be told from a glance."""
        return self.now.time - self._past[0][0].time > 0.6 * self.tolerances.window

    def hand(self, name: str) -> TrackedPose:
        """Return where a hand is; its position is the point that grasps."""
        return self._past[-1][1][name]

    def seen(self, thing: str) -> TrackedPose | None:
        """Return where an object is, None if it is lost from tracking."""
        sighting = self.now.things.get(thing)
        if sighting is None or self.now.time - sighting.time > self.tolerances.stale:
            return None
        return sighting

    def mean(self, thing: str) -> TrackedPose | None:
        """Return an object at rest where it was on average over the window, which evens out noise."""
        last = self.seen(thing)
        if last is None:
            return None
        seen = [at.things[thing] for at, _ in self._fresh(thing)] or [last]
        left, _, right = np.linalg.svd(np.sum([one.rotation for one in seen], axis=0))
        turn = left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right
        return TrackedPose(turn, np.mean([one.position for one in seen], axis=0), last.time)

    def gap(self, hand: str, thing: str) -> float:
        """Return the distance [m] between the grasping point of a hand and the box of a seen object, 0 inside it."""
        return box_gap(self.hand(hand).position, self.now.things[thing], self.world.scene.objects[thing])

    def watched(self, thing: str) -> bool:
        """Return whether an object was seen for long enough that rest can be told from movement."""
        seen = self._fresh(thing)
        return bool(seen) and seen[-1][0].time - seen[0][0].time > 0.6 * self.tolerances.window

    def rests(self, thing: str) -> bool:
        """Return whether a watched object has not moved in the window."""
        return self.watched(thing) and _spread([at.things[thing].position for at, _ in self._fresh(thing)]) <= (
            self.tolerances.still
        )

    def moves_with(self, thing: str, hand: str) -> bool:
        """Return whether a watched object has not moved in the frame of a hand in the window, both at rest included."""
        spots = [
            hands[hand].rotation.T @ (at.things[thing].position - hands[hand].position)
            for at, hands in self._fresh(thing)
        ]
        return self.watched(thing) and _spread(spots) <= self.tolerances.still

    def _fresh(self, thing: str) -> list[tuple[Observation, dict[str, TrackedPose]]]:
        """Return the moments of the window in which an object was really seen."""
        return [
            (at, hands)
            for at, hands in self._past
            if thing in at.things and at.time - at.things[thing].time <= self.tolerances.fresh
        ]

    def table_under(self, thing: str) -> str:
        """Return the full name of the table that a seen object lies on, "" if on none."""
        scene, sighting = self.world.scene, self.now.things[thing]
        low = sighting.position[2] - half_height(scene.objects[thing], sighting.rotation)
        for name, table in scene.tables.items():
            if on_top(table, sighting.position) and abs(low - table.height) <= self.tolerances.level:
                return name
        return ""


def box_gap(point: Array, at: TrackedPose, thing: SceneObject) -> float:
    """Return the distance [m] of a (3,) point from the box of an object, 0 inside it."""
    inside = np.abs(at.rotation.T @ (point - at.position)) - np.array(thing.size) / 2.0
    return float(np.linalg.norm(np.maximum(inside, 0.0)))


def half_height(thing: SceneObject, rotation: Array) -> float:
    """Return how far [m] an object reaches below its middle when turned by a (3, 3) rotation."""
    return float(np.abs(rotation[2]) @ np.array(thing.size)) / 2.0


def on_top(table: Table, position: Array) -> bool:
    """Return whether a (3,) position is above or below the top of a table."""
    yaw = np.radians(table.yaw)
    x, y = position[:2] - np.array(table.position)
    along, across = np.cos(yaw) * x + np.sin(yaw) * y, np.cos(yaw) * y - np.sin(yaw) * x
    return bool(abs(along) <= table.size[0] / 2.0 and abs(across) <= table.size[1] / 2.0)


def _spread(spots: list[Array]) -> float:
    """Return the largest distance [m] of spots from their middle."""
    points = np.array(spots)
    return float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())
