"""Files that a user names: regular ones only, and of a bounded size."""

from __future__ import annotations

import os
import socket
from pathlib import Path

import pytest

from reba.open_file import open_regular, read_regular, read_settings


def test_a_file_and_a_link_to_it_are_read(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"text\r\n")
    (tmp_path / "link").symlink_to(tmp_path / "file")
    assert read_regular(tmp_path / "file") == read_regular(str(tmp_path / "link"), limit_bytes=6) == b"text\r\n"
    assert read_settings(tmp_path / "link") == "text\n"


def test_pipes_sockets_devices_and_folders_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "link").symlink_to(tmp_path / "pipe")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "socket"))
        for name in ("pipe", "link", "socket", "/dev/zero"):
            with pytest.raises(OSError, match="not a regular file"):
                open_regular(tmp_path / name)
    with pytest.raises(IsADirectoryError, match="folder"):
        read_settings(tmp_path)


def test_more_bytes_than_allowed_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_bytes(b"x" * 10)
    assert len(read_regular(tmp_path / "file", limit_bytes=10)) == 10
    with pytest.raises(OSError, match="larger than 9 bytes"):
        read_regular(tmp_path / "file", limit_bytes=9)
    monkeypatch.setattr("reba.open_file._check", lambda *_: None)  # it grew since
    with pytest.raises(OSError, match="larger than 9 bytes"):
        read_regular(tmp_path / "file", limit_bytes=9)


@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="only Linux has such files")
@pytest.mark.parametrize("name", ["self/status", "self/environ", "meminfo"])
def test_what_only_looks_like_a_regular_file_is_refused(name: str, tmp_path: Path) -> None:
    (tmp_path / "link.csv").symlink_to(Path("/proc", name))
    with pytest.raises(OSError, match="not a regular file"):
        open_regular(tmp_path / "link.csv")
    (tmp_path / "empty").touch()
    assert read_regular(tmp_path / "empty") == b""
