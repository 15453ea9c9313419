"""Joint coordinates of two ROS models of a person, solved from segment orientations.

Every angle is an analytic decomposition in the order of the model's joints, not a fit. What a model has no joint for
is left out, and that is the point of the comparison in `docs/encodings.md`.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.support.body_motion import BodyMotion

Array = NDArray[np.float64]
Angles = dict[str, Array]
Hinges = Literal["directions", "angles"]

STAND_UP = Rotation.from_euler("x", 90, degrees=True).as_matrix()
"""The axes of human.urdf (x forward, y up, z right) in those of REP 103 (x forward, y left, z up)."""
ABDOMEN = 0.223
HIP = np.array([0.023, -0.100, 0.0])
CLAVICLE = np.array([0.0, 0.176, 0.0])
SHOULDER = np.array([0.008, -0.075, 0.21])
"""Offsets [m] in human.urdf: length of the abdomen, mid hip in the pelvis, clavicle in the thorax, right shoulder."""
_SIDE = {"left": 1.0, "right": -1.0}


def _euler(order: str, rotation: Array) -> Array:
    """Return (n, 3) intrinsic Euler angles [rad]."""
    return Rotation.from_matrix(rotation).as_euler(order)


def _turn(axis: str, angle: Array) -> Array:
    return Rotation.from_euler(axis, angle[:, None]).as_matrix()


def _between(parent: Array, child: Array) -> Array:
    return np.swapaxes(parent, 1, 2) @ child


def _hinge(relative: Array, sign: float) -> tuple[Array, Array, Array]:
    """Split a rotation into Ry(turn) Rz(sign * bend) Ry(axial) with bend >= 0, as the limits of elbow and knee demand.

    A model whose hinge cannot leave its plane carries the direction of the distal segment only if the proximal one is
    turned about its own axis; this is that turn. The split is singular for a straight hinge, where only turn + axial
    is defined.
    """
    # The distal axis is Ry(turn) Rz(a) y = (-cos(turn) sin(a), cos(a), sin(turn) sin(a)).
    bend = np.arccos(np.clip(relative[:, 1, 1], -1.0, 1.0))
    turn = np.arctan2(sign * relative[:, 2, 1], -sign * relative[:, 0, 1])
    rest = np.swapaxes(_turn("y", turn) @ _turn("z", sign * bend), 1, 2) @ relative
    return turn, bend, np.arctan2(rest[:, 0, 2], rest[:, 0, 0])


def human_urdf_angles(motion: BodyMotion, hinges: Hinges = "angles") -> Angles:
    """Return the 36 joint coordinates [rad] of `human_36dof_ISB_model`, each (n,), by name.

    Spine: the thoracic joint completes the lumbar one to the exact orientation of T8; the lumbar joint places the
    shoulders, see `_lumbar`. Clavicle: elevation of the line from the collar to the shoulder; the rest of the girdle
    goes into the shoulder. Wrist and ankle: Z, X, Y with the last one left out.

    Args:
        motion: segment poses.
        hinges: elbow and knee of the model bend in one plane, those of a person do not quite. "directions": upper arm
            and thigh are turned about their own axis so that forearm and lower leg point where they did. "angles":
            shoulder, pronation and hip are exact. The bend is the angle between the two segments either way.
    """
    model = {name: STAND_UP.T @ motion.of(name) @ STAND_UP for name in motion.names}
    raised = {side: _raised(model, side, sign) for side, sign in _SIDE.items()}
    z, x = _lumbar(motion, model, raised)
    lumbar = _turn("z", z) @ _turn("x", x)
    thoracic = _euler("ZXY", _between(lumbar, _between(model["pelvis"], model["t8"])))
    cervical = _euler("ZXY", _between(model["t8"], model["head"]))
    angles = {"middle_lumbar_Z": -z, "middle_lumbar_X": x}
    for joint, turns in (("thoracic", thoracic), ("cervical", cervical)):
        angles |= {
            f"middle_{joint}_Z": -turns[:, 0],
            f"middle_{joint}_X": turns[:, 1],
            f"middle_{joint}_Y": turns[:, 2],
        }
    for side, sign in _SIDE.items():
        angles |= _arm(model, side, sign, raised[side], hinges) | _leg(model, side, sign, hinges)
    return angles


def _raised(model: dict[str, Array], side: str, sign: float) -> Array:
    """Return the elevation (n,) [rad] of the line from the collar to the shoulder in the thorax."""
    girdle = _between(model["t8"], model[f"{side}_shoulder"])
    return np.arcsin(np.clip(-sign * girdle[:, 1, 2], -1.0, 1.0))


def _lumbar(motion: BodyMotion, model: dict[str, Array], raised: dict[str, Array]) -> tuple[Array, Array]:
    """Return lumbar turns about z and x [rad] that keep the direction of the line from hips to shoulders.

    Orientation of T8 and direction of that line are five numbers, the lumbar and thoracic joints five coordinates. The
    line of the model is abdomen + rest, with the abdomen of fixed length; rest follows from T8 and the clavicles.
    """
    line = _between(motion.of("pelvis") @ STAND_UP, trunk_line(motion))[:, :, 2]
    middle = CLAVICLE + sum(
        _turn("x", sign * raised[side]) @ (SHOULDER * [1.0, 1.0, -sign]) / 2 for side, sign in _SIDE.items()
    )
    rest = np.einsum("nij,nj->ni", _between(model["pelvis"], model["t8"]), middle) - HIP
    along = np.sum(line * rest, axis=1)
    length = along + np.sqrt(along**2 - np.sum(rest * rest, axis=1) + ABDOMEN**2)
    abdomen = (length[:, None] * line - rest) / ABDOMEN
    return np.arctan2(-abdomen[:, 0], abdomen[:, 1]), np.arcsin(np.clip(abdomen[:, 2], -1.0, 1.0))


def _arm(model: dict[str, Array], side: str, sign: float, raised: Array, hinges: Hinges) -> Angles:
    clavicle = _turn("x", sign * raised)
    shoulder = _between(clavicle, _between(model["t8"], model[f"{side}_upper_arm"]))
    elbow = _between(model[f"{side}_upper_arm"], model[f"{side}_forearm"])
    turn, bend, axial = _hinge(elbow, 1.0)
    if hinges == "directions":
        shoulder = shoulder @ _turn("y", turn)
    else:
        axial = _euler("ZXY", elbow)[:, 2]
    triple = _euler("ZXY", shoulder)
    # The model stands with the palms forward, Xsens with the palms on the thighs: a quarter turn of the forearm.
    palm = _turn("y", np.full(len(axial), sign * np.pi / 2))
    wrist = _euler("ZXY", palm @ _between(model[f"{side}_forearm"], model[f"{side}_hand"]) @ np.swapaxes(palm, 1, 2))
    return {
        f"{side}_clavicle_joint_X": raised,
        f"{side}_shoulder_Z": triple[:, 0],
        f"{side}_shoulder_X": sign * triple[:, 1],
        f"{side}_shoulder_Y": -sign * triple[:, 2],
        f"{side}_elbow_Z": bend,
        f"{side}_elbow_Y": np.mod(1.5 * np.pi - sign * axial, 2 * np.pi) - np.pi,
        f"{side}_wrist_Z": wrist[:, 0],
        f"{side}_wrist_X": sign * wrist[:, 1],
    }


def _leg(model: dict[str, Array], side: str, sign: float, hinges: Hinges) -> Angles:
    thigh, shank = model[f"{side}_upper_leg"], model[f"{side}_lower_leg"]
    turn, bend, _ = _hinge(_between(thigh, shank), -1.0)
    if hinges == "directions":
        thigh = thigh @ _turn("y", turn)
        shank = thigh @ _turn("z", -bend)
    hip = _euler("ZXY", _between(model["pelvis"], thigh))
    ankle = _euler("ZXY", _between(shank, model[f"{side}_foot"]))
    return {
        f"{side}_hip_Z": hip[:, 0],
        f"{side}_hip_X": sign * hip[:, 1],
        f"{side}_hip_Y": -sign * hip[:, 2],
        f"{side}_knee_Z": bend,
        f"{side}_ankle_Z": ankle[:, 0],
        f"{side}_ankle_X": -sign * ankle[:, 1],
    }


def ros4hri_angles(motion: BodyMotion) -> Angles:
    """Return the joint coordinates [rad] of the ROS4HRI model (human_description, REP 155), without the id.

    The torso of the model is one straight link from hips to shoulders: the waist takes the flexion of that line
    against the pelvis, and the arms are those against it; its side bend and twist have no joint. The head is that
    against T8. Shoulder girdle, pronation, wrist and ankle have no joint. Limits are not applied.
    """
    trunk = trunk_line(motion)
    angles = {"waist": _euler("YXZ", _between(motion.of("pelvis"), trunk))[:, 0]}
    roll, yaw, pitch = _euler("XZY", motion.relative("head", "t8")[0]).T
    angles |= {"r_head": roll, "y_head": yaw, "p_head": -pitch}
    for side, sign in _SIDE.items():
        letter = side[0]
        upper = _between(trunk, motion.of(f"{side}_upper_arm"))
        turn, bend = _upright_hinge(motion.relative(f"{side}_forearm", f"{side}_upper_arm")[0], 1.0)
        plane, elevation, spin = _plane_triple(upper @ _turn("z", turn), sign)
        hip_turn, knee = _upright_hinge(motion.relative(f"{side}_lower_leg", f"{side}_upper_leg")[0], -1.0)
        hip = _euler("ZXY", motion.relative(f"{side}_upper_leg", "pelvis")[0] @ _turn("z", hip_turn))
        angles |= {
            f"{letter}_y_shoulder": plane,
            f"{letter}_p_shoulder": elevation,
            f"{letter}_r_shoulder": spin,
            f"{letter}_elbow": bend,
            f"{letter}_y_hip": -hip[:, 0],
            f"{letter}_p_hip": sign * hip[:, 1],
            f"{letter}_r_hip": -hip[:, 2],
            f"{letter}_knee": -knee,
        }
    return angles


def trunk_line(motion: BodyMotion) -> Array:
    """Return frames (n, 3, 3) of the trunk: z from mid hips to mid shoulders, y to the left along the shoulders."""
    left, right = motion.at("left_upper_arm"), motion.at("right_upper_arm")
    up = left + right - motion.at("left_upper_leg") - motion.at("right_upper_leg")
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    across = left - right
    across -= np.sum(across * up, axis=1, keepdims=True) * up
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return np.stack([np.cross(across, up), across, up], axis=2)


def trunk_as_line(motion: BodyMotion) -> BodyMotion:
    """Return the movement with T8 turned into the line from hips to shoulders; neck, head and girdle keep to T8.

    A planner or tracker that takes the trunk as one straight body between hips and shoulders publishes such joints.
    """
    rotation = motion.rotation.copy()
    carried = trunk_line(motion) @ np.swapaxes(motion.of("t8"), 1, 2)
    for name in ("t8", "neck", "head", "left_shoulder", "right_shoulder"):
        rotation[:, motion.names.index(name)] = carried @ motion.of(name)
    return BodyMotion(motion.time, motion.names, rotation, motion.position)


def _upright_hinge(relative: Array, sign: float) -> tuple[Array, Array]:
    """Return turn about z and bend of `_hinge` for axes with z up."""
    turn, bend, _ = _hinge(STAND_UP.T @ relative @ STAND_UP, sign)
    return turn, bend


def _plane_triple(upper: Array, sign: float) -> tuple[Array, Array, Array]:
    """Return plane of elevation, elevation and external rotation of an upper arm, which hangs along -z."""
    down = -upper[:, :, 2]
    elevation = np.arccos(np.clip(-down[:, 2], -1.0, 1.0))
    plane = np.arctan2(down[:, 0], sign * down[:, 1])
    before = _turn("z", -sign * plane) @ _turn("x", sign * elevation)
    rest = _between(before, upper)
    return plane, elevation, sign * np.arctan2(rest[:, 1, 0], rest[:, 0, 0])
