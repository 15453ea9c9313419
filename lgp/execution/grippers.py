"""When grippers close and open: by what an action brings about."""

from __future__ import annotations

from lgp.execution.observation import View
from lgp.logic import Action, Task

CLOSING = ("grasped", "holding")
"""Effects (hand, object) for which the hand closes."""


def grips_after(task: Task, action: Action, view: View) -> list[tuple[str, bool]]:
    """Return the robot hands that close (True) or open (False) at the end of an action's motion.

    A gripper gives an object to a human only once their hand is at it.

    Args:
        task: of the plan.
        action: whose motion is over.
        view: the tracked world.
    """
    hands = view.world.scene.hands
    robots = {name for name, hand in hands.items() if hand.agent != "human"}
    taking = [name for name in action.arguments if name in hands and name not in robots]
    things = [name for name in action.arguments if name in view.world.scene.things]
    found: list[tuple[str, bool]] = []
    for atom in task.holding(action.adds):
        hand = atom.arguments[0] if atom.arguments else ""
        if hand not in robots:
            continue
        if atom.predicate in CLOSING:
            found.append((hand, True))
        elif atom.predicate == "free" and all(
            view.gap(taker, thing) <= view.tolerances.reach and view.moves_with(thing, taker)
            for taker in taking
            for thing in things
        ):
            found.append((hand, False))
    return found
