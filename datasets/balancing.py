"""Make `balancing_keypoints.trc`: a person balancing on a beam, recorded by four cameras and a pose estimator.

The videos and the calibration of the cameras are the demo of Pose2Sim (BSD-3-Clause), inside its wheel on PyPI; the
estimator is MediaPipe Pose (Apache-2.0), whose wheel contains its model. It needs an older numpy, so this script
runs in its own environment and does not import this project:

    pip download --no-deps pose2sim==0.10.49
    python -m venv keypoints && keypoints/bin/pip install mediapipe==0.10.14 "numpy<2" scipy
    keypoints/bin/python datasets/balancing.py pose2sim-0.10.49-py3-none-any.whl

videos -> 33 keypoints in each image -> shifts in time between the cameras -> triangulation with weights that
decrease with the reprojection error -> low-pass filter -> TRC in metres, z up.
"""

from __future__ import annotations

import argparse
import xml.etree.ElementTree as ElementTree
import zipfile
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
FILE = "balancing_keypoints.trc"
DEMO = "Pose2Sim/Demo_SinglePerson/"
CAMERAS = ("cam01", "cam02", "cam03", "cam04")
RATE = 60.0
CUTOFF = 6.0
"""Cut-off frequency of the zero-lag Butterworth filter of order 4 [Hz]: default of Pose2Sim, common for walking."""
LARGEST_SHIFT = 12
"""Largest time shift between two videos [frames]."""
TRUST = 10.0
"""Reprojection error at which the weight of a keypoint is halved [pixel]."""

NAMES = (
    "nose", "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer",
    "left_ear", "right_ear", "mouth_left", "mouth_right", "left_shoulder", "right_shoulder", "left_elbow",
    "right_elbow", "left_wrist", "right_wrist", "left_pinky", "right_pinky", "left_index", "right_index", "left_thumb",
    "right_thumb", "left_hip", "right_hip", "left_knee", "right_knee", "left_ankle", "right_ankle", "left_heel",
    "right_heel", "left_foot_index", "right_foot_index",
)  # fmt: skip
"""The keypoints of MediaPipe Pose in their order."""


@dataclass(frozen=True)
class Camera:
    """Calibrated camera: a point X in the world [m] has the camera coordinates rotation @ X + shift.

    Attributes:
        rotation, shift: (3, 3) and (3,).
        matrix, distortion: (3, 3) [pixel] and (5,), as OpenCV has them.
    """

    rotation: Any
    shift: Any
    matrix: Any
    distortion: Any

    @property
    def projection(self) -> Any:
        """(3, 4)."""
        return np.hstack([self.rotation, self.shift[:, None]])


def read_cameras(text: str) -> list[Camera]:
    """Cameras of a Qualisys calibration: millimetres, 64ths of a pixel, view direction -z."""
    cameras = []
    for entry in ElementTree.fromstring(text).iter("camera"):
        place, lens = entry.find("transform"), entry.find("intrinsic")
        if place is None or lens is None:
            raise SystemExit("the calibration has a camera without transform or intrinsic; give a complete calibration")
        turn = np.array([[float(place.attrib[f"r{row}{column}"]) for column in (1, 2, 3)] for row in (1, 2, 3)])
        rotation = np.diag([1.0, -1.0, -1.0]) @ turn
        centre = np.array([float(place.attrib[axis]) for axis in "xyz"]) / 1000.0
        number = {name: float(value) for name, value in lens.attrib.items()}
        matrix = np.diag([number["focalLengthU"] / 64.0, number["focalLengthV"] / 64.0, 1.0])
        matrix[:2, 2] = number["centerPointU"] / 64.0, number["centerPointV"] / 64.0
        bent = ("radialDistortion1", "radialDistortion2", "tangentalDistortion1", "tangentalDistortion2")
        distortion = np.array([*(number[name] for name in bent), number["radialDistortion3"]])
        cameras.append(Camera(rotation, -rotation @ centre, matrix, distortion))
    return cameras


@dataclass(frozen=True)
class Seen:
    """Result of the pose estimator for T images.

    Attributes:
        places: (T, 33, 2) [pixel].
        visible: (T, 33) visibility, 0 to 1.
        guessed: (T, 33, 3) [m] positions estimated from this camera alone: relative to the hips, y up.
    """

    places: Any
    visible: Any
    guessed: Any


