"""One recorded movement in the encodings in which ROS and Foxglove recordings carry a person.

    python -m tests.support.encode_motion RECORDING.bvh --table          how far each encoding carries the angles
    python -m tests.support.encode_motion RECORDING.bvh --folder OUT     write the MCAP files

Each writer takes the same segment poses, so that whatever differs after reading is what an encoding cannot carry.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from tests.support.body_motion import PARENTS, BodyMotion, read_xsens_bvh
from tests.support.joint_angles import STAND_UP, Hinges, human_urdf_angles, ros4hri_angles, trunk_as_line
from tests.support.paths import DATASETS

sys.path.insert(0, str(DATASETS))
from palletising import JOINTS
from ros2_bag import Ros2Bag
from ros2_messages import NANOSECONDS, Transform

Array = NDArray[np.float64]
EPOCH = 1_700_000_000 * NANOSECONDS
BODY = "7c2f"
MODEL = "skeleton"
LIBRARY = "tests.support.encode_motion"
_VECTOR = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyz"}}
_QUATERNION = {"type": "object", "properties": {axis: {"type": "number"} for axis in "xyzw"}}
_TIME = {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}}
FRAME_TRANSFORMS_SCHEMA = {
    "title": "foxglove.FrameTransforms",
    "type": "object",
    "properties": {
        "transforms": {
            "type": "array",
            "items": {
                "type": "object",
                "properties": {
                    "timestamp": _TIME,
                    "parent_frame_id": {"type": "string"},
                    "child_frame_id": {"type": "string"},
                    "translation": _VECTOR,
                    "rotation": _QUATERNION,
                },
            },
        }
    },
}
"""JSON schema of Foxglove's FrameTransforms, as far as it is used."""


def stamps(motion: BodyMotion) -> list[int]:
    """Return the stamp of each frame [ns]."""
    return [EPOCH + round(float(time) * NANOSECONDS) for time in motion.time]


def _poses(rotation: Array, position: Array) -> Array:
    """Return (n, 7): x y z and the quaternion x y z w."""
    return np.concatenate([position, Rotation.from_matrix(rotation).as_quat()], axis=1)


def write_human_urdf(path: Path, motion: BodyMotion, hinges: Hinges = "angles", root: bool = True) -> None:
    """Write JointState of human.urdf on /joint_states and, if asked for, the pose of its root on /tf."""
    angles = human_urdf_angles(motion, hinges)
    position = np.stack([angles[joint] for joint in JOINTS], axis=1)
    poses = _poses(motion.of("pelvis") @ STAND_UP, motion.at("pelvis"))
    with Ros2Bag(path, LIBRARY) as bag:
        for stamp, row, pose in zip(stamps(motion), position, poses, strict=True):
            bag.joints("/joint_states", stamp, JOINTS, row)
            if root:
                bag.transforms("/tf", stamp, [Transform("map", "middle_pelvis", pose)])


def write_xsens_tf(path: Path, motion: BodyMotion, grouped: bool = False, model: str = MODEL) -> None:
    """Write /tf as the Xsens ROS 2 driver: a TFMessage per segment, or one per frame if grouped."""
    poses = {name: _poses(*motion.relative(name, parent)) for name, parent in PARENTS.items()}
    poses["pelvis"] = _poses(motion.of("pelvis"), motion.at("pelvis"))
    # The driver walks through an unordered map: children come before their parents.
    names = sorted(motion.names)
    with Ros2Bag(path, LIBRARY) as bag:
        for index, stamp in enumerate(stamps(motion)):
            transforms = [
                Transform(
                    f"{model}_{PARENTS[name]}" if name in PARENTS else "world", f"{model}_{name}", poses[name][index]
                )
                for name in names
            ]
            for group in [transforms] if grouped else [[transform] for transform in transforms]:
                bag.transforms("/tf", stamp, group)


def write_ros4hri(path: Path, motion: BodyMotion, body: str = BODY) -> None:
    """Write JointState of one ROS4HRI body and its frame body_<id> on /tf."""
    angles = ros4hri_angles(motion)
    names = [f"{joint}_{body}" for joint in angles]
    position = np.stack(list(angles.values()), axis=1)
    poses = _poses(motion.of("pelvis"), motion.at("pelvis"))
    with Ros2Bag(path, LIBRARY) as bag:
        for stamp, row, pose in zip(stamps(motion), position, poses, strict=True):
            bag.joints(f"/humans/bodies/{body}/joint_states", stamp, names, row)
            bag.transforms("/tf", stamp, [Transform("map", f"body_{body}", pose)])


