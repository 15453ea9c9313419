"""Joint states of Foxglove, all in one message or one by one, in protobuf and JSON: the angles of the ROS recording."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from foxglove import messages as foxglove
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.writer import Writer

import reba
from reba.posture.columns import COLUMNS
from tests.support import bag_copies as copies

FRAMES = 100
Encoded = Iterator[tuple[int, bytes]]
"""Time [ns] and payload of messages."""


def frames() -> Iterator[tuple[int, dict[str, float]]]:
    for index, row in enumerate(copies.positions(FRAMES)):
        row = np.where(np.arange(len(row)) % 5 == 0, 0.0, row)
        yield (
            copies.EPOCH_NS + index * copies.SECOND // copies.RATE,
            dict(zip(copies.JOINTS, row.tolist(), strict=True)),
        )


def states() -> Encoded:
    for time, joints in frames():
        rows = [foxglove.JointState(name=name, position=value) for name, value in joints.items()]
        stamp = foxglove.Timestamp(*divmod(time, copies.SECOND))
        yield time, bytes(foxglove.JointStates(timestamp=stamp, joints=rows).encode())


def states_json() -> Encoded:
    for time, joints in frames():
        rows = [{"name": name, "position": value} for name, value in joints.items()]
        seconds, nanos = divmod(time, copies.SECOND)
        yield time, json.dumps({"timestamp": {"sec": seconds, "nsec": nanos}, "joints": rows}).encode()


def states_iso() -> Encoded:
    """Time stamps as protobuf writes them in JSON, in any of its forms."""
    for index, (time, payload) in enumerate(states_json()):
        message = json.loads(payload)
        text = f"{np.datetime64(time, 'ns')}"
        forms = (text + "Z", text.replace("T", " "), f"{np.datetime64(time + 5400 * 10**9, 'ns')}+01:30")
        yield time, json.dumps({**message, "timestamp": forms[index % 3]}).encode()


def one_by_one() -> Encoded:
    for time, joints in frames():
        for name, value in joints.items():
            yield time, bytes(foxglove.JointState(name=name, position=value).encode())


def one_by_one_json() -> Encoded:
    for time, joints in frames():
        for name, value in joints.items():
            yield time, json.dumps({"name": name, "position": value, "velocity": 0.0}).encode()


def plain_type() -> type:
    """Return a JointState whose numbers are not `optional`: protobuf does not write those that are zero."""
    file = descriptor_pb2.FileDescriptorProto(name="joint.proto", package="foxglove", syntax="proto3")
    message = file.message_type.add(name="JointState")
    message.field.add(name="name", number=1, type=9, label=1)
    message.field.add(name="position", number=2, type=1, label=1)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("foxglove.JointState"))


def plain() -> Encoded:
    kind = plain_type()
    for time, joints in frames():
        for name, value in joints.items():
            yield time, kind(name=name, position=value).SerializeToString()


def plain_schema() -> bytes:
    found = descriptor_pb2.FileDescriptorSet()
    plain_type().DESCRIPTOR.file.CopyToProto(found.file.add())
    return found.SerializeToString()


CASES: dict[str, tuple[str, str, bytes, Callable[[], Encoded]]] = {
    "states": ("foxglove.JointStates", "protobuf", bytes(foxglove.JointStates.get_schema().data), states),
    "states_json": ("foxglove.JointStates", "json", b"{}", states_json),
    "states_iso": ("foxglove.JointStates", "json", b"{}", states_iso),
    "one_by_one": ("foxglove.JointState", "protobuf", bytes(foxglove.JointState.get_schema().data), one_by_one),
    "one_by_one_json": ("foxglove.JointState", "json", b"{}", one_by_one_json),
    "numbers_without_presence": ("foxglove.JointState", "protobuf", plain_schema(), plain),
}


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("source") / "a.mcap"
    with copies.Ros2Bag(path, "tests") as bag:
        for time, joints in frames():
            bag.joints("/joint_states", time, list(joints), list(joints.values()))
    return path


@pytest.mark.parametrize("name", CASES)
def test_same_angles(name: str, source: Path, tmp_path: Path) -> None:
    type_name, encoding, schema, make = CASES[name]
    path = tmp_path / "a.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        kind = "jsonschema" if encoding == "json" else encoding
        channel = writer.register_channel("/joints", encoding, writer.register_schema(type_name, kind, schema))
        for index, (time, payload) in enumerate(make()):
            log = time + index % 7 * 10**6 if name.startswith("states") else time  # stamps are the better clock
            writer.add_message(channel, log, payload, log)
        writer.finish()
    expected, found = reba.read(source), reba.read(path)
    assert found.profile == expected.profile == "human_description"
    np.testing.assert_allclose(found.data["time"], expected.data["time"], atol=1e-9)
    np.testing.assert_array_equal(found.data[list(COLUMNS)], expected.data[list(COLUMNS)])
