"""Closed-form inverse kinematics of the legs of a standing person, for any pose of the pelvis and fixed soles.

`solve_legs` returns all leg joints, `knees` knee flexion and leg reach with derivatives for the optimiser. The distance
of hip and ankle determines the knee (law of cosines), the direction of the hip in the axes of the foot the ankle, and
the remaining rotation the hip.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from lgp.kinematics.features import rotation_about_z
from lgp.kinematics.human import ISB, LEGS, sided
from lgp.scene.body_measures import lengths, table
from lgp.scene.model import Human
from reba.arrays import Array
from reba.posture.columns import SIDES

_lengths = cache(lengths)


def solve_legs(pelvis: Array, stature: float, sex: str) -> tuple[dict[str, Array], Array]:
    """Return the leg joints that keep the soles in the pose they have when every joint is 0.

    Args:
        pelvis: (n, 5) pelvis_x, pelvis_y, pelvis_z [m], pelvis_yaw, pelvis_tilt [rad].
        stature: [m].
        sex: "male" or "female".

    Returns:
        Joint name -> (n,) angle [rad], and (n, 2) by how much [m] the distance of hip and ankle exceeds the length of
        the left and right leg; where positive the knee is straight and the sole leaves its place.

    >>> angles, beyond = solve_legs(np.zeros((1, 5)), 1.75, "male")
    >>> bool(abs(angles["left_knee_Z"][0]) < 1e-6 and beyond.max() < 1e-9)
    True
    """
    measures = lengths(stature, sex)
    thigh, shank = measures["thigh"], measures["shank"]
    body = _rotation(pelvis[:, 3], pelvis[:, 4]) @ ISB
    centre = pelvis[:, :3] + np.array([0.0, 0.0, measures["ankle_height"] + shank + thigh])
    joints: dict[str, Array] = {}
    beyond = np.empty((len(pelvis), 2))
    for number, side in enumerate(SIDES):
        out = measures["half_hips"] * (1.0 if side == "right" else -1.0)
        hip_centre = centre + body @ np.array([0.0, 0.0, out])
        ankle = np.array([0.0, -out, measures["ankle_height"]])
        from_ankle = (hip_centre - ankle) @ ISB
        distance = np.linalg.norm(from_ankle, axis=1)
        beyond[:, number] = distance - (thigh + shank)
        cosine = (distance**2 - thigh**2 - shank**2) / (2.0 * thigh * shank)
        knee = np.arccos(np.clip(cosine, -1.0, 1.0))
        angles = _leg(ISB.T @ body, from_ankle, knee, thigh, shank)
        # The left side is the right one in a mirror: turns about x and y change sign.
        for name, angle in zip(LEGS, angles, strict=True):
            mirrored = side == "left" and not name.endswith("Z")
            joints[f"{side}_{name}"] = -angle if mirrored else angle
    return joints, beyond


STRAIGHTEST = np.radians(3.0)
"""[rad] Least knee flexion within reach: at a straight knee flexion has no derivative by the height of the pelvis.

