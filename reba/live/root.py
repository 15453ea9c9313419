"""The pose of the pelvis while it is being recorded: the newest samples, and which frames they suffice for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reba.live.source import Source, followed
from reba.readers.framepose import FramePoses
from reba.readers.mcap.container import Segment
from reba.readers.root import HOLD, RootPose, root_samples
from reba.readers.stream import ReadLog, Stream

LONGEST = 60.0
"""[s] Samples older than this behind the newest one are let go in any case."""

KEPT = 2.0
"""[s] Samples older than this behind the oldest waiting frame are let go."""


class LiveRoot:
    """Follows the frame of the pelvis.

    Args:
        pose: what the first samples gave: axes and vertical.
        stream: where the frame is.
        name: the frame.
    """

    def __init__(self, pose: RootPose, stream: Stream, name: str) -> None:
        self._poses = FramePoses(stream, (name,))
        self._intake = followed(stream, self._poses.wanted, ReadLog())
        self._stream, self._name = stream, name
        self.pose = replace(pose, time=np.empty(0), quaternions=np.empty((0, 4)))

    def take(self, source: Source, segment: Segment) -> None:
        """Take up the samples of a segment."""
        self._intake.take(source, segment)
        block = self._intake.flush_whole()
        if block is None:
            return
        rows = root_samples(self._poses, self._stream, self._name, block)
        time = np.concatenate([self.pose.time, rows[:, 0]])
        quaternions = np.concatenate([self.pose.quaternions, rows[:, 1:]])
        order = np.argsort(time, kind="stable")
        time, quaternions = time[order], quaternions[order]
        flips = np.cumprod(np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0, -1.0, 1.0))
        quaternions[1:] *= flips[:, None]
        self.pose = replace(self.pose, time=time, quaternions=quaternions)
        if len(time):
            self.forget(float(time[-1]) - LONGEST)

    def until(self, newest: float) -> float:
        """Return the time up to which frames need not wait: a later sample is there, or none came for too long.

        Args:
            newest: time of the newest frame that waits.
        """
        last = float(self.pose.time[-1]) if len(self.pose.time) else -np.inf
        return max(last, newest - HOLD)

    def forget(self, before: float) -> None:
        """Let go of samples that no frame from time `before` on can need."""
        kept = max(int(np.searchsorted(self.pose.time, before - KEPT)) - 1, 0)
        self.pose = replace(self.pose, time=self.pose.time[kept:], quaternions=self.pose.quaternions[kept:])
