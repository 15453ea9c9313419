"""All of a recording decides, wherever in it something stands and however it is packed; accounts add up."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

import reba
from reba.errors import ProfileError, ReadError
from reba.posture.columns import INDEX
from tests.support import mcap_builder as make
from tests.support.mcap_builder import EPOCH_NS, JOINT_STATE, STEP_NS
from tests.support.says import says

JOINTS = (
    "left_elbow_Z", "right_elbow_Z", "middle_lumbar_Z", "left_shoulder_Z", "right_shoulder_Z", "left_knee_Z",
    "right_knee_Z", "middle_cervical_Z",
)  # fmt: skip
"""Of the profile human_description."""
Row = tuple[int, int, bytes]


def angles(at: int) -> list[float]:
    """Return angles [rad] that differ in every message."""
    return [0.5 + at * 1e-4, 0.6, -0.2 - at * 1e-5, 0.4, 0.3, 0.3, 0.3, -0.1 - at * 1e-5]


def state(at: int, stamp: int, names: Sequence[str] = JOINTS, log: int | None = None, channel: int = 1) -> Row:
    """Return message `at` as channel, log time and payload; times count in steps of 10 ms from the epoch."""
    payload = make.joint_state(EPOCH_NS + stamp * STEP_NS, names, angles(at)[: len(names)])
    return channel, EPOCH_NS + (at if log is None else log) * STEP_NS, payload


def write(path: Path, rows: Sequence[Row], channels: int = 1, per_chunk: int = 323) -> Path:
    definitions = [make.schema(1, JOINT_STATE, "ros2msg", make.definition(JOINT_STATE))]
    definitions += [make.channel(number, 1, "/joint_states", "cdr") for number in range(1, channels + 1)]
    chunks = tuple(tuple(rows[at : at + per_chunk]) for at in range(0, len(rows), per_chunk))
    path.write_bytes(make.build(make.Plan(chunks, tuple(definitions))))
    return path


def elbow(table: reba.PostureTable) -> np.ndarray:
    """Return the numbers of the messages that the frames come from."""
    values = table.data["lower_arm_flexion_left"].to_numpy()
    return np.rint((np.radians(values) - 0.5) * 1e4).astype(int)


def adds_up(table: reba.PostureTable) -> bool:
    """Return whether what was used and what was not add up to what was read, and frames are what was used."""
    (account, *_) = table.quality.accounts
    whole = account["read"] == account["used"] + sum(account["not_used"].values())
    return whole and account["used"] == len(table.data)


@pytest.mark.parametrize("late", [10, 1500, 2990])
def test_who_comes_late_counts_as_who_comes_early(tmp_path: Path, late: int) -> None:
    rows = [state(at, at, ("pan", "lift")) for at in range(late)] + [state(at, at) for at in range(late, 3000)]
    table = reba.read(write(tmp_path / "late.mcap", rows))
    np.testing.assert_array_equal(elbow(table), np.arange(late, 3000))
    assert table.data["time"][0] == 0.0
    assert table.epoch == pytest.approx((EPOCH_NS + late * STEP_NS) / 1e9)
    assert adds_up(table)
    assert table.quality.accounts[0]["not_used"] == {"other_signals": late}
    assert any("no signal of the profile" in text for text in table.quality.warnings) == (late > 30)


def test_a_joint_that_comes_late_is_measured_from_then_on(tmp_path: Path) -> None:
    rows = [state(at, at, JOINTS[:-1] if at < 2800 else JOINTS) for at in range(3000)]
    table = reba.read(write(tmp_path / "joint.mcap", rows))
    neck = np.isfinite(table.data["neck_flexion"])
    np.testing.assert_array_equal(neck, np.arange(3000) >= 2800)


@pytest.mark.parametrize("log_restarts", [False, True])
@pytest.mark.parametrize("first", [700, 1500])
def test_a_clock_that_restarts_goes_on(tmp_path: Path, log_restarts: bool, first: int) -> None:
    rows = []
    for at in range(2000):
        stamp = at if at < first else at - first
        rows.append(state(at, stamp, log=stamp if log_restarts else at))
    table = reba.read(write(tmp_path / "restart.mcap", rows))
    np.testing.assert_array_equal(elbow(table), np.arange(2000))
    np.testing.assert_allclose(table.data["time"], np.arange(2000) / 100, atol=1e-6)
    assert table.quality.seams == pytest.approx((first / 100,))
    assert any(f"restarts at {first / 100:.2f} s" in text for text in table.quality.warnings)
    assert adds_up(table)


def test_no_held_posture_reaches_across_a_restart(tmp_path: Path) -> None:
    still = [(1, EPOCH_NS + at * STEP_NS, state(0, at % 5000)[2]) for at in range(10_000)]
    table = reba.read(write(tmp_path / "still.mcap", still))
    assert table.quality.seams == pytest.approx((50.0,))
    assert not reba.score(table).factors.static.any()
    unbroken = [(1, time, state(0, at)[2]) for at, (_, time, _) in enumerate(still)]
    assert reba.score(reba.read(write(tmp_path / "unbroken.mcap", unbroken))).factors.static.all()


@pytest.mark.parametrize("damaged", [0, 1, 1400, 2999])
@pytest.mark.parametrize("stamp", [0, 10**8])
def test_one_damaged_stamp_decides_nothing(tmp_path: Path, damaged: int, stamp: int) -> None:
    """The stamps lie a second behind the log time; one message has another."""
    rows = [state(at, at - 100 if at != damaged else stamp - EPOCH_NS // STEP_NS) for at in range(3000)]
    table = reba.read(write(tmp_path / "damaged.mcap", rows))
    assert table.quality.time_source == "header.stamp"
    np.testing.assert_array_equal(elbow(table), np.arange(3000))
    np.testing.assert_allclose(table.data["time"], np.arange(3000) / 100, atol=1e-6)
    assert table.epoch == pytest.approx(EPOCH_NS / 1e9 - 1)


def test_a_simulator_may_start_at_zero(tmp_path: Path) -> None:
    rows = [(1, EPOCH_NS + 3 * at * STEP_NS, make.joint_state(at * STEP_NS, JOINTS, angles(at))) for at in range(500)]
    table = reba.read(write(tmp_path / "zero.mcap", rows))
    assert table.quality.time_source == "header.stamp"
    np.testing.assert_allclose(table.data["time"], np.arange(500) / 100, atol=1e-9)


def person(name: str) -> list[str]:
    return [f"{name}_{joint}" for joint in JOINTS]


@pytest.mark.parametrize("starts", [(0, 1000), (500, 2500)])
def test_ids_that_follow_each_other_are_one_person(tmp_path: Path, starts: tuple[int, int]) -> None:
    rows = [state(at, at, person("p1" if at < starts[1] else "p2")) for at in range(starts[0], 3000)]
    table = reba.read(write(tmp_path / "renewed.mcap", rows))
    np.testing.assert_array_equal(elbow(table), np.arange(starts[0], 3000))
    (said,) = [text for text in table.assumed if "follow each other" in text]
    says(said, "p1", "p2", f"{(starts[1] - starts[0]) / 100:.1f}")
    assert adds_up(table)


def test_two_people_at_once_are_a_question_with_their_seconds(tmp_path: Path) -> None:
    rows = []
    for at in range(3000):
        rows.append(state(at, at, person("alice")))
        if at >= 2000:
            rows.append(state(at, at, person("bob")))
    path = write(tmp_path / "two.mcap", rows)
    with pytest.raises(ProfileError) as caught:
        reba.read(path)
    says(caught, "alice (0.0 to 30.0 s)", "bob (20.0 to 30.0 s)", "--topic")
    table = reba.read(path, topic="bob")
    np.testing.assert_array_equal(elbow(table), np.arange(2000, 3000))
    assert table.quality.accounts[0]["not_used"] == {"other_body": 3000}
    assert adds_up(table)


def test_how_a_recording_is_packed_changes_nothing(tmp_path: Path) -> None:
    """Two publishers of one topic: their messages in turn, in a chunk each, backwards, and in chunks of three."""
    arms, rest = JOINTS[:2], JOINTS[2:]
    times = [EPOCH_NS + at * STEP_NS for at in range(6000)]
    first = [(1, time, make.joint_state(time, arms, angles(at)[:2])) for at, time in enumerate(times)]
    second = [(2, time + 3, make.joint_state(time, rest, angles(at)[2:])) for at, time in enumerate(times)]
    mixed = [row for pair in zip(first, second, strict=True) for row in pair]
    expected = reba.read(write(tmp_path / "mixed.mcap", mixed, 2))
    np.testing.assert_array_equal(elbow(expected), np.arange(6000))
    assert np.isfinite(expected.data[["trunk_flexion", "lower_arm_flexion_left"]].to_numpy()).all()
    halves = [*first[3000:], *second[3000:], *first[:3000], *second[:3000]]
    for name, rows, size in (
        ("by channel", [*first, *second], 6000),
        ("halves", halves, 3000),
        ("small", mixed[:900], 3),
    ):
        table = reba.read(write(tmp_path / f"{name}.mcap", rows, 2, size))
        np.testing.assert_array_equal(table.data.to_numpy(), expected.data.to_numpy()[: len(table.data)], name)
        assert len(table.data) == len(rows) // 2


def test_messages_of_one_time_are_accounted_for_and_refused_if_strict(tmp_path: Path) -> None:
    rows = [state(at, at - at % 2) for at in range(1000)]
    path = write(tmp_path / "twice.mcap", rows)
    table = reba.read(path)
    assert table.quality.accounts[0]["not_used"] == {"repeated_time": 500}
    assert adds_up(table)
    with pytest.raises(ReadError) as caught:
        reba.read(path, strict=True)
    says(caught, "500 of 1000", "repeated time", "strict")


def test_undecodable_messages_are_accounted_for(tmp_path: Path) -> None:
    rows = [state(at, at) for at in range(1000)]
    rows[5:25] = [(channel, time, payload[:30]) for channel, time, payload in rows[5:25]]
    table = reba.read(write(tmp_path / "cut.mcap", rows))
    assert table.quality.accounts[0]["not_used"] == {"undecodable": 20}
    assert adds_up(table)


@pytest.mark.parametrize("form", ["/{}", "human1::{}", "ns/person/{}", "robot.{}", "a:b:{}"])
def test_a_namespace_before_a_name_says_whose_it_is(tmp_path: Path, form: str) -> None:
    rows = [state(at, at, [form.format(name) for name in JOINTS]) for at in range(300)]
    table = reba.read(write(tmp_path / "named.mcap", rows))
    assert table.profile == "human_description"
    np.testing.assert_array_equal(elbow(table), np.arange(300))
    assert np.isfinite(table.data.to_numpy()[:, 1 + INDEX["trunk_flexion"]]).all()


@pytest.mark.parametrize("log_restarts", [False, True])
def test_a_clock_may_restart_between_the_files_of_a_recording(tmp_path: Path, log_restarts: bool) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    for part in range(2):
        rows = [
            state(at, at % 1000, log=at % 1000 if log_restarts else at) for at in range(1000 * part, 1000 * part + 1000)
        ]
        write(folder / f"bag_{part}.mcap", rows)
    table = reba.read(folder)
    np.testing.assert_array_equal(elbow(table), np.arange(2000))
    np.testing.assert_allclose(table.data["time"], np.arange(2000) / 100, atol=1e-6)
    assert table.quality.seams == pytest.approx((10.0,))


def test_recordings_of_one_time_in_a_folder_are_not_one(tmp_path: Path) -> None:
    for name in ("left.mcap", "right.mcap"):
        write(tmp_path / name, [state(at, at) for at in range(500)])
    with pytest.raises(ReadError) as caught:
        reba.read(tmp_path)
    says(caught, "left.mcap", "right.mcap", "one time", "one by one")
    (tmp_path / "right.mcap").unlink()
    write(tmp_path / "later.mcap", [state(at, at, log=at) for at in range(500, 900)])
    assert len(reba.read(tmp_path).data) == 900


KNEES = ("left_knee_Z", "right_knee_Z")


def two_topics(path: Path, legs: Sequence[str]) -> Path:
    """Write a person whose knees are on another topic than the other joints."""
    definitions = [make.schema(1, JOINT_STATE, "ros2msg", make.definition(JOINT_STATE))]
    definitions += [make.channel(1, 1, "/upper/joint_states", "cdr"), make.channel(2, 1, "/legs/joint_states", "cdr")]
    rows = [state(at, at, [joint for joint in JOINTS if joint not in KNEES]) for at in range(300)]
    rows += [state(at, at, legs, channel=2) for at in range(300)]
    path.write_bytes(make.build(make.Plan((tuple(sorted(rows, key=lambda row: row[1])),), tuple(definitions))))
    return path


def test_joints_of_one_person_may_stand_in_several_topics(tmp_path: Path) -> None:
    path = two_topics(tmp_path / "two.mcap", KNEES)
    table = reba.read(path)
    np.testing.assert_allclose(table.data["knee_flexion_left"], np.degrees([angles(at)[0] for at in range(300)]))
    assert "trunk_flexion" not in table.unmeasured
    says("; ".join(table.assumed), "one person", "2 topics", "/legs/joint_states")
    (account,) = table.quality.accounts
    assert (account["read"], account["used"], len(table.data)) == (600, 600, 300)
    assert all(stream.used for stream in reba.info(path).streams)
    assert "knee_flexion_left" in reba.read(path, topic="/upper/joint_states").unmeasured
    assert reba.read(path, topic=table.topic).data.equals(table.data)
    reba.write_scores(reba.score(table), tmp_path / "scored.mcap")
    with (tmp_path / "scored.mcap").open("rb") as file:
        logs = [message.log_time for *_, message in make_reader(file).iter_messages("/ergonomics/reba")]
    assert logs == [EPOCH_NS + at * STEP_NS for at in range(300)]


def test_joints_of_another_topic_are_named(tmp_path: Path) -> None:
    """Where a joint stands in both topics, they are not joined: one of them may be a target, or another person."""
    path = two_topics(tmp_path / "two.mcap", (*KNEES, "middle_lumbar_Z"))
    says("; ".join(reba.read(path).assumed), *KNEES, "/legs/joint_states", "not read")


@pytest.mark.parametrize("apart", [20, -200])
def test_bodies_with_a_topic_each_may_follow_each_other(tmp_path: Path, apart: int) -> None:
    """As a tracker of ROS4HRI writes them when it loses a person and finds them again."""
    definitions = [make.schema(1, JOINT_STATE, "ros2msg", make.definition(JOINT_STATE))]
    rows = []
    for number, (body, first) in enumerate((("a1", 0), ("b2", 300 + apart)), 1):
        definitions.append(make.channel(number, 1, f"/humans/bodies/{body}/joint_states", "cdr"))
        names = [f"{body}_{joint}" for joint in JOINTS]
        rows += [state(at, at, names, channel=number) for at in range(first, first + 300)]
    path = tmp_path / "bodies.mcap"
    path.write_bytes(make.build(make.Plan((tuple(sorted(rows, key=lambda row: row[1])),), tuple(definitions))))
    if apart < 0:
        with pytest.raises(ProfileError) as caught:
            reba.read(path)
        says(caught, "a1 (0.0 to 3.0 s)", "b2 (1.0 to 4.0 s)", "--topic")
        return
    table = reba.read(path)
    np.testing.assert_array_equal(elbow(table), [*range(300), *range(320, 620)])
    says("; ".join(table.assumed), "one person", "a1 (0.0 to 3.0 s)", "b2")
    assert adds_up(table)
    assert [(stream.messages, stream.rate) for stream in reba.info(path).streams] == [(300, pytest.approx(100))] * 2
    assert len(table.quality.accounts) == 1
    assert len(reba.read(path, body="b2").data) == 300


def test_an_empty_path_is_not_the_current_folder() -> None:
    with pytest.raises(reba.RebaError) as caught:
        reba.read("")
    says(caught, "path")


def test_without_stamps_and_log_times_the_publish_times_are_used(tmp_path: Path) -> None:
    rows = [(1, EPOCH_NS + at * STEP_NS, make.joint_state(0, JOINTS, angles(at))) for at in range(500)]

    def without_log_time(_: int, data: bytes) -> bytes:
        changed = bytearray(data)
        for row in rows:
            time = row[1].to_bytes(8, "little")
            at = changed.find(time + time)
            if at >= 0:
                changed[at : at + 8] = bytes(8)
        return bytes(changed)

    path = tmp_path / "published.mcap"
    path.write_bytes(make.build(make.Plan(make.split(rows), records=without_log_time, crc_of_records=True)))
    table = reba.read(path)
    assert table.quality.time_source == "publish_time"
    says(table.quality.time_why, "time stamp")
    np.testing.assert_allclose(table.data["time"], np.arange(500) / 100, atol=1e-9)
