"""BVH (Biovision hierarchy): a tree of joints with offsets, then one line of channel values per frame.

Source: M. Meredith and S. Maddock, "Motion capture file formats explained", University of Sheffield, CS-01-11,
section 3. The format states no unit of length and no vertical axis: positions stay in the unit of the file (angles do
not depend on it) and the vertical is determined from the body. The first frame, often a T-pose, is not removed here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import NoReturn

import numpy as np

from reba.arrays import Array
from reba.errors import ReadError
from reba.posture.named_angles import RADIANS_ABOVE, RADIANS_BELOW, RADIANS_OUTLIERS, RADIANS_POSES
from reba.readers.formats.file_content import unpacked_name
from reba.readers.formats.text import LARGEST, number_rows, read_lines
from reba.readers.recording.quaternions import about_axis, product, rotated
from reba.readers.recording.stream import ReadLog, Recording, Topic, array_stream, clip, unique_names

MAX_JOINTS = 1000
"""More joints than any body model has; protects memory from damaged files."""
LONGEST_FRAME = 1.0
"""[s] No motion is captured more slowly; a choice."""
UNIT = "lengths in the unit of the file, which BVH does not state"


def sniff(path: Path, head: bytes) -> bool:
    """Return whether the first bytes are those of a BVH hierarchy."""
    return head.lstrip()[:9].upper() == b"HIERARCHY"


def open_bvh(path: Path) -> Recording:
    """Open a BVH file: a stream of frames, the global pose of each joint and end site.

    Skeletons of several roots that repeat names are several people, each a stream under the name of its root.

    The stream's values are (n, k, 7): x y z in the unit of the file and qx qy qz qw, in the world of the file; `rest`
    is the pose with every channel zero. An end site is called `<joint>_end`.
    """
    log = ReadLog(time_source="frame time")
    lines = read_lines(path, log)
    joints, motion = _Hierarchy(path, lines).parse()
    skeleton = BvhSkeleton(tuple(joints))
    if not skeleton.width:
        raise ReadError(path, "no joint has a channel, so no joint moves", hint="export the motion with it")
    declared, frame_time, first = _motion_header(path, lines, motion)
    rows, _ = number_rows(path, lines, first, skeleton.width, log)
    if not len(rows):
        raise ReadError(
            path, f"no complete frame of {skeleton.width} numbers after line {first}", hint="export the motion with it"
        )
    if len(rows) != declared:
        log.warn(f"the file states {declared} frames and has {len(rows)} complete ones; those were read")
    largest = skeleton.largest_rotation(rows)
    if len(rows) >= RADIANS_POSES and RADIANS_ABOVE < largest < RADIANS_BELOW:
        log.warn(f"rotations stay within +-{largest:.2f} degrees: check that the unit is not radians")
    add = skeleton.adds_positions(rows)
    if add is False:
        log.warn("position channels of inner joints repeat the offsets; they were read as replacing them")
    if frame_time > LONGEST_FRAME:
        log.warn(f"frames are {frame_time:g} s apart: check that Frame Time is in seconds")
    trees = skeleton.trees()
    labels = unique_names([joints[tree.start].name for tree in trees], log)
    streams = [
        array_stream(
            label if len(trees) > 1 else unpacked_name(path).stem,
            "frames",
            "BVH",
            names := unique_names([joint.name for joint in joints[tree]], log),
            np.arange(len(rows), dtype=np.float64) * frame_time,
            partial(skeleton.poses_of, tree, rows, add),
            opened=log,
            parents=("",) * len(names),
            rest=skeleton.rest()[tree],
        )
        for tree, label in zip(trees, labels, strict=True)
    ]
    topics = tuple(
        Topic(stream.name, "BVH motion", len(rows), True, f"{len(stream.names)} joints and end sites; {UNIT}")
        for stream in streams
    )
    return Recording(str(path), "bvh", tuple(streams), topics, log)


def _motion_header(path: Path, lines: list[str], motion: int) -> tuple[int, float, int]:
    """Return the stated number of frames, the frame time [s] and the index of the first line of numbers."""
    values: dict[str, tuple[str, int]] = {}
    index = motion + 1
    while index < len(lines) and len(values) < 2:
        key, colon, value = lines[index].partition(":")
        key = " ".join(key.split()).lower()
        if key in ("frames", "frame time") and colon:
            values[key] = (value.strip(), index + 1)
        elif lines[index].strip():
            break
        index += 1
    for key in ("frames", "frame time"):
        if key not in values:
            what = f"line {min(index + 1, len(lines))}: '{key.title()}:' expected after MOTION"
            raise ReadError(path, what, hint="the file is truncated or damaged: export it again")
    text, line = values["frame time"]
    frame_time = _float(text)
    if not 0 < frame_time < LARGEST:
        raise ReadError(
            path,
            f"line {line}: Frame Time is {clip(text)}, expected seconds above 0",
            hint="write the time between two frames there, such as 0.016667 for 60 Hz",
        )
    text, line = values["frames"]
    if not (text.isascii() and text.isdigit() and len(text) < 19):
        raise ReadError(path, f"line {line}: Frames is {clip(text)}, expected a number", hint="export it again")
    return int(text), frame_time, index


def _float(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


@dataclass
class _Hierarchy:
    """Parser of the hierarchy; a stack of open joints instead of recursion, so that depth cannot exhaust memory."""

    path: Path
    lines: list[str]

    def parse(self) -> tuple[list[BvhJoint], int]:
        """Return the joints, each after its parent, and the index of the line MOTION."""
        self._take_words()
        joints: list[BvhJoint] = []
        stack: list[int] = []
        self._expect("HIERARCHY")
        while self.at < len(self.words):
            word = self._next("a joint").upper()
            if word == "}" and stack:
                stack.pop()
            elif (word == "ROOT") != bool(stack) and word in ("ROOT", "JOINT", "END"):
                if len(joints) == MAX_JOINTS:
                    self._fail(f"more than {MAX_JOINTS} joints")
                joints.append(self._joint(word, joints, stack[-1] if stack else -1))
                stack.append(len(joints) - 1)
            else:
                self._fail(f"{clip(word)} where {'JOINT, End Site or }' if stack else 'ROOT or MOTION'} was expected")
        if stack:
            self._fail(f"joint {clip(joints[stack[-1]].name)} is not closed")
        if self.motion == len(self.lines):
            self._fail("the hierarchy ends without MOTION")
        if not joints:
            self._fail("the hierarchy has no joint")
        return joints, self.motion

    def _take_words(self) -> None:
        self.words: list[str] = []
        self.line_of: list[int] = []
        self.at = 0
        self.motion = len(self.lines)
        for index, line in enumerate(self.lines):
            row = line.replace("{", " { ").replace("}", " } ").split()
            if row and row[0].upper() == "MOTION":
                self.motion = index
                break
            self.words += row
            self.line_of += [index + 1] * len(row)

    def _joint(self, kind: str, joints: list[BvhJoint], parent: int) -> BvhJoint:
        """Read a joint from its name to the last of its own lines."""
        label = []
        while (word := self._next("{")) != "{":
            label.append(word)
        name = " ".join(label)
        if kind == "END":
            name = f"{joints[parent].name}_end"
        elif not name:
            self._fail("a joint has no name")
        offset = np.zeros(3)
        channels: tuple[str, ...] = ()
        while self.at < len(self.words) and self.words[self.at].upper() in ("OFFSET", "CHANNELS"):
            if self._next("OFFSET").upper() == "OFFSET":
                offset = np.array([self._number() for _ in range(3)])
            else:
                channels = tuple(self._channel() for _ in range(self._count()))
        if len(set(channels)) < len(channels):
            self._fail(f"joint {clip(name)} has a channel twice")
        return BvhJoint(name, parent, offset, channels)

    def _count(self) -> int:
        word = self._next("the number of channels")
        if word not in ("0", "1", "2", "3", "4", "5", "6"):
            self._fail(f"{clip(word)} channels, expected 0 to 6")
        return int(word)

    def _channel(self) -> str:
        word = self._next("a channel")
        if word.lower() not in CHANNELS:
            self._fail(f"{clip(word)} is not a channel, expected Xposition ... Zrotation")
        return word.lower()

    def _number(self) -> float:
        word = self._next("a number")
        value = _float(word)
        if not abs(value) <= LARGEST:
            self._fail(f"{clip(word)} is not a finite number of plausible size")
        return value

    def _expect(self, keyword: str) -> None:
        if self._next(keyword).upper() != keyword:
            self._fail(f"{keyword} expected")

    def _next(self, wanted: str) -> str:
        if self.at == len(self.words):
            self._fail(f"the hierarchy ends where {wanted} was expected")
        self.at += 1
        return self.words[self.at - 1]

    def _fail(self, what: str) -> NoReturn:
        line = self.line_of[self.at - 1] if self.at else 1
        raise ReadError(self.path, f"line {line}: {what}", hint="the hierarchy is damaged: export the recording again")


CHANNELS: dict[str, tuple[str, int]] = {
    f"{axis}{kind}": (kind, index) for kind in ("position", "rotation") for index, axis in enumerate("xyz")
}
"""Channel name in lower case -> position or rotation [deg], and the axis 0, 1 or 2."""


@dataclass(frozen=True)
class BvhJoint:
    """One joint or end site.

    Attributes:
        parent: index of the parent, -1 for a root.
        offset: (3,) from the parent, in the parent's axes.
        channels: keys of `CHANNELS`, in the order of the file, which is the order of the rotations.
    """

    name: str
    parent: int
    offset: Array
    channels: tuple[str, ...]


@dataclass(frozen=True)
class BvhSkeleton:
    """Joints, each after its parent; forward kinematics of rows of channel values."""

    joints: tuple[BvhJoint, ...]

    @property
    def width(self) -> int:
        """Channel values in a frame."""
        return sum(len(joint.channels) for joint in self.joints)

    def trees(self) -> list[slice]:
        """Return the joints of each person: below each root where roots repeat names, else all."""
        roots = [index for index, joint in enumerate(self.joints) if joint.parent < 0]
        trees = [slice(*ends) for ends in pairwise([*roots, len(self.joints)])]
        names = [{joint.name for joint in self.joints[tree]} for tree in trees]
        return trees if sum(map(len, names)) > len(set().union(*names)) else [slice(0, len(self.joints))]

    def rest(self) -> Array:
        """Return (k, 7) global poses with every channel zero: summed offsets and identity quaternions."""
        poses = np.zeros((len(self.joints), 7))
        poses[:, 6] = 1.0
        for index, joint in enumerate(self.joints):
            poses[index, :3] = joint.offset + (poses[joint.parent, :3] if joint.parent >= 0 else 0.0)
        return poses

    def largest_rotation(self, rows: Array) -> float:
        """Return the size [deg] that 98 % of the rotations (n, `width`) do not exceed, 0 without any."""
        channels = [channel for joint in self.joints for channel in joint.channels]
        turning = [at for at, channel in enumerate(channels) if CHANNELS[channel][0] == "rotation"]
        return float(np.quantile(np.abs(rows[:, turning]), 1 - RADIANS_OUTLIERS)) if turning and len(rows) else 0.0

    def adds_positions(self, rows: Array) -> bool | None:
        """Return whether position channels of inner joints add to the offset; None where there are none.

        Some exporters write the complete translation there, which replaces the offset, others the difference from it.
        Values nearer to the offsets than to zero replace them.
        """
        to_zero = to_offset = 0.0
        start = 0
        for joint in self.joints:
            for channel in joint.channels:
                kind, axis = CHANNELS[channel]
                if kind == "position" and joint.parent >= 0:
                    to_zero += float(np.median(np.abs(rows[:, start])))
                    to_offset += float(np.median(np.abs(rows[:, start] - joint.offset[axis])))
                start += 1
        return None if to_zero == to_offset == 0.0 else to_zero <= to_offset

    def poses_of(self, tree: slice, rows: Array, add: bool | None, part: slice) -> Array:
        """Return the poses of the joints of a person in a part of the rows; otherwise as `poses`."""
        return self.poses(rows[part], add)[:, tree]

    def poses(self, rows: Array, add: bool | None) -> Array:
        """Return (n, k, 7) global poses x y z qx qy qz qw of channel values (n, `width`).

        Args:
            rows: positions in the unit of the file, rotations in degrees, in the order of the file.
            add: whether position channels of inner joints add to the offset, see `adds_positions`.
        """
        poses = np.empty((len(rows), len(self.joints), 7))
        start = 0
        for index, joint in enumerate(self.joints):
            position = np.tile(joint.offset, (len(rows), 1))
            rotation: Array = np.tile([0.0, 0.0, 0.0, 1.0], (len(rows), 1))
            for channel in joint.channels:
                kind, axis = CHANNELS[channel]
                value = rows[:, start]
                start += 1
                if kind == "rotation":
                    rotation = product(rotation, about_axis(axis, np.radians(value)))
                elif joint.parent >= 0 and add is False:
                    position[:, axis] = value
                else:
                    position[:, axis] += value
            if joint.parent >= 0:
                parent = poses[:, joint.parent]
                poses[:, index, :3] = parent[:, :3] + rotated(parent[:, 3:], position)
                poses[:, index, 3:] = product(parent[:, 3:], rotation)
            else:
                poses[:, index, :3] = position
                poses[:, index, 3:] = rotation
        return poses
