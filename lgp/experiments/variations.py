"""Scene variations of the sensitivity analysis: each free parameter and the ergonomic weight, 20 % lower and higher.

Every choice that the scene file lists with its keys is varied, one at a time; equal keys of several objects (the
positions of the three tables) are varied together.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from lgp.scene.model import Scene
from lgp.scene.scene_file import load_scene

FACTORS: Final = (0.8, 1.2)
"""Factors on a varied value."""
WEIGHT: Final = "weight of the ergonomic cost"
"""Label of the variation that changes no scene parameter."""


@dataclass(frozen=True)
class SceneVariation:
    """One free choice of the scene, given by its label, or the weight of the ergonomic cost, multiplied by a factor.

    Attributes:
        changes: dotted key of the scene file -> value, as JSON text (so that a variation is hashable).
    """

    choice: str
    factor: float
    changes: str = "{}"
    weight: float = 1.0

    @property
    def name(self) -> str:
        """Folder name of its runs."""
        words = "".join(letter if letter.isalnum() else " " for letter in self.choice).split()
        return "_".join([*words, f"{self.factor:g}"])

    def scene(self, name: str) -> Scene:
        """Shipped scene with the changes."""
        return load_scene(name, json.loads(self.changes))


BASELINE: Final = SceneVariation("as it is", 1.0)
"""The unchanged scene."""


def variations(scene: Scene) -> tuple[SceneVariation, ...]:
    """Baseline, then every free choice of the scene by every factor.

    >>> [one.name for one in variations(load_scene("screwdriver"))][:3]
    ['as_it_is_1', 'tables_left_center_right_position_0.8', 'tables_left_center_right_position_1.2']
    """
    varied = [BASELINE]
    for label, keys in _groups(scene).items():
        values = {key: _value(scene.values, key) for key in keys}
        for factor in FACTORS:
            changes = {key: _scaled(value, factor) for key, value in values.items()}
            varied.append(SceneVariation(label, factor, json.dumps(changes)))
    return (*varied, *(SceneVariation(WEIGHT, factor, weight=factor) for factor in FACTORS))


def _groups(scene: Scene) -> dict[str, list[str]]:
    """Parameters that are varied together: label -> keys that differ in one part only."""
    groups: dict[str, list[str]] = {}
    for choice in scene.choices:
        by_end: dict[str, list[str]] = {}
        for key in choice.keys:
            by_end.setdefault(key.rpartition(".")[2], []).append(key)
        for end, keys in by_end.items():
            parts = [key.split(".")[:-1] for key in keys]
            shared = [
                ", ".join(dict.fromkeys(part[depth] for part in parts))
                for depth in range(min(len(part) for part in parts))
            ]
            groups[": ".join([" ".join(shared), end]) if shared else end] = keys
    return groups


def _value(values: Mapping[str, Any], key: str) -> Any:
    inner: Any = values
    for part in key.split("."):
        inner = inner[part]
    return inner


def _scaled(value: Any, factor: float) -> Any:
    if isinstance(value, list):
        return [_scaled(part, factor) for part in value]
    return round(value * factor, 6)
