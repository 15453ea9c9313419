"""Scores as ROS messages, read by other tools with nothing but the definitions in the file."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

import reba
from tests.reba.readers.test_whole_recording import JOINTS, angles
from tests.reba.test_score_outputs import call
from tests.support.mcap_builder import EPOCH_NS, STEP_NS
from tests.support.paths import DATASETS
from tests.support.says import says
from tests.support.scored_recordings import TOPIC, recorded, scored


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
    assert {message.support for message in decoded} == {0.0}


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
    pd.testing.assert_frame_equal(reba.read_scores(tmp_path / "out.mcap").data, scores.data)


def test_ros_messages_need_an_mcap(tmp_path: Path) -> None:
    scores = reba.score(reba.read(DATASETS / "simulated_assembly.csv"))
    with pytest.raises(reba.RebaError) as error:
        reba.write_scores(scores, tmp_path / "out.csv", as_ros=True)
    says(error, tmp_path / "out.csv", ".mcap")
    assert list(tmp_path.iterdir()) == []


def test_the_command_writes_them(tmp_path: Path) -> None:
    source, out = recorded(tmp_path / "in.mcap", 60), tmp_path / "out.mcap"
    code, _, messages = call("score", source, "-o", out, "--as-ros")
    assert (code, messages) == (0, f"written: {out}\n")
    assert Counter(topic for topic, _, _ in ros_messages(out))[TOPIC] == 60


@pytest.mark.parametrize("words", [(), ("-o", "out.csv"), ("-o", "out/"), ("-o", "out")])
def test_the_command_needs_an_mcap_for_them(tmp_path: Path, words: tuple[str, ...]) -> None:
    source = recorded(tmp_path / "in.mcap", 60)
    code, _, messages = call("score", source, "--as-ros", *(word.replace("out", f"{tmp_path}/out") for word in words))
    assert code == 2
    says(messages, "--as-ros", ".mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["in.mcap"]


def test_topics_that_are_not_ros_are_told(tmp_path: Path) -> None:
    """A recording that was scored in JSON before: its former scores stay in the copy."""
    source, first, second = recorded(tmp_path / "in.mcap", 60), tmp_path / "json.mcap", tmp_path / "ros.mcap"
    call("score", source, "-o", first)
    with pytest.warns(UserWarning, match=r"json\.mcap .*\(/ergonomics/reba\).* rosbags does not open"):
        reba.write_scores(reba.score(reba.read(first)), second, as_ros=True)
    assert second.exists()
