"""Mesh files of robots: real inside the package of the robot only, checked, and read within bounds.

A URDF may come from anywhere, and what it names must not reach other files. A mesh is below the folder of the package
that it names (`package://NAME/...`: the nearest folder NAME around the URDF that has a package.xml, NAME beside the
URDF, or the package on a search path), any other below the package of the URDF, or below the folder of the URDF if no
folder around has a package.xml. Links and `..` are followed only inside these folders; links in packages on a search
path, which the user has chosen, lead anywhere. Textures and other files that a mesh names are never opened.
"""

from __future__ import annotations

import io
import os
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from lgp.errors import WorldError
from lgp.kinematics.ros_packages import PACKAGE, find_package, searched_folders_message, split_package
from lgp.kinematics.xml_file import LARGEST, parse_xml
from reba.arrays import Array
from reba.open_file import read_regular

MESH_BYTES: Final = 1 << 27
"""[bytes] Largest mesh file; a choice."""
MOST_FACES: Final = 2_000_000
"""Most triangles of a mesh file, all uses of a part counted; a choice."""
MOST_NODES: Final = 10_000
"""Most nodes of a DAE scene, all uses counted; a choice."""
MOST_COLOURS: Final = 250
"""Most colours of a mesh file: the page stores them as one byte, with those of the robot."""
ENDINGS: Final = (".stl", ".dae", ".obj")

Body = tuple[Array, NDArray[np.int64], NDArray[np.uint8] | None]
"""Vertices (n, 3), faces (m, 3), and sRGB (3,), None without a colour."""


class MissingMeshError(WorldError):
    """A mesh that a URDF names is not there."""


def mesh_path(name: str, urdf: Path, packages: Iterable[str] = ()) -> Path:
    """Return the path of a mesh that a URDF names.

    Args:
        packages: folders in which other packages are looked for, before those of the environment.

    Raises:
        WorldError: it is outside of the folders of the robot.
        MissingMeshError: it, or its package, does not exist.
    """
    around = urdf.resolve().parents
    own = next((folder for folder in around if (folder / "package.xml").is_file()), around[0])
    owner, inside = split_package(name)
    if name.startswith(PACKAGE):
        near = (folder for folder in around if folder.name == owner and (folder / "package.xml").is_file())
        allowed = next(near, None)
        if allowed is None and not (owner and (around[0] / owner).is_dir()):
            package = find_package(owner, packages)
            if package is not None:
                return _inside(package, inside, name, urdf)
        if allowed is None:
            allowed = around[0] / owner if owner not in ("", ".", "..") else around[0]
        path = allowed / inside
    else:
        allowed, path = own, around[0] / name.removeprefix("file://")
    try:
        real = path.resolve()
        if not real.is_relative_to(allowed.resolve()) or not allowed.resolve().is_relative_to(own):
            raise WorldError(
                f"{urdf}: mesh {name[:120]!r} is outside of {allowed}; keep the meshes of a robot in its folder"
            )
    except (OSError, RuntimeError, ValueError) as error:
        if isinstance(error, WorldError):
            raise
        raise WorldError(f"{urdf}: mesh {name[:120]!r} cannot be real ({error}); correct its path") from error
    if not real.exists():
        what = f"{urdf}: mesh {name[:120]!r} does not exist"
        if owner and not allowed.is_dir():
            raise MissingMeshError(f"{what}: {searched_folders_message(owner, packages)}")
        raise MissingMeshError(f"{what}; install the whole package of the robot")
    return real


def _inside(package: Path, inside: str, name: str, urdf: Path) -> Path:
    """Return a file of a package that the user has put on a search path; links in it are followed, `..` is not."""
    path = Path(os.path.normpath(package / inside))
    if "\0" in inside or not path.is_relative_to(os.path.normpath(package)):
        raise WorldError(f"{urdf}: mesh {name[:120]!r} is outside of {package}; keep the meshes of a package in it")
    if not path.exists():
        raise MissingMeshError(f"{urdf}: mesh {name[:120]!r} does not exist in {package}; install the whole package")
    return path


