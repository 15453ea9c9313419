"""Small tasks in which any hand may do any action: a box between a person with two hands and two robots."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import lgp
from lgp.scene.model import Scene
from lgp.scene.scene_file import read_scene

HANDS = {
    "human": ("human.left_hand", "human.right_hand"),
    "baxter": ("baxter.left", "baxter.right"),
    "panda": ("panda.hand",),
}
"""Agent -> its hands."""
DOMAIN = Path(__file__).with_name("every_hand.pddl")
ROBOTS: dict[str, dict[str, Any]] = {
    "baxter": {"model": "baxter", "position": [1.2, 0.0], "yaw": 180},
    "panda": {"model": "panda", "position": [0.62, 0.65, 0.6], "yaw": -90},
}
LID = {
    "parts": ["box", "lid"],
    "position": [0.0, 0.06, 0.0],
    "screw": [0.1, 0.03, 0.02],
    "along": [0, 0, -1],
    "tool": 0.15,
}


def agents_of(hands: Iterable[str]) -> list[str]:
    """Return the agents of some hands."""
    return [agent for agent, own in HANDS.items() if set(own) & set(hands)]


def scene_of(agents: Sequence[str], goal: Sequence[str], in_hand: str = "", **more: Any) -> Scene:
    """Return a scene with a box on the table, or in a hand, and a lid at the place where it is screwed on.

    Args:
        more: other values of the scene.
    """
    hands = [hand for agent in agents for hand in HANDS[agent]]
    box = {"size": [0.2, 0.04, 0.04], "mass": 0.3, "on": "table.center", "at": [0.0, -0.06, 0.0], "slide": 0.07}
    first = [f"grasped({in_hand}, box)"] if in_hand else ["on_table(box)", "placed(box, table.center)"]
    first += ["on_table(lid)", "placed(lid, table.center)", "fit(box, lid)"]
    values: dict[str, Any] = {
        "domain": str(DOMAIN),
        "goal": list(goal),
        "initial": [*first, *(f"free({hand})" for hand in hands if hand != in_hand)],
        "phase_seconds": 1.0,
        "slices": 4,
        "robots": {agent: ROBOTS[agent] for agent in agents if agent != "human"},
        "tables": {"center": {"position": [0.62, 0.0], "size": [0.4, 0.5], "height": 0.8}},
        "objects": {"box": box | ({"hand": in_hand} if in_hand else {}), "lid": box | {"at": [0.0, 0.0, 0.0]}},
        "joints": [LID],
    }
    if "human" in agents:
        values["human"] = {"hands": [hand.partition(".")[2] for hand in HANDS["human"]]}
    return read_scene(values | more, "every_hand")


def planned(scene: Scene, *sequence: str) -> lgp.Plan:
    """Return the plan of a sequence, without ergonomics and collisions."""
    return lgp.plan(scene, None, sequence=sequence, collisions=False)
