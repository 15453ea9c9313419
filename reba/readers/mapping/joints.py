"""Joint coordinates -> segment frames: elementary rotations composed in the order of the chain.

Rotations about different axes do not commute, so joints of one chain are never added up.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from reba.arrays import Array, Flags
from reba.errors import join_names
from reba.posture.angles import SegmentFrames, rotated_about
from reba.posture.columns import COLUMNS, SIDES
from reba.posture.named_angles import outliers_among
from reba.readers.mapping.reference_frames import PelvisPose, axis_vector
from reba.readers.recording.profile import ElementaryRotation, Profile
from reba.readers.recording.stream import Block, Stream

ARM_AND_LEG = (
    *(("clavicle", "thorax"), ("upper_arm", "clavicle"), ("forearm", "upper_arm"), ("hand", "forearm")),
    *(("thigh", "pelvis"), ("shank", "thigh")),
)
"""Segments of a side and their parents, parents first; without a chain the clavicle is rigid with the thorax."""
SPINE = {"trunk": "thorax", "neck": "head"}
UPRIGHT = ("trunk_flexion", "trunk_side_bend")
"""Columns that are seen from the vertical, so that the pose of the pelvis decides."""
SPINE_AXIS = {"side_bend": 0, "twist": 1, "flexion": 2}
"""ISB axis of the spine rotation that gives an angle: 0 x forward, 1 y up, 2 z right."""
CHAIN_OF = {
    "knee_flexion": "shank",
    "upper_arm_flexion": "upper_arm",
    "upper_arm_abduction": "upper_arm",
    "shoulder_elevation": "clavicle",
    "lower_arm_flexion": "forearm",
    "wrist_flexion": "hand",
    "wrist_deviation": "hand",
    "wrist_twist": "forearm",
}
"""Segment whose chain moves a column of the limbs, where no joint gives the column itself."""
ON_TRUNK = ("upper_arm_flexion", "upper_arm_abduction")
"""Columns that are seen from the trunk, so that the girdle's chain moves them too."""


