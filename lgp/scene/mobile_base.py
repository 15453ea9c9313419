"""Mobile bases of robots, as scene files state them."""

from __future__ import annotations

from typing import Final

from lgp.errors import SceneError
from lgp.scene.model import PlanarBase
from lgp.scene.surroundings import FARTHEST
from reba.toml_table import TomlTable

MOST_TURN: Final = 3600.0
"""[deg] Largest turn each way."""


def read_base(entries: TomlTable) -> PlanarBase:
    """Return how a robot moves over the floor.

    Raises:
        SceneError: a value is wrong.
    """
    base = PlanarBase(
        x=_range(entries, "x", (0.0, 0.0), FARTHEST),
        y=_range(entries, "y", (0.0, 0.0), FARTHEST),
        yaw=_range(entries, "yaw", (-180.0, 180.0), MOST_TURN),
        speed=entries.number("speed", 0.5, low=0.001, high=100.0),
        turn=entries.number("turn", 60.0, low=0.1, high=10000.0),
    )
    entries.done()
    return base


def _range(entries: TomlTable, key: str, default: tuple[float, float], widest: float) -> tuple[float, float]:
    low, high = entries.vector(key, 2, default, -widest, widest)
    if high < low:
        raise SceneError(f"{entries.where}: {key} is [{low:g}, {high:g}], expected [lowest, highest]")
    return low, high
