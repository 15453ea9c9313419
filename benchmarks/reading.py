"""Speed of reading MCAP recordings compared with the official Python packages, on one core, in one run.

    python benchmarks/reading.py [--json FILE] [--messages 60000] [--repeat 5]

Two recordings are generated with a fixed seed: joint states (36 joints, positions and velocities, 100 Hz) and /tf with
23 transforms in each message (100 Hz), both in zstd chunks of 1 MiB. Two more are of a body: the joint states of
human.urdf, without and with 23 transforms at a third of the rate. Of them `reba.read` makes the posture table, with all
angles and checks, while the peer only decodes. The slower peer reads a part of a recording; its time is per message of
that part, ours per message of the complete recording.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import sys
import tempfile
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore

import reba
from reba.readers.mcap import open_mcap

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "datasets"))

from palletising import JOINTS as BODY
from palletising import simulate
from ros2_bag import Ros2Bag
from ros2_messages import Transform

SEED = 20250101
RATE_NS = 10_000_000
EPOCH = 1_700_000_000
JOINTS = tuple(f"{side}_joint_{index:02d}_{axis}" for side in ("left", "right") for index in range(6) for axis in "xyz")
SEGMENTS = tuple(f"skeleton_segment_{index:02d}" for index in range(23))
CHUNK = 1 << 20
JOINT_STATE = "sensor_msgs/msg/JointState"
TF_MESSAGE = "tf2_msgs/msg/TFMessage"

TYPES = get_typestore(Stores.ROS2_JAZZY)
CHAIN = ("world", *SEGMENTS)


def stamped(stamp: int, frame: str) -> Any:
    """A std_msgs/Header."""
    time_of = TYPES.types["builtin_interfaces/msg/Time"](*divmod(stamp, 10**9))
    return TYPES.types["std_msgs/msg/Header"](time_of, frame)


def joint_state(stamp: int, positions: np.ndarray, velocities: np.ndarray) -> Any:
    """One sensor_msgs/JointState."""
    return TYPES.types[JOINT_STATE](stamped(stamp, ""), list(JOINTS), positions, velocities, np.zeros(0))


def tf_message(stamp: int, poses: np.ndarray) -> Any:
    """One tf2_msgs/TFMessage with a transform for each segment."""
    of = TYPES.types
    return of[TF_MESSAGE](
        [
            of["geometry_msgs/msg/TransformStamped"](
                stamped(stamp, parent),
                child,
                of["geometry_msgs/msg/Transform"](
                    of["geometry_msgs/msg/Vector3"](*pose[:3]), of["geometry_msgs/msg/Quaternion"](*pose[3:])
                ),
            )
            for parent, child, pose in zip(CHAIN[:-1], CHAIN[1:], poses.tolist(), strict=True)
        ]
    )


def write(path: Path, topic: str, name: str, message: Callable[[int, int], Any], count: int) -> None:
    """Write a recording of one topic; `message(index, stamp)` gives its messages."""
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=CHUNK, compression=CompressionType.ZSTD)
        writer.start("ros2", "benchmark")
        schema = writer.register_schema(name, "ros2msg", TYPES.generate_msgdef(name, ros_version=2)[0].encode())
        channel = writer.register_channel(topic, "cdr", schema)
        for index in range(count):
            stamp = EPOCH * 10**9 + index * RATE_NS
            payload = TYPES.serialize_cdr(message(index, stamp), name)
            writer.add_message(channel, stamp, bytes(payload), stamp)
        writer.finish()


def write_body(path: Path, count: int, *, transforms: bool) -> int:
    """Write joint states of a body that moves boxes, with /tf of its pelvis and 22 frames; return the messages."""
    rng = np.random.default_rng(SEED)
    motion = simulate(rng)
    places = np.arange(count) * (RATE_NS / 1e9) % motion.time[-1]
    positions = np.stack([np.interp(places, motion.time, column) for column in motion.position.T], axis=1)
    positions += rng.normal(0.0, 1e-3, positions.shape)
    velocities = np.gradient(positions, RATE_NS / 1e9, axis=0)
    frames = ("map", "middle_pelvis", *SEGMENTS[1:])
    with Ros2Bag(path, "benchmark") as bag:
        for index in range(count):
            stamp = EPOCH * 10**9 + index * RATE_NS
            bag.joints("/joint_states", stamp, BODY, positions[index], velocities[index])
            if transforms and index % 3 == 0:
                poses = np.column_stack(
                    [rng.normal(size=(len(SEGMENTS), 3)), np.zeros((len(SEGMENTS), 3)), np.ones(23)]
                )
                links = zip(frames[:-1], frames[1:], poses, strict=True)
                bag.transforms("/tf", stamp, [Transform(parent, child, pose) for parent, child, pose in links])
    return count + (-(-count // 3) if transforms else 0)


def best(run: Callable[[], Any], repeat: int) -> float:
    """Shortest processor time of several runs [s]: that of a machine without other work."""
    times = []
    for _ in range(repeat):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return min(times)


def read_ours(path: Path) -> np.ndarray:
    """Values of the only stream; every row is one message."""
    recording = open_mcap(path)
    (stream,), (topic,) = recording.streams, recording.topics
    result, row = None, 0
    for block in stream.blocks():
        if result is None:
            result = np.empty((topic.count, *block.values.shape[1:]))
        result[row : row + len(block.values)] = block.values
        row += len(block.values)
    return result[:row]


def read_peer(path: Path, count: int, values: Callable[[Any], list[Any]]) -> np.ndarray:
    """Values of the first messages by mcap and mcap-ros2-support."""
    rows = []
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, _, _, message in reader.iter_decoded_messages():
            rows.append(values(message))
            if len(rows) == count:
                break
    return np.array(rows)


def chunks(path: Path) -> list[Chunk]:
    """Compressed chunks of a recording."""
    with path.open("rb") as file:
        return [record for record in StreamReader(file, emit_chunks=True).records if isinstance(record, Chunk)]


def poses_of(message: Any) -> list[Any]:
    """Poses of a decoded TFMessage."""
    return [
        [
            getattr(part, axis)
            for part, axes in ((t.transform.translation, "xyz"), (t.transform.rotation, "xyzw"))
            for axis in axes
        ]
        for t in message.transforms
    ]


def unpack(packed: list[Chunk], decompressor: zstandard.ZstdDecompressor) -> None:
    """Decompress all chunks only."""
    for chunk in packed:
        decompressor.decompress(chunk.data, max_output_size=chunk.uncompressed_size)


def measure(
    path: Path, count: int, peer_count: int, values: Callable[[Any], list[Any]], truth: np.ndarray, repeat: int
) -> dict[str, Any]:
    """Times of one recording, after comparing the values read with those written."""
    if not np.array_equal(read_ours(path), truth):
        raise SystemExit(f"{path.name}: our reader returns other values than were written")
    if not np.array_equal(read_peer(path, peer_count, values), truth[:peer_count]):
        raise SystemExit(f"{path.name}: the peer returns other values than were written")
    return times_of(
        path, lambda: read_ours(path), lambda: read_peer(path, peer_count, values), count, peer_count, repeat
    )


def times_of(
    path: Path, read: Callable[[], Any], read_by_peer: Callable[[], Any], count: int, peer_count: int, repeat: int
) -> dict[str, Any]:
    """Times of reading `count` messages, and `peer_count` of them by the peer."""
    packed = chunks(path)
    decompressor = zstandard.ZstdDecompressor()
    rounds = []
    for _ in range(repeat):
        # Alternating, so that other load on the machine affects all three.
        peer = best(read_by_peer, 1)
        ours = best(read, 3)
        rounds.append((ours, best(lambda: unpack(packed, decompressor), 3), peer))
    ours, zstd_only, peer = (min(times) for times in zip(*rounds, strict=True))
    return {
        "messages": count,
        "file_bytes": path.stat().st_size,
        "ours_s": ours,
        "ours_messages_per_s": count / ours,
        "zstd_only_s": zstd_only,
        "ours_over_zstd": ours / zstd_only,
        "peer_messages": peer_count,
        "peer_s": peer,
        "peer_messages_per_s": peer_count / peer,
        "speed_up": (count / ours) / (peer_count / peer),
    }


def run(count: int, repeat: int) -> dict[str, Any]:
    """Write both recordings and measure them."""
    rng = np.random.default_rng(SEED)
    with tempfile.TemporaryDirectory() as folder:
        joints, tf = Path(folder) / "joint_states.mcap", Path(folder) / "tf.mcap"
        positions, velocities = (np.cumsum(rng.normal(0, 0.01, (count, len(JOINTS))), axis=0) for _ in range(2))
        write(
            joints,
            "/joint_states",
            JOINT_STATE,
            lambda index, stamp: joint_state(stamp, positions[index], velocities[index]),
            count,
        )
        tf_count = count // 3
        poses = rng.normal(size=(tf_count, len(SEGMENTS), 7))
        poses[..., 3:] /= np.linalg.norm(poses[..., 3:], axis=-1, keepdims=True)
        write(
            tf,
            "/tf",
            TF_MESSAGE,
            lambda index, stamp: tf_message(stamp, poses[index]),
            tf_count,
        )
        rows = {
            "joint_states": measure(joints, count, min(count, 10_000), lambda m: list(m.position), positions, repeat),
            "tf": measure(tf, tf_count, min(tf_count, 2000), poses_of, poses, repeat),
        }
        for name, transforms in (("reba.read", False), ("reba.read, tf", True)):
            path = Path(folder) / f"body{transforms}.mcap"
            messages = write_body(path, count, transforms=transforms)
            part = min(messages, 8000)
            rows[name] = times_of(
                path,
                lambda path=path: reba.read(path),
                lambda path=path, part=part: read_peer(path, part, lambda _: []),
                messages,
                part,
                repeat,
            )
        return rows


def main() -> None:
    """Measure, print a table, write JSON."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path)
    parser.add_argument("--messages", type=int, default=60_000)
    parser.add_argument("--repeat", type=int, default=5)
    options = parser.parse_args()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    packages = ("numpy", "mcap", "mcap-ros2-support", "zstandard")
    result = {
        "machine": {"processor": processor(), "system": platform.platform(), "cores_used": 1},
        "versions": {"python": platform.python_version(), **{name: version(name) for name in packages}},
        "seed": SEED,
        "recordings": run(options.messages, options.repeat),
    }
    print(f"{result['machine']['processor']}, one core; {result['versions']}")
    print(
        f"{'recording':<14}{'messages':>9}{'ours s':>9}{'msg/s':>10}"
        f"{'zstd s':>8}{'/ zstd':>8}{'peer msg/s':>12}{'speed-up':>10}"
    )
    for name, row in result["recordings"].items():
        print(
            f"{name:<14}{row['messages']:>9}{row['ours_s']:>9.3f}{row['ours_messages_per_s']:>10.0f}"
            f"{row['zstd_only_s']:>8.3f}{row['ours_over_zstd']:>8.2f}{row['peer_messages_per_s']:>12.0f}"
            f"{row['speed_up']:>9.1f}x"
        )
    print("peer: mcap + mcap-ros2-support on the first messages of the same file (see peer_messages), per message")
    if options.json:
        options.json.write_text(json.dumps(result, indent=2) + "\n")


def processor() -> str:
    """Name of the processor."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())


if __name__ == "__main__":
    sys.exit(main())
