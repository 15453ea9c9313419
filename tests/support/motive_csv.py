"""CSV exports of OptiTrack Motive for tests, with the rows that Motive 2 and 3 write."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

NAMES = {
    "pelvis": "Hip",
    "thorax": "Chest",
    "head": "Head",
    **{
        f"{part}_{side}": f"{side[0].upper()}{name}"
        for side in ("left", "right")
        for part, name in (
            ("clavicle", "Shoulder"),
            ("upper_arm", "UArm"),
            ("forearm", "FArm"),
            ("hand", "Hand"),
            ("thigh", "Thigh"),
            ("shank", "Shin"),
            ("foot", "Foot"),
            ("toe", "Toe"),
        )
    },
}
"""Bone of `t_pose_bodies` -> its name in Motive."""
FBX_NAMES = {
    "pelvis": "Hips",
    "thorax": "Spine1",
    "head": "Head",
    **{
        f"{part}_{side}": f"{side.title()}{name}"
        for side in ("left", "right")
        for part, name in (
            ("clavicle", "Shoulder"),
            ("upper_arm", "Arm"),
            ("forearm", "ForeArm"),
            ("hand", "Hand"),
            ("thigh", "UpLeg"),
            ("shank", "Leg"),
            ("foot", "Foot"),
            ("toe", "ToeBase"),
        )
    },
}
"""The same in the bone naming "FBX"."""


def motive_csv(
    poses: Mapping[str, tuple[Array, Array]] | None = None,
    points: Mapping[str, Array] | None = None,
    *,
    pose_type: str = "Bone",
    point_type: str = "Marker",
    version: str = "1.25",
    rotation: str = "Quaternion",
    unit: str = "Millimeters",
    space: str = "Global",
    rate: float = 100.0,
    timecode: bool = False,
    more: str = "",
) -> str:
    """Return an export of bones or rigid bodies and markers.

    Args:
        poses: label -> orientations (n, 3, 3) and places (n, 3) [m].
        points: label -> places (n, 3) [m], NaN in gaps.
        rotation: "Quaternion", or an order of Euler angles about axes that turn along, such as "XYZ".
        timecode: whether a third column has the time code.
        more: further keys and values of the first line.
    """
    scale = {"Millimeters": 1000.0, "Meters": 1.0, "Centimeters": 100.0}[unit]
    kinds, labels, components, axes = [""], ["Name"], [""], ["Time (Seconds)"]
    kinds[0] = "Type"
    blocks: list[Array] = []
    for label, (orientation, place) in (poses or {}).items():
        turn = Rotation.from_matrix(orientation)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of two angles in gimbal lock one is free
            values = turn.as_quat() if rotation == "Quaternion" else turn.as_euler(rotation, degrees=True)
        if rotation != "Quaternion":
            values = values[:, [rotation.index(axis) for axis in "XYZ"]]
        turned = list("XYZW" if rotation == "Quaternion" else "XYZ")
        count = len(turned) + 4
        kinds += [pose_type] * count
        labels += [label] * count
        components += [*["Rotation"] * len(turned), *["Position"] * 3, "Mean Marker Error"]
        axes += [*turned, *"XYZ", ""]
        blocks += [values, place * scale, np.full((len(place), 1), 0.0003)]
    for label, place in (points or {}).items():
        kinds += [point_type] * 3
        labels += [label] * 3
        components += ["Position"] * 3
        axes += list("XYZ")
        blocks.append(place * scale)
    table = np.concatenate(blocks, axis=1)
    first = (
        f"Format Version,{version},Take Name,walk 1,Take Notes,,Capture Frame Rate,{rate:f},Export Frame Rate,{rate:f},"
        "Capture Start Time,2023-06-02 12.09.45.344 PM,Capture Start Frame,12,"
        f"Total Frames in Take,{len(table)},Total Exported Frames,{len(table)},"
        f"Rotation Type,{rotation},Length Units,{unit},Coordinate Space,{space}{more}"
    )
    ids = ["ID", *(f"{hash(label) & 0xFFFF:04X}:73CB7475AD7A11F0" for label in labels[1:])]
    old = float(version) < 1.24
    rows = [["" if old else "Type", *kinds[1:]], ["" if old else "Name", *labels[1:]], ["" if old else "ID", *ids[1:]]]
    rows += [["Parent", *[""] * (len(labels) - 1)]] if float(version) >= 1.25 else []
    rows += [components, axes]
    samples = [
        [str(index), f"{index / rate:.6f}", *(["15:26:46:12.02"] if timecode else []), *map(_cell, row)]
        for index, row in enumerate(table.tolist())
    ]
    heads = [
        [
            "Frame" if row is axes else "",
            row[0],
            *([""] if timecode and row is not axes else ["TimeCode"] * timecode),
            *row[1:],
        ]
        for row in rows
    ]
    return "\r\n".join([first, "", *map(_line, heads), *map(",".join, samples)]) + "\r\n"


def _line(row: Sequence[str]) -> str:
    return ",".join(f'"{cell}"' if ":" in cell else cell for cell in row)


def _cell(value: float) -> str:
    return "" if np.isnan(value) else f"{value:.6f}"
