"""A stamp differs after every change of a file, also one that hides."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from reba.errors import ReadError, RebaError
from reba.file_stamp import stamp_before, stamp_of, unchanged
from tests.support.says import says

FIRST, SECOND = b"0123456789", b"9876543210"


def rewrite(path: Path) -> None:
    path.write_bytes(SECOND)


def replace(path: Path) -> None:
    other = path.with_name("other")
    other.write_bytes(SECOND)
    other.replace(path)


def rewrite_and_keep_its_time(path: Path) -> None:
    status = path.stat()
    path.write_bytes(SECOND)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def replace_and_keep_its_time(path: Path) -> None:
    status = path.stat()
    replace(path)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def remove(path: Path) -> None:
    path.unlink()


CHANGES = (rewrite, replace, rewrite_and_keep_its_time, replace_and_keep_its_time, remove)


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("kind", ["file", "folder", "link"])
def test_a_change_while_it_is_read_is_an_error(tmp_path: Path, change: Callable[[Path], None], kind: str) -> None:
    folder = tmp_path / "recording"
    folder.mkdir()
    file, link = folder / "a_0.mcap", tmp_path / "link"
    file.write_bytes(FIRST)
    link.symlink_to(file)
    given = {"file": file, "folder": folder, "link": link}[kind]
    with pytest.raises(ReadError) as error, unchanged(given):
        change(file)
    says(error, given, "changed while it was read", "score it again")
    if file.exists():
        with unchanged(given):
            file.read_bytes()


def test_a_link_that_is_pointed_elsewhere_and_back_is_an_error(tmp_path: Path) -> None:
    link, first, second = (tmp_path / name for name in ("link", "first", "second"))
    first.write_bytes(FIRST)
    second.write_bytes(FIRST)
    link.symlink_to(first)

    def point_elsewhere_and_back() -> None:
        for target in (second, first):
            (tmp_path / "new").symlink_to(target)
            (tmp_path / "new").replace(link)

    with pytest.raises(ReadError), unchanged(link):
        point_elsewhere_and_back()


def test_a_file_added_to_a_folder_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ReadError), unchanged(tmp_path):
        (tmp_path / "a_1.mcap").write_bytes(FIRST)


def test_a_change_explains_every_other_error(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    file.write_bytes(FIRST)

    def fail_after_a_change(reason: Exception) -> None:
        with unchanged(file):
            replace(file)
            raise reason

    for reason in (RebaError("row 3 is short"), OSError("gone"), IndexError("7")):
        with pytest.raises(ReadError, match="changed while it was read"):
            fail_after_a_change(reason)
        with pytest.raises(type(reason)), unchanged(file):
            raise reason


def test_a_change_within_the_clock_tick_of_the_former_one_is_seen(tmp_path: Path) -> None:
    file = tmp_path / "a.csv"
    missed = 0
    for _ in range(10):
        file.write_bytes(FIRST)
        before = stamp_before(file)
        rewrite_and_keep_its_time(file)
        missed += stamp_of(file) == before
    assert missed == 0
