"""The recordings below a folder with many links: each real folder once, in time linear in their number."""

from __future__ import annotations

import os
from pathlib import Path

from reba.batch.run import find_inputs

TABLE = "time,trunk_flexion,neck_flexion\n0,10,5\n1,70,5\n"
DEPTH = 30
"""Nested folders with two links each to the next: 2^30 paths."""


def test_links_to_folders_do_not_multiply_the_work(tmp_path: Path) -> None:
    folder = tmp_path / "top"
    folder.mkdir()
    for level in range(DEPTH):
        inner = tmp_path / f"level{level}"
        inner.mkdir()
        (folder / "a").symlink_to(inner)
        (folder / "b").symlink_to(inner)
        (folder / "up").symlink_to(tmp_path)
        folder = inner
    (folder / "shift.csv").write_text(TABLE)
    found = find_inputs([str(tmp_path / "top")])
    assert [Path(name).resolve() for name in found] == [(folder / "shift.csv").resolve()]
    assert find_inputs([str(tmp_path)]) == [str(folder / "shift.csv")]


def test_a_real_path_is_preferred_to_one_through_a_link(tmp_path: Path) -> None:
    (tmp_path / "z").mkdir()
    (tmp_path / "m").mkdir()
    (tmp_path / "z" / "shift.csv").write_text(TABLE)
    (tmp_path / "a").symlink_to(tmp_path / "z")
    (tmp_path / "m" / "sibling").symlink_to(tmp_path / "z")
    assert find_inputs([str(tmp_path)]) == [str(tmp_path / "z" / "shift.csv")]
    assert find_inputs([str(tmp_path / "m")]) == [str(tmp_path / "m" / "sibling" / "shift.csv")]


def test_folders_of_any_depth_and_links_to_nothing_are_passed(tmp_path: Path) -> None:
    folder = tmp_path
    for _ in range(400):
        folder = folder / "deeper"
        folder.mkdir()
    (folder / "shift.csv").write_text(TABLE)
    (tmp_path / "gone").symlink_to(tmp_path / "nothing")
    (tmp_path / "self").symlink_to(tmp_path / "self")
    os.mkfifo(tmp_path / "pipe.csv")
    assert find_inputs([str(tmp_path)]) == [str(folder / "shift.csv")]
