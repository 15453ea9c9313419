"""Segment poses -> segment frames: constant rotations from the axes of the source to the ISB axes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from reba.arrays import Array
from reba.errors import ProfileError
from reba.posture.angles import SegmentFrames, frame_across, frame_from_y_z, rotated_about, unit
from reba.posture.columns import SIDES
from reba.readers.mapping.reference_frames import FrameTree, VerticalAxis, axis_name, axis_vector
from reba.readers.recording.profile import Profile
from reba.readers.recording.quaternions import matrices, rotated
from reba.readers.recording.stream import Block, Stream

AXES: dict[str, Array] = {
    "isb": np.eye(3),
    "ros": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "gltf": np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
}
"""Columns: the ISB axes x forward, y up, z right, in frames of a convention."""
VERTICAL = {"isb": "y", "ros": "z", "gltf": "y", "rest": ""}
"""Vertical axis of the world that is usual for frames of a convention."""
BONE = {
    "upper_arm": "forearm",
    "forearm": "hand",
    "hand": "",
    "thigh": "shank",
    "shank": "foot",
}
"""Segments whose long axis in a rest pose runs to the origin of the next segment (a hand: to its end site)."""


class FrameMapper:
    """Converts blocks of frame poses to segment frames by a profile of kind "frames".

    `names` maps each segment of the profile to a frame of the stream; it has only those present.
    """

    def __init__(self, profile: Profile, names: Mapping[str, str], stream: Stream) -> None:
        self.profile, self.names, self.stream = profile, dict(names), stream
        self.poses = FrameTree(stream, tuple(names.values()))
        self.wanted = self.poses.wanted
        self.vertical = VerticalAxis(stream.up, profile.up or VERTICAL[profile.axes])
        self.assumed: list[str] = list(profile.assumed)
        self.warnings: list[str] = []
        self.rest_is_unknown = False
        self.axes = self._axes()

    def begin(self) -> None:
        """Start a pass over the recording."""
        self.vertical.begin()
        self.lines = 0

    def extend(self, names: Mapping[str, str], stream: Stream) -> None:
        """Go on with frames of further segments, or with other parents of the frames."""
        self.names, self.stream = dict(names), stream
        self.poses = FrameTree(stream, tuple(names.values()))
        self.wanted = self.poses.wanted
        self.axes = self._axes()

    def segment_frames(self, block: Block) -> SegmentFrames:
        """Return the segment frames (n, 3, 3) of a block of n samples."""
        poses = {segment: self.poses.world(block, frame) for segment, frame in self.names.items()}
        where = {segment: position for segment, (_, position) in poses.items() if not np.isnan(position).all()}
        frames = {
            segment: (matrices(quaternion).reshape(-1, 3) @ self.axes[segment]).reshape(-1, 3, 3)
            for segment, (quaternion, _) in poses.items()
            if segment in self.axes
        }
        hips = _line(where, "thigh")
        shoulders = _line(where, "upper_arm")
        self._add_directions(where, frames, hips, shoulders)
        if self.profile.trunk == "line" and hips is not None and shoulders is not None and "thorax" in frames:
            line = unit(shoulders[0] - hips[0])
            known = bool(np.isfinite(line).any())
            self.lines += known
            if known:
                frames["trunk"] = frame_from_y_z(line, shoulders[1])
            if known and "pelvis" in frames:
                frames["pelvis"] = frame_across(frames["pelvis"][:, :, 1], hips[1])
        return SegmentFrames(frames, up=self.vertical.up)

    def is_consistent(self) -> bool:
        """Return whether the vertical fits all frames; if not, it is changed for another pass."""
        consistent = self.vertical.is_consistent()
        if self.vertical.swapped:
            # Frames have their own axes: exchanged names are reported, the frames stay as recorded.
            self.vertical.swapped = False
            consistent = True
        self.warnings += [text.removesuffix("; sides exchanged") for text in self.vertical.warnings]
        self.assumed += self.vertical.assumed
        if not self.vertical.name:
            self.warnings.append("the vertical is unknown: the file states none, and head and feet are not recorded")
        if self.lines:
            self.assumed.append("trunk by the lines between hips and shoulders, not by the chest")
        return consistent

    def unmeasured_columns(self, seconds: float) -> dict[str, str]:
        """Return the columns that no frame measures -> the reason; frames leave the others to the data."""
        return dict.fromkeys(BY_REST, NO_REST) if self.rest_is_unknown else {}

    def _add_directions(
        self, where: Mapping[str, Array], frames: Mapping[str, Array], hips: _Line, shoulders: _Line
    ) -> None:
        low = next((line[0] for name in ("foot", "shank") if (line := _line(where, name)) is not None), None)
        low = low if low is not None else (hips[0] if hips is not None else None)
        high = where.get("head", shoulders[0] if shoulders is not None else None)
        upward = None if low is None or high is None else high - low
        toes, feet = _line(where, "toe"), _line(where, "foot")
        forward = toes[0] - feet[0] if toes is not None and feet is not None else None
        if forward is None and "pelvis" in frames:
            forward = frames["pelvis"][:, :, 0]
        right = hips[1] if hips is not None else None
        self.vertical.add_directions(upward, right, forward, shoulders[1] if shoulders is not None else None)
        if right is None and upward is None and not self.vertical.name and "pelvis" in frames:
            self.vertical.add_directions(frames["pelvis"][:, :, 1], None, None, None)

    def _axes(self) -> dict[str, Array]:
        """Return segment -> (3, 3) its ISB axes in its own frame."""
        if self.profile.axes == "rest" and self.stream.rest is not None:
            return self._rest_axes(self.stream.rest)
        base = AXES[self.profile.axes if self.profile.axes in AXES else "ros"]
        result = {}
        for segment in self.names:
            frame = base
            for step in self.profile.turns.get(segment, ()):
                frame = rotated_about(frame, step.axis, np.radians([step.sign * step.degrees]))[0]
            result[segment] = frame
        return result

    def _rest_axes(self, rest: Array) -> dict[str, Array]:
        """Return the axes from the rest pose: bones as drawn there, thumbs forward in a T-pose and in an N-pose."""
        block = Block(np.zeros(1), self.stream.names, rest[None], self.stream.parents)
        poses = {segment: self.poses.world(block, frame) for segment, frame in self.names.items()}
        where = {segment: position[0] for segment, (_, position) in poses.items()}
        hips, shoulders = _line(where, "thigh"), _line(where, "upper_arm")
        if hips is None or shoulders is None:
            raise ProfileError(
                f"profile {self.profile.name}: axes 'rest' need thigh_left, thigh_right, upper_arm_left and "
                f"upper_arm_right in {self.stream.name}; add them to [segments]"
            )
        if not min(float(np.linalg.norm(line[1])) for line in (hips, shoulders)) > 1e-9:
            raise ProfileError(
                f"profile {self.profile.name}: left and right are at one place in the rest pose of {self.stream.name}, "
                "so the axes of the segments are unknown; export it with the places of the bones"
            )
        up = axis_vector(axis_name(where.get("head", shoulders[0]) - hips[0]))
        right = axis_vector(axis_name(hips[1]))
        forward = np.cross(up, right)
        if not self._is_standing(where, up):
            self.rest_is_unknown = True
            self.warnings.append(f"{NO_REST}: wrists and raised shoulders are not measured")
        result = {}
        for segment, (quaternion, _) in poses.items():
            kind, _, side = segment.rpartition("_")
            bone = self._bone(kind, side, where) if kind in BONE else None
            long = up if bone is None else -bone
            axes = np.stack([forward, up, right], axis=1)
            if bone is not None and np.linalg.norm(np.cross(long, forward)) > 0.1:
                axes = frame_from_y_z(long[None], np.cross(forward, long)[None])[0]
            inverse = quaternion[0] * np.array([-1.0, -1.0, -1.0, 1.0])
            result[segment] = np.stack([rotated(inverse[None], axis[None])[0] for axis in axes.T], axis=1)
        if not self.warnings and float(np.sum(np.abs(up * right))) > 0.5:
            self.warnings.append("the rest pose is neither standing nor facing along an axis: check the angles")
        return result

    def _is_standing(self, where: Mapping[str, Array], up: Array) -> bool:
        """Return whether a rest pose shows a standing person: legs down from the hips, arms not raised, both alike."""
        for kind, highest in (("thigh", -0.7), ("shank", -0.7), ("upper_arm", 0.5), ("forearm", 0.5)):
            bones = [self._bone(kind, side, where) for side in SIDES if f"{kind}_{side}" in where]
            heights = [float(bone @ up) for bone in bones if bone is not None]
            if any(height > highest for height in heights) or (heights and max(heights) - min(heights) > 0.5):
                return False
        return True

    def _bone(self, kind: str, side: str, where: Mapping[str, Array]) -> Array | None:
        """Return the unit vector of a bone in the rest pose, pointing distally; a hand without end: the forearm's."""
        origin = where[f"{kind}_{side}"]
        child = BONE[kind]
        end = where.get(f"{child}_{side}") if child else self._end_site(self.names[f"{kind}_{side}"])
        if end is None or np.linalg.norm(end - origin) < 1e-9:
            parent = {"hand": "forearm", "shank": "thigh"}.get(kind)
            return self._bone(parent, side, where) if parent and f"{parent}_{side}" in where else None
        return (end - origin) / np.linalg.norm(end - origin)

    def _end_site(self, frame: str) -> Array | None:
        """Return the rest position of the end site of a frame, or None."""
        rest = self.stream.rest
        if rest is None or f"{frame}_end" not in self.stream.names:
            return None
        name = f"{frame}_end"
        block = Block(np.zeros(1), self.stream.names, rest[None], self.stream.parents)
        return FrameTree(self.stream, (name,)).world(block, name)[1][0]


NO_REST = "the rest pose shows no standing person, so the axes of hands and shoulder girdles are unknown"
BY_REST = tuple(
    f"{name}_{side}"
    for name in ("wrist_flexion", "wrist_deviation", "wrist_twist", "shoulder_elevation")
    for side in SIDES
)
"""Columns that need the turn of a bone about its long axis in the rest pose; the others follow from its direction."""
_Line = tuple[Array, Array] | None


def _line(where: Mapping[str, Array], name: str) -> _Line:
    """Return the midpoint of the left and right points and the vector from left to right, or None."""
    if not all(f"{name}_{side}" in where for side in SIDES):
        return None
    left, right = where[f"{name}_left"], where[f"{name}_right"]
    return (left + right) / 2.0, right - left
