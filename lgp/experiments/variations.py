"""What if the scene's free choices were others: each one, and the weight of the ergonomic cost, 20 % less and more.

Every choice that the scene file lists with its keys is varied; keys that say the same of several things (the positions
of the three tables) are varied together.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from lgp.scene.model import Scene
from lgp.scene.scene_file import load_scene

FACTORS: Final = (0.8, 1.2)
WEIGHT: Final = "weight of the ergonomic cost"


@dataclass(frozen=True)
class SceneVariation:
    """One choice multiplied by a factor.

    Attributes:
        choice: what is varied, in words.
        factor: by which.
        changes: dotted key of the scene file -> value, as JSON text (so that a variation can be a key).
        weight: of the ergonomic cost.
    """

    choice: str
    factor: float
    changes: str = "{}"
    weight: float = 1.0

    @property
    def name(self) -> str:
        """A name for its folder."""
        words = "".join(letter if letter.isalnum() else " " for letter in self.choice).split()
        return "_".join([*words, f"{self.factor:g}"])

    def scene(self, name: str) -> Scene:
        """Return a shipped scene with the changes."""
        return load_scene(name, json.loads(self.changes))


BASELINE: Final = SceneVariation("as it is", 1.0)


def variations(scene: Scene) -> tuple[SceneVariation, ...]:
    """Return the scene as it is, then every free choice by every factor.

    Example:
        >>> [one.name for one in variations(load_scene("screwdriver"))][:3]
        ['as_it_is_1', 'tables_left_center_right_position_0.8', 'tables_left_center_right_position_1.2']
    """
    found = [BASELINE]
    for label, keys in _groups(scene).items():
        values = {key: _value(scene.values, key) for key in keys}
        for factor in FACTORS:
            changes = {key: _times(value, factor) for key, value in values.items()}
            found.append(SceneVariation(label, factor, json.dumps(changes)))
    return (*found, *(SceneVariation(WEIGHT, factor, weight=factor) for factor in FACTORS))


def _groups(scene: Scene) -> dict[str, list[str]]:
    """Return what is varied together: words -> keys that differ in one part only."""
    found: dict[str, list[str]] = {}
    for choice in scene.choices:
        by_end: dict[str, list[str]] = {}
        for key in choice.keys:
            by_end.setdefault(key.rpartition(".")[2], []).append(key)
        for end, keys in by_end.items():
            parts = [key.split(".")[:-1] for key in keys]
            shared = [
                ", ".join(dict.fromkeys(part[at] for part in parts)) for at in range(min(len(part) for part in parts))
            ]
            found[": ".join([" ".join(shared), end]) if shared else end] = keys
    return found


def _value(values: Mapping[str, Any], key: str) -> Any:
    inner: Any = values
    for part in key.split("."):
        inner = inner[part]
    return inner


def _times(value: Any, factor: float) -> Any:
    if isinstance(value, list):
        return [_times(part, factor) for part in value]
    return round(value * factor, 6)
