"""Signals that stop being followed: restarts, new ids, bodies and files that come and go, silence."""

from __future__ import annotations

import json
import os
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import Writer

import reba
from reba.live.joint_frames import with_gaps
from reba.live.json_lines import LineStore
from reba.live.sources import open_growing
from reba.readers.recording.stream import Block
from tests.support.encode_motion import write_xsens_tf
from tests.support.live_signals import (
    NAMES,
    ROBOT,
    START,
    LiveRun,
    Message,
    Recorder,
    follow,
    joints,
    messages_of,
    run,
    ticks,
    transform,
    written,
)
from tests.support.live_sources import assert_same, moving_body
from tests.support.says import says

pytestmark = pytest.mark.slow


def as_batch(live: LiveRun, path: Path, messages: list[Message]) -> None:
    """Compare every frame, the exposure and the missing time with those of `reba score` on the same messages."""
    postures = reba.read(written(path, messages))
    scores = reba.score(postures, activity="none")
    start = live.scores[0]["time"]
    lines = [{**line, "time": round(line["time"] - start, 9)} for line in live.scores]
    table = scores.data.assign(time=scores.data["time"].round(9))
    assert_same(lines, table)
    exposure = live.summary["exposure"]
    assert exposure["seconds"] == pytest.approx(scores.summary()["seconds"], abs=1e-6)
    period = 1.0 / postures.quality.rate
    gaps = sum(end - begin - period for begin, end in postures.quality.gaps)
    assert exposure["missing"] == pytest.approx(gaps + live.follower.missing, abs=1e-3)


def restarting() -> list[Message]:
    return [joints(at, at if at < 6 else at - 5) for at in ticks(0, 12)]


def restarting_twice_with_pelvis() -> list[Message]:
    messages = []
    for at in ticks(0, 12):
        stamp = at % 4
        messages += [joints(at + 0.004, stamp), transform(at, "map", "middle_pelvis", 12.0, stamp=stamp)]
    return messages


def restarting_after_a_pause() -> list[Message]:
    return [joints(at, at if at < 6 else at - 9) for at in [*ticks(0, 6), *ticks(9, 15)]]


def one_damaged_stamp() -> list[Message]:
    return [joints(at, at + 3600 if number == 250 else at) for number, at in enumerate(ticks(0, 9))]


def renewed_id(pause: float) -> list[Message]:
    first = [joints(at, prefix="human1_") for at in ticks(0, 6)]
    return first + [joints(at + 0.001, prefix="human2_") for at in ticks(6 + pause, 12)]


def alternating_ids() -> list[Message]:
    return [joints(at, prefix=f"human{1 + int(at // 4) % 2}_") for at in ticks(0, 16)]


def pausing() -> list[Message]:
    return [joints(at) for at in [*ticks(0, 5), *ticks(9, 14)]]


def restarting_with_the_log_time() -> list[Message]:
    messages = [joints(at) for at in ticks(0, 5)]
    return messages + [replace(joints(at), at=at + 5) for at in ticks(0, 5)]


def restarting_at_once() -> list[Message]:
    return [joints(at, at if at < 1 else at - 1) for at in ticks(0, 8)]


def slow_simulation() -> list[Message]:
    return [joints(at, at / 3 if at < 12 else (at - 12) / 3) for at in ticks(0, 20)]


def once_a_second() -> list[Message]:
    return [joints(float(at), float(at if at < 20 else at - 18)) for at in range(40)]


def restart_with_another_id() -> list[Message]:
    return [joints(at, at if at < 6 else at - 6, prefix="a_" if at < 6 else "b_") for at in ticks(0, 12)]


def new_id_at_once() -> list[Message]:
    return [joints(at, prefix="a_" if at < 1 else "b_") for at in ticks(0, 6)]


def two_publishers() -> list[Message]:
    messages = []
    for at in ticks(0, 12):
        stamp = at if at < 6 else at - 5
        messages += [joints(at, stamp, names=NAMES[:5]), joints(at + 0.003, stamp, names=NAMES[5:])]
    return messages


