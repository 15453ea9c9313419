"""Mobile bases of robots, and standing places of persons, as scene files state them."""

from __future__ import annotations

from typing import Final

from lgp.errors import SceneError
from lgp.scene.model import PlanarBase
from lgp.scene.surroundings import FARTHEST
from reba.toml_table import TomlTable

WALKING_SHARE: Final = 0.5
"""Of a phase, in which persons who may step do so; then they stand until its end."""
MOST_TURN: Final = 3600.0
"""[deg] Largest turn each way."""


def read_base(entries: TomlTable, speed: float = 0.5, turn: float = 60.0) -> PlanarBase:
    """Return how an agent moves over the floor.

    Args:
        speed, turn: largest speeds [m/s, deg/s] where none are stated.

    Raises:
        SceneError: a value is wrong.
    """
    base = PlanarBase(
        x=_range(entries, "x", (0.0, 0.0), FARTHEST),
        y=_range(entries, "y", (0.0, 0.0), FARTHEST),
        yaw=_range(entries, "yaw", (-180.0, 180.0), MOST_TURN),
        speed=entries.number("speed", speed, low=0.001, high=100.0),
        turn=entries.number("turn", turn, low=0.1, high=10000.0),
        cost=entries.number("cost", 1.0, low=0.0, high=1e6),
    )
    entries.done()
    return base


def standing_from(slices: int) -> int:
    """Return the first slice of a phase of so many, from 0, in which a person who may step stands.

    >>> standing_from(10)
    5
    """
    return int(WALKING_SHARE * slices)


def _range(entries: TomlTable, key: str, default: tuple[float, float], widest: float) -> tuple[float, float]:
    low, high = entries.vector(key, 2, default, -widest, widest)
    if high < low:
        raise SceneError(f"{entries.where}: {key} is [{low:g}, {high:g}], expected [lowest, highest]")
    return low, high
