"""Variants of the paper's experiments: what the paper leaves open, and what each variant takes for it, as data."""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Final

from lgp.errors import LgpError
from lgp.scene.model import FreeParameter, Scene
from lgp.scene.people import SHORT
from lgp.scene.scene_file import load_scene
from reba.errors import did_you_mean
from reba.report.page import read

VARIANT: Final = "paper"
"""The default: the experiments repeat the paper."""


@dataclass(frozen=True)
class Variant:
    """A variant: keys of the scene file that it sets, whether bodies stay apart, and why."""

    name: str
    title: str
    collisions: bool
    changes: Mapping[str, Any]
    assumptions: tuple[FreeParameter, ...]

    def scene(self, which: str | Path, changes: Mapping[str, Any] | None = None) -> Scene:
        """Return a scene, a shipped name or a file, with the changes of the variant and then others.

        Raises:
            SceneError: there is no such scene, or it does not take a change.
        """
        return load_scene(which, {**self.changes, **(changes or {})})

    def left_open(self, scene: Scene) -> tuple[FreeParameter, ...]:
        """Return the free choices of a scene, without those that the variant makes."""
        return tuple(one for one in scene.choices if not set(one.keys) <= set(self.changes))


@cache
def variants() -> dict[str, Variant]:
    """Return the variants by name.

    >>> sorted(variants())
    ['ours', 'paper', 'paper-left', 'paper-rigid']
    """
    known: dict[str, Variant] = {}
    for name, entry in tomllib.loads(read("lgp.experiments", "variants.toml")).items():
        base = known.get(entry.get("like", ""))
        known[name] = Variant(
            name,
            entry["title"],
            entry.get("collisions", base is not None and base.collisions),
            {**(base.changes if base else {}), **entry["changes"]},
            (*(base.assumptions if base else ()), *_assumptions(entry)),
        )
    return known


def variant_of(name: str) -> Variant:
    """Return the variant of a name.

    Raises:
        LgpError: there is none.
    """
    known = variants()
    if name not in known:
        raise LgpError(f"variant is {name!r}; expected one of {', '.join(known)}{did_you_mean(str(name), known)}")
    return known[name]


def setting(
    name: str,
    scene: str | Path,
    cost: str | Path | None,
    weight: float | None,
    phase_seconds: float | None,
    *,
    needs: Sequence[str] = (),
) -> tuple[Variant, Scene]:
    """Return a variant and the scene with its changes, then those of options that are not None.

    Args:
        needs: tables and objects that the experiment is about.

    Raises:
        LgpError: there is no such variant or scene, the scene has not one person, lacks what is needed or what the
            variant changes, or a value is out of range.
    """
    given = {"cost.model": None if cost is None else str(cost), "phase_seconds": phase_seconds}
    given |= {} if weight is None else {"cost.weight": weight, "cost.per": "second"}
    chosen, plain = variant_of(name), load_scene(scene)
    people, known = list(plain.humans), {*plain.tables, *plain.objects}
    if people != [SHORT]:
        named = ", ".join(people) or "none"
        raise LgpError(f"{scene}: its persons are {named}, expected one, the [human]; give a scene with one")
    lacking = [one for one in needs if one not in known]
    if lacking:
        raise LgpError(f"{scene}: has no {lacking[0]}, expected {', '.join(needs)}; give a scene with these")
    changed = {key.split(".")[1] for key in chosen.changes if key.startswith("objects.")}
    if other := sorted(changed - set(plain.objects)):
        raise LgpError(f"{scene}: has no {other[0]}, which the variant {name} changes; give another variant")
    return chosen, chosen.scene(scene, {key: value for key, value in given.items() if value is not None})


def settings_of(experiment: str, chosen: Variant, scene: Scene, collisions: bool) -> dict[str, Any]:
    """Return what identifies the runs of a variant: the scene counts by all of its values."""
    values = json.dumps(scene.values, sort_keys=True)
    return {
        "experiment": experiment,
        "variant": chosen.name,
        "scene": scene.name,
        "scene_hash": hashlib.sha256(values.encode()).hexdigest()[:16],
        "phase_seconds": scene.phase_seconds,
        "slices": scene.slices,
        "weight": scene.cost.weight,
        "per": scene.cost.per,
        "collisions": collisions,
    }


def _assumptions(entry: Mapping[str, Any]) -> tuple[FreeParameter, ...]:
    return tuple(FreeParameter(tuple(one["keys"]), one["reason"]) for one in entry.get("assumptions", ()))
