"""MCAP recordings as a lab has them, and what is in them after scoring."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer

import reba
from tests.reba.readers.test_whole_recording import JOINTS, angles
from tests.support import mcap_builder as make
from tests.support.mcap_builder import EPOCH_NS, JOINT_STATE, STEP_NS
from tests.support.mcap_check import Content, checked

TOPIC = "/ergonomics/reba"
DELAY = 1_234_567
"""[ns] From a stamp to the log time."""
ORIGIN = {"origin": "lab 3"}


def recorded(
    path: Path,
    count: int = 300,
    *,
    first: int = 0,
    profile: str = "ros2",
    slow: int = 1,
    skip_ids: int = 0,
    names: tuple[str, ...] = JOINTS,
    **options: Any,
) -> Path:
    """Write a recording as a lab has it: a camera, a robot's log, an attachment and metadata beside the joints.

    `slow`: how many times slower than the stamps the log time runs; `skip_ids`: topics defined before those.
    """
    with path.open("wb") as stream:
        writer = Writer(stream, **{"chunk_size": 20_000, "compression": CompressionType.ZSTD, **options})
        writer.start(profile=profile, library="libmcap 1.4.0")
        writer.add_metadata("rosbag2", {"serialized_metadata": f"part of {first}"})
        for number in range(skip_ids):
            other = writer.register_schema(f"lab_msgs/msg/Empty{number}", "ros2msg", b"uint8 value\n")
            writer.register_channel(f"/unused_{number}", "cdr", other)
        schema = writer.register_schema(JOINT_STATE, "ros2msg", make.definition(JOINT_STATE))
        joints = writer.register_channel("/joint_states", "cdr", schema, ORIGIN)
        image = writer.register_schema("lab_msgs/msg/Bytes", "ros2msg", b"uint8[] data\n")
        camera = writer.register_channel("/camera", "cdr", image, ORIGIN)
        noise = np.random.default_rng(3)
        for at in range(first, first + count):
            stamp = EPOCH_NS + at * STEP_NS
            log = EPOCH_NS + at * STEP_NS * slow + DELAY
            writer.add_message(joints, log, make.joint_state(stamp, names, np.array(angles(at))), log - 7, at)
            if at % 10 == 0:
                picture = b"\0\1\0\0\xe8\3\0\0" + noise.bytes(1000)
                writer.add_message(camera, log + 500, picture, log + 400, at // 10)
            if at == first + count // 2:
                writer.add_attachment(log, log, "calibration.yaml", "text/yaml", b"camera: 1\n" * 100)
        writer.finish()
    return path


def scored(source: Path, out: Path, **options: Any) -> tuple[reba.Scores, Content]:
    scores = reba.score(reba.read(source), activity="none")
    reba.write_scores(scores, out, **options)
    return scores, checked(out)
