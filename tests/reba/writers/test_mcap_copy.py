"""A scored MCAP recording is a copy of the recording, whatever it holds and however it was written."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType

import reba
from reba.provenance import generator
from tests.reba.readers.test_whole_recording import JOINTS, angles
from tests.support import mcap_builder as make
from tests.support.hostile_mcap import CASES, write
from tests.support.mcap_builder import EPOCH_NS, JOINT_STATE, STEP_NS
from tests.support.mcap_check import Content, checked
from tests.support.paths import DATASETS
from tests.support.says import says
from tests.support.scored_recordings import ORIGIN, TOPIC, recorded, scored


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


def test_a_folder_of_compressed_files_of_which_one_is_damaged(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    for number in range(3):
        data = recorded(tmp_path / "part.mcap", 100, first=100 * number).read_bytes()
        if number == 1:
            at = len(data) // 2
            data = data[:at] + bytes(byte ^ 1 for byte in data[at : at + 4]) + data[at + 4 :]
        (folder / f"bag_{number}.mcap.zstd").write_bytes(zstandard.compress(data))
    scores, copy = scored(folder, tmp_path / "out.mcap")
    assert any("left out" in text for text in scores.postures.quality.warnings)
    assert 200 < len(scores.data) < 300
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
    first, once = scored(recorded(tmp_path / "in.mcap", slow=3), tmp_path / "once.mcap")
    heavy = reba.score(reba.read(tmp_path / "once.mcap"), activity="none", load=12.0)
    reba.write_scores(heavy, tmp_path / "twice.mcap")
    twice = checked(tmp_path / "twice.mcap")
    assert twice.payloads(TOPIC) == once.payloads(TOPIC)
    assert len(twice.messages[f"{TOPIC}_2"]) == len(first.data)
    times = [[(m.log_time, m.publish_time) for _, m in twice.messages[topic]] for topic in (TOPIC, f"{TOPIC}_2")]
    assert times[0] == times[1]
    assert twice.library == once.library


@pytest.mark.parametrize("as_ros", [False, True])
def test_what_is_not_mcap_gives_scores_alone(tmp_path: Path, as_ros: bool) -> None:
    scores, copy = scored(DATASETS / "simulated_assembly.csv", tmp_path / "out.mcap", as_ros=as_ros)
    assert set(copy.messages) == {TOPIC}
    assert len(copy.messages[TOPIC]) == len(scores.data)
    assert copy.profile == ("ros2" if as_ros else "")
    assert copy.library == generator()


def scores_of(source: Path) -> reba.Scores:
    """Return scores that say that they come from a recording."""
    frame = pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]})
    scores = reba.score(frame, activity="none")
    postures = dataclasses.replace(scores.postures, source=str(source), topic="/any", epoch=EPOCH_NS / 1e9)
    return dataclasses.replace(scores, postures=postures)


def test_scores_of_a_table_copy_nothing_that_happens_to_be_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    recorded(tmp_path / "in.mcap")
    monkeypatch.chdir(tmp_path)
    frame = pd.DataFrame({"time": [0.0, 1.0], "trunk_flexion": [10.0, 70.0]})
    for postures in (frame, reba.PostureTable(frame)):
        reba.write_scores(reba.score(postures, activity="none"), tmp_path / "out" / "scores.mcap")
        assert set(checked(tmp_path / "out" / "scores.mcap").messages) == {TOPIC}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if "bomb" in name else []) for name in CASES]
)
def test_of_a_hostile_recording_the_copy_is_sound_or_there_is_none(tmp_path: Path, name: str) -> None:
    source, out = write(name, tmp_path), tmp_path / "out"
    problem = ""
    try:
        reba.write_scores(scores_of(source), out / "scores.mcap")
    except reba.RebaError as error:
        problem = str(error)
    if problem:
        assert "\n" not in problem
        assert not list(out.iterdir())
    else:
        assert len(checked(out / "scores.mcap").messages[TOPIC]) == 2


def test_ids_from_0_on(tmp_path: Path) -> None:
    rows = [
        (0, EPOCH_NS + at * STEP_NS, make.joint_state(EPOCH_NS + at * STEP_NS, JOINTS, np.array(angles(at))))
        for at in range(100)
    ]
    definitions = (
        make.schema(1, JOINT_STATE, "ros2msg", make.definition(JOINT_STATE)),
        make.channel(0, 1, "/joint_states", "cdr"),
    )
    source = tmp_path / "in.mcap"
    source.write_bytes(make.build(make.Plan(make.split(rows), definitions)))
    _, copy = scored(source, tmp_path / "out.mcap")
    assert set(copy.channels) == {0, 1}
    assert copy.logged(TOPIC) == copy.logged("/joint_states")


def test_a_file_with_all_topics_that_it_can_hold_is_told(tmp_path: Path) -> None:
    rows = [
        (1, EPOCH_NS + at * STEP_NS, make.joint_state(EPOCH_NS + at * STEP_NS, JOINTS, np.array(angles(at))))
        for at in range(100)
    ]
    definitions = [make.schema(1, JOINT_STATE, "ros2msg", make.definition(JOINT_STATE))]
    definitions += [make.channel(number, 1, f"/{number}", "cdr") for number in range(1, 65_536)]
    source = tmp_path / "in.mcap"
    source.write_bytes(make.build(make.Plan(make.split(rows), tuple(definitions))))
    with pytest.raises(reba.RebaError) as error:
        reba.write_scores(scores_of(source), tmp_path / "out.mcap")
    says(error, "65535", ".parquet")
    assert not (tmp_path / "out.mcap").exists()
