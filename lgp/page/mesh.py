"""Coloured triangle meshes, and the mesh of a smooth union of rounded solids."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from reba.arrays import Array

if TYPE_CHECKING:
    import pyvista

PROBE = 0.002
"""[m] Distance of the probes on both sides of a face that tell its outside."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A coloured triangle mesh.

    Attributes:
        vertices: (n, 3) [m].
        faces: (m, 3) numbers of vertices, counter-clockwise seen from outside.
        colours: (n, 3) sRGB, 0 to 255.
        gloss: 0 dull to 1 polished.
    """

    vertices: Array
    faces: NDArray[np.int64]
    colours: NDArray[np.uint8]
    gloss: float = 0.2


def surface_points(mesh: Mesh, spacing: float) -> Array:
    """Return points (k, 3) all over a mesh, about `spacing` from each other [m]; always the same ones."""
    corners = mesh.vertices[mesh.faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2.0
    # Triangle k begins where the areas before it end, so that small ones share their points.
    share = np.floor(np.cumsum(area) / spacing**2).astype(int)
    counts = np.diff(share, prepend=0)
    chosen = np.repeat(np.arange(len(counts)), counts)
    weights = np.random.default_rng(0).dirichlet(np.ones(3), len(chosen))
    return np.asarray(np.einsum("kc,kcd->kd", weights, corners[chosen]))


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one, with the gloss of the first."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]),
        np.concatenate([mesh.colours for mesh in meshes]),
        meshes[0].gloss,
    )


def colour(text: str) -> NDArray[np.uint8]:
    """Return (3,) from a colour such as "#d9a07c".

    >>> colour("#ff8000").tolist()
    [255, 128, 0]
    """
    return np.frombuffer(bytes.fromhex(text.removeprefix("#")), np.uint8)


@dataclass(frozen=True, eq=False)
class Solid:
    """A rounded solid: a limb that tapers from one point to another, or an ellipsoid (both ends the same).

    Attributes:
        bone: joint that it moves with.
        colour: name of its colour.
        start, end: (3,) [m].
        radii: at start and end [m], or the three of an ellipsoid.
        axes: (3, 3) of an ellipsoid, in columns.
    """

    bone: str
    colour: str
    start: Array
    end: Array
    radii: tuple[float, ...]
    axes: Array

    def distance(self, points: Array) -> Array:
        """Return the approximate signed distance (n,) of (n, 3) points from the surface [m]; negative inside."""
        if len(self.radii) == 3:
            scaled = (points - self.start) @ self.axes / np.array(self.radii)
            near = np.linalg.norm(scaled, axis=1)
            slope = np.linalg.norm(scaled / np.array(self.radii), axis=1)
            return np.asarray(near * (near - 1.0) / np.maximum(slope, 1e-9))
        along = self.end - self.start
        share = np.clip((points - self.start) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
        radius = self.radii[0] + share * (self.radii[1] - self.radii[0])
        return np.asarray(np.linalg.norm(points - self.start - share[:, None] * along, axis=1) - radius)

    def box(self, margin: float) -> tuple[Array, Array]:
        """Return the corners (3,), (3,) of a box around it."""
        reach = max(self.radii) + margin
        return np.minimum(self.start, self.end) - reach, np.maximum(self.start, self.end) + reach


def surface(solids: Sequence[Solid], voxel: float, blend: float, floor: float = -np.inf) -> pyvista.PolyData:
    """Return the surface of the smooth union of solids.

    The field is the polynomial smooth minimum of the distances (Quilez, "smooth minimum"), its zero level is extracted
    by VTK's flying edges.

    Args:
        solids: in the order in which they are joined.
        voxel: edge of the grid [m].
        blend: width of the transition between two solids [m].
        floor: z of the plane below which the surface is cut off [m].
    """
    import pyvista

    corners = [solid.box(blend + 2 * voxel) for solid in solids]
    low = np.min([low for low, _ in corners], axis=0)
    count = np.ceil((np.max([high for _, high in corners], axis=0) - low) / voxel).astype(int) + 1
    field = np.full(count, 1.0)
    for solid, (near, far) in zip(solids, corners, strict=True):
        first = np.maximum(np.floor((near - low) / voxel).astype(int), 0)
        last = np.minimum(np.ceil((far - low) / voxel).astype(int) + 1, count)
        part = tuple(slice(a, b) for a, b in zip(first, last, strict=True))
        grid = np.stack(np.meshgrid(*(np.arange(a, b) for a, b in zip(first, last, strict=True)), indexing="ij"), -1)
        distance = solid.distance(grid.reshape(-1, 3) * voxel + low).reshape(grid.shape[:3])
        overlap = np.maximum(blend - np.abs(field[part] - distance), 0.0)
        field[part] = np.minimum(field[part], distance) - overlap**2 / (4.0 * blend)
    if np.isfinite(floor):
        field = np.maximum(field, floor - (np.arange(count[2]) * voxel + low[2]))
    image = pyvista.ImageData(dimensions=tuple(count), spacing=(voxel,) * 3, origin=tuple(low))
    image["field"] = field.flatten(order="F")
    return image.contour([0.0], scalars="field", method="flying_edges")


def painted(skin: pyvista.PolyData, solids: Sequence[Solid], colours: Mapping[str, str], gloss: float) -> Mesh:
    """Return a surface in the colours (name -> "#rrggbb") of the solids it is nearest to, cut where they meet."""
    names = tuple(dict.fromkeys(solid.colour for solid in solids))
    distance = np.stack([solid.distance(np.asarray(skin.points, dtype=float)) for solid in solids], axis=1)
    nearest = np.stack([distance[:, [solid.colour == name for solid in solids]].min(axis=1) for name in names], axis=1)
    patches = []
    for number, name in enumerate(names):
        others = np.delete(nearest, number, axis=1)
        skin["lead"] = others.min(axis=1, initial=1.0) - nearest[:, number]
        patch = skin.clip_scalar(scalars="lead", value=0.0, invert=False).triangulate()
        if patch.n_cells:
            points = np.asarray(patch.points, dtype=float)
            tint = np.broadcast_to(colour(colours[name]), points.shape)
            faces = np.asarray(patch.regular_faces, dtype=np.int64)
            patches.append(Mesh(points, _outwards(points, faces, solids), tint, gloss))
    return joined(patches)


def _outwards(points: Array, faces: NDArray[np.int64], solids: Sequence[Solid]) -> NDArray[np.int64]:
    """Return the faces (m, 3) of a closed surface or a part of it, counter-clockwise seen from outside."""
    corners = points[faces]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normal *= PROBE / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    middle = corners.mean(axis=1)
    above, below = (np.min([solid.distance(middle + way * normal) for solid in solids], axis=0) for way in (1, -1))
    return np.where((above < below)[:, None], faces[:, ::-1], faces)
