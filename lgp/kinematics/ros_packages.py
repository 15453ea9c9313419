"""Folders of ROS packages, which `package://NAME/...` names: https://wiki.ros.org/ROS/EnvironmentVariables.

Looked for in the folders that a scene names, then in those of ROS_PACKAGE_PATH and AMENT_PREFIX_PATH. A package is a
folder of its name with a package.xml: one of these folders itself, inside it or one folder deeper (`src/REPOSITORY/`),
or in `share/` below it (installed).
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Final

PACKAGE: Final = "package://"
VARIABLES: Final = ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH")


def split_package(name: str) -> tuple[str, str]:
    """Return the package and the path inside it of `package://NAME/PATH`, ("", "") of any other name.

    >>> split_package("package://arm/meshes/base.stl")
    ('arm', 'meshes/base.stl')
    """
    owner, _, inside = name.removeprefix(PACKAGE).partition("/") if name.startswith(PACKAGE) else ("", "", "")
    return owner, inside


def find_package(owner: str, folders: Iterable[str] = ()) -> Path | None:
    """Return the folder of a package, None where it is in none of `folders` and of the search paths."""
    if owner in ("", ".", "..") or "\0" in owner:
        return None
    for folder in search_folders(folders):
        for place in _candidates(folder, owner):
            if (place / "package.xml").is_file():
                return place
    return None


def search_folders(folders: Iterable[str] = ()) -> list[Path]:
    """Return the folders that are searched, in order."""
    paths = [part for variable in VARIABLES for part in os.environ.get(variable, "").split(os.pathsep)]
    return [Path(part) for part in (*folders, *paths) if part]


def searched_folders_message(owner: str, folders: Iterable[str] = ()) -> str:
    """Return the end of a message: where a package was looked for, and what to do."""
    looked = ", ".join(map(str, search_folders(folders))) or "no folder (none is set)"
    return (
        f"package {owner!r} was looked for in {looked}; add the folder that holds it to `packages` of the robot, "
        f"or to {VARIABLES[0]}"
    )


def _candidates(folder: Path, owner: str) -> Iterator[Path]:
    if folder.name == owner:
        yield folder
    yield folder / owner
    yield folder / "share" / owner
    try:
        inner = sorted(entry for entry in folder.iterdir() if entry.is_dir())
    except OSError:
        return
    yield from (entry / owner for entry in inner)
