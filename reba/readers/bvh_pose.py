"""Forward kinematics of a BVH skeleton, over all frames at once: a loop over joints, none over frames."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

CHANNELS: dict[str, tuple[str, int]] = {
    f"{axis}{kind}": (kind, index) for kind in ("position", "rotation") for index, axis in enumerate("xyz")
}
"""Channel name in lower case: what it moves and the axis 0, 1 or 2. Rotations are in degrees."""


@dataclass(frozen=True)
class Joint:
    """One joint or end site.

    Attributes:
        name: as in the file.
        parent: index of the parent, -1 for a root.
        offset: (3,) from the parent, in the parent's axes.
        channels: keys of `CHANNELS`, in the order of the file, which is the order of the rotations.
    """

    name: str
    parent: int
    offset: NDArray[np.float64]
    channels: tuple[str, ...]


@dataclass(frozen=True)
class Skeleton:
    """Joints, each behind its parent, and what rows of channel values do to them."""

    joints: tuple[Joint, ...]

    @property
    def width(self) -> int:
        """Channel values in a frame."""
        return sum(len(joint.channels) for joint in self.joints)

    def rest(self) -> NDArray[np.float64]:
        """Return (k, 7) global poses with every channel zero: summed offsets and identity quaternions."""
        poses = np.zeros((len(self.joints), 7))
        poses[:, 6] = 1.0
        for index, joint in enumerate(self.joints):
            poses[index, :3] = joint.offset + (poses[joint.parent, :3] if joint.parent >= 0 else 0.0)
        return poses

    def adds_positions(self, rows: NDArray[np.float64]) -> bool | None:
        """Return whether position channels of inner joints add to the offset; None where there are none.

        Some exporters write the whole translation there, so that it replaces the offset, others the departure from
        it. What is nearer to the offsets than to zero replaces them.
        """
        to_zero = to_offset = 0.0
        start = 0
        for joint in self.joints:
            for channel in joint.channels:
                kind, axis = CHANNELS[channel]
                if kind == "position" and joint.parent >= 0:
                    to_zero += float(np.median(np.abs(rows[:, start])))
                    to_offset += float(np.median(np.abs(rows[:, start] - joint.offset[axis])))
                start += 1
        return None if to_zero == to_offset == 0.0 else to_zero <= to_offset

    def poses(self, rows: NDArray[np.float64], add: bool | None) -> NDArray[np.float64]:
        """Return (n, k, 7) global poses x y z qx qy qz qw of channel values (n, `width`).

        Args:
            rows: positions in the unit of the file, rotations in degrees, in the order of the file.
            add: whether position channels of inner joints add to the offset, see `adds_positions`.
        """
        poses = np.empty((len(rows), len(self.joints), 7))
        start = 0
        for index, joint in enumerate(self.joints):
            moved = np.tile(joint.offset, (len(rows), 1))
            turn: NDArray[np.float64] = np.tile([0.0, 0.0, 0.0, 1.0], (len(rows), 1))
            for channel in joint.channels:
                kind, axis = CHANNELS[channel]
                value = rows[:, start]
                start += 1
                if kind == "rotation":
                    turn = multiply(turn, axis_turn(axis, np.radians(value)))
                elif joint.parent >= 0 and add is False:
                    moved[:, axis] = value
                else:
                    moved[:, axis] += value
            if joint.parent >= 0:
                parent = poses[:, joint.parent]
                poses[:, index, :3] = parent[:, :3] + rotate(parent[:, 3:], moved)
                poses[:, index, 3:] = multiply(parent[:, 3:], turn)
            else:
                poses[:, index, :3] = moved
                poses[:, index, 3:] = turn
        return poses


def axis_turn(axis: int, angle: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (n, 4) quaternions x y z w of turns by `angle` (n,) [rad] about the axis 0, 1 or 2."""
    turn = np.zeros((len(angle), 4))
    turn[:, axis] = np.sin(angle / 2)
    turn[:, 3] = np.cos(angle / 2)
    return turn


def multiply(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Hamilton product of quaternions (n, 4) x y z w: the turn `second` inside the turn `first`."""
    a, b = first[:, :3], second[:, :3]
    product = np.empty_like(first)
    product[:, :3] = first[:, 3:] * b + second[:, 3:] * a + np.cross(a, b)
    product[:, 3] = first[:, 3] * second[:, 3] - np.sum(a * b, axis=1)
    return product


def rotate(turn: NDArray[np.float64], vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the vectors (n, 3) turned by unit quaternions (n, 4) x y z w."""
    twice = 2.0 * np.cross(turn[:, :3], vector)
    return vector + turn[:, 3:] * twice + np.cross(turn[:, :3], twice)
