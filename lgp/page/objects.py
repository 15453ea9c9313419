"""The meshes of a robot: what its URDF shows, read with its colours and reduced to what a page needs."""

from __future__ import annotations

import tomllib
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lgp.errors import WorldError
from lgp.kinematics.robot import urdf_of
from lgp.page.mesh import Mesh, colour, joined
from lgp.scene.model import Robot, SceneObject, Table
from reba.arrays import Array

FACES = 2500
"""Most triangles of one link."""
KEPT = 60
"""Triangles of a piece that is small enough to stay as it is."""
SMALLEST = 0.012
"""[m] Parts smaller than this are markers of sensors, not bodies."""
PALE = np.array([205, 208, 212], np.uint8)
"""Colour of a part that has none."""
CREASE = 35.0
"""[deg] Edges sharper than this stay edges."""


@dataclass(frozen=True, eq=False)
class LinkMesh:
    """What is seen of a link: its name, the mesh file or shape as a key to share it by, (4, 4) place in the link."""

    link: str
    key: str
    place: Array
    mesh: Mesh


def parts(robot: Robot) -> list[LinkMesh]:
    """Return what is seen of a robot, link by link.

    Raises:
        WorldError: its URDF or a mesh cannot be read.
    """
    urdf = urdf_of(robot.model)
    try:
        root = ET.parse(urdf).getroot()
    except (OSError, ET.ParseError) as error:
        raise WorldError(f"{urdf}: cannot be read as URDF ({error})") from error
    paints = {entry.get("name"): _rgba(entry) for entry in root.findall("material")}
    found = []
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            paint = _paint(visual, paints)
            # What is half transparent marks a sensor or a zone.
            if paint is not None and paint[3] < 1.0:
                continue
            rgb = PALE if paint is None else np.array(np.clip(paint[:3], 0, 1) * 255, np.uint8)
            shape, mesh = _shape(visual, urdf, rgb)
            if mesh is not None and np.ptp(mesh.vertices, axis=0).max() > SMALLEST:
                found.append(LinkMesh(str(link.get("name")), f"{shape} {rgb.tolist()}", _origin(visual), mesh))
    return found


def _shape(visual: ET.Element, urdf: Path, rgb: NDArray[np.uint8]) -> tuple[str, Mesh | None]:
    import trimesh

    shape = next(iter(visual.find("geometry") or ()), None)
    if shape is None:
        return "", None
    if shape.tag == "mesh":
        file = _file(str(shape.get("filename")), urdf)
        scale = tuple(_numbers(shape.get("scale", "1 1 1")))
        return f"{file.name} {scale}", _load(file, scale, tuple(rgb.tolist()))
    size = {key: _numbers(value) for key, value in shape.attrib.items()}
    if shape.tag == "box":
        body = trimesh.creation.box(size["size"])
    elif shape.tag == "cylinder":
        body = trimesh.creation.cylinder(size["radius"][0], size["length"][0])
    elif shape.tag == "sphere":
        body = trimesh.creation.icosphere(3, size["radius"][0])
    else:
        return "", None
    return f"{shape.tag} {shape.attrib}", reduced([(body.vertices, body.faces, rgb)])


@cache
def _load(file: Path, scale: tuple[float, ...], paint: tuple[int, ...]) -> Mesh:
    """Return a mesh file, reduced; parts without a colour of their own get `paint`."""
    import trimesh

    try:
        scene = trimesh.load_scene(file)
    except (OSError, ValueError) as error:
        raise WorldError(f"{file}: cannot be read as a mesh ({error})") from error
    bodies = [body for body in scene.dump() if isinstance(body, trimesh.Trimesh)]
    return reduced([(body.vertices * scale, body.faces, _colour(body, paint)) for body in bodies])


def _colour(body: Any, paint: tuple[int, ...]) -> NDArray[np.uint8]:
    colour = getattr(getattr(body.visual, "material", None), "main_color", None)
    return np.array(paint if colour is None else colour[:3], np.uint8)


def reduced(bodies: list[tuple[Array, NDArray[np.int64], NDArray[np.uint8]]]) -> Mesh:
    """Return vertices (n, 3), faces (m, 3) and colours (3,) as one mesh of at most about `FACES` triangles.

    Edges of the surface stay edges: vertices there are split. Blacks become dark greys, so that a shape is seen.
    """
    import pyvista
    import trimesh

    total = sum(len(faces) for _, faces, _ in bodies)
    found = []
    for vertices, faces, rgb in bodies:
        whole = trimesh.Trimesh(vertices, faces, process=False)
        whole.merge_vertices(merge_tex=True, merge_norm=True)
        whole.update_faces(whole.nondegenerate_faces())
        body = pyvista.PolyData.from_regular_faces(np.asarray(whole.vertices, float), np.asarray(whole.faces))
        if total > FACES and body.n_cells > KEPT:
            body = body.decimate(1.0 - FACES / total)
        body = body.compute_normals(
            cell_normals=False, split_vertices=True, feature_angle=CREASE, auto_orient_normals=False
        )
        if body.n_cells:
            points = np.asarray(body.points, dtype=float)
            tint = (52 + 0.78 * rgb.astype(float)).astype(np.uint8)
            colours = np.broadcast_to(tint, points.shape)
            found.append(Mesh(points, np.asarray(body.regular_faces, np.int64), colours, gloss=0.5))
    return joined(found)


