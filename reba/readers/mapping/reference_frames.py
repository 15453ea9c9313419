"""Reference frames of a recording: tree of frames (as in tf), pose of the pelvis over time, vertical axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from reba.arrays import Array
from reba.posture.angles import unit
from reba.readers.recording.profile import Profile
from reba.readers.recording.quaternions import matrices, product, rotated
from reba.readers.recording.stream import Block, ReadLog, Stream


class FrameTree:
    """Poses of the wanted frames `names` of a stream in the root of their tree."""

    def __init__(self, stream: Stream, names: Sequence[str]) -> None:
        self._parent = dict(zip(stream.names, stream.parents or ("",) * len(stream.names), strict=False))
        parents: dict[str, list[str]] = {}
        for name, parent in zip(stream.names, stream.parents or ("",) * len(stream.names), strict=False):
            parents.setdefault(name, []).append(parent)
        wanted: dict[str, None] = {}
        waiting = list(names)[::-1]
        while waiting:
            name = waiting.pop()
            if name in parents and name not in wanted:
                wanted[name] = None
                waiting += parents[name][::-1]
        self.wanted = tuple(wanted)
        self._block: Block | None = None
        self._known: dict[str, tuple[Array, Array]] = {}

    def root_of(self, name: str) -> str:
        """Return the root of a frame: where its chain of parents ends, "" for the world."""
        seen = set()
        while name in self._parent and name not in seen:
            seen.add(name)
            name = self._parent[name]
        return name

    def world(self, block: Block, name: str) -> tuple[Array, Array]:
        """Return (n, 4) quaternions qx qy qz qw and (n, 3) positions of a frame in its root; NaN where unknown."""
        if self._block is not block:
            self._block, self._known = block, {}
            self._at: dict[str, list[int]] = {}
            for index, signal in enumerate(block.names):
                self._at.setdefault(signal, []).append(index)
            self._parent.update(zip(block.names, block.parents, strict=False))
        if name in self._known:
            return self._known[name]
        unknown = np.full((len(block.time), 7), np.nan)
        known = unknown[:, 3:], unknown[:, :3]
        for at in self._at.get(name, []):
            # A frame that is given in one parent and later in another has a pose where either is known.
            self._known[name] = unit(block.values[:, at, 3:]), block.values[:, at, :3]  # a cycle of parents ends here
            quaternion, position = self._in_root(block, at)
            there = ~np.isnan(quaternion).any(axis=1, keepdims=True)
            known = np.where(there, quaternion, known[0]), np.where(there, position, known[1])
        self._known[name] = known
        return known

    def _in_root(self, block: Block, at: int) -> tuple[Array, Array]:
        """Return the pose of one signal of a block in the root of its tree."""
        position, quaternion = block.values[:, at, :3], unit(block.values[:, at, 3:])
        parent = block.parents[at] if block.parents else self._parent.get(block.names[at], "")
        if parent in self._at:
            base, origin = self.world(block, parent)
            position = origin + rotated(base, position)
            quaternion = product(base, quaternion)
        return quaternion, position


HOLD = 0.2
"""[s] Largest distance in time from a sample to a frame that uses its pose."""


@dataclass(frozen=True)
class PelvisPose:
    """Orientation of the pelvis over time.

    Attributes:
        time: (m,) Unix time or seconds [s], increasing.
        quaternions: (m, 4) qx qy qz qw of the frame in the world, neighbours in the same hemisphere.
        axes: (3, 3) the ISB axes of the pelvis in that frame.
        up: (3,) vertical of the world.
        assumed: which frame and vertical were used, for the user.
        stream: name of the stream of frames.
        log: of its reading.
    """

    time: Array
    quaternions: Array
    axes: Array
    up: Array
    assumed: str
    stream: str = ""
    log: ReadLog = field(default_factory=ReadLog)

    def at(self, time: Array) -> Array:
        """Return (n, 3, 3) ISB frames of the pelvis at (n,) times [s], interpolated on the shorter arc; NaN in gaps."""
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


def pelvis_samples(poses: FrameTree, stream: Stream, name: str, block: Block) -> Array:
    """Return the (m, 5) times [s] and quaternions of a frame in a block; samples without a pose are left out."""
    quaternions, _ = poses.world(block, name)
    rows = np.column_stack([block.time + stream.epoch, quaternions])
    return rows[np.isfinite(rows).all(axis=1)]


def read_pelvis_pose(profile: Profile, streams: list[tuple[Stream, str]], axes: Array) -> PelvisPose | None:
    """Return the pose of the pelvis from the first stream that has it, or None.

    Args:
        streams: streams of frames of the recording and the name of the pelvis frame in each.
        axes: (3, 3) the ISB axes in the root frame.
    """
    for stream, name in streams:
        poses = FrameTree(stream, (name,))
        parts: list[Array] = []
        log = ReadLog()
        for block in stream.blocks(log, poses.wanted):
            parts.append(pelvis_samples(poses, stream, name, block))
        samples = np.concatenate(parts) if parts else np.empty((0, 5))
        if not len(samples):
            continue
        samples = samples[np.argsort(samples[:, 0], kind="stable")]
        time, quaternions = samples[:, 0], samples[:, 1:]
        flips = np.cumprod(np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0, -1.0, 1.0))
        quaternions[1:] *= flips[:, None]
        vertical = VerticalAxis(stream.up, "z")
        vertical.add_directions(np.matmul(matrices(quaternions), axes)[:, :, 1], None, None, None)
        vertical.is_consistent()
        up = vertical.up
        if up is None:
            continue
        world = poses.root_of(name) or "the world"
        text = f"pelvis orientation from frame {name} of {stream.name}, vertical {vertical.name} of {world}"
        return PelvisPose(time, quaternions, axes, up, text, stream.name, log)
    return None


MIN_COSINE_STATED = -0.5
"""Smallest cosine between the vertical that a file states and that of the body; below it the body decides."""
MIN_COSINE_USUAL = 0.5
"""The same for a vertical that is only usual for a source."""


BACKWARDS = -0.5
"""Cosine between the hip line's forward and that of toes or face below which a frame is turned about; a choice."""
SOME = 0.005
"""Share of such frames that is a warning; a choice."""