Beyond reach flexion decays exponentially to 0 from the same value and slope, so that it stays differentiable."""


def knees(pelvis: Array, stature: float, sex: str) -> tuple[Array, Array, Array, Array]:
    """Return knee flexion and leg reach for fixed soles, with derivatives by the five joints of the pelvis.

    The arguments are those of `solve_legs`.

    Returns:
        Flexion (n, 2) [rad] left and right, `STRAIGHTEST` or more within reach, and its Jacobian (n, 2, 5); distance
        of hip and ankle less that of a leg with the straightest knee (n, 2) [m], <= 0 within reach, and its Jacobian.
    """
    measures = _lengths(stature, sex)
    thigh, shank = measures["thigh"], measures["shank"]
    out = measures["half_hips"] * np.array([-1.0, 1.0])
    sine, cosine = np.sin(pelvis[:, 3, None]), np.cos(pelvis[:, 3, None])
    # Hip from ankle; the hip line lies along the axis of the tilt, so only the yaw moves it.
    away = np.empty((len(pelvis), 2, 3))
    away[:, :, 0] = pelvis[:, 0, None] + out * sine
    away[:, :, 1] = pelvis[:, 1, None] - out * cosine + out
    away[:, :, 2] = pelvis[:, 2, None] + shank + thigh
    by_pelvis = np.zeros((len(pelvis), 2, 5))
    by_pelvis[:, :, :3] = away
    by_pelvis[:, :, 3] = away[:, :, 0] * out * cosine + away[:, :, 1] * out * sine
    distance = np.linalg.norm(away, axis=2)
    by_pelvis /= distance[:, :, None]
    longest = np.sqrt(thigh**2 + shank**2 + 2.0 * thigh * shank * np.cos(STRAIGHTEST))
    beyond = distance - longest
    knee, slope = _flexion(np.minimum(distance, longest), thigh, shank)
    fade = np.exp(np.maximum(beyond, 0.0) * slope / knee)
    return fade * knee, (fade * slope)[:, :, None] * by_pelvis, beyond, by_pelvis


def _flexion(distance: Array, thigh: float, shank: float) -> tuple[Array, Array]:
    """Return knee flexion [rad] at hip-ankle distances within leg length, and its derivative, 0 if folded."""
    cosine = (distance**2 - thigh**2 - shank**2) / (2.0 * thigh * shank)
    knee = np.arccos(np.clip(cosine, -1.0, 1.0))
    return knee, np.where(cosine > -1.0, -distance / (thigh * shank * np.maximum(np.sin(knee), 1e-9)), 0.0)


def _leg(body: Array, from_ankle: Array, knee: Array, thigh: float, shank: float) -> tuple[Array, ...]:
    """Return hip Z, X, Y, knee, ankle Z, X of a right leg, (n,) each [rad], for a knee flexion (n,) [rad].

    Args:
        body: (n, 3, 3) pelvis in the axes of the foot.
        from_ankle: (n, 3) hip relative to the ankle in the axes of the foot [m].
    """
    ankle_x = np.arctan2(-from_ankle[:, 2], from_ankle[:, 1])
    upright = np.hypot(from_ankle[:, 1], from_ankle[:, 2])
    # In the axes of the shank the hip is at (-thigh sin knee, shank + thigh cos knee); the ankle rotates it.
    ankle_z = (
        np.arctan2(from_ankle[:, 0], upright) - np.arctan2(thigh * np.sin(knee), -shank - thigh * np.cos(knee)) + np.pi
    )
    ankle_z = np.remainder(ankle_z + np.pi, 2.0 * np.pi) - np.pi
    return (*_hip(body, knee, ankle_z, ankle_x), knee, ankle_z, ankle_x)


def _hip(body: Array, knee: Array, ankle_z: Array, ankle_x: Array) -> tuple[Array, Array, Array]:
    """Return hip Z, X, Y from pelvis -> foot = Z X Y (knee, ankle Z) (ankle X)."""
    below = _about(2, ankle_z - knee) @ _about(0, ankle_x)
    hip = np.swapaxes(below @ body, 1, 2)
    # Z(a) X(-b) Y(c): the second column is (-sin a cos b, cos a cos b, -sin b), the third row gives c.
    flexion = np.arctan2(-hip[:, 0, 1], hip[:, 1, 1])
    abduction = np.arcsin(np.clip(-hip[:, 2, 1], -1.0, 1.0))
    turn = np.arctan2(-hip[:, 2, 0], hip[:, 2, 2])
    return flexion, abduction, turn


def _rotation(yaw: Array, tilt: Array) -> Array:
    return _about(2, yaw) @ _about(1, tilt)


def _about(axis: int, angle: Array) -> Array:
    """Return (n, 3, 3) rotations about axis 0, 1 or 2."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    out = np.zeros((len(angle), 3, 3))
    out[:, axis, axis] = 1.0
    out[:, i, i] = out[:, j, j] = np.cos(angle)
    out[:, j, i] = np.sin(angle)
    out[:, i, j] = -out[:, j, i]
    return out