def read_mesh(file: Path) -> list[Body]:
    """Return the parts of a mesh file.

    Raises:
        WorldError: it cannot be read, is damaged, or has too many triangles.
    """
    import trimesh

    ending = file.suffix.lower()
    if ending not in ENDINGS:
        raise WorldError(f"{file}: a mesh ending in {ending[:20]!r}, expected {', '.join(ENDINGS)}; convert it")
    try:
        data = read_regular(file, limit_bytes=MESH_BYTES)
    except OSError as error:
        raise WorldError(f"{file}: cannot be read as a mesh ({error.strerror or error})") from error
    if ending == ".dae":
        root = parse_xml(data, file, "COLLADA")
        _check_nodes(root, file)
        _check_numbers(root, file)
    try:
        with warnings.catch_warnings():
            # What the reader of DAE calls is deprecated in newer versions of NumPy.
            warnings.simplefilter("ignore", DeprecationWarning)
            # Without a path and a resolver no other file can be opened.
            scene = trimesh.load_scene(io.BytesIO(data), file_type=ending[1:], process=False)
        uses = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
        if sum(len(getattr(use, "faces", ())) for use in uses) > MOST_FACES:
            raise WorldError(f"{file}: has more than {MOST_FACES} triangles; export a simpler mesh")
        bodies = [body for body in scene.dump() if isinstance(body, trimesh.Trimesh) and len(body.faces)]
        parts = [_checked(body, file) for body in bodies]
    except WorldError:
        raise
    except Exception as error:  # the libraries raise errors of any kind for damaged files
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"[:160]
        raise WorldError(f"{file}: cannot be read as a mesh ({reason}); export it again") from error
    if len({tuple(rgb) for *_, rgb in parts if rgb is not None}) > MOST_COLOURS:
        raise WorldError(f"{file}: has more than {MOST_COLOURS} colours; export a simpler mesh")
    if not parts:
        raise WorldError(f"{file}: has no triangles; export the mesh again")
    return parts


def _checked(body: Any, file: Path) -> Body:
    vertices, faces = np.asarray(body.vertices, float), np.asarray(body.faces, np.int64)
    if not (np.abs(vertices) <= LARGEST).all():
        raise WorldError(f"{file}: a vertex is no finite position up to {LARGEST:g} m; export the mesh again")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise WorldError(f"{file}: a triangle names vertex {faces.max()} of {len(vertices)}; export the mesh again")
    colour = getattr(getattr(body.visual, "material", None), "main_color", None)
    return vertices, faces, None if colour is None else np.asarray(colour[:3], np.uint8)


def _check_numbers(root: ET.Element, file: Path) -> None:
    """Refuse arrays with numbers that are not finite, which the library replaces by 0."""
    for element in root.iter():
        if _tag(element) != "float_array":
            continue
        try:
            finite = bool(np.isfinite(np.array((element.text or "").split(), np.float64)).all())
        except ValueError:  # words are refused by the library
            finite = True
        if not finite:
            raise WorldError(
                f"{file}: <float_array> {element.get('id')!r} has a number that is not finite; export the mesh again"
            )


def _check_nodes(root: ET.Element, file: Path) -> None:
    """Refuse nodes that use each other in a circle or multiply without bound."""
    known: dict[str, int] = {}
    nodes = {f"#{node.get('id')}": node for node in root.iter() if _tag(node) == "node"}

    def size(node: ET.Element, path: tuple[str, ...]) -> int:
        total = 1
        for child in node:
            if _tag(child) == "node":
                total += size(child, path)
            elif _tag(child) == "instance_node":
                name = child.get("url", "")
                if name not in nodes or name in path or len(path) > MOST_NESTED:
                    raise WorldError(f"{file}: <instance_node> names {name[:40]!r}, expected another node")
                if name not in known:
                    known[name] = size(nodes[name], (*path, name))
                total += known[name]
        return min(total, MOST_NODES + 1)

    for scene in root.iter():
        if _tag(scene) == "visual_scene" and size(scene, ()) > MOST_NODES:
            raise WorldError(f"{file}: its scene has more than {MOST_NODES} nodes; export a simpler mesh")


MOST_NESTED: Final = 30
"""Most nodes that use each other in a row."""


def _tag(element: ET.Element) -> str:
    return str(element.tag).rpartition("}")[2]