def simulator_that_starts_at_zero() -> list[Message]:
    messages = [joints(at, max(at - 0.1, 0.0), epoch=0) for at in ticks(0, 8)]
    return messages + [joints(at, at - 8, epoch=0) for at in ticks(8, 12)]


SAME = {
    "restart of the log time": (restarting_with_the_log_time(), ["restarted"]),
    "restart in the first seconds": (restarting_at_once(), ["restarted"]),
    "slow simulation": (slow_simulation(), ["restarted"]),
    "one frame a second": (once_a_second(), ["restarted"]),
    "restart with another id": (restart_with_another_id(), ["restarted", "new_id"]),
    "new id in the first seconds": (new_id_at_once(), ["new_id"]),
    "two publishers": (two_publishers(), ["restarted"]),
    "clock from zero": (simulator_that_starts_at_zero(), ["restarted"]),
    "restart": (restarting(), ["restarted"]),
    "restarts with pelvis": (restarting_twice_with_pelvis(), ["restarted", "restarted"]),
    "restart after a pause": (restarting_after_a_pause(), ["silent", "restarted", "resumed"]),
    "damaged stamp": (one_damaged_stamp(), []),
    "new id": (renewed_id(0.3), ["new_id"]),
    "new id with overlap": (renewed_id(-0.3), ["new_id"]),
    "new id after a pause": (renewed_id(3.0), ["silent", "new_id", "resumed"]),
    "ids in turn": (alternating_ids(), ["new_id"] * 3),
    "pause": (pausing(), ["silent", "resumed"]),
}


