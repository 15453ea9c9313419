"""Bodies and streams made from known posture angles, to be read back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reba.posture.angles import SegmentFrames
from reba.posture.columns import COLUMNS, SIDES
from reba.posture.table import PostureTable
from reba.readers.build_table import build_table
from reba.readers.mapping.segments import AXES
from reba.readers.recognise import choose
from reba.readers.recording.profile import profiles
from reba.readers.recording.stream import Block, Kind, ReadLog, Recording, Stream

Array = NDArray[np.float64]
Posture = Mapping[str, float]

RATE = 50.0


def rotation(axis: str, degrees: float) -> Array:
    """Return the (3, 3) right-handed rotation about x, y or z, written out and not by the code under test."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array(
        {
            "x": [[1, 0, 0], [0, c, -s], [0, s, c]],
            "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
            "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
        }[axis],
        dtype=np.float64,
    )


def segment_frames(posture: Posture, heading: float = 0.0) -> dict[str, Array]:
    """Return segment -> (3, 3) ISB axes, y up, of a person in a posture; absent angles are 0, the pelvis upright."""

    def angle(name: str) -> float:
        return posture.get(name, 0.0)

    mirror = np.diag([1.0, 1.0, -1.0])
    pelvis = rotation("y", heading)
    thorax = pelvis @ rotation("z", -angle("trunk_flexion"))
    thorax = thorax @ rotation("x", angle("trunk_side_bend")) @ rotation("y", angle("trunk_twist"))
    head = thorax @ rotation("z", -angle("neck_flexion"))
    head = head @ rotation("x", angle("neck_side_bend")) @ rotation("y", angle("neck_twist"))
    frames = {"pelvis": pelvis, "thorax": thorax, "head": head}
    for side in SIDES:

        def sided(name: str, side: str = side) -> float:
            return posture.get(f"{name}_{side}", 0.0)

        arm = rotation("z", sided("upper_arm_flexion")) @ rotation("x", -sided("upper_arm_abduction"))
        forearm = arm @ rotation("z", sided("lower_arm_flexion")) @ rotation("y", sided("wrist_twist"))
        hand = forearm @ rotation("x", sided("wrist_flexion")) @ rotation("z", -sided("wrist_deviation"))
        local = {"clavicle": rotation("x", -sided("shoulder_elevation")), "upper_arm": arm}
        local |= {"forearm": forearm, "hand": hand}
        for name, frame in local.items():
            frames[f"{name}_{side}"] = thorax @ (frame if side == "right" else mirror @ frame @ mirror)
        frames[f"thigh_{side}"] = pelvis @ rotation("z", sided("hip_flexion"))
        frames[f"shank_{side}"] = frames[f"thigh_{side}"] @ rotation("z", -sided("knee_flexion"))
    return frames


def body_of(posture: Posture, heading: float = 0.0) -> SegmentFrames:
    """Return the body of one frame in a posture."""
    frames = {name: frame[None] for name, frame in segment_frames(posture, heading).items()}
    return SegmentFrames(frames, up=np.array([0.0, 1.0, 0.0]))


def stream_of(
    name: str, kind: Kind, names: Sequence[str], values: Array, *, rate: float = RATE, block: int = 40, **more: object
) -> Stream:
    """Return a stream over (n, k, ...) values that hands them out in small blocks."""
    given = tuple(names)
    parents = more.get("parents", ())
    assert isinstance(parents, tuple)

    def read(log: ReadLog, wanted: Sequence[str] | None) -> Iterator[Block]:
        keep = [index for index, known in enumerate(given) if wanted is None or known in set(wanted)]
        log.messages += len(values)
        log.time_source = "test"
        for start in range(0, len(values), block):
            part = values[start : start + block]
            time = (start + np.arange(len(part))) / rate
            kept = tuple(parents[index] for index in keep) if parents else ()
            yield Block(time, tuple(given[index] for index in keep), part[:, keep], kept)

    return Stream(name, kind, "test", given, read, **more)  # type: ignore[arg-type]


