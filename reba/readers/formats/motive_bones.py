"""Bones and rigid bodies of a Motive export -> streams of frames, with the rest pose of a skeleton.

Motive's skeletons are in a T-pose where no bone is turned (its calibration pose; its Blender plug-in builds them so).
The file has no such pose, but a bone keeps its place in its parent, so that the rest pose follows from any frame. The
names are those of "Motive" and "FBX" bone naming; the hip may bear the name of the skeleton ("Asset Hip Name").
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path
from typing import Final

import numpy as np

from reba.arrays import Array
from reba.errors import ReadError
from reba.posture.angles import unit
from reba.readers.recording.quaternions import about_axis, product, rotated
from reba.readers.recording.stream import ReadLog, Stream, Topic, array_stream, clip

FORMAT: Final = "OptiTrack Motive"
ORDERS: Final = tuple("".join(order) for order in permutations("XYZ"))
"""Values of Rotation Type beside Quaternion: about which axes a frame was turned, in this order."""
_TRUNKS: Final = (
    ("Hip", "Ab", "Spine2", "Spine3", "Spine4", "Chest"),
    ("Hips", "Spine", "Spine1", "Spine2", "Spine3", "Spine4"),
)
_LIMBS: Final = (
    *(
        (True, (f"{side}Shoulder", f"{side}{arm}", f"{side}{forearm}", f"{side}Hand"))
        for sides, arm, forearm in ((("L", "R"), "UArm", "FArm"), (("Left", "Right"), "Arm", "ForeArm"))
        for side in sides
    ),
    *(
        (False, tuple(f"{side}{part}" for part in parts))
        for sides, parts in (
            (("L", "R"), ("Thigh", "Shin", "Foot", "Toe")),
            (("Left", "Right"), ("UpLeg", "Leg", "Foot", "ToeBase")),
        )
        for side in sides
    ),
    (True, ("Neck", "Neck1", "Neck2", "Head")),
)
"""Chains of bones, and whether they begin at the upper end of the trunk (else at the hip)."""


def parents_of(names: Sequence[str]) -> dict[str, str]:
    """Return bone -> the nearest bone above it that is there, "" for the hip; bones of other names are left out.

    >>> parents_of(["Hip", "Chest", "LShoulder", "LFArm", "Tail"])
    {'Hip': '', 'Chest': 'Hip', 'LShoulder': 'Chest', 'LFArm': 'LShoulder'}
    """
    trunk = next((trunk for trunk in _TRUNKS if trunk[0] in names), ())
    above: dict[str, tuple[str, ...]] = {bone: trunk[:at] for at, bone in enumerate(trunk)}
    for upper, chain in _LIMBS:
        above |= {bone: (*(trunk if upper else trunk[:1]), *chain[:at]) for at, bone in enumerate(chain)}
    result = {}
    for name in names if trunk else ():
        if name in above:
            result[name] = next((bone for bone in reversed(above[name]) if bone in names), "")
    return result


@dataclass(frozen=True)
class BoneFrames:
    """How an export writes poses.

    Attributes:
        rotation: its Rotation Type.
        local: poses are in the parent bone, not in the world.
        scale: length of its unit [m].
    """

    rotation: str
    local: bool
    scale: float

    def stream(
        self,
        path: Path,
        name: str,
        skeleton: str | None,
        signals: Mapping[str, Mapping[str, int]],
        rows: Array,
        time: Array,
        log: ReadLog,
    ) -> tuple[Stream | None, Topic]:
        """Return the stream of the bones of a skeleton, or of rigid bodies, and its topic; no stream without a pose.

        Args:
            name: of the stream.
            skeleton: its name, None for rigid bodies.
            signals: label -> "position x" ... "rotation w" -> column of `rows`.
            rows: (n, m) numbers of the file.
        """
        kind = "rigid bodies" if skeleton is None else f"bones of {skeleton}".removesuffix(" of ")
        labels = [label for label, columns in signals.items() if _has_pose(columns, rows)]
        names = labels if skeleton is None else _with_hip(labels, skeleton)
        known = dict.fromkeys(names, "") if skeleton is None else parents_of(names)
        columns = [signals[label] for label, bone in zip(labels, names, strict=True) if bone in known]
        if not known:
            return None, Topic(name, FORMAT, len(time), False, f"{kind}: none has poses and a known name")
        above = [list(known).index(parent) if parent else -1 for parent in known.values()]
        poses = np.empty((len(rows), len(known), 7))
        for at, places in enumerate(columns):
            poses[:, at, :3] = rows[:, [places[f"position {axis}"] for axis in "xyz"]] * self.scale
        self._turn(path, poses, rows, columns, above, log)
        poses[np.isnan(poses).any(axis=2)] = np.nan
        stream = array_stream(
            name,
            "frames",
            FORMAT,
            tuple(known),
            time,
            poses,
            opened=log,
            parents=tuple(known.values()) if self.local else ("",) * len(known),
            rest=None if skeleton is None else self._rest(poses, above),
        )
        gaps = float(np.mean(np.isnan(poses[..., 0])))
        others = f", {len(signals) - len(known)} others left out" if len(signals) > len(known) else ""
        return stream, Topic(name, FORMAT, len(time), True, f"{len(known)} {kind}{others}, {100 * gaps:.1f} % gaps")

    def _turn(
        self,
        path: Path,
        poses: Array,
        rows: Array,
        columns: Sequence[Mapping[str, int]],
        above: Sequence[int],
        log: ReadLog,
    ) -> None:
        """Fill the quaternions of (n, k, 7) poses from the columns of rotations."""
        if all("rotation w" in places for places in columns):
            for at, places in enumerate(columns):
                poses[:, at, 3:] = unit(rows[:, [places[f"rotation {axis}"] for axis in "xyzw"]])
            return
        order = self.rotation.upper()
        if order not in ORDERS:
            what = f"line 1: Rotation Type is {clip(self.rotation)}, expected Quaternion or an order such as XYZ"
            raise ReadError(path, what, hint="export the take again with quaternions")

        def turned(sequence: str) -> float:
            for at, places in enumerate(columns):
                angles = np.radians(rows[:, [places[f"rotation {axis}"] for axis in "xyz"]])
                poses[:, at, 3:] = _euler(angles, sequence)
            return 0.0 if self.local else _spread(poses, above)

        # Motive turns about axes that turn along; with the other convention bones would change their length.
        along = turned(order)
        if along > 1e-3 and turned(order[::-1]) < 0.5 * along:
            log.warn(f"rotations {order} were read as about axes that stay: only so bones keep their length")
        elif along > 1e-3:
            turned(order)

    def _rest(self, poses: Array, above: Sequence[int]) -> Array:
        """Return the (k, 7) pose of each bone in its parent, or in the world, where no bone is turned."""
        rest = np.zeros((len(above), 7))
        rest[:, 6] = 1.0
        for index in _roots_first(above):
            parent = above[index]
            if parent >= 0:
                rest[index, :3] = _median(_offset(poses, index, parent, self.local))
                rest[index, :3] += 0.0 if self.local else rest[parent, :3]
        return rest


def _has_pose(columns: Mapping[str, int], rows: Array) -> bool:
    """Return whether a signal has a place and an orientation in any row."""
    places = [columns.get(f"{kind} {axis}", -1) for kind in ("position", "rotation") for axis in "xyz"]
    return min(places) >= 0 and bool(np.isfinite(rows[:, places]).all(axis=1).any())


def _with_hip(names: Sequence[str], skeleton: str) -> list[str]:
    """Return names in which the hip has its own one, where it bears that of the skeleton."""
    hip = "Hips" if any(name.endswith("ForeArm") for name in names) else "Hip"
    return [hip if name == skeleton and hip not in names else name for name in names]


def _euler(angles: Array, order: str) -> Array:
    """Return the (n, 4) quaternions of turns by (n, 3) angles [rad] about x, y and z, in an order such as "XYZ"."""
    first, second, third = (about_axis("XYZ".index(axis), angles[:, "XYZ".index(axis)]) for axis in order)
    return product(product(first, second), third)


def _offset(poses: Array, index: int, parent: int, local: bool) -> Array:
    """Return the (n, 3) place of a bone in its parent."""
    if local:
        return poses[:, index, :3]
    back = poses[:, parent, 3:] * np.array([-1.0, -1.0, -1.0, 1.0])
    return rotated(back, poses[:, index, :3] - poses[:, parent, :3])


def _median(values: Array) -> Array:
    known = values[~np.isnan(values).any(axis=1)]
    return np.median(known, axis=0) if len(known) else np.full(3, np.nan)


def _spread(poses: Array, above: Sequence[int]) -> float:
    """Return how far bones move in their parents [m], the median of their standard deviations."""
    spreads = []
    for index, parent in enumerate(above):
        offset = _offset(poses, index, parent, False) if parent >= 0 else np.empty((0, 3))
        known = offset[~np.isnan(offset).any(axis=1)]
        if len(known):
            spreads.append(float(np.linalg.norm(known.std(axis=0))))
    return float(np.median(spreads)) if spreads else 0.0


def _roots_first(above: Sequence[int]) -> list[int]:
    """Return the positions of bones, each after its parent."""
    order: list[int] = []
    while len(order) < len(above):
        order += [at for at, parent in enumerate(above) if at not in order and (parent < 0 or parent in order)]
    return order
