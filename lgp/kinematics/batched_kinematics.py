"""Batched forward kinematics with NumPy, faster than a loop over Pinocchio for many configurations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from reba.arrays import Array, Flags, Indices


@dataclass(frozen=True)
class _Level:
    """The k joints of one depth of the tree: numbers, parents, columns of q, whether prismatic, placements."""

    joints: Indices
    parents: Indices
    columns: Indices
    prismatic: Flags
    rotation: Array
    """(k, 3, 3)"""
    position: Array
    """(k, 3, 1)"""


@dataclass(frozen=True)
class Placements:
    """Placements of F frames for n configurations.

    Attributes:
        rotation: (n, F, 3, 3).
        position: (n, F, 3) [m].
        spatial: (n, 6, nq) spatial velocity of each joint at the origin of the world, linear part first.
    """

    rotation: Array
    position: Array
    spatial: Array


class BatchedKinematics:
    """Forward kinematics of a tree of one-coordinate joints, all configurations at once, one level of depth at a time.

    Args:
        model: the kinematic tree; frames may be added to it later.
    """

    def __init__(self, model: pin.Model) -> None:
        self.model = model
        data = model.createData()
        spatial = pin.computeJointJacobians(model, data, np.zeros(model.nq)).reshape(6, model.nq)
        count = model.njoints
        self._axes = np.tile(np.eye(3), (count, 1, 1))
        self._columns = np.array([0, *(model.joints[number].idx_q for number in range(1, count))], dtype=np.intp)
        self._prismatic = np.zeros(count, dtype=bool)
        depth = np.zeros(count, dtype=np.intp)
        parents = np.array(list(model.parents), dtype=np.intp)
        for number in range(1, count):
            motion = spatial[:, self._columns[number]]
            self._prismatic[number] = not np.any(np.abs(motion[3:]) > 0.5)
            axis = data.oMi[number].rotation.T @ (motion[:3] if self._prismatic[number] else motion[3:])
            self._axes[number] = _rotation_to(axis)
            depth[number] = depth[parents[number]] + 1
        self._levels = []
        for level in range(1, int(depth.max(initial=0)) + 1):
            joints = np.flatnonzero(depth == level)
            to_parent = self._axes[parents[joints]].transpose(0, 2, 1)
            placed = [model.jointPlacements[int(joint)] for joint in joints]
            rotation = to_parent @ np.array([one.rotation for one in placed]) @ self._axes[joints]
            position = to_parent @ np.array([one.translation for one in placed])[:, :, None]
            self._levels.append(
                _Level(joints, parents[joints], self._columns[joints], self._prismatic[joints], rotation, position)
            )

    def at(self, q: Array, frames: Sequence[int]) -> Placements:
        """Return the placements of frames (numbers in the model) for configurations (n, nq)."""
        n, count = len(q), self.model.njoints
        rotations, positions = np.empty((count, n, 3, 3)), np.empty((count, n, 3))
        rotations[0], positions[0] = np.eye(3), 0.0
        sine, cosine = np.sin(q.T)[:, :, None], np.cos(q.T)[:, :, None]
        for level in self._levels:
            before = rotations[level.parents].reshape(-1, 3 * n, 3)
            at = (before @ level.rotation).reshape(-1, n, 3, 3)
            position = positions[level.parents] + (before @ level.position).reshape(-1, n, 3)
            c, s = cosine[level.columns], sine[level.columns]
            if level.prismatic.any():
                c[level.prismatic], s[level.prismatic] = 1.0, 0.0
                position[level.prismatic] += at[level.prismatic, :, :, 2] * q.T[level.columns[level.prismatic], :, None]
            along, across = at[..., 0], at[..., 1]
            turned = rotations[level.joints]
            turned[..., 0], turned[..., 1], turned[..., 2] = c * along + s * across, c * across - s * along, at[..., 2]
            rotations[level.joints], positions[level.joints] = turned, position
        parents = np.array([self.model.frames[frame].parentJoint for frame in frames], dtype=np.intp)
        placed = [self.model.frames[frame].placement for frame in frames]
        axes = self._axes[parents].transpose(0, 2, 1)
        before = rotations[parents].reshape(-1, 3 * n, 3)
        rotation = (before @ (axes @ np.array([one.rotation for one in placed]))).reshape(-1, n, 3, 3)
        offset = axes @ np.array([one.translation for one in placed])[:, :, None]
        position = positions[parents] + (before @ offset).reshape(-1, n, 3)
        spatial = self._spatial(rotations[1:, :, :, 2], positions[1:])
        return Placements(rotation.transpose(1, 0, 2, 3), position.transpose(1, 0, 2), spatial)

    def _spatial(self, axes: Array, positions: Array) -> Array:
        """Return the spatial velocities (n, 6, nq) of joints with axes and positions (joints, n, 3)."""
        spatial = np.zeros((axes.shape[1], 6, self.model.nq))
        columns, prismatic = self._columns[1:], self._prismatic[1:]
        axes, positions = axes.transpose(2, 1, 0), positions.transpose(2, 1, 0)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            moment = positions[j] * axes[k] - positions[k] * axes[j]
            spatial[:, i, columns] = np.where(prismatic, axes[i], moment)
            spatial[:, 3 + i, columns] = np.where(prismatic, 0.0, axes[i])
        return spatial


def _rotation_to(axis: Array) -> Array:
    """Return a rotation (3, 3) that takes z to a unit vector."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(other, axis)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])
