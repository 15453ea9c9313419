"""Steps of persons in words: how far and where to one goes before an action, seen as one stands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np

from lgp.motion import Motion
from lgp.page.sentences import Instruction, person_in_words, table
from lgp.scene.model import Human
from reba.arrays import Array

LEAST: Final = (0.05, 10.0)
"""[m, deg] Smaller steps and turns are not said."""


def with_steps(lines: Sequence[Instruction], motion: Motion) -> tuple[Instruction, ...]:
    """Return the instructions of all phases, each with the steps that persons make in its phase before it."""
    people = [person for person in motion.world.scene.humans.values() if person.ground]
    if not people:
        return tuple(lines)
    rows = np.concatenate([[0], motion.phases.ends + 1])
    said = [_steps(person, motion, rows, len(motion.world.scene.humans) > 1) for person in people]
    return tuple(
        replace(line, text=" ".join([*filter(None, own), line.text])) for *own, line in zip(*said, lines, strict=True)
    )


def _steps(person: Human, motion: Motion, rows: Array, named: bool) -> list[str]:
    """Return what to say to a person in each phase, "" where it stands."""
    poses = motion.frames([person.ground])[person.ground]
    words, said = table()["words"]["step"], []
    for before, after in pairwise(rows):
        heading = poses.rotation[before]
        x, y, _ = heading.T @ (poses.position[after] - poses.position[before])
        turned = heading.T @ poses.rotation[after]
        yaw = float(np.degrees(np.arctan2(turned[1, 0], turned[0, 0])))
        parts = [
            words["far"].format(metres=abs(way), where=words[ways[int(way < 0.0)]])
            for way, ways in ((x, ("ahead", "back")), (y, ("left", "right")))
            if abs(way) > LEAST[0]
        ]
        parts = [words["walk"].format(ways=words["and"].join(parts))] if parts else []
        if abs(yaw) > LEAST[1]:
            parts.append(words["turn"].format(degrees=abs(yaw), where=words["left" if yaw > 0.0 else "right"]))
        text = words["and"].join(parts)
        if named and text:
            text = f"{person_in_words(person.name)}, {text}"
        said.append(f"{text[0].upper()}{text[1:]}." if text else "")
    return said
