"""Steps of persons in words: how far and where to one goes before an action, seen as one stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from lgp.kinematics.world import World
from lgp.page.sentences import Instruction, person_in_words, table
from lgp.scene.model import Human
from reba.arrays import Array

LEAST: Final = (0.05, 10.0)
"""[m, deg] Smaller steps and turns are not said."""


def with_steps(lines: Sequence[Instruction], world: World, path: Array) -> tuple[Instruction, ...]:
    """Return instructions, each with the steps that persons make in its phase before it.

    Args:
        path: (len(lines) + 1, nq) configurations at the start of the first phase and at the end of each [rad, m].
    """
    said = [_steps(person, world, path) for person in world.scene.humans.values() if person.ground]
    return tuple(
        replace(line, text=" ".join([*filter(None, own), line.text])) for *own, line in zip(*said, lines, strict=True)
    )


def _steps(person: Human, world: World, path: Array) -> list[str]:
    """Return what to say to a person in each phase, "" where it stands."""
    kinematics = world.at(path, [person.ground])
    rotation, position = kinematics.rotation[:, 0], kinematics.position[:, 0]
    words, said = table()["words"]["step"], []
    for before, after in pairwise(range(len(path))):
        x, y, _ = rotation[before].T @ (position[after] - position[before])
        turned = rotation[before].T @ rotation[after]
        yaw = float(np.degrees(np.arctan2(turned[1, 0], turned[0, 0])))
        parts = [
            words["far"].format(metres=abs(way), where=words[ways[int(way < 0.0)]])
            for way, ways in ((x, ("ahead", "back")), (y, ("left", "right")))
            if abs(way) > LEAST[0]
        ]
        parts = [words["walk"].format(ways=words["and"].join(parts))] if parts else []
        if abs(yaw) > LEAST[1]:
            parts.append(words["turn"].format(degrees=abs(yaw), where=words["left" if yaw > 0.0 else "right"]))
        text = words["then"].join(parts)
        if text and len(world.scene.humans) > 1:
            text = f"{person_in_words(person.name)}, {text}"
        said.append(f"{text[0].upper()}{text[1:]}." if text else "")
    return said
