"""Bags and databases that are cut, foreign or hostile, and those whose clock restarts."""

from __future__ import annotations

import bz2
import sqlite3
import struct
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import zstandard

import reba
from reba.errors import ReadError
from reba.readers.info import info
from reba.readers.mcap import open_mcap
from tests.support import bag_bytes
from tests.support import bag_copies as copies
from tests.support.says import says

FRAMES = 200


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copies.write_motion(tmp_path_factory.mktemp("source") / "motion.mcap", FRAMES)


@pytest.fixture(scope="module")
def restarted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording whose clock starts again after 200 frames, log times included."""
    return copies.write_motion(tmp_path_factory.mktemp("restarted") / "twice.mcap", FRAMES, passes=2)


@pytest.mark.parametrize("name", ["bag_lz4", "db3_folder", "db3_packed_messages"])
def test_passes_of_a_restarted_clock_are_not_mixed(name: str, restarted: Path, tmp_path: Path) -> None:
    expected, found = reba.read(restarted), reba.read(copies.COPIES[name](restarted, tmp_path))
    assert len(expected.quality.seams) == 1
    assert found.quality.seams == expected.quality.seams
    np.testing.assert_array_equal(found.data.to_numpy(float), expected.data.to_numpy(float))


def rows(source: Path) -> list[bag_bytes.Row]:
    """Return the messages of a recording as the recorder of ROS 1 gets them."""
    known: dict[str, bag_bytes.Connection] = {}
    result = []
    for topic, name, logged, data in copies.messages(source):
        definition = copies.ROS1.generate_msgdef(name, ros_version=1)[0]
        one = known.setdefault(topic, bag_bytes.Connection(len(known), topic, name.replace("/msg/", "/"), definition))
        message = copies.as_ros1(copies.ROS2.deserialize_cdr(data, name))
        result.append((one, logged, bytes(copies.ROS1.serialize_ros1(message, name))))
    return result


@pytest.mark.parametrize("share", [0.3, 0.7])
def test_cut_bag_is_read_up_to_its_end(share: float, source: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    data = bag_bytes.bag(rows(source))
    path.write_bytes(data)
    whole = reba.read(path)
    assert whole.quality.ended_abnormally is None
    assert len(whole.data) == FRAMES
    path.write_bytes(data[: int(share * len(data))])
    table = reba.read(path)
    assert share * FRAMES - 30 < len(table.data) < FRAMES
    says(table.quality.ended_abnormally or "", "truncated inside a record", "messages read")
    np.testing.assert_array_equal(table.data, whole.data.iloc[: len(table.data)])
    with pytest.raises(ReadError) as caught:
        reba.read(path, strict=True)
    says(caught, path, "truncated", "without strict")


def test_bag_that_was_not_closed(source: Path, tmp_path: Path) -> None:
    """A recorder that is killed leaves `x.bag.active`: no index, and 0 for its place."""
    path = tmp_path / "a.bag.active"
    path.write_bytes(bag_bytes.bag(rows(source), closed=False, compression="bz2", pack=bz2.compress))
    table = reba.read(path)
    assert len(table.data) == FRAMES
    says(table.quality.ended_abnormally or "", "no index", "did not close the file", f"{2 * FRAMES} messages read")


def test_bag_without_times(source: Path, tmp_path: Path) -> None:
    """A converter that left the times of the bag empty: header stamps give them; a bag has no others."""
    path = tmp_path / "a.bag"
    path.write_bytes(bag_bytes.bag([(one, 0, payload) for one, _, payload in rows(source)]))
    table = reba.read(path)
    assert table.quality.time_source == "header.stamp"
    np.testing.assert_array_equal(table.data["time"], reba.read(source).data["time"])


def test_missing_chunk_is_told(source: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes(bag_bytes.bag(rows(source), without=[3]))
    assert any("1 of the 8 chunks" in text for text in reba.read(path).quality.warnings)
    with pytest.raises(ReadError) as caught:
        reba.read(path, strict=True)
    says(caught, path, "1 of the 8 chunks that the file states are missing")


@pytest.mark.parametrize(
    ("head", "facts"),
    [
        (b"#ROSBAG V1.2\n", ("old format", "rosbag fix")),
        (b"#ROSBAG V2.0\n\xff\xff\xff\xff", ()),
    ],
)
def test_foreign_bags_are_one_error(head: bytes, facts: tuple[str, ...], tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes(head + bytes(100))
    with pytest.raises(reba.RebaError) as caught:
        reba.read(path)
    says(caught, path, *facts)


def test_encrypted_bag_says_what_to_do(tmp_path: Path) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes(bag_bytes.head(encryptor=b"rosbag/AesCbcEncryptor"))
    with pytest.raises(ReadError) as caught:
        reba.read(path)
    says(caught, path, "encrypted", "AesCbc", "rosbag decrypt")


def test_chunk_that_unpacks_to_more_than_it_declares(tmp_path: Path) -> None:
    packed = bz2.compress(bytes(1 << 26))
    path = tmp_path / "a.bag"
    header = {"op": b"\x05", "compression": b"bz2", "size": struct.pack("<I", 1000)}
    path.write_bytes(bag_bytes.head() + bag_bytes.record(header, packed))
    with pytest.raises(ReadError) as caught:
        open_mcap(path)
    says(caught, path, "unpacks to 1001 bytes, not to the 1000")
    header["size"] = struct.pack("<I", 0xFFFFFFFF)
    path.write_bytes(bag_bytes.head() + bag_bytes.record(header, packed))
    with pytest.raises(ReadError) as caught:
        open_mcap(path)
    says(caught, path, "the limit is")


def _database(path: Path, script: str) -> Path:
    with sqlite3.connect(path) as database:
        database.executescript(script)
    database.close()
    return path


TOPICS = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT);"
MESSAGES = "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB);"
JOINTS = "INSERT INTO topics VALUES (1, '/joint_states', 'sensor_msgs/msg/JointState', 'cdr');"


@pytest.mark.parametrize(
    ("script", "facts"),
    [
        ("CREATE TABLE a(b);", ("without messages.", "no rosbag2 recording")),
        (TOPICS, ("without messages.",)),
        (
            TOPICS + JOINTS + "CREATE VIEW messages AS WITH RECURSIVE n(id) AS (SELECT 1 UNION ALL SELECT id FROM n) "
            "SELECT id, 1 AS topic_id, 1 AS timestamp, x'00' AS data FROM n;",
            ("without messages.",),
        ),
        (
            TOPICS + JOINTS + "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
            "data AS (zeroblob(1000000000)));",
            ("without messages.data",),
        ),
        (TOPICS + JOINTS + MESSAGES, ("/joint_states", "no messages")),
    ],
)
def test_foreign_databases_are_one_error(script: str, facts: tuple[str, ...], tmp_path: Path) -> None:
    path = _database(tmp_path / "a.db3", script)
    start = time.monotonic()
    with pytest.raises(reba.RebaError) as caught:
        reba.read(path)
    says(caught, path, *facts)
    assert time.monotonic() - start < 5


def test_values_of_any_type_are_counted_and_not_a_traceback(tmp_path: Path) -> None:
    rows = "".join(
        f"INSERT INTO messages VALUES ({number}, {topic}, {stamp}, {data});"
        for number, (topic, stamp, data) in enumerate(
            [
                ("1", "'x'", "NULL"),
                ("NULL", "5", "x'00'"),
                ("'1'", "-5", "'text'"),
                ("9", "1e300", "7"),
                ("1", "NULL", "x'28b52ffd0000'"),
            ]
        )
    )
    path = _database(tmp_path / "a.db3", TOPICS + JOINTS + MESSAGES + rows)
    recording = open_mcap(path)
    assert (recording.topics[0].count, recording.topics[0].usable) == (3, False)
    assert "none of its messages is usable" in recording.topics[0].why
    assert any("2 messages name a topic" in text for text in recording.log.warnings)


def test_messages_that_declare_more_than_the_file_has(tmp_path: Path) -> None:
    """Pages of several values may be the same ones, so a small file could hold gigabytes."""
    rows = "".join(f"INSERT INTO messages VALUES ({at}, 1, 5, x'51515151{'00' * 4000}');" for at in (1, 2))
    path = _database(tmp_path / "a.db3", "PRAGMA page_size = 512;" + TOPICS + JOINTS + MESSAGES + rows)
    data = bytearray(path.read_bytes())
    for at in (data.index(b"QQQQ"), data.rindex(b"QQQQ")):
        assert data[at - 7 : at - 3] == b"\6\0\x09\1"  # head of the record: its size, and the types of three values
        data[at - 10 : at - 8] = b"\xc0\0"  # the record has 8192 bytes
        data[at - 3 : at - 1] = b"\xff\x7e"  # and the value 8185
    assert 8185 < len(data) < 2 * 8185
    path.write_bytes(data)
    with pytest.raises(ReadError) as caught:
        reba.read(path)
    says(caught, path, f"values of {2 * 8185} bytes in a file of {len(data)}")


def test_cut_and_damaged_databases(source: Path, tmp_path: Path) -> None:
    path = copies.COPIES["db3"](source, tmp_path)
    data = path.read_bytes()
    for share in (0.2, 0.5, 0.9):
        path.write_bytes(data[: int(share * len(data))])
        table = reba.read(path)
        assert share * FRAMES - 40 < len(table.data) < FRAMES
        np.testing.assert_array_equal(table.data, reba.read(source).data.iloc[: len(table.data)])
        says(table.quality.ended_abnormally or "", "truncated at byte", len(data), "messages read")
        with pytest.raises(ReadError) as caught:
            reba.read(path, strict=True)
        says(caught, path, "truncated")
    path.write_bytes(data[:3000])
    with pytest.raises(ReadError) as caught:
        reba.read(path)
    says(caught, path, "damaged", "recover")
    rng = np.random.default_rng(0)
    for _ in range(30):
        damaged = bytearray(data)
        for at in rng.integers(0, len(data), 20):
            damaged[at] ^= 0xFF
        path.write_bytes(damaged)
        try:
            reba.read(path)
        except reba.RebaError as error:
            says(error, path)


def test_journal_beside_a_database_is_read_and_told(source: Path, tmp_path: Path) -> None:
    """A recorder that is killed leaves its last messages in the write-ahead log."""
    path = copies.COPIES["db3"](source, tmp_path)
    killed = tmp_path / "killed"
    killed.mkdir()
    with sqlite3.connect(path, isolation_level=None) as database:
        database.execute("PRAGMA journal_mode = WAL")
        rows = database.execute("SELECT topic_id, timestamp, data FROM messages WHERE id > 300").fetchall()
        database.execute("DELETE FROM messages WHERE id > 300")
        database.execute("PRAGMA wal_checkpoint(TRUNCATE)")
        database.executemany("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", rows)
        for file in path.parent.iterdir():
            if file.name.startswith(path.name) and not file.name.endswith("-shm"):
                (killed / file.name).write_bytes(file.read_bytes())
    database.close()
    before = {file.name: file.read_bytes() for file in killed.iterdir()}
    assert len(before) == 2
    table = reba.read(killed / path.name)
    assert len(table.data) == FRAMES
    says(table.quality.ended_abnormally or "", "did not close", "-wal")
    assert {file.name: file.read_bytes() for file in killed.iterdir()} == before


def test_packed_database_that_unpacks_to_too_much(tmp_path: Path) -> None:
    path = tmp_path / "a.db3.zstd"
    path.write_bytes(zstandard.ZstdCompressor().compress(b"SQLite format 3\0" + bytes(1 << 24)))
    with pytest.raises(ReadError) as caught:
        open_mcap(path, limit_bytes=1 << 20)
    says(caught, path, "unpacks to more than")


def test_python_without_sqlite_or_bz2(source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python builds without them where their headers are not installed; MCAP is read all the same."""
    paths = [copies.COPIES[name](source, tmp_path) for name in ("db3", "bag_bz2")]
    for path, module, facts in zip(paths, ("sqlite3", "bz2"), (("SQLite", "another Python"), ("bz2",)), strict=True):
        monkeypatch.setitem(sys.modules, module, None)
        with pytest.raises(ReadError) as caught:
            reba.read(path)
        says(caught, path, "built without", *facts)
    assert len(reba.read(source).data) == FRAMES


def test_folder_with_two_formats_is_a_question(source: Path, tmp_path: Path) -> None:
    folder = copies.COPIES["db3_folder"](source, tmp_path)
    (folder / "a.mcap").write_bytes(source.read_bytes())
    assert info(folder).format == "db3"  # the one that metadata.yaml lists
    (folder / "metadata.yaml").unlink()
    with pytest.raises(ReadError) as caught:
        reba.read(folder)
    says(caught, folder, ".db3 and .mcap", "give one")


def test_splits_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    from reba.readers.mcap.channels import recording_files

    for number in range(12):
        (tmp_path / f"a_{number}.db3").write_bytes(b"")
    assert [file.stem for file in recording_files(tmp_path)] == [f"a_{number}" for number in range(12)]
