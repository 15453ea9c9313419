"""How the rows of a contact bend: an object has one pose in two holders, and each row is a pose difference.

Near a met contact the rotation vector of a chain has the mixed second derivative (omega_a x omega_b) / 2, a later part
of the chain turning with an earlier one; two parts on different sides of the contact have -(omega_2 x omega_1) / 2.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from lgp.world import features
from lgp.world.holders import Holder, Pose
from lgp.world.model import Kinematics
from lgp.world.rotations import skew

Array = NDArray[np.float64]
Slices = NDArray[np.intp]

STEP: Final = 1e-6
"""[m, rad] Of the differences that give the second derivatives by a grip."""


def contact_curvature(
    sides: tuple[Holder, Holder], limbs: Slices, own: Slices, kinematics: Kinematics, z: Array, y: Array
) -> Array:
    """Return sum_i y_i d2 row_i (m, m) of a contact by the joints of its limbs, then its variables.

    Args:
        sides: what has the object after the switch, and before.
        limbs: columns of q.
        own: places in z.
        kinematics: of the slice of the switch (n = 1).
        z: (nz,) all variables.
        y: (6,) weights of the rows: difference of positions, rotation vector in the frame of the first pose.
    """
    poses = [side.pose(kinematics, z[side.variables]) for side in sides]
    world = np.concatenate([y[:3], poses[0].rotation[0] @ y[3:]])
    bend, turns = np.zeros((len(limbs) + len(own),) * 2), []
    for side, pose, sign in zip(sides, poses, (1.0, -1.0), strict=True):
        places = len(limbs) + np.searchsorted(own, np.arange(side.variables.start, side.variables.stop))
        moved = np.flatnonzero(np.any(pose.by_q[0][:, limbs] != 0.0, axis=0))
        turn = np.zeros((3, len(bend)))
        turn[:, moved], turn[:, places] = pose.by_q[0, 3:][:, limbs[moved]], pose.by_variables[0, 3:]
        turns.append(turn)
        if len(moved):
            every = np.concatenate([moved, places])
            bend[np.ix_(every, every)] += _held(side, pose, limbs[moved], kinematics, z, sign * world)
    mixed = -0.5 * (skew(world[3:]) @ turns[1]).T @ turns[0]
    return np.asarray(bend + mixed + mixed.T)


def _held(holder: Holder, held: Pose, limb: Slices, kinematics: Kinematics, z: Array, weights: Array) -> Array:
    """Return the weighted second derivative (m, m) of the pose of a held object by its limb and grip."""
    jacobian = np.concatenate([held.by_q[:, :, limb], held.by_variables], axis=2)
    bend = features.position_curvature(jacobian, weights[None, :3])[0]
    angular = jacobian[0, 3:]
    twist = np.triu((skew(weights[3:]) @ angular).T @ angular, 1)
    bend += 0.5 * (twist + twist.T)
    # The grip is a rotation vector itself: its parts do not come one after the other.
    if holder.slopes is not None:
        grip = z[holder.variables]
        moved = holder.slopes(kinematics, grip + STEP * np.eye(len(grip)))
        slopes = weights @ (moved - held.by_variables) / STEP
        bend[len(limb) :, len(limb) :] = 0.5 * (slopes + slopes.T)
    return np.asarray(bend)