def axis_vector(name: str) -> Array:
    """Return the unit vector of "x", "-y" ...

    >>> axis_vector("-y").tolist()
    [0.0, -1.0, 0.0]
    """
    vector = np.zeros(3)
    vector["xyz".index(name[-1])] = -1.0 if name[0] == "-" else 1.0
    return vector


def axis_name(vector: Array) -> str:
    """Return the name of the signed axis nearest to a vector."""
    index = int(np.argmax(np.abs(vector)))
    return ("-" if vector[index] < 0 else "") + "xyz"[index]


class VerticalAxis:
    """The vertical axis of a recording, chosen from its first frames and checked against all of them.

    It is `stated` by the file or `usual` for the source; each is "" if there is none.
    """

    def __init__(self, stated: str, usual: str) -> None:
        self.stated, self.usual = stated, usual
        self.name = stated or usual
        self.swapped = False
        self.assumed: list[str] = []
        self.warnings: list[str] = []
        self.begin()

    @property
    def up(self) -> Array | None:
        """(3,) unit vector of the vertical, or None where neither the file nor the body shows it."""
        return axis_vector(self.name) if self.name else None

    def begin(self) -> None:
        """Start a pass over the recording."""
        self._upward = np.zeros(3)
        self._facing = self._agreement = 0.0
        self._frames = self._faced = self._backwards = 0

    def add_directions(
        self, upward: Array | None, right: Array | None, forward: Array | None, shoulders: Array | None
    ) -> None:
        """Add (n, 3) directions of a block: feet to head, left to right hip, heel to toe, left to right shoulder.

        Any of them may be None or contain NaN.
        """
        if upward is not None:
            self._upward += np.nansum(unit(upward), axis=0)
        if right is None:
            return
        self._frames += len(right)
        if not self.name and np.any(self._upward):
            self.name = axis_name(self._upward)
        if forward is not None and self.up is not None:
            heading = unit(np.cross(self.up, right))
            cosines = np.sum(heading * unit(forward), axis=1)
            self._facing += float(np.nansum(cosines))
            self._faced += int(np.isfinite(cosines).sum())
            self._backwards += int(np.count_nonzero(cosines < BACKWARDS))
        if shoulders is not None:
            self._agreement += float(np.nansum(np.sum(unit(right) * unit(shoulders), axis=1)))

    def is_consistent(self) -> bool:
        """Return whether vertical and sides fit all frames; if not, they are changed for another pass."""
        before = (self.name, self.swapped)
        length = float(np.linalg.norm(self._upward))
        if length > 0:
            body = self._upward / length
            cosine = float(body @ axis_vector(self.name)) if self.name else -1.0
            if cosine < (MIN_COSINE_STATED if self.stated else MIN_COSINE_USUAL) and self.name != axis_name(body):
                old, self.name = self.name, axis_name(body)
                if old:
                    self._warn(f"the vertical is {self.name} by the body (head above feet), not {old}")
        if not self.stated and self.name and self.name != self.usual and np.any(self._upward):
            self._assume(f"vertical {self.name} determined from the body (head above feet)")
        # Which way the body faces was seen from the former vertical, so only an unchanged one tells the sides.
        if self.name == before[0] and self._frames and self._facing / self._frames < -0.3:
            self.swapped = not self.swapped
            what = "left and right look exchanged, or the axes are left-handed"
            self._warn(f"{what} (toes or face point backwards for the hip line); sides exchanged")
        elif self.name == before[0] and self._backwards > SOME * self._faced:
            what = f"left and right look exchanged in {self._backwards} of {self._faced} frames"
            self._warn(f"{what} (toes or face point backwards for the hip line): check them")
        if self._frames and self._agreement / self._frames < -0.3:
            self._warn("left and right of hips and shoulders contradict each other: check the names")
        return before == (self.name, self.swapped)

    def _warn(self, text: str) -> None:
        if text not in self.warnings:
            self.warnings.append(text)

    def _assume(self, text: str) -> None:
        if text not in self.assumed:
            self.assumed.append(text)
