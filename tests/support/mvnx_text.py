"""MVNX files for tests, with the structure that MVN Analyze writes (version 4, whole body without fingers)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SIDES = ("Right", "Left")
SEGMENTS = (
    *("Pelvis", "L5", "L3", "T12", "T8", "Neck", "Head"),
    *(f"{side}{part}" for side in SIDES for part in ("Shoulder", "UpperArm", "ForeArm", "Hand")),
    *(f"{side}{part}" for side in SIDES for part in ("UpperLeg", "LowerLeg", "Foot", "Toe")),
)
JOINTS = (
    *("jL5S1", "jL4L3", "jL1T12", "jT9T8", "jT1C7", "jC1Head"),
    *(f"j{side}{part}" for side in SIDES for part in ("T4Shoulder", "Shoulder", "Elbow", "Wrist")),
    *(f"j{side}{part}" for side in SIDES for part in ("Hip", "Knee", "Ankle", "BallFoot")),
)
ERGONOMIC = ("T8_Head", "T8_LeftUpperArm", "T8_RightUpperArm", "Pelvis_T8", "Vertical_Pelvis", "Vertical_T8")


def mvnx_text(
    orientation: NDArray[np.float64],
    position: NDArray[np.float64],
    angles: NDArray[np.float64],
    ergonomic: NDArray[np.float64],
    *,
    rate: int = 60,
    start: int = 1_700_000_000_000,
    version: int = 4,
) -> str:
    """Return a file of n frames: orientation (n, 23, 4) w x y z, position (n, 23, 3) [m], angles (n, 22, 3) [deg],
    ergonomic (n, 4 or 6, 3) [deg]; `start` [ms] is the date of the first one."""
    rest = np.tile([1.0, 0, 0, 0], (23, 1))
    place = np.tile(np.arange(3), (23, 1))
    calibration = "".join(
        f'<frame time="0" index="" tc="00:00:00:00" ms="0" type="{kind}">'
        f"<orientation>{_words(rest)}</orientation><position>{_words(place)}</position></frame>"
        for kind in ("identity", "tpose", "tpose-isb")
    )
    samples = "".join(
        f'\n<frame time="{round(1000 * index / rate)}" index="{index}" tc="12:00:00:{index}" '
        f'ms="{start + round(1000 * index / rate)}" type="normal">'
        f"\n<orientation>{_words(orientation[index])}</orientation>\n<position>{_words(position[index])}</position>"
        f"\n<velocity>{_words(position[index] * 0)}</velocity><footContacts>1 1 1 1</footContacts>"
        f"\n<jointAngle>{_words(angles[index])}</jointAngle><jointAngleXZY>{_words(angles[index])}</jointAngleXZY>"
        f"\n<jointAngleErgo>{_words(ergonomic[index])}</jointAngleErgo><centerOfMass>0 0 0.9</centerOfMass></frame>"
        for index in range(len(orientation))
    )
    named = version >= 4
    ergonomic_labels = "".join(
        f'<ergonomicJointAngle label="{label}" index="{index}"/>'
        for index, label in enumerate(ERGONOMIC[: ergonomic.shape[1]])
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f'<mvnx version="{version}" xmlns="http://www.xsens.com/mvn/mvnx">\n<mvn version="2021.0" build="1"/>\n'
        f'<comment/><subject label="Suit 1" frameRate="{rate}" segmentCount="23" recDate="Tue Nov 14 2023" '
        'recDateMSecsSinceEpoch="1700000000000" originalFilename="a.mvn" configuration="FullBody">\n<segments>'
        + "".join(
            f'<segment label="{label}" id="{index + 1}"><points><point label="p{label}">'
            "<pos_b>0 0 0</pos_b></point></points></segment>"
            for index, label in enumerate(SEGMENTS)
        )
        + "</segments>\n<sensors><sensor label='Pelvis'/></sensors>\n<joints>"
        + "".join(
            f'<joint label="{label}"><connector1>a/b</connector1><connector2>c/d</connector2></joint>'
            for label in JOINTS
        )
        + "</joints>\n"
        + (f"<ergonomicJointAngles>{ergonomic_labels}</ergonomicJointAngles>" if named else "")
        + "<footContactDefinition><contactDefinition label='LeftFoot_Heel' index='0'/></footContactDefinition>\n"
        f"<frames segmentCount='23' sensorCount='17' jointCount='22'>{calibration}{samples}\n</frames>\n"
        '</subject>\n<securityCode code="x"/>\n</mvnx>\n'
    )


def _words(values: NDArray[np.float64]) -> str:
    return " ".join(f"{value:.6f}" for value in np.ravel(values))
