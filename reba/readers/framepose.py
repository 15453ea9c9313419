"""Poses along a tree of frames: quaternions and positions in the frame at the root."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from reba.angles import cross, unit
from reba.readers.stream import Block, Stream

Array = NDArray[np.float64]


class FramePoses:
    """World poses of some frames of a stream.

    Args:
        stream: a stream of frames.
        names: the frames whose poses are wanted.
    """

    def __init__(self, stream: Stream, names: Sequence[str]) -> None:
        self._parent = dict(zip(stream.names, stream.parents or ("",) * len(stream.names), strict=False))
        wanted: dict[str, None] = {}
        for name in names:
            while name in self._parent and name not in wanted:
                wanted[name] = None
                name = self._parent[name]
        self.wanted = tuple(wanted)
        self._block: Block | None = None
        self._known: dict[str, tuple[Array, Array]] = {}

    def root_of(self, name: str) -> str:
        """Return the frame that a chain of parents ends in, "" for the world."""
        seen = set()
        while name in self._parent and name not in seen:
            seen.add(name)
            name = self._parent[name]
        return name

    def world(self, block: Block, name: str) -> tuple[Array, Array]:
        """Return (n, 4) quaternions qx qy qz qw and (n, 3) positions of a frame in its root; NaN where unknown."""
        if self._block is not block:
            self._block, self._known = block, {}
            self._at = {known: index for index, known in enumerate(block.names)}
            self._parent.update(zip(block.names, block.parents, strict=False))
        if name in self._known:
            return self._known[name]
        at = self._at.get(name)
        if at is None:
            nothing = np.full((len(block.time), 7), np.nan)
            return nothing[:, 3:], nothing[:, :3]
        position, quaternion = block.values[:, at, :3], unit(block.values[:, at, 3:])
        self._known[name] = (quaternion, position)  # a loop of parents ends here
        parent = self._parent.get(name, "")
        if parent in self._at:
            base, origin = self.world(block, parent)
            position = origin + rotated(base, position)
            quaternion = product(base, quaternion)
        self._known[name] = (quaternion, position)
        return self._known[name]


def product(a: Array, b: Array) -> Array:
    """Return the (n, 4) product of quaternions qx qy qz qw: first b, then a."""
    av, aw, bv, bw = a[:, :3], a[:, 3:], b[:, :3], b[:, 3:]
    vector = aw * bv + bw * av + cross(av, bv)
    return np.concatenate([vector, aw * bw - np.sum(av * bv, axis=1, keepdims=True)], axis=1)


def rotated(quaternion: Array, vectors: Array) -> Array:
    """Return (n, 3) vectors turned by (n, 4) unit quaternions."""
    across = 2.0 * cross(quaternion[:, :3], vectors)
    return vectors + quaternion[:, 3:] * across + cross(quaternion[:, :3], across)


def matrices(quaternions: Array) -> Array:
    """Return (n, 3, 3) rotation matrices of (n, 4) unit quaternions qx qy qz qw."""
    x, y, z, w = np.ascontiguousarray(quaternions.T)
    result = np.empty((len(quaternions), 3, 3))
    for index, (i, j, k) in enumerate(((x, y, z), (y, z, x), (z, x, y))):
        after = (index + 1) % 3
        result[:, index, index] = 1.0 - 2.0 * (j * j + k * k)
        result[:, index, after] = 2.0 * (i * j - k * w)
        result[:, after, index] = 2.0 * (i * j + k * w)
    return result
