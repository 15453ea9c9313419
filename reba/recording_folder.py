"""Folders that are one recording: its files belong together, and nothing else may be written among them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

_SPLIT: Final = re.compile(r"(_\d+)?\.((mcap|db3)(\.zstd)?|bag)$")
"""End of the name of a file of a recording: of rosbag2 (.mcap, .db3) and of ROS 1 (.bag)."""


def is_split(name: str) -> bool:
    """Return whether a file has the name of a recording, or of a part of one.

    >>> is_split("walk_0.db3.zstd"), is_split("walk.bag"), is_split("metadata.yaml")
    (True, True, False)
    """
    return _SPLIT.search(name) is not None


def is_recording_folder(path: Path) -> bool:
    """Return whether a folder is one recording: a rosbag2 folder, or splits `x_0.mcap`, `x_1.mcap` ..."""
    files = [file.name for file in path.iterdir() if _SPLIT.search(file.name)]
    if (path / "metadata.yaml").is_file():
        return bool(files)
    splits = [_SPLIT.sub("", name) for name in files]
    return len(splits) > 1 and len(set(splits)) == 1 and all(re.search(r"_\d+\.(mcap|db3|bag)", name) for name in files)