def _world_frames(motion: BodyMotion) -> Iterator[tuple[int, list[tuple[str, Array]]]]:
    """Yield (stamp, (segment, pose in the world)) of each frame."""
    poses = np.stack([_poses(motion.of(name), motion.at(name)) for name in motion.names], axis=1)
    for stamp, frame in zip(stamps(motion), poses, strict=True):
        yield stamp, list(zip(motion.names, frame, strict=True))


def write_foxglove_json(path: Path, motion: BodyMotion) -> None:
    """Write foxglove.FrameTransforms as JSON on /tf, every segment in the world."""

    def encode(stamp: int, frame: list[tuple[str, Array]]) -> bytes:
        seconds, nanoseconds = divmod(stamp, NANOSECONDS)
        transforms = [
            {
                "timestamp": {"sec": seconds, "nsec": nanoseconds},
                "parent_frame_id": "world",
                "child_frame_id": f"{MODEL}_{name}",
                "translation": dict(zip("xyz", pose[:3].tolist(), strict=True)),
                "rotation": dict(zip("xyzw", pose[3:].tolist(), strict=True)),
            }
            for name, pose in frame
        ]
        return json.dumps({"transforms": transforms}, separators=(",", ":")).encode()

    _write_frames(path, motion, "json", ("jsonschema", json.dumps(FRAME_TRANSFORMS_SCHEMA).encode()), encode)


def write_foxglove_protobuf(path: Path, motion: BodyMotion) -> None:
    """Write foxglove.FrameTransforms as protobuf on /tf, every segment in the world (needs foxglove-sdk)."""
    from foxglove import messages

    def encode(stamp: int, frame: list[tuple[str, Array]]) -> bytes:
        time = messages.Timestamp(*divmod(stamp, NANOSECONDS))
        transforms = [
            messages.FrameTransform(
                timestamp=time,
                parent_frame_id="world",
                child_frame_id=f"{MODEL}_{name}",
                translation=messages.Vector3(**dict(zip("xyz", pose[:3].tolist(), strict=True))),
                rotation=messages.Quaternion(**dict(zip("xyzw", pose[3:].tolist(), strict=True))),
            )
            for name, pose in frame
        ]
        return bytes(messages.FrameTransforms(transforms=transforms).encode())

    schema = messages.FrameTransforms.get_schema()
    _write_frames(path, motion, "protobuf", (schema.encoding, bytes(schema.data)), encode)


def _write_frames(
    path: Path,
    motion: BodyMotion,
    encoding: str,
    schema: tuple[str, bytes],
    encode: Callable[[int, list[tuple[str, Array]]], bytes],
) -> None:
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start(library=LIBRARY)
        number = writer.register_schema("foxglove.FrameTransforms", *schema)
        channel = writer.register_channel("/tf", encoding, number)
        for stamp, frame in _world_frames(motion):
            writer.add_message(channel, stamp, encode(stamp, frame), stamp)
        writer.finish()


ENCODINGS: dict[str, Callable[[Path, BodyMotion], None]] = {
    "human_urdf": write_human_urdf,
    "human_urdf_line": lambda path, motion: write_human_urdf(path, trunk_as_line(motion)),
    "human_urdf_directions": lambda path, motion: write_human_urdf(path, motion, "directions"),
    "human_urdf_no_root": lambda path, motion: write_human_urdf(path, motion, root=False),
    "xsens_tf": write_xsens_tf,
    "xsens_tf_grouped": lambda path, motion: write_xsens_tf(path, motion, grouped=True),
    "ros4hri": write_ros4hri,
    "foxglove_json": write_foxglove_json,
    "foxglove_protobuf": write_foxglove_protobuf,
}
"""Name -> writer(path, motion)."""


def write_all(folder: Path, motion: BodyMotion) -> dict[str, Path]:
    """Write every encoding into a folder; return the files by name."""
    paths = {name: folder / f"{name}.mcap" for name in ENCODINGS}
    for name, path in paths.items():
        ENCODINGS[name](path, motion)
    return paths


def main() -> None:
    """Write the files or print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path, help="an Xsens BVH file")
    parser.add_argument("--folder", type=Path, help="where to keep the MCAP files")
    parser.add_argument("--table", action="store_true", help="print how far each encoding agrees with the recording")
    arguments = parser.parse_args()
    with TemporaryDirectory() as scratch:
        folder = arguments.folder or Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        paths = write_all(folder, read_xsens_bvh(arguments.recording))
        if arguments.table:
            from tests.support.compare_encodings import agreement_table, compare_all

            print(agreement_table(compare_all(arguments.recording, paths, folder)))


if __name__ == "__main__":
    main()
