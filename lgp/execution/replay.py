"""A recording as the source of observations: tracked poses, and joints of human and robots if it has them.

All transforms that `reba` reads are accepted (tf2_msgs/TFMessage, foxglove.FrameTransforms ...): a frame with the name
of an object is that object. Joints of agents that were not recorded, and all grippers, come from the simulated robots.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from lgp.errors import LgpError
from lgp.execution.log import joint_topic
from lgp.execution.simulation import SimulatedRobots
from lgp.execution.tracking import Observation, TrackedPose
from lgp.kinematics.world import World
from reba.arrays import Array, Indices
from reba.errors import did_you_mean
from reba.readers.mapping.reference_frames import FrameTree
from reba.readers.mcap import open_mcap
from reba.readers.recording.stream import ReadLog, Recording, Stream


class Replay:
    """Observations from a recording.

    Args:
        robots: source of grippers, and of joints that were not recorded.

    Attributes:
        seconds: length of the recording [s].
        time: since its beginning [s]; the caller advances it.

    Raises:
        LgpError: an object of the scene is not in the recording.
        ReadError: it cannot be read.
    """

    def __init__(self, file: Path, world: World, robots: SimulatedRobots) -> None:
        self.world, self.robots, self.time = world, robots, 0.0
        recording = open_mcap(file)
        poses = {name: _poses(recording, name) for name in world.scene.objects}
        absent = [name for name, samples in poses.items() if not len(samples)]
        if absent:
            known = [name for stream in recording.streams if stream.kind == "frames" for name in stream.names]
            hint = did_you_mean(absent[0], known) or f"; frames are {', '.join(known) or 'none'}"
            raise LgpError(f"{file}: no transform of object {absent[0]!r}{hint}")
        joints = [_joints(recording, world, agent.name) for agent in world.scene.agents]
        ends = [samples[[0, -1], 0] for samples in (*poses.values(), *(one for one, _ in joints)) if len(samples)]
        begin = min(end[0] for end in ends)
        self.seconds = float(max(end[1] for end in ends) - begin)
        self._poses = {name: _since(samples, begin) for name, samples in poses.items()}
        self._joints = [(_since(samples, begin), columns) for samples, columns in joints if len(samples)]

    def observe(self) -> Observation:
        """Return the observation at `time`: the last recorded pose of each object, the last recorded joints."""
        from scipy.spatial.transform import Rotation

        objects = {}
        for name, samples in self._poses.items():
            at = int(np.searchsorted(samples[:, 0], self.time + 1e-9)) - 1
            if at >= 0:
                turn = Rotation.from_quat(samples[at, 1:5]).as_matrix()
                objects[name] = TrackedPose(turn, samples[at, 5:], float(samples[at, 0]))
        q = self.robots.q.copy()
        for samples, columns in self._joints:
            at = max(int(np.searchsorted(samples[:, 0], self.time + 1e-9)) - 1, 0)
            q[columns] = samples[at, 1:]
        return Observation(self.time, q, objects, frozenset(self.robots.closed))


def _poses(recording: Recording, name: str) -> Array:
    """Return (n, 8) time, quaternion, position of a frame, from the first stream that has it."""
    for stream in _streams(recording, "frames"):
        poses = FrameTree(stream, (name,))
        parts = []
        for block in stream.blocks(ReadLog(), poses.wanted):
            turn, position = poses.world(block, name)
            parts.append(np.column_stack([block.time + stream.epoch, turn, position]))
        samples = np.concatenate(parts) if parts else np.empty((0, 8))
        samples = samples[np.isfinite(samples).all(axis=1)]
        if len(samples):
            return samples[np.argsort(samples[:, 0], kind="stable")]
    return np.empty((0, 8))


def _joints(recording: Recording, world: World, agent: str) -> tuple[Array, Indices]:
    """Return (n, 1 + k) time and joints of an agent, and their columns of q (k,); n = 0 if they were not recorded."""
    own = {name.partition(".")[2]: at for name, at in world.column.items() if name.startswith(f"{agent}.")}
    topics = {one.name: joint_topic(world.scene, one.name) for one in world.scene.agents}
    others = set(topics.values()) - {topics[agent]}  # two persons, or robots of one model, have joints of one name
    streams = [stream for stream in _streams(recording, "joints") if stream.name not in others]
    for stream in sorted(streams, key=lambda one: one.name != topics[agent]):
        names = [name for name in stream.names if name in own]
        if not names or len(names) < len(own) / 2:
            continue
        parts = []
        for block in stream.blocks(ReadLog(), names):
            order = [block.names.index(name) for name in names]
            parts.append(np.column_stack([block.time + stream.epoch, block.values[:, order]]))
        samples = np.concatenate(parts) if parts else np.empty((0, 1 + len(names)))
        return samples[np.isfinite(samples).all(axis=1)], np.array([own[name] for name in names], dtype=np.intp)
    return np.empty((0, 1)), np.zeros(0, np.intp)


def _streams(recording: Recording, kind: str) -> Iterable[Stream]:
    return (stream for stream in recording.streams if stream.kind == kind)


def _since(samples: Array, begin: float) -> Array:
    """Return samples (n, ...) with their time, the first column, counted from `begin` [s]."""
    moved = samples.copy()
    if len(moved):
        moved[:, 0] -= begin
    return moved
