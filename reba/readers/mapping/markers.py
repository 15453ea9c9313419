"""Marker or keypoint positions -> joint centres -> segment axes and frames (ISB: Wu et al. 2002, 2005)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from reba.arrays import Array
from reba.errors import join_names
from reba.posture.angles import SegmentFrames, frame_across, frame_from_y_z
from reba.posture.columns import SIDES
from reba.readers.mapping.reference_frames import VerticalAxis
from reba.readers.recording.profile import ZEROLESS, Profile
from reba.readers.recording.stream import Block, Stream

Points = dict[str, Array]
LIMBS = {
    "upper_arm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
    "hand": ("wrist", "hand"),
    "thigh": ("hip", "knee"),
    "shank": ("knee", "ankle"),
}
"""Segments with the joint centres at their proximal and distal ends."""
CENTRES = {
    "elbow": ("elbow_lateral", "elbow_medial"),
    "wrist": ("wrist_radial", "wrist_ulnar"),
    "hand": ("hand_radial", "hand_ulnar"),
    "knee": ("knee_lateral", "knee_medial"),
    "ankle": ("ankle_lateral", "ankle_medial"),
}
"""Joint centres midway between two markers, where the recording has no point for the centre itself."""
HARRINGTON = {"back": (-0.24, -0.0099), "down": (-0.30, -0.0109), "out": (0.33, 0.0073)}
"""Hip centre from the middle of the ASIS: slope times pelvis depth (back) or width (down, out), plus an offset [m].