def joints_stream(
    joints: Mapping[str, Array | float], name: str = "/joint_states", n: int = 100, **more: object
) -> Stream:
    """Return a stream of joints, each a constant or (n,) values."""
    values = np.stack([np.broadcast_to(np.asarray(value, dtype=np.float64), (n,)) for value in joints.values()], axis=1)
    return stream_of(name, "joints", tuple(joints), values, **more)


def recording_of(*streams: Stream, path: str = __file__) -> Recording:
    """Return a recording of some streams; it has this file's path, so that it can be hashed."""
    return Recording(path, "test", streams)


def quaternion(matrix: Array) -> Array:
    """Return qx qy qz qw of a (3, 3) rotation."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(matrix).as_quat()


def segment_poses(
    postures: list[dict[str, float]], axes: Array, turns: dict[str, Array] | None = None, world: Array | None = None
) -> tuple[tuple[str, ...], Array]:
    """Return segments and their (n, k, 7) poses, positions from plain lengths, in a world turned by `world`."""
    lengths = {
        "upper_arm": ("forearm", 0.3),
        "forearm": ("hand", 0.25),
        "thigh": ("shank", 0.4),
        "shank": ("foot", 0.4),
    }
    rows, names = [], ()
    for posture in postures:
        frames = segment_frames(posture)
        frames |= {f"foot_{side}": frames[f"shank_{side}"] for side in ("left", "right")}
        line = frames["thorax"] @ np.array([0.0, 0.5, 0.0])
        where = {"pelvis": np.zeros(3), "thorax": line * 0.6, "head": line * 1.3}
        for side, out in (("left", -1.0), ("right", 1.0)):
            where[f"clavicle_{side}"] = line
            where[f"upper_arm_{side}"] = line + frames["thorax"] @ np.array([0.0, 0.0, 0.2 * out])
            where[f"thigh_{side}"] = frames["pelvis"] @ np.array([0.0, 0.0, 0.1 * out])
            for near, (far, length) in lengths.items():
                bone = frames[f"{near}_{side}"] @ np.array([0.0, -length, 0.0])
                where[f"{far}_{side}"] = where[f"{near}_{side}"] + bone
        names = tuple(frames)
        base = AXES["ros"] if world is None else world
        rows.append(
            [
                [*(base @ where[name]), *quaternion(base @ frames[name] @ axes.T @ (turns or {}).get(name, np.eye(3)))]
                for name in names
            ]
        )
    return names, np.array(rows)


def moving_postures() -> list[dict[str, float]]:
    """Return 80 postures [deg] from standing to a bent, one-sided reach."""
    wave = np.linspace(0.0, 1.0, 80)
    return [
        {
            "trunk_flexion": 60 * s,
            "trunk_side_bend": 10 * s,
            "neck_flexion": -20 * s,
            "neck_twist": 15 * s,
            "upper_arm_flexion_left": 80 * s,
            "upper_arm_abduction_right": 40 * s,
            "shoulder_elevation_left": 10 * s,
            "lower_arm_flexion_right": 90 * s,
            "lower_arm_flexion_left": 20 * s,
            "wrist_flexion_right": 30 * s,
            "wrist_deviation_left": -10 * s,
            "wrist_twist_left": 40 * s,
            "knee_flexion_right": 70 * s,
        }
        for s in wave
    ]


def check_movement(table: PostureTable, leave: tuple[str, ...] = ()) -> None:
    """Assert that a table has the angles of `moving_postures` in every measured column but those of `leave`."""
    for column in COLUMNS:
        if column in table.unmeasured or column in leave:
            continue
        expected = [posture.get(column, 0.0) for posture in moving_postures()]
        np.testing.assert_allclose(table.data[column], expected, atol=1e-5, err_msg=column)


def read_stream(stream: Stream, neutral: str = "none", format: str = "test") -> PostureTable:
    """Return the posture table of a recording of one stream by the shipped profiles."""
    recording = Recording(__file__, format, (stream,))
    return build_table(recording, choose(recording, profiles()), neutral=neutral)


def table_file(path: Path, rows: list[str], header: str = "time,trunk_flexion,neck_flexion,load") -> Path:
    """Write a CSV file of some rows and return its path."""
    path.write_text("\n".join([header, *rows]) + "\n")
    return path
