"""The recordings below a folder: each real folder once, in time linear in the links; what is unreadable fails alone."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from reba.batch.run import ScoringOptions, access_probe, find_inputs, score_many
from tests.support.permissions import run_heeding

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


@pytest.mark.parametrize("where", [(), ("-o",)])
def test_what_cannot_be_read_in_a_folder_fails_alone(tmp_path: Path, where: tuple[str, ...]) -> None:
    given = tmp_path / "given"
    for name, mode in (("good", 0o755), ("unlisted", 0o300), ("unopened", 0o600), ("closed", 0)):
        (given / name).mkdir(parents=True)
        (given / name / "shift.csv").write_text(TABLE)
        (given / name).chmod(mode)
    for name in ("shift.csv.gz", "shift_0.mcap", "notes.txt"):
        (given / name).write_text("")
        (given / name).chmod(0)
    out = (*where, *(tmp_path / "scores" for _ in where))
    done = run_heeding("reba", "score", given, *out, "--json")
    for folder in given.iterdir():
        folder.chmod(0o755)
    assert done.returncode == 1, done.stderr
    told = json.loads(done.stdout)
    assert [one["input"] for one in told["recordings"]] == [str(given / "good" / "shift.csv")]
    failed = {Path(one["input"]).name: one["error"] for one in told["failed"]}
    assert sorted(failed) == ["closed", "shift.csv.gz", "shift_0.mcap", "unlisted", "unopened"]
    assert all("Permission denied" in error for error in failed.values())


def test_a_worker_is_checked_with_a_recording_that_can_be_read_here(tmp_path: Path) -> None:
    (tmp_path / "shift.csv").write_text(TABLE)
    probe = access_probe([str(tmp_path / "absent"), str(tmp_path / "shift.csv")])
    assert probe is not None
    assert probe() == ""
    assert access_probe([str(tmp_path / "absent")]) is None


@pytest.mark.parametrize("name", ["shift.mcap", "shift.bag", "shift.bvh", "shift.c3d", "shift.mvnx", "shift.mot.gz"])
@pytest.mark.parametrize("content", [b"", b"\0" * 500, b"no recording"])
def test_a_recording_damaged_from_its_first_byte_on_is_a_failed_input(
    tmp_path: Path, name: str, content: bytes
) -> None:
    (tmp_path / name).write_bytes(content)
    (tmp_path / "good.csv").write_text(TABLE)
    found = find_inputs([str(tmp_path)])
    assert sorted(found) == [str(tmp_path / "good.csv"), str(tmp_path / name)]
    failed = [one for one in score_many(found, None, ScoringOptions()) if one.error]
    assert [one.input for one in failed] == [str(tmp_path / name)]


def test_workbooks_that_are_no_recordings_are_named_once(tmp_path: Path) -> None:
    (tmp_path / "good.csv").write_text(TABLE)
    for number in range(5):
        (tmp_path / f"notes{number}.xlsx").write_bytes(b"no workbook")
    (tmp_path / "photo.jpg").write_bytes(b"\xff\xd8")
    with pytest.warns(UserWarning, match="left out") as told:
        assert find_inputs([str(tmp_path)]) == [str(tmp_path / "good.csv")]
    assert [str(one.message) for one in told] == [
        f"{tmp_path}: left out as no recordings: notes0.xlsx, notes1.xlsx, notes2.xlsx and 2 more; "
        "`reba info FILE` says why"
    ]
