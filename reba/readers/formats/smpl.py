"""Body poses of SMPL, SMPL-H and SMPL-X in NumPy archives (.npz), as AMASS and pose estimators write them.

Sources: Loper et al. 2015 (SMPL): 24 joints, each turned in its parent; zero is a T-pose with x to the left, y up and z
forward. Romero et al. 2017 (SMPL-H) and Pavlakos et al. 2019 (SMPL-X): the same first 22 joints, then hands and face.
Mahmood et al. 2019 (AMASS): `poses` (n, 156 or 165) [rad], axis times angle, `mocap_framerate`; the floor is the x-y
plane, z up. Outputs of the smplx library have `global_orient` and `body_pose`, usually with y up or in camera axes.
Angles need no body model: its licensed part is the shape. No archive is unpickled.
"""

from __future__ import annotations

import io
import warnings
import zipfile
from pathlib import Path
from tokenize import TokenError
from typing import Final

import numpy as np
from numpy.lib import format as npy

from reba.arrays import Array
from reba.errors import ReadError, join_names
from reba.readers.formats.file_content import unpacked_name
from reba.readers.formats.zip_archive import HINT, first_member, open_zip
from reba.readers.recording.quaternions import product, rotated
from reba.readers.recording.stream import ReadLog, Recording, Topic, array_stream, clip

JOINTS: Final = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle"),
    *("spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder"),
    *("right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist"),
)
"""The joints that all models share, in the order of their poses."""
PARENTS: Final = (-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19)
WHOLE: Final = ("poses", "pose", "smpl_poses", "fullpose", "full_pose")
"""Arrays with the root and the body."""
ROOT: Final = ("root_orient", "global_orient")
BODY: Final = ("pose_body", "body_pose")
RATES: Final = ("mocap_framerate", "mocap_frame_rate", "fps", "frame_rate", "framerate")
MODELS: Final = {72: "SMPL", 156: "SMPL-H", 165: "SMPL-X", 63: "SMPL-H or SMPL-X", 69: "SMPL"}
"""Numbers for each frame -> model."""
AMASS: Final = ("mocap_framerate", "mocap_frame_rate")
"""Rates that AMASS writes; its z is up."""
MOST_LOOKED_AT: Final = 5000
"""Frames, spread over all, from which the vertical is found."""
MOST_TURN: Final = 100.0
"""[rad] Larger rotations are damage."""
UPRIGHT: Final = 0.5
"""Cosine between an axis and the mean direction of a body, above which the axis may be the vertical."""
Arrays = dict[str, "np.ndarray"]


def sniff(path: Path, head: bytes) -> bool:
    """Return whether this is a NumPy archive with a body pose, or a damaged one; AMASS has others beside it."""
    if not first_member(head).endswith(".npy"):
        return False
    try:
        with open_zip(path) as archive:
            return any(name.removesuffix(".npy") in (*WHOLE, *BODY) for name in archive.namelist())
    except ReadError:
        return True