Regression of Harrington et al. 2007, J Biomech 40, 595-602."""

NEEDED = {
    "knee_flexion": ("hip", "knee", "ankle"),
    "upper_arm_flexion": ("shoulder", "elbow"),
    "upper_arm_abduction": ("shoulder", "elbow"),
    "lower_arm_flexion": ("shoulder", "elbow", "wrist"),
    "wrist_flexion": ("elbow", "wrist_radial", "wrist_ulnar", "hand"),
    "wrist_deviation": ("elbow", "wrist_radial", "wrist_ulnar", "hand"),
    "wrist_twist": ("elbow_lateral", "elbow_medial", "wrist_radial", "wrist_ulnar"),
}
"""Angle of a limb -> points, measured or between others, without which it is not measured."""
NECK = ("neck_flexion", "neck_side_bend", "neck_twist")
COMPUTED_NECK = 0.01
"""A neck that is never further from the middle of the shoulders, as a share of their distance, was computed from it."""

FLAT = 0.003
"""Thickness of a body as a share of its length below which its points lie in a plane; a choice."""
LEAST_OF_A_PLANE = 6
"""Points; fewer may lie in one."""
DEPTH_STEP = 10
"""Every so many frames are looked at for their depth."""
IN_A_PLANE = (
    "all points lie in one plane, as 2D keypoints do: angles out of it are not measured and those in it are of a "
    "projection; give points in 3D"
)


class PointMapper:
    """Converts blocks of marker positions to segment frames by a profile of kind "points".

    `names` maps each point of the profile to the markers whose mean it is; it has only points with all their markers.
    """

    def __init__(self, profile: Profile, names: Mapping[str, tuple[str, ...]], stream: Stream) -> None:
        self.profile = profile
        self.extend(names, stream)
        self.vertical = VerticalAxis(stream.up, profile.up)
        self.assumed: list[str] = list(profile.assumed)
        self.warnings: list[str] = []

    def begin(self) -> None:
        """Start a pass over the recording."""
        self.vertical.begin()
        self._neck_height = 0.0
        self._present: set[str] = set()
        self._flat = self._looked_at = 0

    def extend(self, names: Mapping[str, tuple[str, ...]], stream: Stream) -> None:
        """Go on with further points."""
        self.names = dict(names)
        self.wanted = tuple(dict.fromkeys(marker for group in names.values() for marker in group))

    def segment_frames(self, block: Block) -> SegmentFrames:
        """Return the segment frames (n, 3, 3) and long axes (n, 3) of a block of n samples."""
        at = {name: index for index, name in enumerate(block.names)}
        points = {
            self._sided(point): block.values[:, [at[marker] for marker in markers]].mean(axis=1)
            for point, markers in self.names.items()
            if all(marker in at for marker in markers)
        }
        _add_centres(points)
        self._add_directions(points)
        self._measure_neck(points)
        self._measure_depth(points)
        self._present |= points.keys()
        body = SegmentFrames(up=self.vertical.up)
        _add_trunk(points, body)
        _add_head(points, body)
        for side, outward in zip(SIDES, (-1.0, 1.0), strict=True):
            _add_limbs(points, body, side, outward)
        return body

    def is_consistent(self) -> bool:
        """Return whether vertical and sides fit all frames; if not, they are changed for another pass."""
        consistent = self.vertical.is_consistent()
        if self._flat > 0.95 * self._looked_at and IN_A_PLANE not in self.warnings:
            self.warnings.append(IN_A_PLANE)
        self.warnings += [text for text in self.vertical.warnings if text not in self.warnings]
        self.assumed += [text for text in self.vertical.assumed if text not in self.assumed]
        return consistent

    def unmeasured_columns(self, seconds: float) -> dict[str, str]:
        """Return the columns that no point measures -> the reason; points leave the others to the data."""
        present, reasons = self._present, {}
        for name, needed in NEEDED.items():
            for side in SIDES:
                absent = [f"{point}_{side}" for point in needed if f"{point}_{side}" not in present]
                if absent:
                    reasons[f"{name}_{side}"] = f"no point {join_names(absent)}"
        if "notch" not in present:
            if "neck" in present and self._neck_height < COMPUTED_NECK:
                reasons |= dict.fromkeys(ZEROLESS, "the neck was computed as the middle of the shoulders")
            elif not present & {"neck", "c7"}:
                reasons |= dict.fromkeys(ZEROLESS, "no point on the neck between the shoulders")
        if not present & {"head", "ear_left", "ear_right"}:
            reasons |= dict.fromkeys(NECK, "no point on the head")
        return reasons

    def _measure_neck(self, points: Points) -> None:
        middle, across = _midpoint(points, "shoulder"), _left_to_right(points, "shoulder")
        if "neck" in points and middle is not None and across is not None:
            off = np.linalg.norm(points["neck"] - middle, axis=1) / np.linalg.norm(across, axis=1)
            self._neck_height = max(self._neck_height, float(np.nanmax(off, initial=0.0)))
        else:
            self._neck_height = np.inf

    def _measure_depth(self, points: Points) -> None:
        """Count frames whose points lie in a plane, which those of a body do not."""
        if len(points) < LEAST_OF_A_PLANE:
            return
        cloud = np.stack(list(points.values()), axis=1)
        cloud = cloud[np.isfinite(cloud).all(axis=(1, 2))][::DEPTH_STEP]
        if len(cloud):
            extents = np.linalg.svd(cloud - cloud.mean(axis=1, keepdims=True), compute_uv=False)
            self._looked_at += len(cloud)
            self._flat += int(np.count_nonzero(extents[:, 2] < FLAT * extents[:, 0]))

    def _sided(self, point: str) -> str:
        if not self.vertical.swapped:
            return point
        name, _, side = point.rpartition("_")
        return f"{name}_{'left' if side == 'right' else 'right'}" if side in SIDES else point

    def _add_directions(self, points: Points) -> None:
        low = next(
            (
                middle
                for name in ("heel", "ankle", "knee", "hip", "psis")
                if (middle := _midpoint(points, name)) is not None
            ),
            None,
        )
        high = points.get("head", points.get("neck", points.get("c7", _midpoint(points, "shoulder"))))
        upward = None if low is None or high is None else high - low
        front = [_midpoint(points, "toe"), points.get("notch"), points.get("nose"), _midpoint(points, "asis")]
        back = [_midpoint(points, "heel"), points.get("c7"), _midpoint(points, "ear"), _midpoint(points, "psis")]
        pairs = ((a, b) for a, b in zip(front, back, strict=True) if a is not None and b is not None)
        forward = next((a - b for a, b in pairs), None)
        right = _left_to_right(points, "hip") if "hip_left" in points else _left_to_right(points, "asis")
        self.vertical.add_directions(upward, right, forward, _left_to_right(points, "shoulder"))


def _midpoint(points: Points, name: str) -> Array | None:
    """Return the middle of the left and right points, or None."""
    if not all(f"{name}_{side}" in points for side in SIDES):
        return None
    return (points[f"{name}_left"] + points[f"{name}_right"]) / 2.0


def _left_to_right(points: Points, name: str) -> Array | None:
    """Return the vector from the left to the right point, or None."""
    if not all(f"{name}_{side}" in points for side in SIDES):
        return None
    return points[f"{name}_right"] - points[f"{name}_left"]


def _add_centres(points: Points) -> None:
    """Add the joint centres that follow from other points."""
    for side in SIDES:
        for centre, pair in CENTRES.items():
            if f"{centre}_{side}" not in points and all(f"{name}_{side}" in points for name in pair):
                points[f"{centre}_{side}"] = (points[f"{pair[0]}_{side}"] + points[f"{pair[1]}_{side}"]) / 2.0
    front, back = _midpoint(points, "asis"), _midpoint(points, "psis")
    if front is not None and back is not None:
        points["pelvis_front"], points["pelvis_back"] = front, back
        if "hip_left" not in points:
            _add_hip_centres(points, front, back)


def _add_hip_centres(points: Points, front: Array, back: Array) -> None:
    across = points["asis_right"] - points["asis_left"]
    pelvis = frame_from_y_z(np.cross(across, front - back), across)
    width = np.linalg.norm(across, axis=1)
    depth = np.linalg.norm(front - back, axis=1)
    sizes = {"back": depth, "down": width, "out": width}
    x, y, z = (
        HARRINGTON[direction][0] * sizes[direction] + HARRINGTON[direction][1] for direction in ("back", "down", "out")
    )
    for side, outward in zip(SIDES, (-1.0, 1.0), strict=True):
        local = np.stack([x, y, z * outward], axis=1)
        points[f"hip_{side}"] = front + np.einsum("nij,nj->ni", pelvis, local)


def _add_trunk(points: Points, body: SegmentFrames) -> None:
    """Add pelvis, thorax (ISB: notch, C7, xiphoid, T8) and trunk (line from hips to shoulders)."""
    hips, shoulders = _midpoint(points, "hip"), _midpoint(points, "shoulder")
    if all(name in points for name in ("notch", "c7", "xiphoid", "t8")):
        high, low = (points["notch"] + points["c7"]) / 2.0, (points["xiphoid"] + points["t8"]) / 2.0
        ahead = points["notch"] - points["c7"] + points["xiphoid"] - points["t8"]
        body.frames["thorax"] = frame_from_y_z(high - low, np.cross(ahead, high - low))
    if hips is not None and shoulders is not None:
        across = points["shoulder_right"] - points["shoulder_left"]
        body.frames["trunk"] = frame_from_y_z(shoulders - hips, across)
    elif hips is not None and "thorax" in body.frames:
        # Markers on one arm only: the middle of notch and C7 is at the height of the shoulders.
        neck = (points["notch"] + points["c7"]) / 2.0
        body.frames["trunk"] = frame_from_y_z(neck - hips, body.frames["thorax"][:, :, 2])
    right = _left_to_right(points, "asis")
    right = right if right is not None else _left_to_right(points, "hip")
    if right is None:
        return
    if "pelvis_front" in points:
        body.frames["pelvis"] = frame_across(np.cross(right, points["pelvis_front"] - points["pelvis_back"]), right)
    elif "trunk" in body.frames:
        body.frames["pelvis"] = frame_across(body.frames["trunk"][:, :, 1], right)


def _add_head(points: Points, body: SegmentFrames) -> None:
    """Add the head: a frame from four markers or from ears and nose, else the line from the neck."""
    right = _left_to_right(points, "ear")
    if right is not None and "head_front" in points and "head_back" in points:
        body.frames["head"] = frame_from_y_z(np.cross(right, points["head_front"] - points["head_back"]), right)
        return
    neck = points.get("neck", points.get("c7", _midpoint(points, "shoulder")))
    head = _midpoint(points, "ear")
    head = head if head is not None else points.get("head")
    if neck is None or head is None:
        return
    body.axes["head"] = head - neck
    if right is None and "nose" in points:
        right = np.cross(points["nose"] - head, head - neck)
    if right is not None:
        body.frames["head"] = frame_from_y_z(head - neck, right)


def _add_limbs(points: Points, body: SegmentFrames, side: str, outward: float) -> None:
    for segment, (proximal, distal) in LIMBS.items():
        if f"{proximal}_{side}" in points and f"{distal}_{side}" in points:
            body.axes[f"{segment}_{side}"] = points[f"{proximal}_{side}"] - points[f"{distal}_{side}"]
    lateral, medial = points.get(f"elbow_lateral_{side}"), points.get(f"elbow_medial_{side}")
    arm = body.axes.get(f"upper_arm_{side}")
    if arm is not None and lateral is not None and medial is not None:
        body.frames[f"upper_arm_{side}"] = frame_from_y_z(arm, (lateral - medial) * outward)
    radial, ulnar = points.get(f"wrist_radial_{side}"), points.get(f"wrist_ulnar_{side}")
    forearm = body.axes.get(f"forearm_{side}")
    if forearm is not None and radial is not None and ulnar is not None:
        body.frames[f"forearm_{side}"] = frame_from_y_z(forearm, np.cross(radial - ulnar, forearm))
    neck = points.get("notch", points.get("neck", points.get("c7")))
    if neck is not None and f"shoulder_{side}" in points:
        body.axes[f"clavicle_{side}"] = points[f"shoulder_{side}"] - neck
