"""Scores in MCAP: at the log time of the message that a frame comes from, in JSON that viewers plot."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mcap.writer import Writer

import reba
from tests.reba.readers.test_whole_recording import JOINTS, angles
from tests.support import mcap_builder as make
from tests.support.json_viewer import problems_of_texts, unnamed
from tests.support.mcap_builder import EPOCH_NS, JOINT_STATE, STEP_NS
from tests.support.mcap_check import checked
from tests.support.scored_recordings import TOPIC, recorded, scored


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


def test_of_two_people_at_one_time_the_message_of_the_one_who_is_scored(tmp_path: Path) -> None:
    rows = []
    for at in range(100):
        for person in ("bob", "alice", "carol"):
            names = tuple(f"{person}_{name}" for name in JOINTS)
            payload = make.joint_state(EPOCH_NS + at * STEP_NS, names, np.array(angles(at)))
            rows.append((1, EPOCH_NS + at * STEP_NS + len(rows) % 3 * 1_000_000, payload))
    definitions = (
        make.schema(1, JOINT_STATE, "ros2msg", make.definition(JOINT_STATE)),
        make.channel(1, 1, "/joint_states", "cdr"),
    )
    source = tmp_path / "in.mcap"
    source.write_bytes(make.build(make.Plan(make.split(rows), definitions)))
    for late, person in enumerate(("bob", "alice", "carol")):
        scores = reba.score(reba.read(source, topic=person), activity="none")
        reba.write_scores(scores, tmp_path / "out.mcap")
        expected = [EPOCH_NS + at * STEP_NS + late * 1_000_000 for at in range(100)]
        assert checked(tmp_path / "out.mcap").logged(TOPIC) == expected


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


def test_every_property_has_one_plain_type_and_missing_ones_are_left_out(tmp_path: Path) -> None:
    source = recorded(tmp_path / "in.mcap", names=(*JOINTS[:-1], "unknown"))
    scores, copy = scored(source, tmp_path / "out.mcap")
    assert scores.data["reba"].isna().any()
    (schema,) = [schema for schema in copy.schemas.values() if schema.encoding == "jsonschema"]
    texts = copy.payloads(TOPIC)
    assert problems_of_texts(schema.data, texts) == []
    reba.write_scores(scores, tmp_path / "out.parquet")
    table = pd.read_parquet(tmp_path / "out.parquet")
    assert {"reba", "trunk_flexion", "support"} < set(table.columns)
    for text, row in zip(texts, table.itertuples(index=False), strict=True):
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