class JointMapper:
    """Converts blocks of joint coordinates to segment frames and collects the range of each joint.

    Args:
        profile: a profile of kind "joints".
        names: joint of the profile -> signal of the stream; only those present.
        root: pose of the pelvis in the world, None if the recording has none.
    """

    def __init__(self, profile: Profile, names: Mapping[str, str], stream: Stream, root: PelvisPose | None) -> None:
        self.profile, self.names, self.root = profile, dict(names), root
        self.wanted = tuple(names.values())
        self.epoch = stream.epoch
        self.stated, self.unit = stream.unit, stream.unit or profile.unit
        self.assumed: list[str] = list(profile.assumed)
        self.warnings: list[str] = []
        self.radians = False
        """Whether joints in degrees look like radians."""
        if root is not None:
            self.assumed.append(root.assumed)
        elif not profile.up:
            self.assumed.append("pelvis assumed upright: trunk angles are relative to the pelvis")
        self._moved_by = {column: _moved_by(profile, column) for column in COLUMNS}
        self.begin()

    def begin(self) -> None:
        """Start a pass over the recording."""
        self.ranges = JointRanges(len(self.names))

    def extend(self, names: Mapping[str, str], stream: Stream) -> None:
        """Go on with signals of further joints; the ranges of the others are kept."""
        ranges = JointRanges(len(names))
        for index, joint in enumerate(names):
            if joint in self.names:
                ranges.take_from(index, self.ranges, list(self.names).index(joint))
        self.names, self.wanted, self.ranges = dict(names), tuple(names.values()), ranges

    def segment_frames(self, block: Block) -> SegmentFrames:
        """Return the segment frames (n, 3, 3) of a block of n samples."""
        measured = self._values(block)
        n = len(block.time)
        body = SegmentFrames(up=axis_vector(self.profile.up) if self.profile.up else None)
        frames = body.frames
        values, lost = self._without_gaps(measured)
        if self.root is not None:
            body.up = self.root.up
            frames["pelvis"], lost[""] = _without_lost(self.root.at(block.time + self.epoch))
        else:
            frames["pelvis"] = self._chain_frames(np.eye(3), "pelvis", values, n)
        frames["thorax"] = self._chain_frames(frames["pelvis"], "thorax", values, n)
        if "head" in self.profile.chains:
            frames["head"] = self._chain_frames(frames["thorax"], "head", values, n)
        for side in SIDES:
            for segment, parent in ARM_AND_LEG:
                if f"{segment}_{side}" in self.profile.chains:
                    base = frames.get(f"{parent}_{side}", frames["pelvis" if parent == "pelvis" else "thorax"])
                    frames[f"{segment}_{side}"] = self._chain_frames(base, f"{segment}_{side}", values, n)
        body.columns = self._columns(measured, n)
        lost = {joint: gap for joint, gap in lost.items() if gap.any()}
        for column, joints in self._moved_by.items() if lost else ():
            gaps = [gap for joint, gap in lost.items() if joint in joints]
            if gaps and column not in body.columns:
                body.gaps[column] = np.logical_or.reduce(gaps)
        return body

    @staticmethod
    def _without_gaps(values: Mapping[str, Array]) -> tuple[dict[str, Array], dict[str, Flags]]:
        """Return values of joints with 0 in gaps, and where these are: a joint hides the columns of its own chain."""
        lost = {joint: gap for joint, data in values.items() if (gap := ~np.isfinite(data)).any()}
        return {
            joint: np.where(lost[joint], 0.0, data) if joint in lost else data for joint, data in values.items()
        }, lost

    def is_consistent(self) -> bool:
        """Return whether the unit fits all values; if not, it is changed for another pass."""
        beyond = self.ranges.count_beyond_rotation()
        if self.unit == "rad" and beyond >= 2:
            self.unit = "deg"
            where = "the file states radians" if self.stated else "the source usually has radians"
            self.warnings.append(
                f"{where}, but {beyond} joints exceed {MAX_ROTATION:g}: the values were read as degrees"
            )
            return False
        if self.ranges.outliers:
            self.warnings.append(f"{self.ranges.outliers} joint values beyond two turns were left out as damaged")
        self.radians = self.unit == "deg" and self.ranges.look_like_radians()
        return True

    def unmeasured_columns(self, seconds: float) -> dict[str, str]:
        """Return the columns that no moving joint measures -> the reason.

        In recordings of up to 1 s a constant joint counts as measured.
        """
        fixed = self._constant_joints() if seconds > 1.0 else {}
        reasons: dict[str, str] = {}
        for column in COLUMNS:
            joints = joints_of(self.profile, column)
            absent = [joint for joint in joints if joint not in self.names]
            constant = [joint for joint in joints if joint in fixed]
            if not joints:
                reasons[column] = "this source has no such joint"
            elif len(absent) == len(joints):
                reasons[column] = f"no joint {join_names(absent, MOST_NAMES)}"
            elif len(absent) + len(constant) == len(joints):
                signals = join_names([self.names[joint] for joint in constant], MOST_NAMES)
                reasons[column] = f"{signals} constant {fixed[constant[0]]:g}"
        partial = [joint for joint in self.profile.slots if joint not in self.names]
        if partial:
            self.assumed.append(f"joints not recorded, taken as 0 in their chain: {join_names(partial, MOST_NAMES)}")
        return reasons

    def _constant_joints(self) -> dict[str, float]:
        """Return the joints that were not measured -> their constant value [deg]."""
        middle, constant = self.ranges.constant(1.0 if self.unit == "deg" else 180.0 / np.pi)
        known = self.ranges.known
        moves = bool(np.any(known & ~constant))
        all_zero = not np.any(np.abs(middle[known]) > CONSTANT)
        result = {}
        for index, (joint, signal) in enumerate(self.names.items()):
            if not constant[index]:
                continue
            dummy = self.profile.dummies.get(joint)
            if dummy is not None and abs(middle[index] - dummy) < 0.01:
                result[joint] = dummy
            elif abs(middle[index]) <= CONSTANT and (moves or all_zero):
                result[joint] = 0.0
            elif moves and abs(middle[index]) > CONSTANT:
                self.warnings.append(f"{signal} is constant {middle[index]:.4g} deg: check that it was measured")
        if all_zero and known.any():
            self.warnings.append("every joint is constant 0: the source sent no joint angles")
        return result

    def _values(self, block: Block) -> dict[str, Array]:
        """Return joint -> (n,) values of a block, and extend their ranges."""
        columns = {name: index for index, name in enumerate(block.names)}
        present = [
            (index, joint, columns[name]) for index, (joint, name) in enumerate(self.names.items()) if name in columns
        ]
        data = np.ascontiguousarray(block.values.T[[at for _, _, at in present]])
        if not self.unit:
            beyond = np.count_nonzero(np.abs(data) > MAX_ROTATION, axis=1)
            self.unit = "deg" if (beyond > outliers_among(data.shape[1])).any() else "rad"
            self.assumed.append(f"the unit of the joints is not stated: {self.unit} by their range")
        self.ranges.add([index for index, _, _ in present], data, radians=self.unit == "rad")
        return {joint: values for (_, joint, _), values in zip(present, data, strict=True)}

    def _chain_frames(self, frame: Array, segment: str, values: Mapping[str, Array], n: int) -> Array:
        """Return (n, 3, 3) frames of a segment: the parent's, rotated by each step of the chain."""
        factor = 1.0 if self.unit == "rad" else np.pi / 180.0
        result = frame
        for step in self.profile.chains.get(segment, ()):
            if step.name in values:
                result = rotated_about(result, step.axis, values[step.name] * (self._sign(step, segment) * factor))
            elif not step.name:
                result = rotated_about(
                    result, step.axis, np.full(n, np.radians(self._sign(step, segment) * step.degrees))
                )
        return result if result.ndim == 3 else np.broadcast_to(result, (n, 3, 3))

    def _sign(self, step: ElementaryRotation, segment: str) -> float:
        """Return the sense of a rotation; in the mirror image x and y change their sense, z does not."""
        mirrored = self.profile.mirror and segment.endswith("_left") and step.axis != 2
        return -step.sign if mirrored else step.sign

    def _columns(self, values: Mapping[str, Array], n: int) -> dict[str, Array]:
        factor = 1.0 if self.unit == "deg" else 180.0 / np.pi
        result = {}
        for column, terms in self.profile.columns.items():
            if any(term.name in values for term in terms):
                parts = [term.sign * values[term.name] * factor for term in terms if term.name in values]
                result[column] = sum(parts, np.full(n, sum(term.degrees for term in terms)))
        return result