@pytest.mark.parametrize("name", SAME)
def test_following_goes_on_as_in_the_recording(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    messages, kinds = SAME[name]
    live = run(tmp_path / "live.mcap", messages, monkeypatch)
    as_batch(live, tmp_path / "whole.mcap", messages)
    assert live.kinds == kinds


def test_a_silent_signal_is_reported_within_two_seconds_and_ends_the_alert(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    live = run(tmp_path / "live.mcap", pausing(), monkeypatch)
    (silent,) = live.notices("silent")
    assert 6.0 < silent["at"] <= 7.0
    assert silent["notice"]["followed"] is False
    assert silent["alert"]["active"] is False
    assert silent["exposure"]["missing"] == pytest.approx(silent["at"] - 4.98, abs=0.1)
    before = [line for line in live.scores if line["time"] < 5]
    assert silent["alert"]["event"] == ("cleared" if before[-1]["alert"]["active"] else None)
    assert any(line["alert"]["active"] for line in before)


@pytest.mark.parametrize(
    ("messages", "kind", "event"),
    [
        (restarting(), "restarted", 6.0),
        (restarting_with_the_log_time(), "restarted", 5.0),
        (restarting_after_a_pause(), "restarted", 9.0),
        (two_publishers(), "restarted", 6.0),
        (renewed_id(0.3), "new_id", 6.3),
        (renewed_id(-0.3), "new_id", 6.0),
        (renewed_id(3.0), "new_id", 9.0),
        (pausing(), "resumed", 9.0),
    ],
)
def test_what_happens_to_a_signal_is_reported_within_two_seconds(
    messages: list[Message], kind: str, event: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Times are those of the messages: the source hands each one out at its log time."""
    live = run(tmp_path / "live.mcap", messages, monkeypatch)
    (notice,) = live.notices(kind)
    assert event - 1e-6 <= notice["at"] <= event + 2.0
    later = [line["time"] for line in live.scores if line["time"] > notice["time"]]
    assert notice["notice"]["followed"]
    assert later


def test_a_recorder_that_collects_chunks_is_silent_only_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    messages = [joints(at) for at in ticks(0, 16)]
    live = run(tmp_path / "live.mcap", messages, monkeypatch, chunked=True)
    as_batch(live, tmp_path / "whole.mcap", messages)
    assert live.kinds in ([], ["silent", "resumed"])


def test_two_bodies_from_the_start_are_a_question(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    messages = [joints(at + shift, prefix=prefix) for at in ticks(0, 9) for prefix, shift in (("a_", 0), ("b_", 0.001))]
    with pytest.raises(reba.ProfileError) as error:
        run(tmp_path / "live.mcap", messages, monkeypatch)
    says(error, "2 bodies", "--topic")


@pytest.mark.parametrize("silent_end", [0.0, 5.0])
def test_the_end_counts_as_missing_only_after_silence(
    silent_end: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    messages = [joints(at) for at in ticks(0, 4)]
    live = run(tmp_path / "live.mcap", messages, monkeypatch, silent_end=silent_end)
    assert live.kinds == (["silent"] if silent_end else [])
    assert live.summary["exposure"]["missing"] == pytest.approx(silent_end, abs=0.1)


def test_a_second_body_at_once_is_reported_and_not_mixed_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    alice = [joints(at, prefix="alice_") for at in ticks(0, 12)]
    bob = [joints(at + 0.003, prefix="bob_") for at in ticks(6, 12)]
    live = run(tmp_path / "live.mcap", alice + bob, monkeypatch)
    (second,) = live.notices("second_body")
    assert second["at"] < 8.0
    for part in ("bob", "alice", "--topic bob"):
        assert part in second["notice"]["text"]
    assert second["notice"]["followed"]
    assert live.kinds == ["second_body"]
    as_batch(live, tmp_path / "alice.mcap", alice)


def test_an_old_id_that_comes_back_at_once_with_the_new_one_is_another_body(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = [joints(at, prefix="human1_") for at in [*ticks(0, 4), *ticks(8, 12)]]
    second = [joints(at + 0.003, prefix="human2_") for at in ticks(4, 12)]
    live = run(tmp_path / "live.mcap", first + second, monkeypatch)
    assert live.kinds == ["new_id", "second_body"]
    as_batch(live, tmp_path / "one.mcap", [message for message in first if message.log < 4] + second)


def test_a_body_that_leaves_is_reported_while_others_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = [joints(at + 0.002, names=ROBOT) for at in ticks(0, 14)]
    person = [joints(at) for at in [*ticks(0, 5), *ticks(10, 14)]]
    live = run(tmp_path / "live.mcap", robot + person, monkeypatch)
    (left,) = live.notices("left")
    assert 6.0 < left["at"] <= 7.0
    assert not left["notice"]["followed"]
    assert live.kinds == ["left", "resumed"]
    assert live.summary["exposure"]["missing"] == pytest.approx(5.0, abs=0.1)


def test_a_body_that_leaves_as_others_come_is_not_a_silent_source(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    messages = [joints(at) for at in ticks(0, 4)] + [joints(at, names=ROBOT) for at in ticks(4, 9)]
    live = run(tmp_path / "live.mcap", messages, monkeypatch)
    assert live.kinds == ["left"]
    assert live.summary["exposure"]["missing"] == pytest.approx(5.0, abs=0.1)


def test_a_person_who_enters_late_is_waited_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = [joints(at + 0.002, names=ROBOT) for at in ticks(0, 40)]
    person = [joints(at) for at in ticks(32, 40)]
    live = run(tmp_path / "live.mcap", robot + person, monkeypatch)
    assert live.kinds == ["waiting"]
    as_batch(live, tmp_path / "whole.mcap", robot + person)


def assert_same_from(second: float, live: LiveRun, path: Path, messages: list[Message]) -> None:
    """Compare the frames from a time [s] on with those of `reba score` on the same messages."""
    scores = reba.score(reba.read(written(path, messages)), activity="none").data
    rows = scores[scores["time"] >= second - 1e-6].reset_index(drop=True)
    assert_same([line for line in live.scores if line["time"] >= second - 1e-6], rows)


def test_joints_that_appear_late_are_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    late = [name for name in NAMES if "wrist" in name]
    messages = [joints(at, names=[name for name in NAMES if name not in late]) for at in ticks(0, 28)]
    messages += [joints(at) for at in ticks(28, 34)]
    live = run(tmp_path / "live.mcap", messages, monkeypatch)
    (appeared,) = live.notices("appeared")
    assert "wrist_flexion_left" in appeared["notice"]["text"]
    assert appeared["at"] < 30.0
    assert_same_from(28.0, live, tmp_path / "whole.mcap", messages)
    assert "wrist_flexion_left" not in live.follower.converter.unmeasured


def test_samples_from_before_a_joint_appeared_have_gaps_for_it() -> None:
    block = Block(np.array([0.0, 0.1]), ("elbow",), np.array([[0.4], [0.5]]))
    longer = with_gaps(block, ("shoulder", "elbow", "wrist"))
    assert longer.names == ("elbow", "shoulder", "wrist")
    np.testing.assert_array_equal(longer.values, [[0.4, np.nan, np.nan], [0.5, np.nan, np.nan]])
    assert with_gaps(block, ("elbow",)) is block


def test_a_pelvis_that_appears_late_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    messages = [joints(at) for at in ticks(0, 20)]
    messages += [transform(at + 0.002, "map", "middle_pelvis", 40.0) for at in ticks(12, 20)]
    live = run(tmp_path / "live.mcap", messages, monkeypatch)
    assert "middle_pelvis" in live.notices("appeared")[0]["notice"]["text"]
    assert_same_from(12.5, live, tmp_path / "whole.mcap", messages)


def leaning(parent: str) -> list[Message]:
    """A pelvis whose parent has another name halfway, or gets a mount that leans."""
    messages = [joints(at + 0.001) for at in ticks(0, 16)]
    messages += [transform(at, "odom" if at < 8 else parent, "middle_pelvis", 10.0) for at in ticks(0, 16)]
    return messages


def test_a_parent_with_another_name_is_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    messages = leaning("world")
    live = run(tmp_path / "live.mcap", messages, monkeypatch)
    as_batch(live, tmp_path / "whole.mcap", messages)


def test_a_mount_that_comes_late_is_used_from_then_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mount = transform(8.0, "map", "odom", 25.0, topic="/tf_static")
    messages = [*leaning("odom"), mount]
    live = run(tmp_path / "live.mcap", messages, monkeypatch)
    assert_same_from(8.5, live, tmp_path / "whole.mcap", messages)


def test_joints_of_several_topics_are_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A body whose arms are on another topic, and who gets another id, with topics of its own."""
    messages = []
    for body, first, last in (("one", 0, 4), ("two", 4, 8)):
        for at in ticks(first, last):
            for part, names in (("legs", NAMES[:4]), ("arms", NAMES[4:])):
                topic = f"/humans/bodies/{body}/{part}"
                messages.append(replace(joints(at, prefix=f"{body}_", names=names), topic=topic))
    live = run(tmp_path / "live.mcap", messages, monkeypatch)
    assert live.kinds == ["new_id"]
    as_batch(live, tmp_path / "whole.mcap", messages)


def test_a_mount_that_is_moved_is_used_from_then_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mounts = [transform(at, "map", "odom", lean, topic="/tf_static") for at, lean in ((0.0, 5.0), (9.0, 25.0))]
    messages = [*leaning("odom"), *mounts]
    live = run(tmp_path / "live.mcap", messages, monkeypatch)
    assert_same_from(0.5, live, tmp_path / "whole.mcap", messages)


def test_ids_with_a_pelvis_each_are_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    messages = []
    for number, first, last in ((1, 0, 6), (2, 6.2, 12)):
        for at in ticks(first, last):
            messages.append(joints(at + 0.001, prefix=f"human{number}_"))
            messages.append(transform(at, "map", f"human{number}_middle_pelvis", 15.0 * number))
    live = run(tmp_path / "live.mcap", messages, monkeypatch)
    assert live.kinds == ["new_id"]
    as_batch(live, tmp_path / "whole.mcap", messages)
    assert live.scores[-1]["trunk"] is not None or live.scores[-1]["reba_low"] != live.scores[-1]["reba_high"]


def test_a_tree_of_frames_with_another_id_is_the_same_body(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    motion, messages = moving_body(500), []
    for model, first, last in (("one", 0, 5), ("two", 5, 10)):
        write_xsens_tf(tmp_path / f"{model}.mcap", motion, model=model)
        messages += messages_of(tmp_path / f"{model}.mcap", first, last)
    write_xsens_tf(tmp_path / "whole.mcap", motion)
    live = run(tmp_path / "live.mcap", messages, monkeypatch)
    assert live.kinds == ["new_id"]
    as_batch(live, tmp_path / "renewed.mcap", messages)
    expected = reba.read(tmp_path / "whole.mcap").data
    np.testing.assert_allclose(reba.read(tmp_path / "renewed.mcap").data, expected, atol=1e-6)


def test_joints_and_a_pelvis_that_stay_away_are_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wrists = [name for name in NAMES if "wrist" in name]
    messages = []
    for at in ticks(0, 16):
        messages.append(joints(at, names=[name for name in NAMES if name not in wrists]))
        if not 4 <= at < 8:
            messages.append(joints(at, names=wrists))
        if at < 10:
            messages.append(transform(at + 0.001, "map", "middle_pelvis", 10.0))
    live = run(tmp_path / "live.mcap", sorted(messages, key=lambda message: message.log), monkeypatch)
    lost, again, pelvis = live.notices("columns")
    assert "not measured since 4." in lost["notice"]["text"]
    assert "wrist_flexion_left" in lost["notice"]["text"]
    assert lost["at"] < 6.5
    assert "measured again at 8." in again["notice"]["text"]
    assert "trunk_flexion" in pelvis["notice"]["text"]
    assert pelvis["at"] < 12.5
    as_batch(live, tmp_path / "whole.mcap", messages)


def test_a_static_transform_that_is_sent_again_delays_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    messages = leaning("odom")
    for at in range(16):
        messages.append(transform(at + 0.5, "map", "odom", 25.0, topic="/tf_static"))
    live = run(tmp_path / "live.mcap", messages, monkeypatch)
    delays = [at - line["time"] for line, at in zip(live.lines, live.at, strict=True) if line["time"] > 3]
    assert max(delays) < 0.1
    as_batch(live, tmp_path / "whole.mcap", messages)


@pytest.mark.parametrize("change", ["replaced", "cut", "removed"])
def test_the_next_file_under_the_name_is_followed(change: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, later = tmp_path / "live.mcap", tmp_path / "later.mcap"
    first, second = [joints(at) for at in ticks(0, 6)], [joints(at) for at in ticks(8, 13)]
    files = [Recorder(path)]

    def change_file() -> None:
        if change == "removed":
            path.unlink()
        else:
            files.append(Recorder(path if change == "cut" else later))
        if change == "replaced":
            later.replace(path)

    def write(message: Message) -> None:
        if len(files) == 1:
            files.append(Recorder(path))
        files[1].write(message)

    acts = [(message.log, partial(files[0].write, message)) for message in first]
    acts += [(7.0, change_file), *((message.log, partial(write, message)) for message in second)]
    live = follow(open_growing(path, 0.0), [*acts, (13.5, lambda: files[1].finish())], monkeypatch)
    files[0].finish()
    assert live.kinds == ["new_file", "resumed"] or live.kinds == ["silent", "new_file", "resumed"]
    assert live.notices("new_file")[0]["at"] < 7.1
    as_batch(live, tmp_path / "whole.mcap", first + second)


def test_a_file_that_is_cut_is_not_read_twice(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "live.mcap"
    messages = [joints(at) for at in ticks(0, 6)]
    recorder = Recorder(path)
    acts = [(message.log, partial(recorder.write, message)) for message in messages]
    acts.append((7.0, lambda: os.truncate(path, path.stat().st_size - 1000)))
    live = follow(open_growing(path, 0.0), acts, monkeypatch, until_idle=5.0)
    recorder.finish()
    assert live.kinds == ["new_file"]
    as_batch(live, tmp_path / "whole.mcap", messages)


def lines_of(rows: list[dict[str, object]], monkeypatch: pytest.MonkeyPatch, *, arrive: bool) -> LiveRun:
    """Follow JSON lines that arrive at the times `at` of the rows, or all at once."""
    reading, writing = os.pipe()
    clock = [0.0]
    monkeypatch.setattr("reba.live.json_lines.time.time_ns", lambda: START + round(clock[0] * 1e9))

    def write(row: dict[str, object]) -> None:
        clock[0] = float(str(row["at"])) if arrive else 0.0
        os.write(writing, json.dumps({name: value for name, value in row.items() if name != "at"}).encode() + b"\n")

    acts = [(float(str(row["at"])) if arrive else 0.0, partial(write, row)) for row in rows]
    source = LineStore(reading, lambda text: None)
    live = follow(source, [*acts, (acts[-1][0] + 0.1, lambda: os.close(writing))], monkeypatch)
    os.close(reading)
    return live


def recorded_rows(path: Path, rows: list[dict[str, object]], *, arrive: bool) -> Path:
    """Write rows as JSON messages of a recording whose log times are those of their arrival, or their own."""
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("reba.Posture", "jsonschema", b"{}")
        channel = writer.register_channel("/posture", "json", schema)
        for row in rows:
            log = START + round(float(str(row["at" if arrive else "time"])) * 1e9)
            text = json.dumps({name: value for name, value in row.items() if name != "at"}).encode()
            writer.add_message(channel, log, text, log)
        writer.finish()
    return path


@pytest.mark.parametrize("arrive", [True, False])
def test_rows_whose_time_restarts_go_on(arrive: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    moments = [at for at in ticks(0, 9) if at < 4 or at >= (6 if arrive else 4)]
    rows: list[dict[str, object]] = [
        {"at": at, "time": at if at < 4 else round(at - 4, 6), "trunk_flexion": 50 + 40 * np.sin(at), "load": 8}
        for at in moments
    ]
    live = lines_of(rows, monkeypatch, arrive=arrive)
    assert live.kinds == (["silent", "restarted", "resumed"] if arrive else ["restarted"])
    scores = reba.score(reba.read(recorded_rows(tmp_path / "rows.mcap", rows, arrive=arrive)), activity="none")
    assert_same([{**line, "time": round(line["time"], 6)} for line in live.scores], scores.data.round({"time": 6}))
    assert live.summary["exposure"]["seconds"] == pytest.approx(scores.summary()["seconds"], abs=1e-6)


@pytest.mark.parametrize("damage", [3600.0, -3.0])
def test_a_row_with_a_damaged_time_moves_no_other(damage: float, monkeypatch: pytest.MonkeyPatch) -> None:
    rows: list[dict[str, object]] = [
        {"at": at, "time": at + damage * (number == 200), "trunk_flexion": 50.0}
        for number, at in enumerate(ticks(0, 8))
    ]
    live = lines_of(rows, monkeypatch, arrive=True)
    assert live.kinds == []
    assert [line["time"] for line in live.scores] == pytest.approx(ticks(0, 8), abs=1e-6)


@pytest.mark.parametrize("damage", [9e8, -9e8])
def test_a_time_of_another_decade_costs_no_memory(damage: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows that arrive all at once have no other clock; every one is scored."""
    rows: list[dict[str, object]] = [
        {"at": 0.0, "time": at + damage * (number == 150), "trunk_flexion": 50.0}
        for number, at in enumerate(ticks(0, 8))
    ]
    live = lines_of(rows, monkeypatch, arrive=False)
    assert len(live.scores) >= len(rows) - 1
