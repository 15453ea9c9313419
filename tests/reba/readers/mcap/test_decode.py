"""Decoding messages: our numbers are those of rosbags, mcap-ros1-support, protobuf and json."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import foxglove.messages as fox
import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_typestore

from reba.readers.mcap import open_mcap, protobuf, ros
from reba.readers.mcap.decode import Batch, ColumnDecoder
from reba.readers.mcap.extract import TEXTS, extract_joints
from reba.readers.mcap.layout import FieldSpan, MessageLayout, Undecodable, Walked
from reba.readers.mcap.merge import MOST_SIGNALS
from reba.readers.mcap.records import Scan
from reba.readers.mcap.ros import BadSchema, Number, parse
from reba.readers.mcap.store import ChunkRef, Loaded
from reba.readers.recording.stream import Block, ReadLog, Recording
from tests.support import mcap_builder as make
from tests.support.mcap_builder import EPOCH_NS, JOINT_STATE, STEP_NS
from tests.support.says import says

ROS1 = get_typestore(Stores.ROS1_NOETIC)
QUICK = settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def recording(path: Path, definitions: Sequence[bytes], rows: Sequence[tuple[int, int, bytes]]) -> Recording:
    """Write rows of (channel, log time, payload) and open the file."""
    path.write_bytes(make.build(make.Plan(make.split(rows), tuple(definitions))))
    return open_mcap(path)


def only(opened: Recording, log: ReadLog | None = None) -> Block:
    """Return the only block of the only stream."""
    (stream,) = opened.streams
    (block,) = stream.blocks(log)
    return block


def timed(payloads: Sequence[bytes]) -> list[tuple[int, int, bytes]]:
    return [(1, EPOCH_NS + at * STEP_NS, payload) for at, payload in enumerate(payloads)]


def one_channel(
    path: Path, type_name: str, schema: tuple[str, bytes], encoding: str, payloads: Sequence[bytes]
) -> Recording:
    definitions = (make.schema(1, type_name, *schema), make.channel(1, 1, "/topic", encoding))
    return recording(path, definitions, timed(payloads))


finite = st.floats(allow_nan=False, width=64)
joint_states = st.lists(st.text(max_size=12), min_size=1, max_size=9, unique=True).flatmap(
    lambda names: st.tuples(
        st.just(names),
        st.text(max_size=9),
        st.lists(st.lists(finite, min_size=len(names), max_size=len(names)), min_size=2, max_size=6),
        st.lists(finite, max_size=3),
        st.lists(finite, max_size=2),
    )
)


def without_zero(text: str) -> str:
    """CDR strings end at a zero byte; surrogates are no UTF-8 text."""
    return text.replace("\0", "").encode("utf-8", "ignore").decode()


@QUICK
@given(joint_states, st.booleans())
def test_joint_states_of_any_layout_round_trip(tmp_path: Path, drawn: Any, little: bool) -> None:
    names, frame, rows, velocities, efforts = drawn
    names = [f"{index}{without_zero(name)}" for index, name in enumerate(names)]
    payloads = []
    for at, row in enumerate(rows):
        head = make.header(EPOCH_NS + at * STEP_NS, without_zero(frame) * (at % 2))
        message = make.TYPES.types[JOINT_STATE](head, names, np.array(row), np.array(velocities), np.array(efforts))
        payloads.append(bytes(make.TYPES.serialize_cdr(message, JOINT_STATE, little_endian=little)))
    schema = ("ros2msg", make.definition(JOINT_STATE))
    block = only(one_channel(tmp_path / "any.mcap", JOINT_STATE, schema, "cdr", payloads))
    assert block.names == tuple(names)
    np.testing.assert_array_equal(block.values, rows)


@pytest.mark.parametrize("little", [True, False])
def test_joint_states_equal_the_official_decoder(tmp_path: Path, little: bool) -> None:
    path = tmp_path / "joints.mcap"
    path.write_bytes(make.build(make.whole(make.payloads(little)[:500])))
    with path.open("rb") as file:
        decoded = [
            item.decoded_message
            for item in make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        ]
    block = only(open_mcap(path))
    np.testing.assert_array_equal(block.values, [list(message.position) for message in decoded])
    stamps = [message.header.stamp.sec + message.header.stamp.nanosec / 1e9 for message in decoded]
    np.testing.assert_allclose(block.time, np.array(stamps) - stamps[0], atol=1e-6)


def test_more_layouts_than_are_kept_are_decoded_one_by_one(tmp_path: Path) -> None:
    """Names that change with every message, all of one length."""
    values = np.arange(300.0).reshape(100, 3)
    payloads = [
        make.joint_state(EPOCH_NS + at * STEP_NS, (f"a{at:03}", f"b{at:03}", "same"), row)
        for at, row in enumerate(values)
    ]
    log = ReadLog()
    schema = ("ros2msg", make.definition(JOINT_STATE))
    block = only(one_channel(tmp_path / "many.mcap", JOINT_STATE, schema, "cdr", payloads), log)
    assert len(block.names) == 201
    assert log.skipped == 0
    np.testing.assert_array_equal(block.values[:, block.names.index("same")], values[:, 2])
    for at in range(100):
        assert block.values[at, block.names.index(f"a{at:03}")] == values[at, 0]


def test_names_that_never_end_are_cut_off(tmp_path: Path) -> None:
    payloads = [
        make.joint_state(EPOCH_NS + at * STEP_NS, [f"{at}_{index}" for index in range(50)], np.zeros(50))
        for at in range(45)
    ]
    log = ReadLog()
    schema = ("ros2msg", make.definition(JOINT_STATE))
    (stream,) = one_channel(tmp_path / "names.mcap", JOINT_STATE, schema, "cdr", payloads).streams
    assert all(len(block.names) == MOST_SIGNALS for block in stream.blocks(log))
    assert "more than" in log.warnings[0]


def test_messages_that_all_fail_are_counted(tmp_path: Path) -> None:
    payloads = [b"\0\3\0\0" + payload[4:] for payload in make.payloads()]
    schema = ("ros2msg", make.definition(JOINT_STATE))
    opened = one_channel(tmp_path / "all.mcap", JOINT_STATE, schema, "cdr", payloads)
    assert opened.streams == ()
    assert "not plain CDR" in opened.topics[0].why


def test_ros1_joint_states(tmp_path: Path) -> None:
    name, values = "sensor_msgs/msg/JointState", np.random.default_rng(1).normal(size=(50, 2))
    header = ROS1.types["std_msgs/msg/Header"]
    time_of = ROS1.types["builtin_interfaces/msg/Time"]
    payloads = []
    for at, row in enumerate(values):
        stamp = time_of(*divmod(EPOCH_NS + at * STEP_NS, 10**9))
        message = ROS1.types[name](header(at, stamp, "base"), ["a", "bcd"], row, np.zeros(0), np.zeros(1))
        payloads.append(bytes(ROS1.serialize_ros1(message, name)))
    schema = ("ros1msg", ROS1.generate_msgdef(name, ros_version=1)[0].encode())
    opened = one_channel(tmp_path / "ros1.mcap", "sensor_msgs/JointState", schema, "ros1", payloads)
    block = only(opened)
    assert opened.streams[0].format == "ROS 1 (ROS1) sensor_msgs/JointState"
    assert opened.streams[0].epoch == EPOCH_NS / 1e9
    np.testing.assert_array_equal(block.values, values)
    np.testing.assert_allclose(block.time, np.arange(50) * 0.01, atol=1e-9)


def test_xcdr2_aligns_numbers_of_eight_bytes_to_four() -> None:
    root = parse("uint32 a\nfloat64 b\nuint8 c\nfloat64[] d", "x/Y")
    body = b"\1\0\0\0" + np.float64(2.5).tobytes() + b"\7\0\0\0" + b"\1\0\0\0" + np.float64(3.5).tobytes()
    tree = ros.walk(root, b"\0\7\0\0" + body, (), ros1=False).tree
    assert tree["b"] == FieldSpan(8, "<f8")
    assert tree["d"] == FieldSpan(24, "<f8", 1, scalar=False)
    with pytest.raises(Undecodable) as caught:
        ros.walk(root, b"\0\3\0\0" + body, (), ros1=False)
    says(caught, "00030000", "not plain CDR")


@pytest.mark.parametrize("kind", [7, 9])
@pytest.mark.parametrize("collections", [True, False], ids=["standard", "without"])
def test_xcdr2_has_delimiter_headers(kind: int, collections: bool) -> None:
    """A joint state as DDS writes it by XTypes 1.3, and as those do that leave the headers of collections out."""

    def delimited(content: bytes, has: bool) -> bytes:
        return len(content).to_bytes(4, "little") + content if has else content

    names = b"\2\0\0\0" + b"\2\0\0\0a\0" + b"\0\0" + b"\2\0\0\0b\0" + b"\0\0"
    names, padding = (names[:-2], b"\0\0") if collections else (names, b"")
    numbers = b"\2\0\0\0" + np.array([1.5, 2.5]).tobytes()
    stamp = delimited(b"\5\0\0\0\6\0\0\0", kind == 9)
    body = delimited(stamp + delimited(names, collections) + padding + numbers, kind == 9)
    root = parse("Time stamp\nstring[] name\nfloat64[] position\n====\nMSG: x/Time\nint32 sec\nuint32 nanosec", "x/Y")
    message = bytes([0, kind, 0, 0]) + body
    tree = ros.walk(root, message, TEXTS, ros1=False).tree
    assert tree["name"] == ["a", "b"]
    span = tree["position"]
    np.testing.assert_array_equal(np.frombuffer(message, "<f8", span.count, span.start), [1.5, 2.5])
    with pytest.raises(Undecodable):
        ros.walk(root, message[:-9], TEXTS, ros1=False)


def test_an_empty_array_is_not_padded() -> None:
    root = parse("uint32 a\nfloat64[] b\nuint8 c", "x/Y")
    tree = ros.walk(root, b"\0\1\0\0\1\0\0\0\0\0\0\0\5", (), ros1=False).tree
    assert tree["c"] == FieldSpan(12, "<u1")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x/Y a\n===\nMSG: x/Y\nx/Y a", "contains itself"),
        ("Foo a", "not defined"),
        ("wstring a", "wstring"),
        ("float64", "not a field"),
        ("int32 a\n====\nIDL: x/Y\nstruct", "section"),
    ],
)
def test_schemas_that_cannot_be_used(text: str, words: str) -> None:
    with pytest.raises(BadSchema) as caught:
        parse(text, "x/Root")
    says(caught, words)


def test_schema_constants_defaults_and_comments() -> None:
    text = "# note\nint32 A=5\nstring B = 'a # b'\nfloat64 x 1.5 # start\nfloat64[<=3] y\nstring<=5[2] z\n\n"
    fields = dict(parse(text, "x/Y").fields)
    assert list(fields) == ["x", "y", "z"]
    assert fields["x"] == Number("f8")
    assert fields["y"].length is None
    assert fields["z"].length == 2


def fox_joints(stamp: int, names: Sequence[str], row: Sequence[float | None]) -> bytes:
    joints = [fox.JointState(name=name, position=value) for name, value in zip(names, row, strict=True)]
    moment = fox.Timestamp(*divmod(stamp, 10**9))
    return bytes(fox.JointStates(timestamp=moment, joints=joints).encode())


def fox_transforms(stamp: int, row: np.ndarray) -> bytes:
    transforms = [
        fox.FrameTransform(
            timestamp=fox.Timestamp(*divmod(stamp, 10**9)),
            parent_frame_id="/world",
            child_frame_id=f"/link{index}",
            translation=fox.Vector3(x=pose[0], y=pose[1], z=pose[2]),
            rotation=fox.Quaternion(x=pose[3], y=pose[4], z=pose[5], w=pose[6]),
        )
        for index, pose in enumerate(row.tolist())
    ]
    return bytes(fox.FrameTransforms(transforms=transforms).encode())


def test_protobuf_joint_states(tmp_path: Path) -> None:
    values = np.random.default_rng(2).normal(size=(400, 3))
    values[5] = 0.0
    stamps = [EPOCH_NS + at * 7_777_777 for at in range(400)]
    payloads = [fox_joints(stamp, "abc", row.tolist()) for stamp, row in zip(stamps, values, strict=True)]
    payloads[7] = fox_joints(stamps[7], "abc", [1.0, None, 2.0])
    schema = ("protobuf", fox.JointStates.get_schema().data)
    block = only(one_channel(tmp_path / "pb.mcap", "foxglove.JointStates", schema, "protobuf", payloads))
    values[7] = [1.0, np.nan, 2.0]
    np.testing.assert_array_equal(block.values, values)
    np.testing.assert_allclose(block.time, np.arange(400) * 7.777777e-3, atol=1e-9)


def test_protobuf_transforms(tmp_path: Path) -> None:
    values = np.random.default_rng(3).normal(size=(60, 4, 7))
    values[10, 2] = [0, 0, 1, 0, 0, 0, 1]
    payloads = [fox_transforms(EPOCH_NS + at * STEP_NS, row) for at, row in enumerate(values)]
    schema = ("protobuf", fox.FrameTransforms.get_schema().data)
    block = only(one_channel(tmp_path / "pb.mcap", "foxglove.FrameTransforms", schema, "protobuf", payloads))
    assert block.names == ("link0", "link1", "link2", "link3")
    assert block.parents == ("world",) * 4
    np.testing.assert_array_equal(block.values, values)


def test_damaged_protobuf_is_skipped_or_refused(tmp_path: Path) -> None:
    payloads = [fox_joints(EPOCH_NS + at * STEP_NS, "ab", [1.0, 2.0]) for at in range(20)]
    payloads[3] = payloads[3][:-3]
    payloads[4] = b"\xff" * 12
    data = fox.JointStates.get_schema().data
    log = ReadLog()
    opened = one_channel(tmp_path / "pb.mcap", "foxglove.JointStates", ("protobuf", data), "protobuf", payloads)
    assert len(only(opened, log).time) == 18
    assert log.skipped == 2
    with pytest.raises(BadSchema):
        protobuf.parse(data[:-5])


def ros_json(at: int, row: Sequence[Any]) -> dict[str, Any]:
    return {"header": {"stamp": {"sec": 10 + at, "nanosec": 0}}, "name": ["a", "b"], "position": row}


def fox_json(at: int, row: Sequence[Any]) -> dict[str, Any]:
    joints = [{"name": name, "position": value} for name, value in zip("ab", row, strict=True)]
    return {"timestamp": {"sec": 10 + at, "nsec": 0}, "joints": joints}


@pytest.mark.parametrize("shape", [ros_json, fox_json, lambda at, row: fox_json(at, row)["joints"]])
def test_json_joint_states(tmp_path: Path, shape: Callable[[int, Sequence[Any]], Any]) -> None:
    values = [[0.5, 1.0], [float("nan"), 2.0], [None, 3.0], [4, 1e400]]
    payloads = [json.dumps(shape(at, row)).encode() for at, row in enumerate(values)]
    payloads += [b"{", b"[" * 100_000, b'"text"', b'{"name": ["a"], "position": []}', b'{"name": 3, "position": 4}']
    log = ReadLog()
    opened = one_channel(tmp_path / "j.mcap", "my.Joints", ("jsonschema", b"{}"), "json", payloads)
    block = only(opened, log)
    np.testing.assert_array_equal(block.values, [[0.5, 1], [np.nan, 2], [np.nan, 3], [4, np.inf]])
    assert (log.messages, log.skipped) == (9, 5)
    assert "JSON" in str(log.first_skipped)


def test_rows_of_a_posture_table(tmp_path: Path) -> None:
    rows = [
        {
            "time": 1.5 + at,
            "trunk_flexion": 10.0 * at,
            "neck_twist": None,
            "load": 3,
            "shock": True,
            "support": "sitting",
        }
        for at in range(3)
    ]
    opened = one_channel(
        tmp_path / "p.mcap", "reba.Posture", ("jsonschema", b"{}"), "json", [json.dumps(row).encode() for row in rows]
    )
    (stream,) = opened.streams
    block = only(opened)
    assert stream.kind == "angles"
    assert stream.epoch == EPOCH_NS / 1e9 - 1.5
    assert block.names == ("trunk_flexion", "neck_twist", "load", "shock", "support")
    np.testing.assert_array_equal(block.time, [1.5, 2.5, 3.5])
    np.testing.assert_array_equal(block.values[:, :4], [[10.0 * at, np.nan, 3, 1] for at in range(3)])
    assert stream.table is not None
    assert stream.table().to_dict("records")[2]["support"] == "sitting"


def test_a_damaged_layout_does_not_hide_good_messages() -> None:
    """Messages of one length that do not fit the schema are counted one by one, the others are decoded."""
    root = parse(make.definition(JOINT_STATE).decode(), JOINT_STATE)
    payloads = list(make.payloads()[:10])
    payloads[0] = payloads[0][:24] + b"\xff\xff\xff\x7f" + payloads[0][28:]
    data = b"".join(payloads)
    lengths = np.array([len(payload) for payload in payloads])
    starts = np.concatenate([[0], np.cumsum(lengths)[:-1]])
    none = Scan(starts, lengths, np.zeros(10, np.uint16), starts, (), 0)
    batch = Batch(Loaded(ChunkRef(0, len(data), None, 0), data, none), starts, lengths, starts, np.arange(10))
    decoder = ColumnDecoder(lambda message: ros.walk(root, message, TEXTS, ros1=False), extract_joints, None)
    log = ReadLog()
    (piece,) = decoder.decode(batch, log)
    assert log.skipped == 1
    np.testing.assert_array_equal(piece.values, make.positions()[1:10])


def test_what_differs_in_each_message_is_in_no_compared_block() -> None:
    """A block in which something differs in each message is compared three times."""
    message = bytes(range(64))
    layout = MessageLayout(Walked(fixed=[(0, 4), (12, 40), (43, 60)]), message)
    assert [(start, len(template)) for start, template, _ in layout._blocks] == [(0, 4), (12, 48)]