def _without_lost(frames: Array) -> tuple[Array, Flags]:
    """Return (n, 3, 3) frames with those that have no value upright, and which these are."""
    lost: Flags = np.asarray(np.isnan(frames).any(axis=(1, 2)))
    if lost.any():
        frames = frames.copy()
        frames[lost] = np.eye(3)
    return frames, lost


def _moved_by(profile: Profile, column: str) -> frozenset[str]:
    """Return the joints without which a column of the chains is not known; "" is the pose of the pelvis."""
    part, _, _ = column.partition("_")
    if part in SPINE:
        segments = [SPINE[part], *["pelvis"] * (column in UPRIGHT)]
    else:
        angle, _, side = column.rpartition("_")
        segments = [f"{CHAIN_OF[angle]}_{side}", *[f"clavicle_{side}"] * (angle in ON_TRUNK)]
    steps = [step.name for segment in segments for step in profile.chains.get(segment, ()) if step.name]
    return frozenset([*steps, *[""] * (column in UPRIGHT)])


def joints_of(profile: Profile, column: str) -> list[str]:
    """Return the joints whose rotation changes a column."""
    if column in profile.columns:
        return [term.name for term in profile.columns[column] if term.name]
    part, _, angle = column.partition("_")
    if part in SPINE:
        chains = [SPINE[part], "pelvis"] if column in UPRIGHT else [SPINE[part]]
        steps = [step for chain in chains for step in profile.chains.get(chain, ())]
        return [step.name for step in steps if step.axis == SPINE_AXIS[angle] and step.name]
    angle, _, side = column.rpartition("_")
    return [step.name for step in profile.chains.get(f"{CHAIN_OF[angle]}_{side}", ()) if step.name]


