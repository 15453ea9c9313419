"""A small plan to execute, made once: a robot brings the screwdriver, the human takes it."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Any

import lgp
from lgp.execution.events import Event
from lgp.execution.faults import parse_fault
from lgp.execution.session import ExecutionRun, RunOptions
from lgp.execution.worker import EXACT

CODED = re.compile(r"[a-z]\.[a-z]|_|\w\(")
"""What the name of a hand or table, or an action as a plan prints it, has in it."""
SEQUENCE = (
    "grasp(baxter.right, screwdriver)",
    "place(baxter.right, screwdriver, table.left)",
    "grasp(human.right_hand, screwdriver)",
)


@cache
def small_plan() -> lgp.Plan:
    """Return a plan without ergonomics, which is replanned quickly."""
    scene = lgp.load_scene("screwdriver").with_heights({"left": 0.9, "center": 1.0, "right": 1.2})
    return lgp.plan(scene, None, sequence=SEQUENCE, slices=4)


def saved(folder: Path) -> Path:
    """Return a folder with the plan."""
    small_plan().save(folder)
    return folder


def went(folder: Path, *faults: str, **more: Any) -> tuple[dict[str, Any], list[Event]]:
    """Run the plan in a folder as fast as possible; return the summary and all events, which are in words."""
    events: list[Event] = []
    chosen = {"speed": 0.0, "compare": False, "behaviour": EXACT, **more}
    run = RunOptions(faults=tuple(map(parse_fault, faults)), **chosen)
    summary = ExecutionRun(folder, run, events.append).go()
    coded = [event.text for event in events if CODED.search(event.text)]
    assert not coded, "people read the texts of events"
    return summary, events


def kinds(events: list[Event]) -> list[str]:
    """Return the kinds of events."""
    return [event.kind for event in events]
