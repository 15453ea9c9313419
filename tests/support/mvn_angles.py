"""A moving person made up, and the joint angles that Xsens MVN states of it, written out from their definitions.

MVN User Manual, "joint angle definitions" (ISB): Euler angles Z-X-Y of the child in the parent, x forward, y up,
z right; flexion, abduction (of the hand: to the thumb side) and internal rotation are positive on both sides, so are
bends to the right and turns to the left. Frames of the arm are those of the hanging arm, the zero of pronation is the
palm that looks forward, and the frames of a wrist look along it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.support.body_motion import PARENTS, SEGMENTS, BodyMotion
from tests.support.joint_angles import STAND_UP
from tests.support.mvnx_text import JOINTS

Array = NDArray[np.float64]

LINKS = {
    "jL5S1": ("pelvis", "l5"),
    "jL4L3": ("l5", "l3"),
    "jL1T12": ("l3", "t12"),
    "jT9T8": ("t12", "t8"),
    "jT1C7": ("t8", "neck"),
    "jC1Head": ("neck", "head"),
    **{
        f"j{side}{joint}": (
            f"{side.lower()}_{parent}" if parent not in ("t8", "pelvis") else parent,
            f"{side.lower()}_{child}",
        )
        for side in ("Right", "Left")
        for joint, parent, child in (
            ("T4Shoulder", "t8", "shoulder"),
            ("Shoulder", "shoulder", "upper_arm"),
            ("Elbow", "upper_arm", "forearm"),
            ("Wrist", "forearm", "hand"),
            ("Hip", "pelvis", "upper_leg"),
            ("Knee", "upper_leg", "lower_leg"),
            ("Ankle", "lower_leg", "foot"),
            ("BallFoot", "foot", "toe"),
        )
    },
}
"""Joint -> segments on its two sides."""
LENGTHS = {"forearm": 0.29, "hand": 0.25, "lower_leg": 0.42, "foot": 0.41}
"""Segment -> length [m] of the one above it."""


def made_up_motion(n: int = 120, rate: float = 60.0, ahead: float = 0.0) -> BodyMotion:
    """Return a movement of every joint, each at its own pace; elbows and knees are hinges.

    Args:
        n, rate: frames, and how many in a second [Hz].
        ahead: how far [m] the shoulders lie before the hips in the axes of T8; with 0 the trunk by joint centres is
            that by the chest.
    """
    time = np.arange(n) / rate
    names = tuple(SEGMENTS.values())
    rotation: dict[str, Array] = {}
    for number, name in enumerate(names):
        parent = rotation[PARENTS[name]] if name in PARENTS else np.eye(3)
        rotation[name] = parent @ _joint(name, time, 0.7 + 0.13 * number)
    at = {"pelvis": np.tile([0.3, -0.2, 0.95], (n, 1))}
    at["t8"] = at["pelvis"] + rotation["t8"] @ [0.0, 0.0, 0.3]
    at |= {name: at["pelvis"] + rotation["t8"] @ [0.0, 0.0, 0.1] for name in ("l5", "l3", "t12")}
    at |= {name: at["t8"] + rotation["t8"] @ [0.0, 0.0, z] for name, z in (("neck", 0.2), ("head", 0.3))}
    for side, out in (("left", 1.0), ("right", -1.0)):
        at[f"{side}_shoulder"] = at["t8"] + rotation["t8"] @ [0.0, 0.03 * out, 0.15]
        at[f"{side}_upper_arm"] = at["pelvis"] + rotation["t8"] @ [ahead, 0.18 * out, 0.5]
        at[f"{side}_upper_leg"] = at["pelvis"] + rotation["pelvis"] @ [0.0, 0.09 * out, 0.0]
        for name, length in LENGTHS.items():
            above = PARENTS[f"{side}_{name}"]
            at[f"{side}_{name}"] = at[above] - length * rotation[above][:, :, 2]
        at[f"{side}_toe"] = at[f"{side}_foot"] + rotation[f"{side}_foot"] @ [0.14, 0.0, -0.05]
    return BodyMotion(
        time, names, np.stack([rotation[name] for name in names], 1), np.stack([at[name] for name in names], 1)
    )


def _joint(name: str, time: Array, pace: float) -> Array:
    """Return (n, 3, 3) rotations of a segment in its parent; x forward, y left, z up."""
    side, _, part = name.partition("_")
    out = 1.0 if side == "left" else -1.0
    wave = np.sin(pace * 2.0 * np.pi * time + pace)
    other = np.cos(0.8 * pace * 2.0 * np.pi * time)
    if part in ("forearm", "lower_leg"):
        bend = np.radians(50.0 + 35.0 * wave) * (-1.0 if part == "forearm" else 1.0)
        turn = np.radians(25.0 * other) * out * (part == "forearm")
        return Rotation.from_euler("YZ", np.stack([bend, turn], axis=1)).as_matrix()
    size = {"upper_arm": 40.0, "hand": 15.0, "upper_leg": 20.0}.get(part, 8.0)
    return Rotation.from_rotvec(np.radians(size) * np.stack([0.5 * other * out, wave, 0.4 * other], axis=1)).as_matrix()


def mvn_joint_angles(motion: BodyMotion) -> dict[str, Array]:
    """Return joint -> (n, 3) angles [deg] x, y, z as in `jointAngle` of MVNX."""
    return {joint: _triple(joint, motion) for joint in JOINTS}


def _triple(joint: str, motion: BodyMotion) -> Array:
    parent, child = LINKS[joint]
    relative = STAND_UP.T @ motion.relative(child, parent)[0] @ STAND_UP
    left, right = joint.startswith("jLeft"), joint.startswith("jRight")
    if joint.endswith("Wrist"):
        palm = Rotation.from_euler("y", 90.0 if left else -90.0, degrees=True).as_matrix()
        relative = palm @ relative @ palm.T
    z, x, y = Rotation.from_matrix(relative).as_euler("ZXY", degrees=True).T
    if joint.endswith("Knee") or not (left or right):
        z = -z
    if right:
        x = -x
    if left:
        y = -y
    return np.stack([x, y + (90.0 if joint.endswith("Elbow") else 0.0), z], axis=1)


def mvn_orientations(motion: BodyMotion) -> Array:
    """Return (n, 23, 4) quaternions w x y z as in `orientation` of MVNX: frames of the arms are those of the T-pose."""
    quaternions = []
    for name in SEGMENTS.values():
        turned = motion.of(name)
        if name.endswith(("upper_arm", "forearm", "hand")):
            turned = (
                turned @ Rotation.from_euler("x", -90.0 if name.startswith("left") else 90.0, degrees=True).as_matrix()
            )
        quaternions.append(Rotation.from_matrix(turned).as_quat()[:, [3, 0, 1, 2]])
    return np.stack(quaternions, axis=1)


def driver_joint_states(angles: dict[str, Array]) -> dict[str, Array]:
    """Return signal -> (n,) joint states [rad] that the Xsens ROS 2 driver makes of MVN's angles in stream mode.

    xsens_stream_client.cpp, updateJointAngles: y and z change places; x and flexion are negated on the right, axial
    rotation and flexion on the left, but not the flexion of the knees; elbows are turned by 90 degrees.
    """
    words = {"jL5S1": "l5_s1", "jL4L3": "l4_l3", "jL1T12": "l1_t12", "jT9T8": "t9_t8", "jT1C7": "t1_c7"}
    words |= {"jC1Head": "c1_head"}
    states = {}
    for joint, (x, y, z) in ((joint, triple.T) for joint, triple in angles.items()):
        side = next((side for side in ("right", "left") if joint.lower().startswith(f"j{side}")), "")
        part = joint[1 + len(side) :].lower().replace("t4shoulder", "c7_shoulder")
        if side:
            x, y = (-x, y) if side == "right" else (x, -y)
            z = z if part == "knee" else -z
        if part == "elbow":
            y = y - 90.0 if side == "right" else y + 90.0
        name = f"{side}_{part}" if side else words[joint]
        states |= {f"{name}_{axis}": np.radians(value) for axis, value in (("x", x), ("y", z), ("z", y))}
    return states
