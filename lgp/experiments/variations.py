"""Scene variations of the sensitivity analysis, one parameter at a time.

Every choice that the scene file lists with its keys is varied by 20 %; equal keys of several objects (the positions of
the three tables) are varied together. What may be off by more, the weight of the ergonomic cost first of all, is swept
over the values of `sweeps.toml`.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Final

from lgp.scene.model import Scene
from lgp.scene.scene_file import read_scene
from reba.report.page import read

FACTORS: Final = (0.8, 1.2)
"""Factors on a free choice of the scene."""
WEIGHT_KEY: Final = "cost.weight"
"""Key of the weight of the ergonomic cost, of which a figure is drawn."""


@dataclass(frozen=True)
class SceneVariation:
    """One parameter of the scene with another value.

    Attributes:
        choice: label of the parameter.
        setting: of it, as text: a factor or the value.
        changes: dotted key of the scene file -> value, as JSON text (so that a variation is hashable).
    """

    choice: str
    setting: str
    changes: str = "{}"

    @property
    def name(self) -> str:
        """Folder name of its runs."""
        words = "".join(letter if letter.isalnum() else " " for letter in self.choice).split()
        return "_".join([*words, *self.setting.split()])

    def scene(self, base: Scene) -> Scene:
        """Return a scene with the changes."""
        return read_scene(base.values, base.name, json.loads(self.changes)) if self.changes != "{}" else base


BASELINE: Final = SceneVariation("as it is", "")
"""The unchanged scene."""


def variations(scene: Scene) -> tuple[SceneVariation, ...]:
    """Baseline, then every free choice of the scene by every factor, then the sweeps without the scene's own values.

    >>> from lgp.scene.scene_file import load_scene
    >>> [one.name for one in variations(load_scene("screwdriver"))][:3]
    ['as_it_is', 'tables_left_center_right_position_x_0.8', 'tables_left_center_right_position_x_1.2']
    """
    varied = [BASELINE]
    for label, keys in _groups(scene).items():
        values = {key: _value(scene.values, key) for key in keys}
        for factor in FACTORS:
            changes = {key: _scaled(value, factor) for key, value in values.items()}
            varied.append(SceneVariation(label, f"x {factor:g}", json.dumps(changes)))
    return (*varied, *(one for sweep in _sweeps() for one in _of_sweep(scene, sweep)))


def values_of_weight(scene: Scene) -> dict[str, float]:
    """Return the settings of the sweep of the weight of the ergonomic cost, "" for the scene's own -> weight."""
    sweep = next(one for one in _sweeps() if one["key"] == WEIGHT_KEY)
    own = scene.cost.weight
    return {"": own} | {f"x {factor:g}": own * factor for factor in sweep["factors"]}


@cache
def _sweeps() -> tuple[dict[str, Any], ...]:
    return tuple(tomllib.loads(read("lgp.experiments", "sweeps.toml"))["sweeps"])


def _of_sweep(scene: Scene, sweep: Mapping[str, Any]) -> Iterator[SceneVariation]:
    now = own_value(scene, sweep["key"])
    for factor in sweep.get("factors", ()):
        yield SceneVariation(sweep["label"], f"x {factor:g}", json.dumps({sweep["key"]: _scaled(now, factor)}))
    for value in sweep.get("values", ()):
        if value != now:
            yield SceneVariation(sweep["label"], str(value), json.dumps({sweep["key"]: value}))


def own_value(scene: Scene, key: str) -> Any:
    """Return the value of a dotted key of a scene, which its file may leave to its default."""
    inner: Any = scene
    for part in key.split("."):
        inner = getattr(inner, part)
    return inner


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