def open_smpl(path: Path, rate: float | None = None) -> Recording:
    """Open an archive: one stream of frames, the orientation of each joint in the world; places need the body model.

    Args:
        rate: [Hz] of the frames, if the archive does not state it.
    """
    log = ReadLog()
    shapes: dict[str, str] = {}
    with open_zip(path) as archive:
        arrays = _arrays(path, archive, shapes)
    turns, used, model = _turns(path, arrays, shapes, log)
    time = np.arange(len(turns)) / _rate(path, arrays, rate, log)
    some = turns[:: max(1, len(turns) // MOST_LOOKED_AT)]
    up, why = _vertical(_world(some), any(name in arrays for name in AMASS), log)
    stream = array_stream(
        unpacked_name(path).stem,
        "frames",
        model,
        JOINTS,
        time,
        lambda part: _poses(turns[part]),
        opened=log,
        parents=("",) * len(JOINTS),
        up=up,
    )
    topics = [Topic(stream.name, model, len(time), True, f"{len(JOINTS)} joints from {join_names(used)}; {why}")]
    topics += [Topic(name, "array", None, False, shape) for name, shape in shapes.items() if name not in used]
    return Recording(str(path), "smpl", (stream,), tuple(topics), log)


def _arrays(path: Path, archive: zipfile.ZipFile, shapes: dict[str, str]) -> Arrays:
    """Return the arrays of numbers that are needed; `shapes` gets a description of every array."""
    arrays: Arrays = {}
    for member in archive.infolist():
        name = member.filename.removesuffix(".npy")
        if not member.filename.endswith(".npy"):
            continue
        file = io.BytesIO(archive.read(member))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UserWarning)
                version = npy.read_magic(file)
                header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
                shape, fortran, dtype = header(file)
        except (ValueError, SyntaxError, TypeError, RecursionError, TokenError) as error:
            raise ReadError(path, f"array {clip(name)} has a damaged header", hint=HINT) from error
        shapes[name] = "texts or objects, not read" if dtype.kind not in "fiu" else f"shape {shape}"[:100]
        if dtype.kind not in "fiu" or name not in (*WHOLE, *ROOT, *BODY, *RATES):
            continue
        data = file.read()
        count = int(np.prod(shape, dtype=object)) if all(length >= 0 for length in shape) else -1
        if count < 0 or count * dtype.itemsize != len(data):
            raise ReadError(path, f"array {clip(name)} has {len(data)} bytes, not those of shape {shape}", hint=HINT)
        values = np.frombuffer(data, dtype=dtype).reshape(shape, order="F" if fortran else "C")
        with np.errstate(over="ignore", invalid="ignore"):
            arrays[name] = values.astype(np.float64)
    return arrays


def _turns(path: Path, arrays: Arrays, shapes: dict[str, str], log: ReadLog) -> tuple[Array, list[str], str]:
    """Return the rotations (n, 22, 3) [rad] of the joints in their parents, the arrays used and the model."""
    whole = next((name for name in WHOLE if name in arrays), None)
    body = next((name for name in BODY if name in arrays), None)
    if whole is None and body is None:
        objects = [name for name in (*WHOLE, *BODY) if name in shapes]
        listed = join_names([f"{clip(name)} ({shape})" for name, shape in shapes.items()], 4)
        what = f"no body pose among its arrays {listed}, expected poses or body_pose"
        if objects:
            what = f"{objects[0]} is stored as objects, which only a pickle can hold"
        raise ReadError(path, what, hint="save poses (n, 72) or body_pose (n, 63) and global_orient as numbers")
    used: list[str] = []
    if whole is not None:
        used.append(whole)
        values = _rows(path, whole, arrays[whole], 3 * len(JOINTS))
        model = MODELS.get(values.shape[1], "SMPL")
    else:
        assert body is not None
        values = _rows(path, body, arrays[body], 3 * len(JOINTS) - 3)
        used.append(body)
        model = MODELS.get(values.shape[1], "SMPL")
        root = next((name for name in ROOT if name in arrays), None)
        if root is None:
            log.warn("no orientation of the root (global_orient): the pelvis is taken as upright")
            orientation: Array = np.zeros((len(values), 3))
        else:
            orientation = _rows(path, root, arrays[root], 3)
            used.append(root)
        if len(orientation) != len(values):
            what = f"{root} has {len(orientation)} frames and {body} {len(values)}"
            raise ReadError(path, what, hint="save both for the same frames")
        values = np.concatenate([orientation, values], axis=1)
    if not len(values):
        raise ReadError(path, f"{used[0]} has no frame", hint="save the poses again")
    turns: Array = values[:, : 3 * len(JOINTS)].reshape(len(values), len(JOINTS), 3)
    turns = np.where(np.abs(turns).max(axis=2, keepdims=True) <= MOST_TURN, turns, np.nan)
    damaged = int(np.isnan(turns[:, :, 0]).sum())
    if damaged:
        log.warn(f"{damaged} rotations are not numbers up to {MOST_TURN:g} rad; they are gaps")
    return turns, used, f"{model} poses"


def _rows(path: Path, name: str, values: Array, least: int) -> Array:
    """Return (n, m) rotations of n frames from (n, m), (n, m / 3, 3) or one person of (1, n, m) or (n, 1, m)."""
    hint = "save one person's rotations as axis times angle [rad], (frames, 3 for each joint)"
    if values.ndim > 1 and values.size and least > 3 and (other := _other_encoding(values.reshape(len(values), -1))):
        raise ReadError(path, f"{name} has {other}, {values.shape}", hint=hint)
    if values.ndim == 3 and values.shape[0] == 1 and (values.shape[2] != 3 or least == 3):
        values = values[0]
    elif values.ndim == 3 and values.shape[1] == 1:
        values = values[:, 0]
    elif values.ndim == 3 and values.shape[2] != 3:
        raise ReadError(path, f"{name} has {values.shape[0]} people, {values.shape}", hint=hint)
    elif values.ndim == 3 and values.shape[1:] == (3, 3) and least == 3:
        raise ReadError(path, f"{name} has rotation matrices, {values.shape}", hint=hint)
    elif values.ndim == 3:
        values = values.reshape(len(values), -1)
    if values.ndim != 2 or values.shape[1] < least or values.shape[1] % 3:
        what = f"{name} has shape {values.shape}, expected (frames, {least} or more)"
        raise ReadError(path, what, hint=hint)
    return values


def _other_encoding(values: Array) -> str:
    """Return what (n, m) numbers are by their sizes if not axis times angle [rad], else ""."""
    some = values[:: max(1, len(values) // MOST_LOOKED_AT)]
    columns: dict[str, Array] = {}
    if some.shape[1] % 9 == 0:
        columns["rotation matrices"] = some.reshape(-1, 3, 3)
    if some.shape[1] % 6 == 0:
        columns["rotations of 6 numbers"] = some.reshape(-1, 2, 3)
        columns["rotations of 6 numbers, two columns"] = some.reshape(-1, 3, 2).swapaxes(1, 2)
    if some.shape[1] % 4 == 0:
        columns["quaternions"] = some.reshape(-1, 1, 4)
    for kind, vectors in columns.items():
        products = np.einsum("nik,njk->nij", vectors, vectors)
        if len(products) and np.mean(np.abs(products - np.eye(vectors.shape[1])).max(axis=(1, 2)) < UNIT) > MOST:
            return kind
    if some.shape[1] % 3 == 0 and some.size:
        sizes = np.linalg.norm(some.reshape(-1, 3), axis=1)
        turned = sizes[np.isfinite(sizes) & (sizes > 0)]  # hands are often left at zero
        if len(turned) and np.mean(turned > 2 * np.pi) > FULL_TURNS:
            return "rotations of more than a turn, as degrees are"
    return ""


def _rate(path: Path, arrays: Arrays, given: float | None, log: ReadLog) -> float:
    """Return the rate of the frames [Hz]."""
    name = next((name for name in RATES if name in arrays and arrays[name].size == 1), None)
    if name is None and given is None:
        raise ReadError(path, "no frame rate (mocap_framerate, fps)", hint="give the rate (--rate 30)")
    if name is None or given is not None:
        if name is not None:
            raise ReadError(path, f"it has a rate of its own in {name}", hint="leave the rate out")
        assert given is not None
        log.time_source = f"frames at {given:g} Hz, as given"
        return given
    rate = float(arrays[name].reshape(-1)[0])
    if not 0 < rate < 1e5:
        raise ReadError(path, f"{name} is {rate:g}, expected a rate in Hz", hint="save the rate of the recording")
    log.time_source = name
    return rate


def _world(turns: Array) -> Array:
    """Return the (n, 22, 4) quaternions of the joints in the world from their (n, 22, 3) rotations in the parents."""
    half = np.linalg.norm(turns, axis=2, keepdims=True) / 2.0
    local = np.concatenate([turns / 2.0 * np.sinc(half / np.pi), np.cos(half)], axis=2)
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            local[:, joint] = product(local[:, parent], local[:, joint])
    return local


def _poses(turns: Array) -> Array:
    """Return the (n, 22, 7) poses of the joints: no places, and the orientations in the world."""
    world = _world(turns)
    return np.concatenate([np.full((*world.shape[:2], 3), np.nan), world], axis=2)


UNIT: Final = 0.02
"""Difference from unit vectors at right angles up to which numbers are those of rotation matrices or quaternions."""
MOST: Final = 0.9
"""Share of the rotations that decides about their encoding."""
FULL_TURNS: Final = 0.2
"""Share of the rotations beyond a turn from which they are degrees; axis times angle stays below one."""
_UPWARD: Final = ("pelvis", "spine3", "left_knee", "right_knee")
"""Joints whose segments are upright in most postures of work."""


def _vertical(world: Array, amass: bool, log: ReadLog) -> tuple[str, str]:
    """Return the vertical axis of the world, "" for y, the usual one, and why: the source states it, or the body."""
    y = np.array([0.0, 1.0, 0.0])
    upward = np.zeros(3)
    for name in _UPWARD:
        quaternions = world[:, JOINTS.index(name)]
        upward += np.nansum(rotated(quaternions, np.broadcast_to(y, (len(world), 3))), axis=0)
    length = float(np.linalg.norm(upward))
    body = upward / length if length > 0 else y
    index = int(np.argmax(np.abs(body)))
    nearest = ("-" if body[index] < 0 else "") + "xyz"[index]
    usual = "z" if amass else "y"
    if body["xyz".index(usual)] < UPRIGHT and nearest != usual:
        source = "AMASS has" if amass else "SMPL has"
        level = "; the camera is taken as level" if nearest == "-y" else ""
        log.warn(f"the vertical is {nearest} by the body, where {source} {usual}{level}")
        return nearest, f"vertical {nearest} by the body"
    return usual if amass else "", f"vertical {usual}" + (" as in AMASS" if amass else "")
