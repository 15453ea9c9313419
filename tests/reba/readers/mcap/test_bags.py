"""ROS 1 bags, rosbag2 databases and packed messages: the same motion gives what its MCAP recording gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from mcap.reader import make_reader

import reba
from reba.posture.columns import COLUMNS
from reba.readers.info import info
from reba.readers.mcap import sniff
from tests.support import bag_copies as copies

FRAMES = 200


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return copies.write_motion(tmp_path_factory.mktemp("source") / "motion.mcap", FRAMES)


@pytest.mark.parametrize("name", copies.COPIES)
def test_a_copy_gives_the_same_angles_scores_and_accounts(name: str, source: Path, tmp_path: Path) -> None:
    path = copies.COPIES[name](source, tmp_path)
    expected, found = reba.read(source), reba.read(path)
    assert len(found.data) == FRAMES
    np.testing.assert_array_equal(found.data[list(COLUMNS)], expected.data[list(COLUMNS)])
    np.testing.assert_array_equal(found.data["time"], expected.data["time"])
    assert found.epoch == expected.epoch
    assert found.quality.accounts == expected.quality.accounts
    assert found.quality.time_source == "header.stamp"
    scores, reference = reba.score(found, load=3.0), reba.score(expected, load=3.0)
    np.testing.assert_array_equal(scores.data["reba"], reference.data["reba"])
    assert sniff(path)
    topics = {topic["name"]: topic["count"] for topic in info(path).topics}
    assert topics == {"/joint_states": FRAMES, "/tf": FRAMES}
    reba.write_scores(scores, tmp_path / "scored.mcap")
    with (tmp_path / "scored.mcap").open("rb") as file:
        logged = [message.log_time for *_, message in make_reader(file).iter_messages(topics=["/ergonomics/reba"])]
    joints = [time for topic, _, time, _ in copies.messages(source) if topic == "/joint_states"]
    assert logged == joints


@pytest.mark.parametrize("name", ["bag", "db3"])
def test_format_is_named(name: str, source: Path, tmp_path: Path) -> None:
    assert info(copies.COPIES[name](source, tmp_path)).format == name


@pytest.mark.parametrize("plugin", ["MCAP", "SQLITE3"])
def test_threads_that_pack_messages_may_swap_them(plugin: str, source: Path, tmp_path: Path) -> None:
    """`ros2 bag record` packs messages in several threads and writes each one as it is done."""
    rows = list(copies.messages(source))
    order = np.argsort(np.arange(len(rows)) + np.random.default_rng(0).uniform(0, 8, len(rows)))
    assert (np.diff(order) < 0).any()
    path = copies.to_rosbag2([rows[index] for index in order], tmp_path / "a", plugin, "MESSAGE")
    expected, found = reba.read(source), reba.read(path)
    np.testing.assert_array_equal(found.data[list(COLUMNS)], expected.data[list(COLUMNS)])
    assert found.quality.seams == ()


@pytest.mark.parametrize("kind", ["bag", "database", "both"])
def test_a_list_of_bags_or_databases_is_one_recording(kind: str, tmp_path: Path) -> None:
    source = copies.write_motion(tmp_path / "whole.mcap", 300)
    whole, rows = reba.read(source), list(copies.messages(source))
    parts = [rows[:200], rows[200:]]
    bags = [copies.to_bag(part, tmp_path / f"part_{at}.bag") for at, part in enumerate(parts)]
    folders = [copies.to_rosbag2(part, tmp_path / f"part_{at}") for at, part in enumerate(parts)]
    databases = [next(folder.glob("*.db3")) for folder in folders]
    files = {"bag": bags[::-1], "database": databases, "both": [bags[0], databases[1]]}[kind]
    read = reba.read(files)
    pd.testing.assert_frame_equal(read.data, whole.data)
    assert [account["used"] for account in read.quality.accounts] == [300, 300]
    assert reba.info(files).frames == 300
