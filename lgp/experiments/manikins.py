"""The family of manikins: persons of several statures and both sexes for whom one workplace is made, as data."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache

from lgp.scene.model import Scene
from lgp.scene.scene_file import read_scene
from reba.report.page import read


@dataclass(frozen=True)
class Manikin:
    """A member of the family; stature in metres."""

    name: str
    sex: str
    stature: float

    def scene(self, base: Scene) -> Scene:
        """Return a scene with this person in it.

        Raises:
            SceneError: the scene has no human.
        """
        return read_scene(base.values, base.name, {"human.sex": self.sex, "human.stature": self.stature})


@dataclass(frozen=True)
class Family:
    """All members, and where their statures come from."""

    title: str
    source: str
    members: tuple[Manikin, ...]


@cache
def family() -> Family:
    """Return the family that the package ships.

    >>> [one.name for one in family().members][:2]
    ['female 5th', 'female 50th']
    """
    values = tomllib.loads(read("lgp.experiments", "manikins.toml"))
    return Family(values["title"], values["source"], tuple(Manikin(**one) for one in values["members"]))
