"""What is in the way: obstacles, shelves and boards above tables, as scene files state them."""

from __future__ import annotations

import math
import os
from typing import Any, Final

from lgp.errors import SceneError
from lgp.scene.model import Obstacle, Scene, Table
from reba.toml_table import TomlTable

FARTHEST: Final = 1000.0
"""[m] Largest coordinate of a position."""
LARGEST: Final = 100.0
"""[m] Largest side."""
ENDINGS: Final = (".stl", ".dae", ".obj")
WALLS: Final = {"+x": (0, 1.0), "-x": (0, -1.0), "+y": (1, 1.0), "-y": (1, -1.0)}
"""Walls of a shelf by the axis of the shelf that they are across: number of the axis and side."""


def read_obstacle(name: str, entries: TomlTable) -> Obstacle:
    """Return an obstacle: a box (`size`), an upright cylinder (`radius`, `length`) or a mesh (`mesh`, `scale`).

    Raises:
        SceneError: a value is wrong, or there is no such file.
    """
    forms = [form for form, key in (("box", "size"), ("cylinder", "radius"), ("mesh", "mesh")) if entries.has(key)]
    if len(forms) != 1:
        given = " and ".join(forms) or "neither"
        raise SceneError(f"{entries.where}: gives {given}, expected one of size, radius with length, and mesh")
    size, file = (1.0, 1.0, 1.0), ""
    if forms == ["box"]:
        size = entries.vector("size", 3, low=0.001, high=LARGEST)
    elif forms == ["cylinder"]:
        radius, length = (entries.number(key, low=0.001, high=LARGEST) for key in ("radius", "length"))
        size = (2.0 * radius, 2.0 * radius, length)
    else:
        file = entries.text("mesh")
        size = entries.vector("scale", 3, (1.0, 1.0, 1.0), 1e-6, 1e6, one=True)
        if not file.lower().endswith(ENDINGS) or not os.path.isfile(file):
            what = "a file" if os.path.isfile(file) else "a file that is there"
            raise SceneError(f"{entries.where}: mesh is {file!r}, expected the path of {what}, {', '.join(ENDINGS)}")
    obstacle = Obstacle(
        name=name,
        shape=forms[0],
        position=entries.vector("position", 3, None, -FARTHEST, FARTHEST),
        rotation=entries.vector("rotation", 3, (0.0, 0.0, entries.number("yaw", 0.0)), -360.0, 360.0),
        size=size,
        file=file,
    )
    if entries.has("yaw") and entries.has("rotation"):
        raise SceneError(f"{entries.where}: gives yaw and rotation, expected one of them")
    entries.done()
    return obstacle


def read_shelf(name: str, entries: TomlTable) -> tuple[dict[str, Table], dict[str, Obstacle]]:
    """Return the boards of a shelf as tables `table.NAME.1`, from the lowest, and its walls as obstacles.

    Raises:
        SceneError: a value is wrong.
    """
    position: tuple[float, float] = entries.vector("position", 2, None, -FARTHEST, FARTHEST)
    size: tuple[float, float] = entries.vector("size", 2, low=0.01, high=LARGEST)
    yaw, thickness = entries.number("yaw", 0.0), entries.number("thickness", 0.03, low=0.001, high=3.0)
    tops = entries.series("boards")
    walls = entries.texts("walls", ())
    entries.done()
    for low, high in zip((0.0, *tops), tops, strict=False):
        if not low + thickness < high <= 3.0:
            raise SceneError(
                f"{entries.where}: boards is {list(tops)}, expected rising heights of their tops up to 3 m, each more "
                f"than a thickness of {thickness:g} m above the one before"
            )
    if not tops:
        raise SceneError(f"{entries.where}: boards is empty, expected the heights of their tops")
    tables = {}
    for number, (top, above) in enumerate(zip(tops, (*tops[1:], float("inf")), strict=True), 1):
        board = Table(f"{name}.{number}", position, yaw, size, top, (top, top), thickness, above - thickness - top)
        tables[board.full] = board
    return tables, {f"obstacle.{name}.{wall}": _wall(name, wall, position, yaw, size, tops[-1], thickness, entries)
                    for wall in walls}  # fmt: skip


def _wall(
    name: str,
    wall: str,
    position: tuple[float, float],
    yaw: float,
    size: tuple[float, float],
    height: float,
    thickness: float,
    entries: TomlTable,
) -> Obstacle:
    if wall not in WALLS:
        raise SceneError(f"{entries.where}: walls has {wall!r}, expected {', '.join(WALLS)}")
    axis, side = WALLS[wall]
    offset = [0.0, 0.0]
    offset[axis] = side * (size[axis] + thickness) / 2.0
    sides = [size[0], size[1], height]
    sides[axis] = thickness
    return _beside(
        f"{name}.{wall}", position, yaw, (offset[0], offset[1]), height / 2.0, (sides[0], sides[1], sides[2])
    )


def fixed_bodies(scene: Scene) -> dict[str, Obstacle]:
    """Return what is in the way by full name: obstacles, walls of shelves, and the boards above covered tables."""
    covers = {
        f"obstacle.{table.name}.cover": _beside(
            f"{table.name}.cover",
            table.position,
            table.yaw,
            (0.0, 0.0),
            table.height + table.clearance + table.thickness / 2.0,
            (*table.size, table.thickness),
        )
        for table in scene.tables.values()
        if table.covered
    }
    return {**scene.obstacles, **covers}


def standing(scene: Scene) -> dict[str, dict[str, Any]]:
    """Return where everything stands, as plain data: `tables` and `obstacles` by full name, boards of shelves included.

    For readers of a saved plan that do not know shelves and covers. `clearance` is None where nothing is above a table.

    >>> from lgp.scene.scene_file import load_scene
    >>> standing(load_scene("screwdriver"))["tables"]["table.start"]["size"]
    [0.3, 0.3]
    """
    tables = {
        name: {
            "position": list(table.position),
            "yaw": table.yaw,
            "size": list(table.size),
            "height": table.height,
            "thickness": table.thickness,
            "clearance": table.clearance if math.isfinite(table.clearance) else None,
            "frame": table.frame,
        }
        for name, table in scene.tables.items()
    }
    obstacles = {
        name: {
            "shape": body.shape,
            "position": list(body.position),
            "rotation": list(body.rotation),
            "size": list(body.size),
            "file": body.file,
        }
        for name, body in fixed_bodies(scene).items()
    }
    return {"tables": tables, "obstacles": obstacles}


def _beside(
    name: str,
    position: tuple[float, float],
    yaw: float,
    offset: tuple[float, float],
    height: float,
    size: tuple[float, float, float],
) -> Obstacle:
    """Return a box with its middle at an offset [m] along the axes of a table, upright."""
    cosine, sine = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    x = position[0] + cosine * offset[0] - sine * offset[1]
    y = position[1] + sine * offset[0] + cosine * offset[1]
    return Obstacle(name, "box", (x, y, height), (0.0, 0.0, yaw), size)
