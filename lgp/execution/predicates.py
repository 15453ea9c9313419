"""Start and end predicates of an action: its PDDL preconditions and effects, evaluated in the tracked world."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from lgp.execution.tracking import TrackedWorld
from lgp.logic.task import Action, Atom, Task


@dataclass(frozen=True)
class Predicate:
    """An atom that is required to hold, or with `wanted` False not to hold."""

    atom: Atom
    wanted: bool = True

    def __str__(self) -> str:
        return str(self.atom) if self.wanted else f"not {self.atom}"

    def check(self, view: TrackedWorld, nominal: bool) -> PredicateState:
        """Return whether it holds; an atom without geometry holds if it does so in the plan (`nominal`)."""
        state = evaluate_predicate(view, self.atom)
        if state is None:
            return PredicateState(nominal == self.wanted, f"{self} does not hold by the plan")
        if self.wanted or state.holds is None:
            return PredicateState(state.holds, state.why or f"{self} does not hold")
        return PredicateState(not state.holds, f"{self.atom} holds")


def start_of(task: Task, action: Action) -> tuple[Predicate, ...]:
    """Return the start predicates of an action: its preconditions, negative ones last."""
    return tuple(Predicate(atom) for atom in task.holding(action.needs)) + tuple(
        Predicate(atom, False) for atom in task.holding(action.forbids)
    )


def end_of(task: Task, action: Action) -> tuple[Predicate, ...]:
    """Return the end predicates of an action: its add effects."""
    return tuple(Predicate(atom) for atom in task.holding(action.adds))


def check(predicates: tuple[Predicate, ...], view: TrackedWorld, task: Task, state: int) -> dict[str, PredicateState]:
    """Return the state of each predicate, by its text; atoms without geometry hold as in the planned `state` (bits)."""
    nominal = set(task.holding(state))
    return {str(one): one.check(view, one.atom in nominal) for one in predicates}


def all_hold(states: dict[str, PredicateState]) -> bool:
    """Return whether all predicates are known to hold."""
    return all(state.holds for state in states.values())


def first_failing(states: dict[str, PredicateState]) -> str:
    """Return the reason of the first predicate that does not hold, "" if all hold."""
    return next((state.why for state in states.values() if not state.holds), "")


TOGETHER = 0.04
"""[m] Largest deviation of two parts from the relative position of their joint at which they can be screwed."""


class PredicateState(NamedTuple):
    """Whether an atom holds (None: unknown), and the reason if not."""

    holds: bool | None
    why: str = ""


def grasped(view: TrackedWorld, hand: str, object_name: str) -> PredicateState:
    """Return whether an object is in a hand: at its grasping point and moving with it."""
    if _unsure(view, object_name):
        return PredicateState(None, _unsure(view, object_name))
    if view.gap(hand, object_name) > view.tolerances.reach:
        return PredicateState(False, f"{object_name} is {view.gap(hand, object_name):.2f} m away from {hand}")
    if not _human(view, hand):
        if hand not in view.now.closed:
            return PredicateState(False, f"{hand} is open")
    elif _in_gripper(view, object_name):
        return PredicateState(False, f"{object_name} is still in a gripper")
    if not view.moves_with(object_name, hand):
        return PredicateState(False, f"{object_name} does not move with {hand}")
    return PredicateState(True)


def free(view: TrackedWorld, hand: str) -> PredicateState:
    """Return whether a hand is empty: a gripper is open, a human hand is at no object that is off the tables."""
    if not _human(view, hand):
        return PredicateState(hand not in view.now.closed, f"{hand} is closed")
    for object_name in view.world.scene.objects:
        if view.seen(object_name) is None or view.gap(hand, object_name) > view.tolerances.reach:
            continue
        if not view.table_under(object_name) and not _in_gripper(view, object_name):
            return PredicateState(False, f"{hand} has {object_name}")
    return PredicateState(True)


def on_table(view: TrackedWorld, object_name: str) -> PredicateState:
    """Return whether an object rests on any table."""
    if _unsure(view, object_name):
        return PredicateState(None, _unsure(view, object_name))
    if not view.table_under(object_name):
        return PredicateState(False, f"{object_name} lies on no table")
    return PredicateState(view.rests(object_name), f"{object_name} moves")


def placed(view: TrackedWorld, object_name: str, table: str) -> PredicateState:
    """Return whether an object rests on a certain table."""
    state = on_table(view, object_name)
    if state.holds and view.table_under(object_name) != table:
        return PredicateState(False, f"{object_name} lies on {view.table_under(object_name)}, not on {table}")
    return state


def holding(view: TrackedWorld, hand: str, object_name: str) -> PredicateState:
    """Return whether a hand holds an object in place: at rest at it."""
    if _unsure(view, object_name):
        return PredicateState(None, _unsure(view, object_name))
    if view.gap(hand, object_name) > view.tolerances.reach:
        return PredicateState(False, f"{hand} is {view.gap(hand, object_name):.2f} m away from {object_name}")
    if not _human(view, hand) and hand not in view.now.closed:
        return PredicateState(False, f"{hand} is open")
    return PredicateState(view.moves_with(object_name, hand), f"{hand} is not at rest at {object_name}")


def held(view: TrackedWorld, object_name: str) -> PredicateState:
    """Return whether any hand holds an object in place."""
    states = [holding(view, hand, object_name) for hand in view.world.scene.hands]
    return next((one for one in states if one.holds), PredicateState(states[0].holds, f"no hand holds {object_name}"))


def screwed(view: TrackedWorld, first: str, second: str) -> PredicateState:
    """Return whether two parts stand as their joint has them, with a human hand at rest at the screw."""
    for joint in view.world.scene.assemblies:
        if set(joint.parts) != {first, second}:
            continue
        base, other = view.seen(joint.parts[0]), view.seen(joint.parts[1])
        if base is None or other is None:
            return PredicateState(None, f"{joint.parts[0] if base is None else joint.parts[1]} is not seen")
        distance = np.linalg.norm(base.position + base.rotation @ np.array(joint.position) - other.position)
        if distance > TOGETHER:
            return PredicateState(False, f"{joint.parts[1]} stands {distance:.2f} m away from where it is screwed on")
        screw = base.position + base.rotation @ np.array(joint.screw)
        reach = joint.tool + view.tolerances.reach
        for hand in view.world.scene.hands:
            near = np.linalg.norm(view.hand(hand).position - screw) <= reach
            if _human(view, hand) and near and view.moves_with(joint.parts[0], hand):
                return PredicateState(True)
        return PredicateState(False, "no hand is at the screw")
    return PredicateState(None, f"the scene has no joint of {first} and {second}")


RECOGNISERS: Final[dict[str, Callable[..., PredicateState]]] = {
    "grasped": grasped,
    "free": free,
    "on_table": on_table,
    "placed": placed,
    "holding": holding,
    "held": held,
    "screwed": screwed,
}
"""PDDL predicate -> its geometric meaning; all others hold as in the plan."""


def evaluate_predicate(view: TrackedWorld, atom: Atom) -> PredicateState | None:
    """Return whether an atom holds in the tracked world, None if its predicate has no geometry."""
    known = RECOGNISERS.get(atom.predicate)
    return None if known is None else known(view, *atom.arguments)


def _unsure(view: TrackedWorld, object_name: str) -> str:
    """Return the reason if the state of an object is unknown, else ""."""
    if view.seen(object_name) is None:
        return f"{object_name} is not seen"
    return "" if view.watched(object_name) else f"{object_name} was seen for a moment only"


def _human(view: TrackedWorld, hand: str) -> bool:
    return view.world.scene.hands[hand].agent == "human"


def _in_gripper(view: TrackedWorld, object_name: str) -> bool:
    """Return whether a closed gripper is at an object."""
    return any(view.gap(hand, object_name) <= view.tolerances.reach for hand in view.now.closed)


CLOSING = ("grasped", "holding")
"""Effects (hand, object) that close the gripper."""


def gripper_commands(task: Task, action: Action, view: TrackedWorld) -> list[tuple[str, bool]]:
    """Return the grippers that close (True) or open (False) at the end of an action's motion.

    A gripper releases an object to a human once their hand is at rest at it.
    """
    hands = view.world.scene.hands
    robots = {name for name, hand in hands.items() if hand.agent != "human"}
    taking = [name for name in action.arguments if name in hands and name not in robots]
    object_names = [name for name in action.arguments if name in view.world.scene.objects]
    commands: list[tuple[str, bool]] = []
    for atom in task.holding(action.adds):
        hand = atom.arguments[0] if atom.arguments else ""
        if hand not in robots:
            continue
        if atom.predicate in CLOSING:
            commands.append((hand, True))
        elif atom.predicate == "free" and all(
            view.gap(taker, object_name) <= view.tolerances.reach and view.moves_with(object_name, taker)
            for taker in taking
            for object_name in object_names
        ):
            commands.append((hand, False))
    return commands
