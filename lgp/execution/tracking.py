"""Observations of the world over a short window, and the geometric relations read off them (`TrackedWorld`)."""

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
    """A pose in the world: rotation (3, 3), position (3,) [m], time of its observation [s]."""

    rotation: Array
    position: Array
    time: float


@dataclass(frozen=True)
class Observation:
    """The observed state of the world at one time.

    Attributes:
        time: [s] since the run began.
        q: (nq,) joints: encoders of the robots, motion capture of the human [rad, m].
        objects: last tracked pose of each object that was ever seen.
        closed: robot hands whose grippers are closed.
    """

    time: float
    q: Array
    objects: Mapping[str, TrackedPose]
    closed: frozenset[str] = frozenset()


class ObservationSource(Protocol):
    """A source of observations: simulated tracker, recording or real tracker."""

    def observe(self) -> Observation:
        """Return the current observation."""
        ...


@dataclass(frozen=True)
class Tolerances:
    """Tolerances of the predicates; wide against the noise of optical trackers (about 1 mm).

    Attributes:
        reach: largest distance between the grasping point of a hand and the box of an object in it [m].
        still: largest distance from its mean position over the window of an object at rest [m].
        level: largest gap between the underside of an object and the table it lies on [m].
        inclined: largest inclination of an object in a hand that counts as level: the noise of trackers [rad].
        moved, turned: largest deviation of an object from its planned pose [m, rad].
        joints: largest deviation of a robot joint from the initial configuration of a motion [rad, m].
        window: length of the observed past [s].
        fresh: largest age of a tracked pose that counts as an observation of movement [s].
        stale: age of its last tracked pose after which an object is lost [s].
    """

    reach: float = 0.03
    still: float = 0.01
    level: float = 0.02
    inclined: float = 0.015
    moved: float = 0.015
    turned: float = 0.15
    joints: float = 0.02
    window: float = 0.3
    fresh: float = 0.1
    stale: float = 0.4


