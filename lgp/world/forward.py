"""Forward kinematics of many configurations at once: the batched twin of Pinocchio's, joint after joint in numpy.

Pinocchio takes one configuration at a time, and half of that time goes into handing results to Python. Here each joint
of a tree is one step for the whole batch. Joints turn about or slide along the z axis of their own frame: whatever
turns their axis there is put into the constant placements of what they carry (Craig 2005, chapter 3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


@dataclass(frozen=True)
class _Level:
    """The k joints as far from the world as each other: their numbers, carriers, columns of q and placements."""

    joints: Numbers
    parents: Numbers
    columns: Numbers
    slides: NDArray[np.bool_]
    rotation: Array
    """(k, 3, 3)"""
    position: Array
    """(k, 3, 1)"""


@dataclass(frozen=True)
class Placements:
    """What `Forward.at` returns, for n configurations and F frames.

    Attributes:
        rotation: (n, F, 3, 3).
        position: (n, F, 3).
        spatial: (n, 6, nq) motion of each joint as felt at the world's origin, linear part first.
    """

    rotation: Array
    position: Array
    spatial: Array


class Forward:
    """Forward kinematics of a model whose joints each have one coordinate.

    Args:
        model: the kinematic tree; frames may still be added to it.

    Example:
        >>> Forward(model).at(q, [model.getFrameId("human.left_hand")]).position      # doctest: +SKIP
    """

    def __init__(self, model: pin.Model) -> None:
        self.model = model
        data = model.createData()
        spatial = pin.computeJointJacobians(model, data, np.zeros(model.nq)).reshape(6, model.nq)
        count = model.njoints
        self._turns = np.tile(np.eye(3), (count, 1, 1))
        self._columns = np.array([0, *(model.joints[number].idx_q for number in range(1, count))], dtype=np.intp)
        self._slides = np.zeros(count, dtype=bool)
        depth = np.zeros(count, dtype=np.intp)
        parents = np.array(list(model.parents), dtype=np.intp)
        for number in range(1, count):
            motion = spatial[:, self._columns[number]]
            self._slides[number] = not np.any(np.abs(motion[3:]) > 0.5)
            axis = data.oMi[number].rotation.T @ (motion[:3] if self._slides[number] else motion[3:])
            self._turns[number] = _onto(axis)
            depth[number] = depth[parents[number]] + 1
        self._levels = []
        for level in range(1, int(depth.max(initial=0)) + 1):
            joints = np.flatnonzero(depth == level)
            carried = self._turns[parents[joints]].transpose(0, 2, 1)
            placed = [model.jointPlacements[int(joint)] for joint in joints]
            rotation = carried @ np.array([one.rotation for one in placed]) @ self._turns[joints]
            position = carried @ np.array([one.translation for one in placed])[:, :, None]
            self._levels.append(
                _Level(joints, parents[joints], self._columns[joints], self._slides[joints], rotation, position)
            )

    def at(self, q: Array, frames: Sequence[int]) -> Placements:
        """Return the placements of frames, by their numbers in the model, for configurations (n, nq)."""
        n, count = len(q), self.model.njoints
        rotations, positions = np.empty((count, n, 3, 3)), np.empty((count, n, 3))
        rotations[0], positions[0] = np.eye(3), 0.0
        sine, cosine = np.sin(q.T)[:, :, None], np.cos(q.T)[:, :, None]
        for level in self._levels:
            before = rotations[level.parents].reshape(-1, 3 * n, 3)
            at = (before @ level.rotation).reshape(-1, n, 3, 3)
            position = positions[level.parents] + (before @ level.position).reshape(-1, n, 3)
            c, s = cosine[level.columns], sine[level.columns]
            if level.slides.any():
                c[level.slides], s[level.slides] = 1.0, 0.0
                position[level.slides] += at[level.slides, :, :, 2] * q.T[level.columns[level.slides], :, None]
            along, across = at[..., 0], at[..., 1]
            turned = rotations[level.joints]
            turned[..., 0], turned[..., 1], turned[..., 2] = c * along + s * across, c * across - s * along, at[..., 2]
            rotations[level.joints], positions[level.joints] = turned, position
        carriers = np.array([self.model.frames[frame].parentJoint for frame in frames], dtype=np.intp)
        placed = [self.model.frames[frame].placement for frame in frames]
        turn = self._turns[carriers].transpose(0, 2, 1)
        before = rotations[carriers].reshape(-1, 3 * n, 3)
        rotation = (before @ (turn @ np.array([one.rotation for one in placed]))).reshape(-1, n, 3, 3)
        offset = turn @ np.array([one.translation for one in placed])[:, :, None]
        position = positions[carriers] + (before @ offset).reshape(-1, n, 3)
        spatial = self._spatial(rotations[1:, :, :, 2], positions[1:])
        return Placements(rotation.transpose(1, 0, 2, 3), position.transpose(1, 0, 2), spatial)

    def _spatial(self, axes: Array, positions: Array) -> Array:
        """Return the motions (n, 6, nq) of joints with given axes and positions (joints, n, 3)."""
        spatial = np.zeros((axes.shape[1], 6, self.model.nq))
        columns, slides = self._columns[1:], self._slides[1:]
        axes, positions = axes.transpose(2, 1, 0), positions.transpose(2, 1, 0)
        for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
            moment = positions[j] * axes[k] - positions[k] * axes[j]
            spatial[:, i, columns] = np.where(slides, axes[i], moment)
            spatial[:, 3 + i, columns] = np.where(slides, 0.0, axes[i])
        return spatial


def _onto(axis: Array) -> Array:
    """Return a rotation (3, 3) whose third column is a unit vector."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    first = np.cross(other, axis)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(axis, first), axis])
