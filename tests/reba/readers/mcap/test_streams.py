"""Streams of MCAP recordings: transforms, partial messages, splits, time, memory."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from reba.errors import ReadError
from reba.readers.accounts import accounts_of, of_interval
from reba.readers.mcap import contents, open_mcap
from reba.readers.mcap.container import Container
from reba.readers.mcap.merge import HOLD, MOST_SIGNALS
from reba.readers.recognise import Match
from reba.readers.recording.stream import Block, ReadLog, Recording
from tests.support import hostile_mcap as hostile
from tests.support import mcap_builder as make
from tests.support.mcap_builder import EPOCH_NS, JOINT_STATE, STEP_NS, TYPES
from tests.support.says import says

TF = "tf2_msgs/msg/TFMessage"
LINKS = "xsens_mvn_msgs/msg/LinkStateArray"
LINE = "=" * 80
Row = tuple[int, int, bytes]


def transform(stamp: int, parent: str, child: str, pose: Sequence[float]) -> Any:
    of = TYPES.types
    placed = of["geometry_msgs/msg/Transform"](
        of["geometry_msgs/msg/Vector3"](*pose[:3]), of["geometry_msgs/msg/Quaternion"](*pose[3:])
    )
    return of["geometry_msgs/msg/TransformStamped"](make.header(stamp, parent), child, placed)


def tf_message(*transforms: Any) -> bytes:
    return bytes(TYPES.serialize_cdr(TYPES.types[TF](list(transforms)), TF))


def write(path: Path, rows: Sequence[Row], **topics: tuple[str, str]) -> Recording:
    """Write rows of (channel, log time, payload); `topics` maps c1, c2 ... to (topic, type)."""
    definitions = []
    for number, (topic, name) in enumerate(topics.values(), 1):
        text = LINK_SCHEMA if name == LINKS else make.definition(name)
        definitions += [make.schema(number, name, "ros2msg", text), make.channel(number, number, topic, "cdr")]
    ordered = sorted(rows, key=lambda row: row[1])
    path.write_bytes(make.build(make.Plan(make.split(ordered), tuple(definitions))))
    return open_mcap(path)


def joined(opened: Recording, log: ReadLog | None = None, names: Sequence[str] | None = None) -> Block:
    """Return the only stream in one block."""
    (stream,) = opened.streams
    blocks = list(stream.blocks(log, names))
    assert all(block.names == blocks[-1].names for block in blocks)
    return Block(
        np.concatenate([block.time for block in blocks]),
        blocks[-1].names,
        np.concatenate([block.values for block in blocks]),
        blocks[-1].parents,
    )


def poses(count: int, segments: int) -> np.ndarray:
    return np.random.default_rng(4).normal(size=(count, segments, 7))


@pytest.mark.parametrize("jitter", [0, 9_000])
def test_one_message_per_segment_gives_one_row_per_frame(tmp_path: Path, jitter: int) -> None:
    values = poses(300, 23)
    rows = []
    for at in range(300):
        for segment in range(23):
            stamp = EPOCH_NS + at * STEP_NS + segment * jitter
            pose = transform(stamp, "/world", f"/s{segment}", values[at, segment])
            rows.append((1, stamp + segment, tf_message(pose)))
    log = ReadLog()
    block = joined(write(tmp_path / "tf.mcap", rows, c1=("/tf", TF)), log)
    assert block.names == tuple(f"s{segment}" for segment in range(23))
    assert set(block.parents) == {"world"}
    np.testing.assert_array_equal(block.values, values)
    np.testing.assert_allclose(block.time, np.arange(300) * 0.01, atol=1e-9)
    assert (log.messages, log.skipped, log.warnings) == (6900, 0, [])


def test_one_message_per_frame_with_static_transforms(tmp_path: Path) -> None:
    values = poses(700, 3)
    fixed = [1.0, 2, 3, 0, 0, 0, 1]
    rows = [
        (1, stamp, tf_message(*(transform(stamp, "world", f"s{k}", values[at, k]) for k in range(3))))
        for at in range(700)
        for stamp in [EPOCH_NS + at * STEP_NS]
    ]
    # The static transform comes in the middle and with a stamp of zero.
    rows.append((2, EPOCH_NS + 350 * STEP_NS, tf_message(transform(0, "s0", "sensor", fixed))))
    opened = write(tmp_path / "tf.mcap", rows, c1=("/tf", TF), c2=("/tf_static", TF))
    assert [stream.name for stream in opened.streams] == ["/tf"]
    assert all(topic.usable for topic in opened.topics)
    log = ReadLog()
    block = joined(opened, log)
    assert block.names == ("s0", "s1", "s2", "sensor")
    assert block.parents == ("world", "world", "world", "s0")
    np.testing.assert_array_equal(block.values[:, :3], values)
    np.testing.assert_array_equal(block.values[:, 3], np.tile(fixed, (700, 1)))
    assert log.time_source == "header.stamp"
    assert log.warnings == []


def test_static_transforms_are_accounted_for_and_damaged_ones_told(tmp_path: Path) -> None:
    values = poses(50, 1)
    stamps = [EPOCH_NS + at * STEP_NS for at in range(50)]
    rows = [(1, stamp, tf_message(transform(stamp, "world", "s0", values[at, 0]))) for at, stamp in enumerate(stamps)]
    fixed = tf_message(transform(stamps[0], "s0", "sensor", values[0, 0]))
    rows += [(2, stamps[0], fixed), (2, stamps[20], fixed[:-30]), (2, stamps[30], fixed)]
    opened = write(tmp_path / "tf.mcap", rows, c1=("/tf", TF), c2=("/tf_static", TF))
    log = ReadLog()
    joined(opened, log)
    assert len(log.warnings) == 1
    says(log.warnings[0], "1 of 3 messages of /tf_static cannot be decoded")
    (stream,) = opened.streams
    match = Match(stream, None)
    main, static = accounts_of(opened, match, log, 0.98, {})
    assert (main["stream"], main["read"], main["used"]) == ("/tf", 50, 50)
    assert static == {"stream": "/tf_static", "read": 3, "used": 2, "not_used": {"undecodable": 1},
                      "seconds": {"read": 0.98, "used": 0.98}, "static": True}  # fmt: skip
    assert of_interval(static, 0, 0.2)["used"] == 2
    other = replace(stream, name="/other", static={})
    beside = accounts_of(opened, Match(other, None), ReadLog(), 0.98, {})[-1]
    assert beside["not_used"] == {"other_stream": 3}


@pytest.mark.parametrize("stamped", [True, False])
def test_a_static_transform_holds_until_another_one_is_sent(tmp_path: Path, stamped: bool) -> None:
    """A camera that is moved twice: the first pose holds before its message too, a pose sent again is the same one."""
    values = poses(700, 1)
    places = [[place, 2.0, 3, 0, 0, 0, 1] for place in (1.0, 5.0, 9.0)]
    rows = [
        (1, stamp, tf_message(transform(stamp - 3, "camera", "hand", values[at, 0])))
        for at in range(700)
        for stamp in [EPOCH_NS + at * STEP_NS]
    ]
    for at, place in ((40, 0), (200, 1), (300, 1), (450, 2), (451, 2)):
        stamp = EPOCH_NS + at * STEP_NS
        rows.append((2, stamp - 4, tf_message(transform(stamp if stamped else 0, "world", "camera", places[place]))))
    log = ReadLog()
    opened = write(tmp_path / "tf.mcap", sorted(rows, key=lambda row: row[1]), c1=("/tf", TF), c2=("/tf_static", TF))
    block = joined(opened, log)
    which = np.repeat([0, 1, 2], [200, 250, 250])
    np.testing.assert_array_equal(block.values[:, block.names.index("camera")], np.array(places)[which])
    says(" ".join(log.warnings), "'camera'", "2.00 s, 4.50 s")


def test_stamps_of_one_message_may_differ(tmp_path: Path) -> None:
    values = poses(50, 2)
    rows = []
    for at in range(50):
        stamps = [EPOCH_NS + at * STEP_NS, EPOCH_NS + at * STEP_NS + 4_000_000]
        rows.append((1, stamps[0], tf_message(*(transform(stamps[k], "w", f"s{k}", values[at, k]) for k in (0, 1)))))
    block = joined(write(tmp_path / "tf.mcap", rows, c1=("/tf", TF)))
    assert len(block.time) == 100
    np.testing.assert_array_equal(block.values[0::2, 0], values[:, 0])
    np.testing.assert_array_equal(block.values[1::2, 1], values[:, 1])
    np.testing.assert_array_equal(block.values[2::2, 1], values[:-1, 1])


@pytest.mark.parametrize("at_once", [False, True])
def test_a_frame_may_change_its_parent_but_not_have_two_at_once(tmp_path: Path, at_once: bool) -> None:
    pose = [0.0, 0, 0, 0, 0, 0, 1]
    rows = []
    for at in range(300):
        parents = ["a", "b"] if at_once else ["a" if at < 200 else "b"]
        transforms = [transform(EPOCH_NS + at * STEP_NS, parent, "s", pose) for parent in parents]
        rows.append((1, EPOCH_NS + at * STEP_NS, tf_message(*transforms)))
    log = ReadLog()
    block = joined(write(tmp_path / "tf.mcap", rows, c1=("/tf", TF)), log)
    assert len(block.time) == 300
    if at_once:
        assert block.parents == ("a",)
        says(log.warnings[0], "'s'", "'a'", "'b'", "at once", "first")
    else:
        assert block.names == ("s", "s")
        assert block.parents == ("a", "b")
        assert not log.warnings or "held" in log.warnings[0]
        np.testing.assert_array_equal(np.isfinite(block.values[:, 1, 6]), np.arange(300) >= 200)


@pytest.mark.slow
def test_a_parent_that_is_renamed_with_every_message_is_read_in_time(tmp_path: Path) -> None:
    pose = [0.0, 0, 0, 0, 0, 0, 1]
    stamps = [EPOCH_NS + at * 2_000_000_000 for at in range(5000)]
    rows = [(1, stamp, tf_message(transform(stamp, f"p{stamp}", "s", pose))) for stamp in stamps]
    start = time.process_time()
    opened = write(tmp_path / "tf.mcap", rows, c1=("/tf", TF))
    assert time.process_time() - start < 15.0, "the time grows with the square of the number of names"
    (stream,) = opened.streams
    assert len(stream.names) == MOST_SIGNALS


def test_a_quaternion_of_zeros_is_no_value(tmp_path: Path) -> None:
    rows = [(1, EPOCH_NS, tf_message(transform(EPOCH_NS, "w", "s", [1.0, 2, 3, 0, 0, 0, 0])))]
    assert np.isnan(joined(write(tmp_path / "tf.mcap", rows, c1=("/tf", TF))).values).all()


LINK_SCHEMA = f"""std_msgs/Header header
xsens_mvn_msgs/LinkState[] states
{LINE}
MSG: xsens_mvn_msgs/LinkState
std_msgs/Header header
geometry_msgs/Pose pose
geometry_msgs/Twist twist
{LINE}
MSG: geometry_msgs/Pose
Point position
Quaternion orientation
{LINE}
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
{LINE}
MSG: geometry_msgs/Quaternion
float64 x 0
float64 y 0
float64 z 0
float64 w 1
{LINE}
MSG: geometry_msgs/Twist
Vector3 linear
Vector3 angular
{LINE}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
""".encode()


def test_link_states_are_absolute_poses(tmp_path: Path) -> None:
    """The schema is of a package that no type store knows; the message is made by one that registers it."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    link = "std_msgs/Header header\ngeometry_msgs/Pose pose\ngeometry_msgs/Twist twist"
    store.register(get_types_from_msg(link, "xsens_mvn_msgs/msg/LinkState"))
    store.register(get_types_from_msg("std_msgs/Header header\nxsens_mvn_msgs/LinkState[] states", LINKS))
    of = store.types
    values = poses(20, 2)
    still = of["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    rows = []
    for at, row in enumerate(values):
        stamp = EPOCH_NS + at * STEP_NS
        states = [
            of["xsens_mvn_msgs/msg/LinkState"](
                make.header(stamp, name),
                of["geometry_msgs/msg/Pose"](
                    of["geometry_msgs/msg/Point"](*pose[:3]), of["geometry_msgs/msg/Quaternion"](*pose[3:])
                ),
                of["geometry_msgs/msg/Twist"](still, still),
            )
            for name, pose in zip(("skeleton_pelvis", "skeleton_l5"), row, strict=True)
        ]
        rows.append((1, stamp, bytes(store.serialize_cdr(of[LINKS](make.header(stamp), states), LINKS))))
    block = joined(write(tmp_path / "links.mcap", rows, c1=("/link_states", LINKS)))
    assert block.names == ("skeleton_pelvis", "skeleton_l5")
    assert block.parents == ("", "")
    np.testing.assert_array_equal(block.values, values)


def test_partial_messages_are_held_and_grow_stale(tmp_path: Path) -> None:
    rows = []
    for at in range(200):
        stamp = EPOCH_NS + at * STEP_NS
        rows.append((1, stamp, make.joint_state(stamp, ["a"], [at])))
        if at < 100 and at % 2:
            rows.append((2, stamp, make.joint_state(stamp, ["b"], [at])))
    opened = write(tmp_path / "half.mcap", rows, c1=("/joints", JOINT_STATE), c2=("/joints", JOINT_STATE))
    assert opened.topics[0].count == 250
    log = ReadLog()
    block = joined(opened, log)
    np.testing.assert_array_equal(block.values[:, 0], np.arange(200))
    expected = np.where(np.arange(200) % 2, np.arange(200), np.arange(200) - 1.0)
    expected[0] = np.nan
    held = 99 + round(HOLD / 0.01)
    expected[99 : held + 1] = 99
    expected[held + 1 :] = np.nan
    np.testing.assert_array_equal(block.values[:, 1], expected)
    assert f"held for {HOLD} s" in log.warnings[0]


def test_names_restrict_what_is_decoded(tmp_path: Path) -> None:
    block = joined(open_mcap(hostile.write("sound", tmp_path)), names=("right_knee", "neck", "absent"))
    assert block.names == ("neck", "right_knee")
    np.testing.assert_array_equal(block.values, make.positions()[:, [1, 5]])


def test_a_late_joint_adds_a_column(tmp_path: Path) -> None:
    rows = []
    for at in range(6000):
        stamp = EPOCH_NS + at * STEP_NS
        rows.append(
            (1, stamp, make.joint_state(stamp, ["a", "late"] if at >= 5500 else ["a"], [at, at][: 1 + (at >= 5500)]))
        )
    opened = write(tmp_path / "late.mcap", rows, c1=("/joints", JOINT_STATE))
    assert opened.streams[0].names == ("a", "late")
    first, *_, last = opened.streams[0].blocks()
    assert first.names == last.names == ("a", "late")
    assert np.isnan(first.values[:, 1]).all()
    assert np.isnan(last.values[0, 1])
    assert last.values[-1, 1] == 5999


@pytest.mark.parametrize(
    ("stamp_of", "source"),
    [
        (lambda at: EPOCH_NS - 10**9 + at * STEP_NS, "header.stamp"),
        (lambda at: 0, "log_time"),
        (lambda at: 0 if at == 5 else EPOCH_NS - 10**9 + at * STEP_NS, "header.stamp"),
        (lambda at: EPOCH_NS + 10**17 * (at == 0) - 10**9 + at * STEP_NS, "header.stamp"),
        (lambda at: 0 if at % 2 else EPOCH_NS + at * STEP_NS, "log_time"),
        (lambda at: EPOCH_NS - at * 10**9, "log_time"),
        (lambda at: EPOCH_NS, "log_time"),
    ],
)
def test_time_comes_from_stamps_only_if_they_are_sound(tmp_path: Path, stamp_of: Any, source: str) -> None:
    rows = [(1, EPOCH_NS + at * STEP_NS, make.joint_state(stamp_of(at), ["a"], [at])) for at in range(9)]
    opened = write(tmp_path / "time.mcap", rows, c1=("/joints", JOINT_STATE))
    log = ReadLog()
    block = joined(opened, log)
    assert log.time_source == source
    assert opened.streams[0].epoch == (EPOCH_NS - (10**9 if source == "header.stamp" else 0)) / 1e9
    np.testing.assert_allclose(block.time, np.arange(9) * 0.01, atol=1e-9)


def splits(folder: Path, count: int = 3) -> list[Path]:
    """Write a recording in splits whose names run against time."""
    folder.mkdir()
    files = []
    for part in range(count):
        rows = [(1, EPOCH_NS + at * STEP_NS, make.payloads()[at]) for at in range(part * 100, part * 100 + 100)]
        path = folder / f"bag_{count - part}.mcap"
        path.write_bytes(make.build(make.Plan(make.split(rows))))
        files.append(path)
    (folder / "notes.txt").write_text("not a recording")
    return files


def test_splits_are_read_in_the_order_of_time(tmp_path: Path) -> None:
    splits(tmp_path / "bag")
    opened = open_mcap(tmp_path / "bag")
    block = joined(opened)
    assert opened.topics[0].count == 300
    np.testing.assert_array_equal(block.values, make.positions()[:300])
    np.testing.assert_allclose(block.time, np.arange(300) * 0.01, atol=1e-9)


@pytest.mark.parametrize("damage", ["head", "chunk"])
def test_a_broken_split_is_named_and_left_out(tmp_path: Path, damage: str) -> None:
    files = splits(tmp_path / "bag")
    data = bytearray(files[1].read_bytes())
    at = 0 if damage == "head" else len(data) // 2
    data[at : at + 4] = b"xxxx"
    files[1].write_bytes(data)
    log = ReadLog()
    block = joined(open_mcap(tmp_path / "bag"), log)
    np.testing.assert_array_equal(block.values, np.delete(make.positions()[:300], np.s_[100:200], axis=0))
    assert files[1].name in log.warnings[0]
    with pytest.raises(ReadError) as caught:
        open_mcap(tmp_path / "bag", strict=True)
    says(caught, files[1].name)


def test_folder_without_a_readable_recording(tmp_path: Path) -> None:
    with pytest.raises(ReadError) as caught:
        open_mcap(tmp_path)
    says(caught, tmp_path, "no .mcap, .db3 or .bag file")
    (tmp_path / "a.mcap").write_bytes(b"nothing")
    (tmp_path / "b.mcap").write_bytes(b"")
    with pytest.raises(ReadError) as caught:
        open_mcap(tmp_path)
    says(caught, "none of its 2 files")


def test_other_topics_are_listed_with_the_reason(tmp_path: Path) -> None:
    text = bytes(TYPES.serialize_cdr(TYPES.types["std_msgs/msg/String"]("hello"), "std_msgs/msg/String"))
    rows = [(1, EPOCH_NS, make.payloads()[0]), (2, EPOCH_NS, text), (2, EPOCH_NS + 1, text)]
    opened = write(tmp_path / "two.mcap", rows, c1=("/joints", JOINT_STATE), c2=("/chatter", "std_msgs/msg/String"))
    assert [(topic.name, topic.count, topic.usable) for topic in opened.topics] == [
        ("/joints", 1, True),
        ("/chatter", 2, False),
    ]
    assert opened.topics[1].type == "std_msgs/msg/String"
    assert "no joint states" in opened.topics[1].why


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="peak memory is read from /proc")
def test_memory_does_not_grow_with_the_recording(tmp_path: Path) -> None:
    code = """
        import sys
        from pathlib import Path
        from reba.readers.mcap import contents, open_mcap
        contents.KEPT_BYTES = int(sys.argv[2])
        (stream,) = open_mcap(Path(sys.argv[1])).streams
        print(sum(len(block.time) for block in stream.blocks()))
        peak = next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
        print(peak.split()[1])
        """
    peaks, kept = [], 1 << 23
    payload = make.joint_state(0, [f"joint_{index}" for index in range(100)], np.zeros(100))
    for count in (4_000, 40_000):
        chunks = make.split([(1, EPOCH_NS + at * STEP_NS, payload) for at in range(count)])
        path = tmp_path / f"{count}.mcap"
        path.write_bytes(make.build(make.Plan(chunks, compression="", pack=bytes)))
        run = subprocess.run(
            [sys.executable, "-c", textwrap.dedent(code), str(path), str(kept)],
            capture_output=True,
            text=True,
            timeout=60,
            check=True,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )
        read, peak = map(int, run.stdout.split())
        assert read == count
        peaks.append(peak)
        assert path.stat().st_size > count * 2000
    # Ten times the length is 76 MB more of recording; the blocks and chunks in memory are the same.
    assert peaks[1] - peaks[0] < 12_000 + kept / 1024


def test_values_are_kept_once_and_decoded_again_for_another_reading(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded: list[int] = []
    load = Container.load
    monkeypatch.setattr(Container, "load", lambda self, segment: loaded.append(segment.offset) or load(self, segment))
    rows = [(1, EPOCH_NS + at * STEP_NS, payload) for at, payload in enumerate(make.payloads())]
    whole = write(tmp_path / "whole.mcap", rows, c1=("/joints", JOINT_STATE))
    opening = len(loaded)
    first = joined(whole)
    assert len(loaded) == opening
    assert np.array_equal(joined(whole).values, first.values)
    assert len(loaded) > opening
    # Of a longer recording those that fit are kept.
    monkeypatch.setattr(contents, "KEPT_BYTES", 2 * make.PER_CHUNK * (len(make.NAMES) + 3) * 8)
    loaded.clear()
    part = open_mcap(tmp_path / "whole.mcap")
    opening = len(set(loaded))
    loaded.clear()
    assert np.array_equal(joined(part).values, first.values)
    assert len(set(loaded)) == opening - 2
