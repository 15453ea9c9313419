"""Folders that are one recording: its files belong together, and nothing else may be written among them."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Final

_SPLIT: Final = re.compile(r"(_\d+)?\.((mcap|db3)(\.zstd)?|bag(\.active)?)$")
"""End of the name of a file of a recording: of rosbag2 (.mcap, .db3) and of ROS 1 (.bag)."""
_DATE: Final = re.compile(r"\d{4}(-\d\d){5}$")
"""When a part was begun, as `rosbag record --split` puts it before the number of the part."""


def is_split(name: str) -> bool:
    """Return whether a file has the name of a recording, or of a part of one.

    >>> is_split("walk_0.db3.zstd"), is_split("walk.bag"), is_split("metadata.yaml")
    (True, True, False)
    """
    return _SPLIT.search(name) is not None


def entries_of(folder: Path) -> list[Path]:
    """Return the files and folders in a folder.

    Raises:
        OSError: it cannot be listed, or what it holds cannot be opened.
    """
    os.stat(os.path.join(folder, "."))  # needs the permission that its files need
    return list(folder.iterdir())


def is_recording_folder(path: Path) -> bool:
    """Return whether a folder is one recording: a rosbag2 folder, or splits `x_0.mcap`, `x_1.mcap` ...

    Raises:
        OSError: as in `entries_of`.
    """
    files = [(file.name, end) for file in entries_of(path) if (end := _SPLIT.search(file.name))]
    if (path / "metadata.yaml").is_file():
        return bool(files)
    parts = {end[1] for _, end in files}
    recordings = {_DATE.sub("", name[: end.start()]) for name, end in files}
    return len(files) > 1 and len(recordings) == 1 and len(parts) == len(files) and None not in parts