class LegSegments:
    """Hip, knee and ankle of a person whose soles stay in place, from the pose of the pelvis.

    The knee is in front, in the plane of hip, ankle and the direction of the foot.

    Args:
        ground: poses (n, 3, 3), (n, 3) [m] of the frame that the soles stand in, of a person who may step.
    """

    def __init__(self, person: Human, ground: tuple[Array, Array] | None = None) -> None:
        self.measures = _lengths(person.stature, person.sex)
        standing: tuple[Array, Array] = rotation_about_z(np.radians(person.yaw)), np.array(person.position)
        self.rotation, self.origin = standing if ground is None else ground

    def ends(self, leg: str, rotation: Array, position: Array) -> tuple[Array, Array]:
        """Return both ends (n, 3) [m] of "left thigh", "right shank" ... for poses (n, 3, 3), (n, 3) of the pelvis."""
        side, _, segment = leg.partition(" ")
        hip = self.hip(side, rotation, position)
        knee = self.knee(side, hip)
        return (hip, knee) if segment == "thigh" else (knee, np.broadcast_to(self.ankle(side), hip.shape))

    def hip(self, side: str, rotation: Array, position: Array) -> Array:
        """Return the hip (n, 3) [m]."""
        return position + rotation @ ISB @ np.array([0.0, 0.0, self._out(side)])

    def knee(self, side: str, hip: Array) -> Array:
        """Return the knee (n, 3) [m] for hips (n, 3)."""
        thigh, shank = self.measures["thigh"], self.measures["shank"]
        ankle, ahead = self.ankle(side), self.rotation[..., 0]
        upwards = hip - ankle
        distance = np.linalg.norm(upwards, axis=1, keepdims=True)
        upwards = upwards / distance
        along = upwards @ ahead if ahead.ndim == 1 else np.einsum("ni,ni->n", upwards, ahead)
        forward = ahead - along[:, None] * upwards
        forward /= np.linalg.norm(forward, axis=1, keepdims=True)
        share = (distance**2 + shank**2 - thigh**2) / (2.0 * distance)
        bent = np.sqrt(np.maximum(shank**2 - share**2, 0.0))
        return np.asarray(ankle + share * upwards + bent * forward)

    def knee_by_hip(self, side: str, hip: Array) -> Array:
        """Return the derivative (n, 3, 3) of the knee by the hip, by central differences."""
        steps = 1e-6 * np.eye(3)
        ahead, behind = (np.stack([self.knee(side, hip + sense * step) for step in steps], 2) for sense in (1.0, -1.0))
        return np.asarray((ahead - behind) / 2e-6)

    def _out(self, side: str) -> float:
        return self.measures["half_hips"] * (1.0 if side == "right" else -1.0)

    def ankle(self, side: str) -> Array:
        """Return the ankle, (3,) or (n, 3) [m]."""
        return self.origin + self.rotation @ np.array([0.0, -self._out(side), self.measures["ankle_height"]])


def rest_posture(stature: float, sex: str) -> dict[str, float]:
    """Return joint -> value [rad, m] of the posture with the lowest REBA score, soles on the floor; others are 0."""
    values: dict[str, float] = {}
    for name, degrees in table()["rest"].items():
        if name == "pelvis_drop":
            values["pelvis_z"] = -degrees
        else:
            values |= {sided(name, side): float(np.radians(degrees)) for side in SIDES}
    pelvis = np.array([[0.0, 0.0, values["pelvis_z"], 0.0, 0.0]])
    bent, _ = solve_legs(pelvis, stature, sex)
    return values | {name: float(angle[0]) for name, angle in bent.items()}
