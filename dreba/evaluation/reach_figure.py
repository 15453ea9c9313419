"""The figure of the reach tasks: a standing person of 22 degrees of freedom, from the feet to the grips of the hands.

Its angles are those of the posture table without the shoulder girdle, and the internal rotation of the upper arms,
which REBA does not score. Both legs carry the pelvis at their mean height.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

import reba
from dreba.domain import domain_of
from reba.arrays import Array
from reba.posture.columns import COLUMNS, INDEX, SIDES

HEIGHT: Final = 1.75
"""[m] Stature of the figure."""
SHARES: Final = {
    "ankle": 0.039, "shank": 0.246, "thigh": 0.245, "trunk": 0.288, "half shoulders": 0.129,
    "upper arm": 0.186, "forearm": 0.146, "grip": 0.055,
}  # fmt: skip
"""Segment lengths as shares of stature (Drillis & Contini 1966, in Winter 2009, Fig. 4.1); grip is half the hand."""
ROTATIONS: Final = tuple(f"upper_arm_rotation_{side}" for side in SIDES)
"""[deg] Internal rotation of the upper arms, 0 with the elbow axis pointing sideways."""
ROTATION_LIMITS: Final = (-60.0, 80.0)
"""[deg] American Academy of Orthopaedic Surgeons (1965), Joint Motion, rounded."""
DOFS: Final = (*(column for column in COLUMNS if not column.startswith("shoulder_elevation")), *ROTATIONS)
"""Names of the 22 degrees of freedom."""
_SCORED: Final = np.array([INDEX[name] for name in DOFS if name in INDEX])
DOF_INDEX: Final = {name: index for index, name in enumerate(DOFS)}
"""Place of each degree of freedom."""


class Joint(NamedTuple):
    """Revolute joint: degree of freedom, axis in the parent frame, offset [m] of the next joint in its own frame."""

    dof: int
    axis: tuple[float, float, float]
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)


def _chain(side: str) -> tuple[Joint, ...]:
    """Return the joints from pelvis to hand."""
    out = 1.0 if side == "left" else -1.0
    size = {name: share * HEIGHT for name, share in SHARES.items()}

    def joint(
        name: str, axis: tuple[float, float, float], offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> Joint:
        return Joint(DOF_INDEX[name], axis, offset)

    return (
        joint("trunk_flexion", (0.0, 1.0, 0.0)),
        joint("trunk_side_bend", (1.0, 0.0, 0.0)),
        joint("trunk_twist", (0.0, 0.0, 1.0), (0.0, out * size["half shoulders"], size["trunk"])),
        joint(f"upper_arm_flexion_{side}", (0.0, -1.0, 0.0)),
        joint(f"upper_arm_abduction_{side}", (out, 0.0, 0.0)),
        joint(f"upper_arm_rotation_{side}", (0.0, 0.0, -out), (0.0, 0.0, -size["upper arm"])),
        joint(f"lower_arm_flexion_{side}", (0.0, -1.0, 0.0)),
        joint(f"wrist_twist_{side}", (0.0, 0.0, -out), (0.0, 0.0, -size["forearm"])),
        joint(f"wrist_flexion_{side}", (-out, 0.0, 0.0)),
        joint(f"wrist_deviation_{side}", (0.0, 1.0, 0.0), (0.0, 0.0, -size["grip"])),
    )


CHAINS: Final = {side: _chain(side) for side in SIDES}
"""Joints of each side from the pelvis to the hand."""
ARMS: Final = {side: [joint.dof for joint in CHAINS[side][3:]] for side in SIDES}
"""Places of the degrees of freedom of each arm."""


def limits() -> tuple[Array, Array]:
    """Return lower and upper limits (22,) [deg] of `DOFS`: those of the domain `human` and `ROTATION_LIMITS`."""
    human = domain_of("human")
    ends = np.array([ROTATION_LIMITS, ROTATION_LIMITS])
    return np.append(human.low[_SCORED], ends[:, 0]), np.append(human.high[_SCORED], ends[:, 1])


def neutral() -> Array:
    """Return the neutral posture (22,) [deg]: upright, upper arms hanging, elbows at 80 deg."""
    dofs = np.zeros(len(DOFS))
    for side in SIDES:
        dofs[DOF_INDEX[f"lower_arm_flexion_{side}"]] = 80.0
    return dofs


def posture(dofs: Array) -> Array:
    """Return the angles (22,) [deg] of `reba.COLUMNS` from the degrees of freedom (22,) [deg]."""
    angles = np.zeros(len(COLUMNS))
    angles[_SCORED] = dofs[: len(_SCORED)]
    return angles


def pull_back(gradient: Array) -> Array:
    """Return the gradient (22,) by the degrees of freedom from that by the angles (22,)."""
    by_dofs = np.zeros(len(DOFS))
    by_dofs[: len(_SCORED)] = gradient[_SCORED]
    return by_dofs


def true_score(dofs: Array) -> int:
    """Return the exact REBA score of degrees of freedom (22,) [deg]."""
    return int(reba.score_array(posture(dofs)[None]).reba[0])


def hand(dofs: Array, side: str) -> tuple[Array, Array]:
    """Return the grip position (3,) [m] of a hand and its Jacobian (3, 22) [m/deg].

    Example:
        >>> hand(neutral(), "right")[0].round(2)
        array([ 0.35, -0.23,  1.04])
    """
    base, by_knee = pelvis(dofs)
    position, frame = np.array([0.0, 0.0, base]), np.eye(3)
    origins, axes = [], []
    for joint in CHAINS[side]:
        axis = np.array(joint.axis)
        origins.append(position)
        axes.append(frame @ axis)
        frame = frame @ turn(joint, float(dofs[joint.dof]))
        position = position + frame @ np.array(joint.offset)
    jacobian = np.zeros((3, len(DOFS)))
    (x, y, z), (u, v, w) = np.array(axes).T, (position - np.array(origins)).T
    cross = np.array([y * w - z * v, z * u - x * w, x * v - y * u])
    jacobian[:, [joint.dof for joint in CHAINS[side]]] = np.radians(cross)
    for knee, slope in zip(("knee_flexion_left", "knee_flexion_right"), by_knee, strict=True):
        jacobian[2, DOF_INDEX[knee]] = slope
    return position, jacobian


def from_shoulder(dofs: Array, side: str, target: tuple[float, float, float]) -> Array:
    """Return a point (3,) [m] as seen from the shoulder of n postures (n, 22) [deg], in the frame of the trunk (n, 3).

    Example:
        >>> from_shoulder(neutral()[None], "left", (0.0, 0.129 * HEIGHT, 0.818 * HEIGHT)).round(6) + 0.0
        array([[0., 0., 0.]])
    """
    seen = np.tile(np.array(target), (len(dofs), 1))
    seen[:, 2] -= _pelvis_height(dofs)
    for joint in CHAINS[side][:3]:
        seen = np.einsum("nij,ni->nj", _turns(joint, dofs[:, joint.dof]), seen)
    return np.asarray(seen - np.array(CHAINS[side][2].offset))


def _turns(joint: Joint, angles: Array) -> Array:
    """Return the rotation matrices (n, 3, 3) of a joint at angles (n,) [deg]."""
    along = int(np.flatnonzero(joint.axis)[0])
    one, two = (along + 1) % 3, (along + 2) % 3
    turned = joint.axis[along] * np.radians(angles)
    turns = np.zeros((len(angles), 3, 3))
    turns[:, along, along] = 1.0
    turns[:, one, one] = turns[:, two, two] = np.cos(turned)
    turns[:, two, one] = np.sin(turned)
    turns[:, one, two] = -np.sin(turned)
    return turns


def _pelvis_height(dofs: Array) -> Array:
    """Return the height of the pelvis [m] of postures (n, 22) [deg]."""
    shank, thigh = SHARES["shank"] * HEIGHT, SHARES["thigh"] * HEIGHT
    knees = np.radians(dofs[:, [DOF_INDEX[f"knee_flexion_{side}"] for side in SIDES]])
    legs = np.sqrt(shank**2 + thigh**2 + 2.0 * shank * thigh * np.cos(knees))
    return np.asarray(SHARES["ankle"] * HEIGHT + legs.mean(axis=1))


def pelvis(dofs: Array) -> tuple[float, tuple[float, float]]:
    """Return the height of the pelvis [m], the mean over both legs, and its slope by each knee [m/deg]."""
    shank, thigh = SHARES["shank"] * HEIGHT, SHARES["thigh"] * HEIGHT
    height, slopes = SHARES["ankle"] * HEIGHT, []
    for side in SIDES:
        knee = np.radians(float(dofs[DOF_INDEX[f"knee_flexion_{side}"]]))
        leg = np.sqrt(shank**2 + thigh**2 + 2.0 * shank * thigh * np.cos(knee))
        height += leg / 2.0
        slopes.append(float(np.radians(-shank * thigh * np.sin(knee) / leg / 2.0)))
    return float(height), (slopes[0], slopes[1])


def turn(joint: Joint, angle: float) -> Array:
    """Return the rotation matrix of a joint at an angle [deg]; its axis is a coordinate axis, positive or negative."""
    x, y, z = joint.axis
    c, s = float(np.cos(np.radians(angle))), float(np.sin(np.radians(angle)))
    if x:
        return np.array([[1.0, 0.0, 0.0], [0.0, c, -x * s], [0.0, x * s, c]])
    if y:
        return np.array([[c, 0.0, y * s], [0.0, 1.0, 0.0], [-y * s, 0.0, c]])
    return np.array([[c, -z * s, 0.0], [z * s, c, 0.0], [0.0, 0.0, 1.0]])
