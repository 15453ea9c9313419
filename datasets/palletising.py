"""Simulated palletising of boxes, as joint coordinates of the model `human_36dof_ISB_model`.

No person was measured: key postures (standing, reaching down, carrying, placing) are connected by minimum-jerk
movements.
The joint names and their signs are those of human.urdf in the package example-robot-data (BSD-2-Clause, Gepetto):
flexion, abduction, internal rotation, pronation, bending to the right and turning to the left are positive, and an
arm that hangs with the palm forward is zero.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from smooth_motion import Array, minimum_jerk, quantise, tremor

_ARM = ("clavicle_joint_X", "shoulder_Z", "shoulder_X", "shoulder_Y", "elbow_Z", "elbow_Y", "wrist_Z", "wrist_X")
_LEG = ("hip_Z", "hip_X", "hip_Y", "knee_Z", "ankle_Z", "ankle_X")
_SPINE = ("lumbar_Z", "lumbar_X", "thoracic_Z", "thoracic_X", "thoracic_Y")
_NECK = ("cervical_Z", "cervical_X", "cervical_Y")
JOINTS: tuple[str, ...] = (
    *(f"left_{name}" for name in _LEG),
    *(f"middle_{name}" for name in (*_SPINE, *_NECK)),
    *(f"left_{name}" for name in _ARM),
    *(f"right_{name}" for name in _ARM),
    *(f"right_{name}" for name in _LEG),
)
"""The 36 joints in the order of the file."""

RATE = 25.0
"""Samples per second."""
THIGH, SHANK, SOLE = 0.439, 0.440, 0.08
"""Lengths of the model [m]: hip to knee, knee to ankle, ankle above the floor (the last one is chosen here)."""
HIP = (0.023, -0.100)
"""Hip joint in the pelvis of the model [m]: forward, up."""


@dataclass(frozen=True)
class Pose:
    """A key posture, degrees and metres; one value for both sides.

    Attributes:
        pelvis: pelvis tilted forward.
        back: flexion of the spine above it, shared by the lumbar and the thoracic joint.
        bend: spine bent to the right.
        turn: spine turned to the left.
        neck: neck flexion.
        nod: neck turned to the left.
        thigh: thigh inclined forward from the vertical.
        shank: shank inclined forward from the vertical.
        arm: upper arm flexion against the thorax.
        spread: upper arm abduction.
        elbow: elbow flexion.
        palm: pronation; 90 is the thumb-up mid position.
        wrist: wrist flexion.
        ulnar: ulnar deviation of the wrist.
        raised: shoulder girdle raised.
        x: place on the floor [m].
        heading: direction of the pelvis, counter-clockwise from x; the pallet is at 180, the table at 0.
    """

    pelvis: float = 2.0
    back: float = 3.0
    bend: float = 0.0
    turn: float = 0.0
    neck: float = 5.0
    nod: float = 0.0
    thigh: float = 3.0
    shank: float = 2.0
    arm: float = 5.0
    spread: float = 8.0
    elbow: float = 15.0
    palm: float = 88.0
    wrist: float = 3.0
    ulnar: float = 2.0
    raised: float = 0.0
    x: float = 0.0
    heading: float = 180.0


STAND = Pose()
CARRY = Pose(pelvis=-2.0, back=-2.0, neck=8.0, arm=22.0, spread=14.0, elbow=82.0, palm=80.0, wrist=10.0, ulnar=6.0)
STOOP = Pose(
    pelvis=40.0, back=36.0, neck=-12.0, thigh=8.0, shank=6.0, arm=72.0, spread=12.0, elbow=18.0, wrist=18.0, ulnar=8.0
)
SQUAT = Pose(
    pelvis=22.0, back=20.0, neck=-4.0, thigh=78.0, shank=27.0, arm=38.0, spread=24.0, elbow=28.0, wrist=18.0, ulnar=8.0
)
WAIST = Pose(pelvis=8.0, back=14.0, neck=16.0, thigh=6.0, shank=4.0, arm=48.0, spread=16.0, elbow=48.0, wrist=12.0)
SHELF = Pose(
    pelvis=-4.0, back=-6.0, neck=-26.0, arm=132.0, spread=24.0, elbow=34.0, wrist=-20.0, ulnar=14.0, raised=16.0
)
LIFTS = {
    "stoop": STOOP,
    "squat": SQUAT,
    "stoop, twisted left": replace(STOOP, turn=26.0, bend=-14.0, nod=10.0, back=30.0),
    "stoop, twisted right": replace(STOOP, turn=-24.0, bend=13.0, nod=-10.0, back=28.0),
}
PLACES = {"waist": WAIST, "shelf": SHELF}
BOXES: tuple[tuple[str, str], ...] = (
    ("stoop", "waist"),
    ("squat", "waist"),
    ("stoop, twisted left", "shelf"),
    ("squat", "shelf"),
    ("stoop", "waist"),
    ("stoop, twisted right", "waist"),
    ("squat", "shelf"),
    ("pause", ""),
    ("stoop, twisted left", "waist"),
    ("squat", "waist"),
    ("stoop", "shelf"),
    ("stoop, twisted right", "waist"),
    ("squat", "shelf"),
    ("stoop", "waist"),
)
"""How each box is lifted from the pallet and where it is put down; one pause."""
PAUSE = 14.0
"""Length of the pause [s]."""
TABLE_X = 1.6
"""Distance from the pallet to the table and the shelf [m]."""

_FIELDS = tuple(Pose.__dataclass_fields__)
_VARIATION = np.array([0.04 if field == "x" else 2.0 for field in _FIELDS])


@dataclass(frozen=True)
class Motion:
    """Simulated movement.

    Attributes:
        time: (n,) [s].
        position: (n, 36) joint coordinates of `JOINTS` [rad].
        velocity: (n, 36) [rad/s].
        root: (n, 7) pose of `middle_pelvis` in `map`: x y z [m], quaternion x y z w.
    """

    time: Array
    position: Array
    velocity: Array
    root: Array


def _box(lift: str, place: str) -> Iterator[tuple[float, Pose]]:
    """Yield (seconds to get there, posture) of one box."""
    if lift == "pause":
        yield PAUSE, replace(STAND, neck=9.0, elbow=20.0)
        return
    down, put = LIFTS[lift], replace(PLACES[place], x=TABLE_X, heading=0.0)
    yield 1.3, down
    yield 0.7, down
    yield 1.5, CARRY
    yield 2.4, replace(CARRY, x=TABLE_X, heading=0.0)
    yield 1.3, put
    yield 0.8, put
    yield 1.2, replace(STAND, x=TABLE_X, heading=0.0)
    yield 2.6, STAND
    yield 0.6, STAND


def _keys(rng: np.random.Generator) -> tuple[Array, Array]:
    """Key postures (k, 17) and the (k - 1,) seconds between them, each a little different."""
    steps = [(0.0, STAND), (2.0, STAND), *(step for box in BOXES for step in _box(*box))]
    keys = np.array([[getattr(pose, field) for field in _FIELDS] for _, pose in steps])
    keys += rng.normal(size=keys.shape) * _VARIATION
    seconds = np.array([duration for duration, _ in steps[1:]])
    return keys, seconds * rng.uniform(0.92, 1.08, size=seconds.shape)


def _gait(x: Array, time: Array) -> Array:
    """Angles (n, 2, 3) [deg] that walking adds to thigh and shank inclination and arm swing, left and right."""
    speed = np.abs(np.gradient(x, time))
    effort = np.clip(speed / 0.9, 0.0, 1.0)
    phase = 2.0 * np.pi * 0.9 * time
    sides = []
    for start in (0.0, np.pi):
        swing = np.sin(phase + start)
        lift = np.clip(np.cos(phase + start), 0.0, None)
        sides.append(np.stack([18 * swing + 12 * lift, 12 * -swing + -28 * -lift, -8 * swing], axis=1))
    return np.stack(sides, axis=1) * effort[:, None, None]


def _coordinates(pose: dict[str, Array], gait: Array) -> dict[str, Array]:
    """Turn postures into the 36 joint coordinates [deg]."""
    coordinates = {
        "middle_lumbar_Z": 0.5 * pose["back"],
        "middle_lumbar_X": 0.4 * pose["bend"],
        "middle_thoracic_Z": 0.5 * pose["back"],
        "middle_thoracic_X": 0.6 * pose["bend"],
        "middle_thoracic_Y": pose["turn"],
        "middle_cervical_Z": pose["neck"],
        "middle_cervical_X": 0.2 * pose["nod"],
        "middle_cervical_Y": pose["nod"],
    }
    for number, side in enumerate(("left", "right")):
        thigh, shank = pose["thigh"] + gait[:, number, 0], pose["shank"] + gait[:, number, 1]
        values = {
            "hip_Z": thigh + pose["pelvis"],
            "hip_X": np.full_like(thigh, 5.0),
            "hip_Y": np.full_like(thigh, -4.0),
            "knee_Z": np.maximum(thigh + shank, 0.0),
            "ankle_Z": np.clip(shank, -45.0, 45.0),
            "ankle_X": np.full_like(thigh, 1.0),
            "clavicle_joint_X": pose["raised"],
            "shoulder_Z": pose["arm"] + gait[:, number, 2],
            "shoulder_X": pose["spread"],
            "shoulder_Y": 0.5 * pose["spread"],
            "elbow_Z": np.maximum(pose["elbow"], 1.0),
            "elbow_Y": pose["palm"],
            "wrist_Z": pose["wrist"],
            "wrist_X": -pose["ulnar"],
        }
        coordinates |= {f"{side}_{joint}": value for joint, value in values.items()}
    return coordinates


def _root(pose: dict[str, Array], degrees: dict[str, Array]) -> Array:
    """Pose (n, 7) of the pelvis with the lower foot on the floor.

    The axes of the model are x forward, y up, z right; `map` is z up (REP 103). The root therefore carries the
    quarter turn about x that stands the model up, before its own pitch and after its heading.
    """
    pitch, half_heading = np.radians(pose["pelvis"]), np.radians(pose["heading"]) / 2
    heights = []
    for side in ("left", "right"):
        thigh = np.radians(degrees[f"{side}_hip_Z"]) - pitch
        shank = np.radians(degrees[f"{side}_knee_Z"]) - thigh
        heights.append(THIGH * np.cos(thigh) + SHANK * np.cos(shank) + SOLE)
    hip_below = -HIP[1] * np.cos(pitch) + HIP[0] * np.sin(pitch)
    height = np.max(heights, axis=0) + hip_below
    place = np.stack([pose["x"], np.zeros_like(height), height], axis=1)
    # Rz(heading) Rx(90 deg) Rz(-pitch) as a quaternion: the model leans forward by a negative turn about its z.
    quarter = np.sqrt(0.5)
    forward = pitch / 2
    turned = np.stack(
        [
            quarter * np.cos(forward + half_heading),
            quarter * np.sin(forward + half_heading),
            quarter * np.sin(half_heading - forward),
            quarter * np.cos(half_heading - forward),
        ],
        axis=1,
    )
    return np.concatenate([place, turned], axis=1)


def simulate(rng: np.random.Generator) -> Motion:
    """Simulate the whole recording."""
    keys, seconds = _keys(rng)
    values = minimum_jerk(keys, seconds, RATE)
    values += tremor(rng, values.shape, 0.15) * (_VARIATION / 2.0)
    time = np.arange(len(values)) / RATE
    pose = dict(zip(_FIELDS, values.T, strict=True))
    degrees = _coordinates(pose, _gait(pose["x"], time))
    position = np.stack([np.radians(degrees[joint]) for joint in JOINTS], axis=1)
    position += tremor(rng, position.shape, np.radians(0.1))
    hinges = [index for index, joint in enumerate(JOINTS) if joint.endswith(("knee_Z", "elbow_Z"))]
    position[:, hinges] = np.maximum(position[:, hinges], 0.0)
    position = quantise(position, 13)
    return Motion(
        time=time,
        position=position,
        velocity=quantise(np.gradient(position, 1.0 / RATE, axis=0), 9),
        root=quantise(_root(pose, degrees), 16),
    )
