"""Meshes of robots, tables and objects: visuals of a URDF, decimated, and simple shapes by the table objects.toml."""

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
from lgp.kinematics.mesh_file import mesh_path, read_mesh
from lgp.kinematics.robot import urdf_of
from lgp.kinematics.urdf import read_urdf
from lgp.page.mesh import Mesh, colour, joined
from lgp.scene.model import Obstacle, Robot, SceneObject, Table
from reba.arrays import Array

FACES = 2500
"""Largest number of triangles of a link."""
KEPT = 60
"""Number of triangles up to which a piece is not decimated."""
SMALLEST = 0.012
"""[m] Parts smaller than this mark sensors and are left out."""
PALE = np.array([205, 208, 212], np.uint8)
"""sRGB of a part without a colour."""
CREASE = 35.0
"""[deg] Edges sharper than this are drawn as edges."""


@dataclass(frozen=True, eq=False)
class LinkMesh:
    """A visual of a link: name of the link, key of the shared mesh, (4, 4) pose in the link, mesh."""

    link: str
    key: str
    place: Array
    mesh: Mesh


def robot_meshes(robot: Robot) -> list[LinkMesh]:
    """Return the visuals of a robot, link by link.

    Raises:
        WorldError: its URDF or a mesh cannot be read.
    """
    urdf = urdf_of(robot.model, robot.packages)
    root, _ = read_urdf(urdf, robot.base)
    paints = {entry.get("name"): _rgba(entry) for entry in root.findall("material")}
    visuals = []
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            paint = _paint(visual, paints)
            # Transparent visuals mark sensors or zones.
            if paint is not None and paint[3] < 1.0:
                continue
            rgb = PALE if paint is None else np.array(np.clip(paint[:3], 0, 1) * 255, np.uint8)
            shape, mesh = _shape(visual, urdf, rgb, robot.packages)
            if mesh is not None and np.ptp(mesh.vertices, axis=0).max() > SMALLEST:
                visuals.append(LinkMesh(str(link.get("name")), f"{shape} {rgb.tolist()}", _origin(visual), mesh))
    return visuals


def _shape(
    visual: ET.Element, urdf: Path, rgb: NDArray[np.uint8], packages: tuple[str, ...]
) -> tuple[str, Mesh | None]:
    import trimesh

    shape = visual.find("geometry/*")
    if shape is None:
        return "", None
    if shape.tag == "mesh":
        file = mesh_path(str(shape.get("filename")), urdf, packages)
        scale = tuple(_numbers(shape.get("scale", "1 1 1")))
        return f"{file} {scale}", _load(file, scale, tuple(rgb.tolist()))
    size = {key: _numbers(value) for key, value in shape.attrib.items()}
    if shape.tag == "box":
        body = trimesh.creation.box(size["size"])
    elif shape.tag == "cylinder":
        body = trimesh.creation.cylinder(size["radius"][0], size["length"][0])
    elif shape.tag == "capsule":
        body = trimesh.creation.capsule(size["length"][0], size["radius"][0])
        body.vertices -= body.bounds.mean(axis=0)
    else:
        body = trimesh.creation.icosphere(3, size["radius"][0])
    return f"{shape.tag} {shape.attrib}", reduced([(body.vertices, body.faces, rgb)])


@cache
def _load(file: Path, scale: tuple[float, ...], paint: tuple[int, ...]) -> Mesh:
    """Return a mesh file, decimated; parts without a colour get `paint`."""
    bodies = [
        (points * scale, faces, np.array(paint, np.uint8) if rgb is None else rgb)
        for points, faces, rgb in read_mesh(file)
    ]
    try:
        return reduced(bodies)
    except WorldError as error:
        raise WorldError(f"{file}: {error}") from error


def reduced(bodies: list[tuple[Array, NDArray[np.int64], NDArray[np.uint8]]]) -> Mesh:
    """Return vertices (n, 3), faces (m, 3) and colours (3,) as one mesh of at most about `FACES` triangles.

    Vertices at sharp edges are split, so that they are shaded as edges. Black becomes dark grey, to show the shape.

    Raises:
        WorldError: no triangle has an area.
    """
    import pyvista
    import trimesh

    total = sum(len(faces) for _, faces, _ in bodies)
    meshes = []
    for vertices, faces, rgb in bodies:
        whole = trimesh.Trimesh(vertices, faces, process=False)
        whole.merge_vertices(merge_tex=True, merge_norm=True)
        whole.update_faces(whole.nondegenerate_faces())
        if not len(whole.faces):
            continue
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
            meshes.append(Mesh(points, np.asarray(body.regular_faces, np.int64), colours, gloss=0.5))
    if not meshes:
        raise WorldError("no triangle has an area; export the mesh again")
    return joined(meshes)


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


TABLE = Path(__file__).parent / "data" / "objects.toml"


@cache
def shapes() -> dict[str, Any]:
    """Return the table of shapes and colours (read once)."""
    return tomllib.loads(TABLE.read_text(encoding="utf-8"))


def table_mesh(table: Table) -> Mesh:
    """Return a table: its top on four legs, a small one on a pillar with a foot, of one on a robot the top alone."""
    look = shapes()["table"]
    length, width = table.size
    middle = (0.0 if table.frame else table.height) - table.thickness / 2.0
    bodies = [_box((length, width, table.thickness), (0.0, 0.0, middle), look["top"])]
    if table.frame:
        return joined(bodies)
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


def obstacle_mesh(body: Obstacle) -> Mesh:
    """Return an obstacle, in the colour of obstacles; a mesh keeps its own."""
    import trimesh

    tint = shapes()["table"]["obstacle"]
    if body.shape == "box":
        return _box(body.size, (0.0, 0.0, 0.0), tint)
    if body.shape == "cylinder":
        bar = trimesh.creation.cylinder(body.size[0] / 2.0, body.size[2])
        return reduced([(bar.vertices, bar.faces, colour(tint))])
    return _load(Path(body.file), body.size, tuple(colour(tint).tolist()))


def object_mesh(scene_object: SceneObject, number: int) -> Mesh:
    """Return an object: the shape of a word of its name in objects.toml, else a box; `number` chooses its colour."""
    data = shapes()
    tint = data["colours"][number % len(data["colours"])]
    words = scene_object.name.replace(".", " ").replace("_", " ").replace("/", " ").split()
    entries = next((data["shapes"][word] for word in words if word in data["shapes"]), [{"kind": "box"}])
    size = np.array(scene_object.size)
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
    # A cyclic permutation of the axes is a rotation, not a mirror image.
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