MOST_NAMES = 4
"""Names in a message; further ones are only counted."""
MAX_ROTATION = 7.0
"""[rad] No anatomical joint rotates further: larger values are degrees in a field of radians."""
OUTLIER = 4.0 * np.pi
"""[rad] A single value beyond this, two turns, is damaged data, not a posture."""
SMALL_DEGREES = 3.2
"""[deg] Joints that all stay within this look like radians."""
CONSTANT = 1e-3
"""[deg] A joint with a smaller range is constant: the noise of any sensor is larger."""


class JointRanges:
    """Ranges of k joints, extended block by block; memory does not grow with the recording.

    `beyond` counts the values that are larger than any joint turns in radians, or than radians in degrees.
    """

    def __init__(self, size: int) -> None:
        self.low, self.high = np.full(size, np.inf), np.full(size, -np.inf)
        self.seen, self.beyond = np.zeros(size), np.zeros(size)
        self.outliers = 0

    def take_from(self, index: int, other: JointRanges, at: int) -> None:
        """Take over the range of a joint from other ranges."""
        for name in ("low", "high", "seen", "beyond"):
            getattr(self, name)[index] = getattr(other, name)[at]
        self.outliers = other.outliers

    def add(self, at: Sequence[int], data: Array, *, radians: bool) -> None:
        """Extend the ranges of the joints `at` (m,) by (m, n) values, and make damaged ones NaN."""
        if not data.size:
            return
        low, high = np.fmin.reduce(data, axis=1), np.fmax.reduce(data, axis=1)
        usual = MAX_ROTATION if radians else SMALL_DEGREES
        self.seen[at] += data.shape[1] if np.isfinite(data.sum()) else np.isfinite(data).sum(axis=1)
        for row in np.flatnonzero((low < -usual) | (high > usual)).tolist():
            size = np.abs(data[row])
            damaged = size > (OUTLIER if radians else np.degrees(OUTLIER))
            self.beyond[at[row]] += np.count_nonzero((size > usual) & np.isfinite(size))
            if damaged.any():
                self.outliers += int(np.count_nonzero(damaged))
                data[row, damaged] = np.nan
                low[row], high[row] = np.fmin.reduce(data[row]), np.fmax.reduce(data[row])
        self.low[at], self.high[at] = np.fmin(self.low[at], low), np.fmax(self.high[at], high)

    @property
    def known(self) -> Flags:
        """(k,) joints that have a value."""
        return self.low <= self.high

    def count_beyond_rotation(self) -> int:
        """Return how many joints in radians exceed `MAX_ROTATION` in more than a fifth of their samples."""
        return int(np.sum(self.beyond > 0.2 * np.maximum(self.seen, 1.0)))

    def look_like_radians(self) -> bool:
        """Return whether joints in degrees, that move, have nearly all values within `SMALL_DEGREES`."""
        known = self.known
        largest = np.maximum(np.abs(self.low[known]), np.abs(self.high[known]))
        allowed = outliers_among(int(self.seen.max(initial=0.0)))
        return bool((largest > CONSTANT).any() and self.beyond.max(initial=0.0) <= allowed)

    def constant(self, to_degrees: float) -> tuple[Array, Flags]:
        """Return the (k,) middle of each range [deg] and which joints are constant."""
        known = self.known
        low, high = np.where(known, self.low, np.nan), np.where(known, self.high, np.nan)
        return (low + high) / 2.0 * to_degrees, known & ((high - low) * to_degrees <= CONSTANT)
