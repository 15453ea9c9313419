"""The persons of a scene file: `[human]` for one, `[humans.NAME]` for several, each with a body of their own."""

from __future__ import annotations

import math
import re
from typing import Final

from lgp.errors import SceneError
from lgp.scene.body_measures import STATURE, table
from lgp.scene.mobile_base import read_base
from lgp.scene.model import Hand, Human
from lgp.scene.surroundings import FARTHEST
from reba.toml_table import TomlTable

FREEDOMS: Final = ("free", "axis", "jaw", "fixed")
LEGS: Final = ("planted", "solved", "locked")
SHORT: Final = "human"
"""Name of the person of `[human]`."""
WALKING: Final = (1.2, 120.0)
"""[m/s, deg/s] Largest speeds of a person who steps: walking pace of adults in comfort is 1.2 to 1.4 m/s."""
RESERVED: Final = ("table", "obstacle")
"""First parts of names that are not those of agents."""


def read_people(entries: TomlTable) -> dict[str, Human]:
    """Return the persons of a scene by name, that of `[human]` first.

    Raises:
        SceneError: a key is unknown or out of range, or two persons have one name.
    """
    tables = {SHORT: entries.table(SHORT)} if entries.has(SHORT) else {}
    for name, entry in entries.tables("humans").items():
        if name in tables:
            raise SceneError(f"{entry.where}: [human] is the person {name!r} already; give one of them another name")
        if name in RESERVED or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name):
            raise SceneError(
                f"{entry.where}: {name!r} is no name of a person, expected letters, digits, _ and -, and not "
                f"{' or '.join(RESERVED)}; give another one"
            )
        tables[name] = entry
    return {name: _human(name, entry) for name, entry in tables.items()}


def payload_of(entries: TomlTable, default: float = math.inf) -> float:
    """Return the largest mass [kg] that a hand carries."""
    return entries.number("payload", low=0.0) if entries.has("payload") else default


def _human(name: str, entries: TomlTable) -> Human:
    x, y = entries.vector("position", 2, (0.0, 0.0), -FARTHEST, FARTHEST)
    hands = [f"{side}_hand" for side in ("left", "right")]
    chosen = entries.texts("hands", ("right_hand",))
    for hand in chosen:
        if hand not in hands:
            raise SceneError(f"{entries.where}: no hand {hand!r}, expected {' or '.join(hands)}")
    tilt = entries.number("tilt", 180.0, 0.0, 180.0)
    freedom = entries.text("freedom", "free", FREEDOMS)
    payload = payload_of(entries)
    legs = entries.text("legs", "solved", LEGS)
    step = read_base(entries.table("step"), *WALKING) if entries.has("step") else None
    if step is not None and legs != "solved":
        raise SceneError(
            f'{entries.where}: legs are {legs!r}, expected "solved" for one who may step; leave out `legs` or `step`'
        )
    human = Human(
        name=name,
        position=(x, y, 0.0),
        yaw=entries.number("yaw", 0.0),
        hands=tuple(Hand(name, hand, hand, 0.0, "human_hand", tilt, freedom, payload, human=True) for hand in chosen),
        locked=entries.texts("locked", ()),
        joints=entries.numbers("joints"),
        stature=entries.number("stature", 1.75, *STATURE),
        sex=entries.text("sex", "male", table()["de_leva"]),
        legs=legs,
        step=step,
    )
    entries.done()
    return human