class TrackedWorld:
    """The observations of the last `Tolerances.window`, and the geometric relations that hold in them."""

    def __init__(self, world: World, tolerances: Tolerances | None = None) -> None:
        self.world = world
        self.tolerances = Tolerances() if tolerances is None else tolerances
        self._past: deque[tuple[Observation, dict[str, TrackedPose]]] = deque()
        self._tables: dict[str, Table] = {}

    @property
    def now(self) -> Observation:
        """The last observation."""
        return self._past[-1][0]

    def add(self, observation: Observation) -> None:
        """Append an observation and drop those older than the window."""
        scene = self.world.scene
        at = self.world.at(observation.q[None], (*scene.hands, *scene.carried_tables))
        self._tables = {name: at.table(name) for name in scene.tables}
        hand_poses = {
            name: TrackedPose(at.rotation[0, number], at.position[0, number], observation.time)
            for name, number in at.index.items()
        }
        self._past.append((observation, hand_poses))
        while self.now.time - self._past[0][0].time > self.tolerances.window + 1e-6:
            self._past.popleft()

    def settled(self) -> bool:
        """Return whether the window is long enough to tell rest from movement."""
        return self.now.time - self._past[0][0].time > 0.6 * self.tolerances.window

    def hand(self, name: str) -> TrackedPose:
        """Return the pose of a hand, its grasping point, or of a carried table, the centre of its top."""
        return self._past[-1][1][name]

    def table(self, name: str) -> Table:
        """Return a table as it stands in the world now."""
        return self._tables[name]

    def carried_under(self, object_name: str) -> str:
        """Return the table that a robot carries with an object on it, "" if there is none or the object is lost."""
        under = "" if self.seen(object_name) is None else self.table_under(object_name)
        return under if under in self.world.scene.carried_tables else ""

    def seen(self, object_name: str) -> TrackedPose | None:
        """Return the pose of an object, None if it is lost from tracking."""
        pose = self.now.objects.get(object_name)
        return None if pose is None or self.now.time - pose.time > self.tolerances.stale else pose

    def mean(self, object_name: str) -> TrackedPose | None:
        """Return the mean pose of an object over the window, None if it is lost: at rest, the mean cancels noise.

        On a table that a robot carries it is the last one: a mean would lag behind.
        """
        last = self.seen(object_name)
        if last is None or self.carried_under(object_name):
            return last
        seen = [at.objects[object_name] for at, _ in self._fresh(object_name)] or [last]
        left, _, right = np.linalg.svd(np.sum([one.rotation for one in seen], axis=0))
        turn = left @ np.diag([1.0, 1.0, np.sign(np.linalg.det(left @ right))]) @ right
        return TrackedPose(turn, np.mean([one.position for one in seen], axis=0), last.time)

    def lies(self, object_name: str) -> tuple[str, TrackedPose] | None:
        """Return the table that a robot carries under an object, "" for none, and the mean pose of the object.

        It is in the frame of that top, else in the world. None if the object is lost.
        """
        at, under = self.mean(object_name), self.carried_under(object_name)
        if at is None or not under:
            return None if at is None else ("", at)
        top = self.hand(under)
        position = top.rotation.T @ (at.position - top.position)
        return under, TrackedPose(top.rotation.T @ at.rotation, position, at.time)

    def gap(self, hand: str, object_name: str) -> float:
        """Return the distance [m] between the grasping point of a hand and the box of a seen object, 0 inside it."""
        return box_gap(self.hand(hand).position, self.now.objects[object_name], self.world.scene.objects[object_name])

    def watched(self, object_name: str) -> bool:
        """Return whether an object was seen for long enough to tell rest from movement."""
        seen = self._fresh(object_name)
        return bool(seen) and seen[-1][0].time - seen[0][0].time > 0.6 * self.tolerances.window

    def rests(self, object_name: str) -> bool:
        """Return whether a watched object has not moved in the window; on a table that a robot carries, not on it."""
        carried = self.carried_under(object_name)
        if carried:
            return self.moves_with(object_name, carried)
        positions = [at.objects[object_name].position for at, _ in self._fresh(object_name)]
        return self.watched(object_name) and _spread(positions) <= self.tolerances.still

    def moves_with(self, object_name: str, hand: str) -> bool:
        """Return whether a watched object has not moved in the frame of a hand in the window, both at rest included.

        A table that a robot carries stands for a hand.
        """
        positions = [
            hands[hand].rotation.T @ (at.objects[object_name].position - hands[hand].position)
            for at, hands in self._fresh(object_name)
        ]
        return self.watched(object_name) and _spread(positions) <= self.tolerances.still

    def _fresh(self, object_name: str) -> list[tuple[Observation, dict[str, TrackedPose]]]:
        """Return the observations of the window in which an object was seen, with the poses of the hands."""
        return [
            (at, hands)
            for at, hands in self._past
            if object_name in at.objects and at.time - at.objects[object_name].time <= self.tolerances.fresh
        ]

    def table_under(self, object_name: str) -> str:
        """Return the full name of the table that a seen object lies on, "" if there is none."""
        scene, pose = self.world.scene, self.now.objects[object_name]
        low = pose.position[2] - half_height(scene.objects[object_name], pose.rotation)
        for name, table in self._tables.items():
            if on_top(table, pose.position) and abs(low - table.height) <= self.tolerances.level:
                return name
        return ""


def box_gap(point: Array, at: TrackedPose, scene_object: SceneObject) -> float:
    """Return the distance [m] of a (3,) point from the box of an object, 0 inside it."""
    inside = np.abs(at.rotation.T @ (point - at.position)) - np.array(scene_object.size) / 2.0
    return float(np.linalg.norm(np.maximum(inside, 0.0)))


def half_height(scene_object: SceneObject, rotation: Array) -> float:
    """Return the height [m] of an object's centre above its lowest point under a rotation (3, 3)."""
    return float(np.abs(rotation[2]) @ np.array(scene_object.size)) / 2.0


def on_top(table: Table, position: Array) -> bool:
    """Return whether a (3,) position is above or below the top of a table."""
    yaw = np.radians(table.yaw)
    x, y = position[:2] - np.array(table.position)
    along, across = np.cos(yaw) * x + np.sin(yaw) * y, np.cos(yaw) * y - np.sin(yaw) * x
    return bool(abs(along) <= table.size[0] / 2.0 and abs(across) <= table.size[1] / 2.0)


def _spread(positions: list[Array]) -> float:
    """Return the largest distance [m] of positions (3,) from their mean."""
    points = np.array(positions)
    return float(np.linalg.norm(points - points.mean(axis=0), axis=1).max())
