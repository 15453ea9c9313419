"""Tables and objects as bodies to look at, in the axes of their own middle (objects) or of the floor below (tables)."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lgp.page.mesh import Mesh, colour, joined
from lgp.page.robots import reduced
from lgp.world.scene import Table, Thing

Array = NDArray[np.float64]

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


def thing_mesh(thing: Thing, number: int) -> Mesh:
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
