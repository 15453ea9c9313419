"""The pose of the pelvis in the world from a stream of frames, for joints that are relative to the pelvis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reba.angles import unit
from reba.readers.framepose import FramePoses, matrices
from reba.readers.orient import Orientation
from reba.readers.profile import Profile
from reba.readers.stream import Block, ReadLog, Stream

Array = NDArray[np.float64]

HOLD = 0.2
"""[s] A pose is not carried further than this beyond the samples it comes from."""


@dataclass(frozen=True)
class RootPose:
    """Orientation of the pelvis over time.

    Attributes:
        time: (m,) Unix time or seconds [s], increasing.
        quaternions: (m, 4) qx qy qz qw of the frame in the world, neighbours in the same half of the sphere.
        axes: (3, 3) the ISB axes of the pelvis in that frame.
        up: (3,) vertical of the world.
        assumed: what was taken for what.
    """

    time: Array
    quaternions: Array
    axes: Array
    up: Array
    assumed: str

    def at(self, time: Array) -> Array:
        """Return (n, 3, 3) ISB frames of the pelvis at (n,) times, between samples by the shorter arc; NaN in gaps."""
        after = np.clip(np.searchsorted(self.time, time), 1, max(len(self.time) - 1, 1))
        after = np.minimum(after, len(self.time) - 1)
        before = np.maximum(after - 1, 0)
        start, end = self.time[before], self.time[after]
        with np.errstate(invalid="ignore", divide="ignore"):
            share = np.clip(np.nan_to_num((time - start) / (end - start)), 0.0, 1.0)[:, None]
        mixed = (1.0 - share) * self.quaternions[before] + share * self.quaternions[after]
        near = np.minimum(np.abs(time - start), np.abs(time - end)) <= HOLD
        mixed = np.where(near[:, None], mixed, np.nan)
        return np.matmul(matrices(unit(mixed)), self.axes)


def root_samples(poses: FramePoses, stream: Stream, name: str, block: Block) -> Array:
    """Return the (m, 5) times [s] and quaternions of a frame in a block, those without a pose left out."""
    quaternions, _ = poses.world(block, name)
    rows = np.column_stack([block.time + stream.epoch, quaternions])
    return rows[np.isfinite(rows).all(axis=1)]


def read_root(profile: Profile, streams: list[tuple[Stream, str]], axes: Array) -> RootPose | None:
    """Return the pelvis' pose from the first stream that holds it, or None.

    Args:
        profile: the joints profile.
        streams: streams of frames of the recording and the name of the root frame in each.
        axes: (3, 3) the ISB axes in the root frame.
    """
    for stream, name in streams:
        poses = FramePoses(stream, (name,))
        parts: list[Array] = []
        for block in stream.blocks(ReadLog(), poses.wanted):
            parts.append(root_samples(poses, stream, name, block))
        samples = np.concatenate(parts) if parts else np.empty((0, 5))
        if not len(samples):
            continue
        samples = samples[np.argsort(samples[:, 0], kind="stable")]
        time, quaternions = samples[:, 0], samples[:, 1:]
        flips = np.cumprod(np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0, -1.0, 1.0))
        quaternions[1:] *= flips[:, None]
        orientation = Orientation(stream.up, "z")
        orientation.watch(np.matmul(matrices(quaternions), axes)[:, :, 1], None, None, None)
        orientation.settled()
        up = orientation.up
        if up is None:
            continue
        world = poses.root_of(name) or "the world"
        text = f"pelvis orientation from frame {name} of {stream.name}, vertical {orientation.name} of {world}"
        return RootPose(time, quaternions, axes, up, text)
    return None
