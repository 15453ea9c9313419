"""MCAP recordings of postures with the images of a camera, whose colors tell when each was taken."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import Writer
from PIL import Image

from tests.support.mcap_builder import EPOCH_NS, TYPES, definition, header

ROS = "sensor_msgs/msg/CompressedImage"
TOPIC = "/ann_lee/front/compressed"
"""Names a person, as topics may."""
FRAMES, STEP = 500, 0.04
"""Of the postures: [s] between two."""
WORST = 12.0
"""[s] When the trunk is bent most."""
COLOR = 10
"""Levels of red by which images of a second differ from those of the next."""


def picture(seconds: float, size: tuple[int, int] = (640, 480), kind: str = "JPEG", noise: bool = False) -> bytes:
    """Return an image of one color that tells its time, or of noise."""
    shape = (size[1], size[0], 3)
    pixels = np.full(shape, (min(int(seconds * COLOR), 255), 60, 90), np.uint8)
    if noise:
        pixels = np.random.default_rng(round(seconds * 10)).integers(0, 255, shape, np.uint8)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, kind, quality=95)
    return file.getvalue()


def time_of(data: bytes) -> float:
    """Return the time [s] that the color of a picture tells."""
    with Image.open(io.BytesIO(data)) as image:
        return float(np.asarray(image)[..., 0].mean()) / COLOR


def as_ros(stamp: int, data: bytes, text: str = "jpeg") -> bytes:
    """Return a sensor_msgs/CompressedImage in CDR."""
    message = TYPES.types[ROS](header(stamp, "camera"), text, np.frombuffer(data, np.uint8))
    return bytes(TYPES.serialize_cdr(message, ROS))


def as_json(stamp: int, data: bytes) -> bytes:
    """Return a foxglove.CompressedImage in JSON."""
    seconds, rest = divmod(stamp, 10**9)
    tree = {"timestamp": {"sec": seconds, "nsec": rest}, "format": "jpeg", "data": base64.b64encode(data).decode()}
    return json.dumps(tree).encode()


def as_protobuf(stamp: int, data: bytes) -> bytes:
    """Return a foxglove.CompressedImage in protobuf."""
    message = _message()(data=data, format="jpeg")
    message.timestamp.seconds, message.timestamp.nanos = divmod(stamp, 10**9)
    return bytes(message.SerializeToString())


def _file() -> Any:
    from google.protobuf import descriptor_pb2

    file = descriptor_pb2.FileDescriptorProto(
        name="image.proto", package="foxglove", syntax="proto3", dependency=["google/protobuf/timestamp.proto"]
    )
    message = file.message_type.add(name="CompressedImage")
    message.field.add(name="timestamp", number=1, type=11, label=1, type_name=".google.protobuf.Timestamp")
    message.field.add(name="data", number=2, type=12, label=1)
    message.field.add(name="format", number=3, type=9, label=1)
    return file


def _message() -> Any:
    from google.protobuf import descriptor_pool, message_factory, timestamp_pb2

    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(timestamp_pb2.DESCRIPTOR.serialized_pb)
    pool.Add(_file())
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("foxglove.CompressedImage"))


def protobuf_schema() -> bytes:
    """Return the descriptors of foxglove.CompressedImage."""
    from google.protobuf import descriptor_pb2, timestamp_pb2

    both = descriptor_pb2.FileDescriptorSet()
    both.file.add().ParseFromString(timestamp_pb2.DESCRIPTOR.serialized_pb)
    both.file.add().CopyFrom(_file())
    return both.SerializeToString()


def write(
    path: Path,
    images: Iterable[tuple[float, bytes]],
    *,
    encode: Callable[[int, bytes], bytes] = as_ros,
    schema: tuple[str, str, bytes] | None = None,
    encoding: str = "cdr",
    late: float = 0.0,
    others: Iterable[tuple[float, bytes]] = (),
) -> Path:
    """Write postures and (log time [s], image) of a camera; `late` [s]: its stamps behind the log time.

    Args:
        schema: name, encoding and text of the type of the images; None for ROS 2.
        others: images of a second camera.
    """
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=1 << 16)
        writer.start("")
        postures = writer.register_channel(
            "/posture", "json", writer.register_schema("reba.Posture", "jsonschema", b"")
        )
        kind = schema or (ROS, "ros2msg", definition(ROS))
        number = writer.register_schema(*kind)
        cameras = [writer.register_channel(topic, encoding, number) for topic in (TOPIC, "/ann_lee/side")]
        rows = []
        for frame in range(FRAMES):
            time = frame * STEP
            bent = 70.0 if abs(time - WORST) < 0.6 else 10.0
            row = {"time": round(time, 3), "trunk_flexion": bent, "neck_flexion": 10.0}
            rows.append((time, postures, json.dumps(row).encode()))
        for camera, some in zip(cameras, (images, others), strict=True):
            rows += [(time, camera, encode(EPOCH_NS + round((time - late) * 1e9), data)) for time, data in some]
        for time, channel, data in sorted(rows, key=lambda row: row[:2]):
            log = EPOCH_NS + round(time * 1e9)
            writer.add_message(channel, log, data, log)
        writer.finish()
    return path


def every(seconds: float, **how: object) -> list[tuple[float, bytes]]:
    """Return an image for all times this far apart [s]."""
    return [(time, picture(time, **how)) for time in np.arange(0, FRAMES * STEP, seconds).tolist()]  # type: ignore[arg-type]
