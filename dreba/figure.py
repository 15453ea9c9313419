"""A human figure over the posture table: where the hands are, and how they move with every angle.

22 degrees of freedom: the columns of the posture table without shoulder elevation, which stays 0, and the rotation of
both upper arms about themselves, which REBA does not score. Axes: x forward, y to the left, z up, origin on the floor
below the pelvis; the feet stay on the floor and the pelvis sinks with the knees.

Lengths are shares of the body height: Drillis & Contini (1966), Body Segment Parameters, as printed in Winter (2009),
Biomechanics and Motor Control of Human Movement, figure 4.1.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dreba.domain import domain_of
from reba.posture import COLUMNS, INDEX, SIDES

Array = NDArray[np.float64]

HEIGHT: Final = 1.75
"""[m] Body height of the figure."""
_SHARES: Final = {
    "ankle": 0.039, "shank": 0.246, "thigh": 0.245, "trunk": 0.288, "half shoulders": 0.129,
    "upper arm": 0.186, "forearm": 0.146, "grip": 0.055,
}  # fmt: skip

ROTATIONS: Final = tuple(f"upper_arm_rotation_{side}" for side in SIDES)
"""[deg] Internal rotation of the upper arms, 0 with the elbow hinge across the line of sight."""
ROTATION_LIMITS: Final = (-60.0, 80.0)
"""[deg] American Academy of Orthopaedic Surgeons (1965), Joint Motion, rounded."""
DOFS: Final = (*(column for column in COLUMNS if not column.startswith("shoulder_elevation")), *ROTATIONS)
"""Names of the 22 degrees of freedom."""

_SCORED: Final = np.array([INDEX[name] for name in DOFS if name in INDEX])
_PLACE: Final = {name: place for place, name in enumerate(DOFS)}


class _Joint(NamedTuple):
    """A hinge: degree of freedom, axis in the frame before it, and the way [m] to the next one, in the frame after."""

    dof: int
    axis: tuple[float, float, float]
    ahead: tuple[float, float, float] = (0.0, 0.0, 0.0)


def _chain(side: str) -> tuple[_Joint, ...]:
    out = 1.0 if side == "left" else -1.0
    size = {name: share * HEIGHT for name, share in _SHARES.items()}

    def joint(
        name: str, axis: tuple[float, float, float], ahead: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> _Joint:
        return _Joint(_PLACE[name], axis, ahead)

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


_CHAINS: Final = {side: _chain(side) for side in SIDES}


def limits() -> tuple[Array, Array]:
    """Return (22,) lower and upper limits [deg] of `DOFS`: those of the domain `human`, and of the rotations."""
    human = domain_of("human")
    ends = np.array([ROTATION_LIMITS, ROTATION_LIMITS])
    return np.append(human.low[_SCORED], ends[:, 0]), np.append(human.high[_SCORED], ends[:, 1])


def neutral() -> Array:
    """Return (22,) degrees of standing upright with hanging upper arms and elbows at 80 deg."""
    found = np.zeros(len(DOFS))
    for side in SIDES:
        found[_PLACE[f"lower_arm_flexion_{side}"]] = 80.0
    return found


def posture(dofs: Array) -> Array:
    """Return (22,) angles in the order of `reba.COLUMNS` for the degrees of freedom (22,)."""
    angles = np.zeros(len(COLUMNS))
    angles[_SCORED] = dofs[: len(_SCORED)]
    return angles


def pull_back(gradient: Array) -> Array:
    """Return the gradient (22,) by the degrees of freedom of one by the angles (22,)."""
    found = np.zeros(len(DOFS))
    found[: len(_SCORED)] = gradient[_SCORED]
    return found


def hand(dofs: Array, side: str) -> tuple[Array, Array]:
    """Return where a hand grips, (3,) [m], and its Jacobian (3, 22) [m/deg].

    Example:
        >>> hand(neutral(), "right")[0].round(2)
        array([ 0.35, -0.23,  1.04])
    """
    pelvis, by_knee = _pelvis(dofs)
    position, frame = np.array([0.0, 0.0, pelvis]), np.eye(3)
    origins, axes = [], []
    for joint in _CHAINS[side]:
        axis = np.array(joint.axis)
        origins.append(position)
        axes.append(frame @ axis)
        frame = frame @ _turn(axis, float(dofs[joint.dof]))
        position = position + frame @ np.array(joint.ahead)
    jacobian = np.zeros((3, len(DOFS)))
    (x, y, z), (u, v, w) = np.array(axes).T, (position - np.array(origins)).T
    turned = np.array([y * w - z * v, z * u - x * w, x * v - y * u])
    jacobian[:, [joint.dof for joint in _CHAINS[side]]] = np.radians(turned)
    for knee, slope in zip(("knee_flexion_left", "knee_flexion_right"), by_knee, strict=True):
        jacobian[2, _PLACE[knee]] = slope
    return position, jacobian


def _pelvis(dofs: Array) -> tuple[float, tuple[float, float]]:
    """Return the height of the pelvis [m], the mean over both legs, and its slope by each knee [m/deg]."""
    shank, thigh = _SHARES["shank"] * HEIGHT, _SHARES["thigh"] * HEIGHT
    height, slopes = _SHARES["ankle"] * HEIGHT, []
    for side in SIDES:
        knee = np.radians(float(dofs[_PLACE[f"knee_flexion_{side}"]]))
        leg = np.sqrt(shank**2 + thigh**2 + 2.0 * shank * thigh * np.cos(knee))
        height += leg / 2.0
        slopes.append(float(np.radians(-shank * thigh * np.sin(knee) / leg / 2.0)))
    return float(height), (slopes[0], slopes[1])


def _turn(axis: Array, angle: float) -> Array:
    """Return the rotation by an angle [deg] about one of the coordinate axes, either way round."""
    x, y, z = (float(part) for part in axis)
    c, s = float(np.cos(np.radians(angle))), float(np.sin(np.radians(angle)))
    if x:
        return np.array([[1.0, 0.0, 0.0], [0.0, c, -x * s], [0.0, x * s, c]])
    if y:
        return np.array([[c, 0.0, y * s], [0.0, 1.0, 0.0], [-y * s, 0.0, c]])
    return np.array([[c, -z * s, 0.0], [z * s, c, 0.0], [0.0, 0.0, 1.0]])