def see(video: Path) -> Seen:
    """Keypoints of every image of a video."""
    import cv2
    import mediapipe

    images = cv2.VideoCapture(str(video))
    places, visible, guessed = [], [], []
    # Without the smoothing of the estimator, which has a lag; the filter below has none.
    with mediapipe.solutions.pose.Pose(model_complexity=1, smooth_landmarks=False) as estimator:
        while True:
            there, image = images.read()
            if not there:
                break
            result = estimator.process(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
            landmarks = result.pose_landmarks
            if landmarks is None:
                raise SystemExit(
                    f"{video.name}: no person detected in image {len(places)}; give a video with one person"
                )
            height, width = image.shape[:2]
            places.append([(point.x * width, point.y * height) for point in landmarks.landmark])
            visible.append([point.visibility for point in landmarks.landmark])
            guessed.append([(point.x, -point.y, -point.z) for point in result.pose_world_landmarks.landmark])
    return Seen(np.array(places), np.array(visible), np.array(guessed))


def straighten(places: Any, camera: Camera) -> Any:
    """Directions (T, 33, 2) (x / z, y / z) without lens distortion."""
    import cv2

    flat = np.ascontiguousarray(places.reshape(-1, 1, 2))
    return cv2.undistortPoints(flat, camera.matrix, camera.distortion).reshape(places.shape)


def triangulate(seen: list[Any], weights: list[Any], cameras: list[Camera]) -> tuple[Any, Any]:
    """Points (T, 33, 3) [m] and the reprojection error of each camera (4, T, 33) [pixel], by iterative reweighting."""
    trust = [np.asarray(weight) for weight in weights]
    points, away = np.empty(0), np.empty(0)
    for _ in range(8):
        rows = []
        for direction, weight, camera in zip(seen, trust, cameras, strict=True):
            for axis in (0, 1):
                row = direction[..., axis, None] * camera.projection[2] - camera.projection[axis]
                rows.append(weight[..., None] * row)
        last = np.linalg.svd(np.stack(rows, axis=-2))[2][..., -1, :]
        points = last[..., :3] / last[..., 3:]
        away = np.stack([_away(points, *pair) for pair in zip(seen, cameras, strict=True)])
        trust = [weight / (1.0 + (gap / TRUST) ** 2) for weight, gap in zip(weights, away, strict=True)]
    return points, away


def _away(points: Any, direction: Any, camera: Camera) -> Any:
    there = points @ camera.rotation.T + camera.shift
    return np.linalg.norm(there[..., :2] / there[..., 2:] - direction, axis=-1) * camera.matrix[0, 0]


def shifted(tables: list[Any], shifts: list[int]) -> list[Any]:
    """Images common to all cameras, each shifted by its delay in images."""
    first = [shift - min(shifts) for shift in shifts]
    count = min(len(table) - start for table, start in zip(tables, first, strict=True))
    return [table[start : start + count] for table, start in zip(tables, first, strict=True)]


def align(seen: list[Any], weights: list[Any], cameras: list[Camera]) -> list[int]:
    """Delay of each camera in images: the shifts of the smallest median reprojection error."""
    shifts = [0] * len(seen)
    while True:
        before = list(shifts)
        for number in range(1, len(seen)):
            trials = []
            for shift in range(-LARGEST_SHIFT, LARGEST_SHIFT + 1):
                tried = [*shifts[:number], shift, *shifts[number + 1 :]]
                away = triangulate(shifted(seen, tried), shifted(weights, tried), cameras)[1]
                trials.append((float(np.median(away)), abs(shift), shift))
            shifts[number] = min(trials)[2]
        if shifts == before:
            return shifts


def write_trc(path: Path, points: Any) -> None:
    """Write points (T, 33, 3) [m] as a TRC file."""
    count, width = len(points), len(NAMES)
    places = "\t".join(f"{axis}{number}" for number in range(1, width + 1) for axis in "XYZ")
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{RATE:g}\t{RATE:g}\t{count}\t{width}\tm\t{RATE:g}\t0\t{count}",
        "Frame#\tTime\t" + "\t\t\t".join(NAMES) + "\t\t",
        f"\t\t{places}",
    ]
    for number, row in enumerate(points.reshape(count, -1)):
        lines.append(f"{number + 1}\t{number / RATE:.6f}\t" + "\t".join(f"{value:.4f}" for value in row))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def main() -> None:
    """Write the file and print the reprojection error and the segment lengths."""
    from scipy.signal import butter, filtfilt

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("wheel", type=Path, help="wheel of pose2sim")
    parser.add_argument("--folder", type=Path, default=HERE, help="where to write (default: beside the script)")
    parser.add_argument("--alone", type=Path, help="also write the estimate of each camera alone into this folder")
    options = parser.parse_args()
    with TemporaryDirectory() as there, zipfile.ZipFile(options.wheel) as wheel:
        cameras = read_cameras(wheel.read(f"{DEMO}calibration/Calib.qca.txt").decode("ascii"))
        detections = [see(Path(wheel.extract(f"{DEMO}videos/{name}.mp4", there))) for name in CAMERAS]
    seen = [straighten(one.places, camera) for one, camera in zip(detections, cameras, strict=True)]
    weights = [one.visible for one in detections]
    shifts = align(seen, weights, cameras)
    points, away = triangulate(shifted(seen, shifts), shifted(weights, shifts), cameras)
    low_pass = butter(4, CUTOFF / (RATE / 2.0))
    smooth = filtfilt(*low_pass, points, axis=0)
    write_trc(options.folder / FILE, smooth)
    if options.alone:
        options.alone.mkdir(parents=True, exist_ok=True)
        for name, guess in zip(CAMERAS, shifted([one.guessed for one in detections], shifts), strict=True):
            write_trc(options.alone / f"{name}.trc", filtfilt(*low_pass, guess, axis=0))
    print(f"{len(points)} images; delays of the cameras: {shifts} images; reprojection error {np.median(away):.1f} px")
    print(f"(median); change by the filter {1000 * np.median(np.abs(smooth - points)):.1f} mm")
    for first, second in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle")):
        for side in ("left", "right"):
            ends = [smooth[:, NAMES.index(f"{side}_{name}")] for name in (first, second)]
            length = np.linalg.norm(ends[0] - ends[1], axis=1)
            print(f"{side} {first} to {second}: {length.mean():.3f} +- {length.std():.3f} m")


if __name__ == "__main__":
    main()
