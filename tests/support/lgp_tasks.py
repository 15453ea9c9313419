"""The screwdriver task for tests of logic and search."""

from __future__ import annotations

from lgp.logic.pddl import load_domain
from lgp.logic.task import Task, ground, parse_atom

OBJECTS = {
    "human.right_hand": "human_hand",
    "baxter.left": "robot_hand",
    "baxter.right": "robot_hand",
    "screwdriver": "thing",
    "table.start": "table",
    "table.left": "table",
    "table.center": "table",
}


INITIAL = [
    "free(human.right_hand)",
    "free(baxter.left)",
    "free(baxter.right)",
    "on_table(screwdriver)",
    "placed(screwdriver, table.start)",
]


GOAL = "grasped(human.right_hand, screwdriver)"


DOMAIN = load_domain("screwdriver")


def screwdriver(goal: str = GOAL, initial: list[str] = INITIAL) -> Task:
    return ground(DOMAIN, OBJECTS, map(parse_atom, initial), [parse_atom(goal)])
