"""A scored MCAP recording: a copy of the recording in which every frame has its scores at the time of its message."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

import reba
from reba.provenance import generator
from tests.reba.readers.test_whole_recording import JOINTS, angles
from tests.support import mcap_builder as make
from tests.support.json_viewer import problems_of_texts, unnamed
from tests.support.mcap_builder import EPOCH_NS, JOINT_STATE, STEP_NS
from tests.support.mcap_check import Content, checked
from tests.support.paths import DATASETS
from tests.support.says import says

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


def same(copy: Content, source: Path, *topics: str) -> None:
    """Compare every message of some topics with the source: bytes, times and sequence."""

    original: dict[str, list[tuple[int, int, int, bytes]]] = {}
    with source.open("rb") as file:
        for _, channel, m in make_reader(file).iter_messages(log_time_order=False):
            row = (m.sequence, m.log_time, m.publish_time, m.data)
            original.setdefault(channel.topic, []).append(row)
    for topic in topics:
        mine = [(m.sequence, m.log_time, m.publish_time, m.data) for _, m in copy.messages[topic]]
        assert mine == original[topic]
        assert mine


@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_copy_has_all_that_the_recording_has(tmp_path: Path, compression: CompressionType) -> None:
    source = recorded(tmp_path / "in.mcap", compression=compression)
    scores, copy = scored(source, tmp_path / "out.mcap")
    same(copy, source, "/joint_states", "/camera")
    assert copy.profile == "ros2"
    assert copy.library == f"{generator()} (libmcap 1.4.0)"
    assert [one.name for one in copy.metadata] == ["rosbag2", "reba"]
    assert copy.metadata[0].metadata == {"serialized_metadata": "part of 0"}
    assert [(one.name, one.data) for one in copy.attachments] == [("calibration.yaml", b"camera: 1\n" * 100)]
    assert {c.topic: c.metadata for c in copy.channels.values()}["/camera"] == ORIGIN
    assert len(copy.messages[TOPIC]) == len(scores.data) == 300
    assert checked(source).chunks[1] in copy.chunks, "chunks are copied as they are"


@pytest.mark.parametrize("slow", [1, 3])
def test_scores_stand_at_the_log_time_of_their_message(tmp_path: Path, slow: int) -> None:
    _, copy = scored(recorded(tmp_path / "in.mcap", slow=slow), tmp_path / "out.mcap")
    for (_, score), (_, message) in zip(copy.messages[TOPIC], copy.messages["/joint_states"], strict=True):
        assert score.log_time == message.log_time
        assert score.publish_time == message.publish_time
    assert json.loads(copy.payloads(TOPIC)[-1])["time"] == pytest.approx(2.99)


def test_a_message_without_publish_time_gives_none(tmp_path: Path) -> None:
    source = tmp_path / "in.mcap"
    with source.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        schema = writer.register_schema(JOINT_STATE, "ros2msg", make.definition(JOINT_STATE))
        channel = writer.register_channel("/joint_states", "cdr", schema)
        for at in range(100):
            stamp = EPOCH_NS + at * STEP_NS
            writer.add_message(channel, stamp + 5, make.joint_state(stamp, JOINTS, np.array(angles(at))), 0)
        writer.finish()
    _, copy = scored(source, tmp_path / "out.mcap")
    assert [m.publish_time for _, m in copy.messages[TOPIC]] == copy.logged(TOPIC)


def test_frames_of_several_messages_stand_at_the_last_of_them(tmp_path: Path) -> None:
    rows = []
    for at in range(200):
        for half, names in enumerate((JOINTS[:4], JOINTS[4:])):
            part = angles(at)[:4] if half == 0 else angles(at)[4:]
            payload = make.joint_state(EPOCH_NS + at * STEP_NS, names, np.array(part))
            rows.append((1 + half, EPOCH_NS + at * STEP_NS + half * 3_000_000, payload))
    definitions = [make.schema(1, JOINT_STATE, "ros2msg", make.definition(JOINT_STATE))]
    definitions += [make.channel(number, 1, "/joint_states", "cdr") for number in (1, 2)]
    source = tmp_path / "in.mcap"
    source.write_bytes(make.build(make.Plan(make.split(rows), tuple(definitions))))
    _, copy = scored(source, tmp_path / "out.mcap")
    assert copy.logged(TOPIC) == [EPOCH_NS + at * STEP_NS + 3_000_000 for at in range(200)]
    assert len({number for number, _ in copy.messages["/joint_states"]}) == 2, "two publishers stay two channels"


def test_a_clock_that_restarts(tmp_path: Path) -> None:
    rows = [
        (1, EPOCH_NS + at * STEP_NS, make.joint_state(EPOCH_NS + at % 200 * STEP_NS, JOINTS, np.array(angles(at))))
        for at in range(400)
    ]
    source = tmp_path / "in.mcap"
    source.write_bytes(
        make.build(
            make.Plan(
                make.split(rows),
                (
                    make.schema(1, JOINT_STATE, "ros2msg", make.definition(JOINT_STATE)),
                    make.channel(1, 1, "/joint_states", "cdr"),
                ),
            )
        )
    )
    _, copy = scored(source, tmp_path / "out.mcap")
    assert copy.logged(TOPIC) == [EPOCH_NS + at * STEP_NS for at in range(400)]


@pytest.mark.parametrize("skip_ids", [0, 3])
def test_a_folder_becomes_one_file(tmp_path: Path, skip_ids: int) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    recorded(folder / "bag_0.mcap", 150)
    recorded(folder / "bag_1.mcap", 150, first=150, skip_ids=skip_ids)
    scores, copy = scored(folder, tmp_path / "out.mcap")
    assert len(copy.messages[TOPIC]) == len(scores.data) == 300
    assert copy.logged(TOPIC) == copy.logged("/joint_states")
    assert copy.payloads("/joint_states") == [
        data for part in sorted(folder.iterdir()) for data in checked(part).payloads("/joint_states")
    ]
    topics = Counter(channel.topic for channel in copy.channels.values())
    assert topics == Counter(["/joint_states", "/camera", TOPIC, *(f"/unused_{n}" for n in range(skip_ids))])
    assert [one.name for one in copy.metadata] == ["rosbag2", "rosbag2", "reba"]
    assert len(copy.attachments) == 2
    assert copy.profile == "ros2"


def test_a_compressed_recording(tmp_path: Path) -> None:
    plain = recorded(tmp_path / "in.mcap")
    packed = tmp_path / "packed.mcap.zstd"
    packed.write_bytes(zstandard.compress(plain.read_bytes()))
    _, copy = scored(packed, tmp_path / "out.mcap")
    same(copy, plain, "/joint_states", "/camera")
    assert copy.logged(TOPIC) == copy.logged("/joint_states")


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "truncated": lambda data: data[: len(data) * 2 // 3],
    "no end": lambda data: data[: data.rindex(b"\x0f\x04\0\0\0\0\0\0\0")],
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_recording_that_breaks_off_is_copied_up_to_there(tmp_path: Path, damage: str) -> None:
    source = recorded(tmp_path / "in.mcap")
    source.write_bytes(DAMAGES[damage](source.read_bytes()))
    scores, copy = scored(source, tmp_path / "out.mcap")
    assert copy.logged(TOPIC) == copy.logged("/joint_states")
    assert len(scores.data) == len(copy.messages["/joint_states"]) > 100


def test_messages_outside_chunks(tmp_path: Path) -> None:
    source = recorded(tmp_path / "in.mcap", use_chunking=False)
    _, copy = scored(source, tmp_path / "out.mcap")
    same(copy, source, "/joint_states", "/camera")
    assert copy.logged(TOPIC) == copy.logged("/joint_states")


def test_what_a_reader_would_stumble_over_is_not_copied(tmp_path: Path) -> None:
    rows = [
        (1, EPOCH_NS + at * STEP_NS, make.joint_state(EPOCH_NS + at * STEP_NS, JOINTS, np.array(angles(at))))
        for at in range(300)
    ]
    rows += [(9, EPOCH_NS + 300 * STEP_NS, b"of no channel"), (2, EPOCH_NS + 301 * STEP_NS, b"of no schema")]
    definitions = (
        make.schema(1, JOINT_STATE, "ros2msg", make.definition(JOINT_STATE)),
        make.channel(1, 1, "/joint_states", "cdr"),
        make.channel(2, 77, "/other", "cdr"),
    )
    source = tmp_path / "in.mcap"
    source.write_bytes(make.build(make.Plan(make.split(rows), definitions, index=False)))
    _, copy = scored(source, tmp_path / "out.mcap")
    assert set(copy.messages) == {"/joint_states", "/other", TOPIC}
    assert copy.payloads("/other") == [b"of no schema"]


def test_private_records_are_copied(tmp_path: Path) -> None:
    rows = [
        (1, EPOCH_NS + at * STEP_NS, make.joint_state(EPOCH_NS + at * STEP_NS, JOINTS, np.array(angles(at))))
        for at in range(100)
    ]
    definitions = (
        make.schema(1, JOINT_STATE, "ros2msg", make.definition(JOINT_STATE)),
        make.channel(1, 1, "/joint_states", "cdr"),
    )
    source = tmp_path / "in.mcap"
    between = make.record(0x91, b"of an application")
    source.write_bytes(make.build(make.Plan(make.split(rows), definitions, between=between)))
    _, copy = scored(source, tmp_path / "out.mcap")
    assert copy.private == [b"of an application"]


def test_scoring_a_scored_recording_keeps_its_scores(tmp_path: Path) -> None:
    first, once = scored(recorded(tmp_path / "in.mcap"), tmp_path / "once.mcap")
    heavy = reba.score(reba.read(tmp_path / "once.mcap"), activity="none", load=12.0)
    reba.write_scores(heavy, tmp_path / "twice.mcap")
    twice = checked(tmp_path / "twice.mcap")
    assert twice.payloads(TOPIC) == once.payloads(TOPIC)
    assert len(twice.messages[f"{TOPIC}_2"]) == len(first.data)
    assert twice.library == once.library


@pytest.mark.parametrize("as_ros", [False, True])
def test_what_is_not_mcap_gives_scores_alone(tmp_path: Path, as_ros: bool) -> None:
    scores, copy = scored(DATASETS / "simulated_assembly.csv", tmp_path / "out.mcap", as_ros=as_ros)
    assert set(copy.messages) == {TOPIC}
    assert len(copy.messages[TOPIC]) == len(scores.data)
    assert copy.profile == ("ros2" if as_ros else "")
    assert copy.library == generator()


def test_every_property_has_one_plain_type_and_missing_ones_are_left_out(tmp_path: Path) -> None:
    source = recorded(tmp_path / "in.mcap", names=(*JOINTS[:-1], "unknown"))
    scores, copy = scored(source, tmp_path / "out.mcap")
    assert scores.data["reba"].isna().any()
    (schema,) = [schema for schema in copy.schemas.values() if schema.encoding == "jsonschema"]
    texts = copy.payloads(TOPIC)
    assert problems_of_texts(schema.data, texts) == []
    for text, row in zip(texts, scores.data.itertuples(index=False), strict=True):
        message = json.loads(text)
        known = {name: value for name, value in row._asdict().items() if not pd.isna(value)}
        assert message == pytest.approx(known, abs=1e-8)
        assert unnamed(json.loads(schema.data), message) == set()


def test_posture_tables_have_plain_types_too(tmp_path: Path) -> None:
    frame = pd.DataFrame(
        {
            "time": [0.0, 0.1, 0.2],
            "trunk_flexion": [10.0, np.nan, 30.0],
            "load": [1.0, np.nan, 2.0],
            "shock": [True, None, False],
            "coupling_left": ["good", None, 'a, "b":null,c'],
            "coupling_right": ["good", 2, "fair"],
        }
    )
    table = reba.PostureTable(frame)
    reba.write_postures(table, tmp_path / "out.mcap")
    copy = checked(tmp_path / "out.mcap")
    ((schema,), (texts,)) = copy.schemas.values(), [copy.payloads("/ergonomics/posture")]
    assert problems_of_texts(schema.data, texts) == []
    first, second, third = map(json.loads, texts)
    assert first == {
        "time": 0.0, "trunk_flexion": 10.0, "load": 1.0, "shock": True, "coupling_left": "good",
        "coupling_right": "good",
    }  # fmt: skip
    assert second == {"time": 0.1, "coupling_right": "2"}
    assert third["coupling_left"] == 'a, "b":null,c'


def ros_messages(path: Path) -> list[tuple[str, int, Any]]:
    """Return topic, log time and message of every message that rosbags decodes with the definitions in the file."""
    from rosbags.highlevel import AnyReader

    with AnyReader([path]) as reader:
        return [
            (connection.topic, stamp, reader.deserialize(data, connection.msgtype))
            for connection, stamp, data in reader.messages()
        ]


@pytest.mark.parametrize("profile", ["ros2", ""])
def test_scores_as_ros_messages_open_in_rosbags(tmp_path: Path, profile: str) -> None:
    source = recorded(tmp_path / "in.mcap", profile=profile, slow=2)
    scores, copy = scored(source, tmp_path / "out.mcap", as_ros=True)
    assert not [schema for schema in copy.schemas.values() if schema.encoding == "jsonschema"]
    read = ros_messages(tmp_path / "out.mcap")
    assert Counter(topic for topic, _, _ in read) == {"/joint_states": 300, "/camera": 30, TOPIC: 300}
    frames = [(stamp, message) for topic, stamp, message in read if topic == TOPIC]
    logged = [stamp for topic, stamp, _ in read if topic == "/joint_states"]
    assert [stamp for stamp, _ in frames] == logged
    for at, (_, message) in enumerate(frames):
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        assert abs(stamp - (EPOCH_NS + at * STEP_NS)) <= 1000
        for name, value in scores.data.iloc[at].items():
            got = getattr(message, name)
            assert np.isnan(got) if pd.isna(value) else got == value, name


def test_ros_messages_are_read_by_the_official_decoder(tmp_path: Path) -> None:
    from mcap_ros2.decoder import DecoderFactory

    scores, _ = scored(DATASETS / "simulated_assembly.csv", tmp_path / "out.mcap", as_ros=True)
    with (tmp_path / "out.mcap").open("rb") as stream:
        decoded = [
            m.decoded_message for m in make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        ]
    assert [message.reba_low for message in decoded] == scores.data["reba_low"].tolist()


def test_a_ros_1_recording_stays_one(tmp_path: Path) -> None:
    from mcap_ros1.decoder import DecoderFactory
    from rosbags.typesys import Stores, get_typestore

    types = get_typestore(Stores.ROS1_NOETIC)
    kind = "sensor_msgs/msg/JointState"
    head = types.types["std_msgs/msg/Header"]
    source = tmp_path / "in.mcap"
    with source.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros1", "rosbag 1")
        schema = writer.register_schema("sensor_msgs/JointState", "ros1msg", types.generate_msgdef(kind)[0].encode())
        channel = writer.register_channel("/joint_states", "ros1", schema)
        for at in range(100):
            moment = types.types["builtin_interfaces/msg/Time"](*divmod(EPOCH_NS + at * STEP_NS, 10**9))
            none = np.zeros(0)
            message = types.types[kind](head(at, moment, ""), list(JOINTS), np.array(angles(at)), none, none)
            writer.add_message(channel, EPOCH_NS + at, bytes(types.serialize_ros1(message, kind)), 0)
        writer.finish()
    for as_ros in (False, True):
        scores, copy = scored(source, tmp_path / "out.mcap", as_ros=as_ros)
        assert copy.profile == "ros1"
        assert len(copy.messages["/joint_states"]) == 100
    with (tmp_path / "out.mcap").open("rb") as stream:
        rows = list(make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages(topics=[TOPIC]))
    assert [row.decoded_message.reba_low for row in rows] == scores.data["reba_low"].tolist()
    assert [row.message.log_time for row in rows] == copy.logged("/joint_states")
    assert rows[3].decoded_message.header.stamp.nsecs == pytest.approx(3 * STEP_NS, abs=1000)


def test_ros_messages_need_an_mcap(tmp_path: Path) -> None:
    scores = reba.score(reba.read(DATASETS / "simulated_assembly.csv"))
    with pytest.raises(reba.RebaError) as error:
        reba.write_scores(scores, tmp_path / "out.csv", as_ros=True)
    says(error, tmp_path / "out.csv", ".mcap")
    assert list(tmp_path.iterdir()) == []
