"""Folders that are one recording: its files belong together, and nothing else may be written among them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

_SPLIT: Final = re.compile(r"(_\d+)?\.mcap(\.zstd)?$")


def is_recording_folder(path: Path) -> bool:
    """Return whether a folder is one recording: a rosbag2 folder, or splits `x_0.mcap`, `x_1.mcap` ..."""
    files = [file.name for file in path.iterdir() if _SPLIT.search(file.name)]
    if (path / "metadata.yaml").is_file():
        return bool(files)
    splits = [_SPLIT.sub("", name) for name in files]
    return len(splits) > 1 and len(set(splits)) == 1 and all(re.search(r"_\d+\.mcap", name) for name in files)