def _file(name: str, urdf: Path) -> Path:
    """Return the path of a mesh: `package://NAME/...` below a folder around the URDF, or beside it."""
    _, package, inside = name.partition("package://")
    if not package:
        return urdf.parent / name.removeprefix("file://")
    owner, _, rest = inside.partition("/")
    for folder in urdf.parents:
        if folder.name == owner and (folder / rest).is_file():
            return folder / rest
        if (folder / inside).is_file():
            return folder / inside
    raise WorldError(f"{urdf}: its mesh {name} is not there; install the whole package of the robot")


def _paint(visual: ET.Element, paints: dict[str | None, list[float] | None]) -> list[float] | None:
    material = visual.find("material")
    return None if material is None else _rgba(material) or paints.get(material.get("name"))


def _rgba(material: ET.Element) -> list[float] | None:
    colour = material.find("color")
    return None if colour is None else _numbers(colour.get("rgba", "1 1 1 1"))


def _origin(visual: ET.Element) -> Array:
    """Return (4, 4) from xyz [m] and roll, pitch, yaw [rad]."""
    from scipy.spatial.transform import Rotation

    origin = visual.find("origin")
    place = np.eye(4)
    if origin is not None:
        place[:3, 3] = _numbers(origin.get("xyz", "0 0 0"))
        place[:3, :3] = Rotation.from_euler("xyz", _numbers(origin.get("rpy", "0 0 0"))).as_matrix()
    return place


def _numbers(text: str) -> list[float]:
    return [float(word) for word in text.split()]


TABLE = Path(__file__).parent / "data" / "things.toml"


@cache
def shapes() -> dict[str, Any]:
    """Return the table of shapes and colours (read once)."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def table_mesh(table: Table) -> Mesh:
    """Return a table: its top at its height, on four legs, a small one on a pillar with a foot."""
    look = shapes()["table"]
    length, width = table.size
    middle = table.height - table.thickness / 2.0
    bodies = [_box((length, width, table.thickness), (0.0, 0.0, middle), look["top"])]
    leg, bottom = look["leg"], table.height - table.thickness
    if max(table.size) < look["pillar"]:
        bodies.append(_box((2 * leg, 2 * leg, bottom), (0.0, 0.0, bottom / 2.0), look["legs"]))
        bodies.append(_box((0.8 * length, 0.8 * width, leg), (0.0, 0.0, leg / 2.0), look["legs"]))
        return joined(bodies)
    for x in (-1.0, 1.0):
        for y in (-1.0, 1.0):
            at = (x * (length / 2 - leg), y * (width / 2 - leg), bottom / 2.0)
            bodies.append(_box((leg, leg, bottom), at, look["legs"]))
    return joined(bodies)


def thing_mesh(thing: SceneObject, number: int) -> Mesh:
    """Return an object: the shape that a word of its name stands for, else a box.

    Args:
        thing: the object.
        number: in the scene, for a colour of its own.
    """
    data = shapes()
    tint = data["colours"][number % len(data["colours"])]
    words = thing.name.replace(".", " ").replace("_", " ").replace("/", " ").split()
    entries = next((data["shapes"][word] for word in words if word in data["shapes"]), [{"kind": "box"}])
    size = np.array(thing.size)
    return joined([_piece(entry, size, entry.get("colour", tint)) for entry in entries])


def _piece(entry: dict[str, Any], size: Array, tint: str) -> Mesh:
    """Return a piece of an object: a box or a round bar between two shares of its longest side."""
    low, high = entry.get("along", (0.0, 1.0))
    longest = int(np.argmax(size))
    wide = size * entry.get("width", 1.0)
    wide[longest] = size[longest] * (high - low)
    at = np.zeros(3)
    at[longest] = size[longest] * ((low + high) / 2.0 - 0.5)
    if entry["kind"] == "box":
        return _box(tuple(wide), tuple(at), tint)
    return _bar(wide, at, longest, tint)


def _bar(size: Array, at: Array, longest: int, tint: str) -> Mesh:
    """Return a round bar along one side of a box, with rounded rims."""
    import trimesh

    across = [axis for axis in range(3) if axis != longest]
    half, rim = size[longest] / 2.0, min(0.12 * size[across].min(), size[longest] / 4.0)
    radius = 0.5
    share = rim / size[across].min()
    profile = [(0, -half), (radius - share, -half), (radius, -half + rim), (radius, half - rim), (radius - share, half)]
    body = trimesh.creation.revolve([*profile, (0, half)], sections=28)
    points = np.empty_like(body.vertices)
    points[:, longest] = body.vertices[:, 2]
    # The remaining axes follow in order, so that the bar is turned and not mirrored.
    for source, axis in enumerate(((longest + 1) % 3, (longest + 2) % 3)):
        points[:, axis] = body.vertices[:, source] * size[axis]
    return reduced([(points + at, body.faces, colour(tint))])


def _box(size: tuple[float, ...], at: tuple[float, ...], tint: str) -> Mesh:
    """Return a box with bevelled edges."""
    import trimesh

    half = np.array(size) / 2.0
    rim = min(0.004, 0.2 * half.min())
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    points = np.concatenate([corners * (half - rim * (1 - np.eye(3)[axis])) for axis in range(3)])
    hull = trimesh.convex.convex_hull(points)
    return reduced([(hull.vertices + np.array(at), hull.faces, colour(tint))])
