"""Start and end predicates of an action: its preconditions and effects, read off the tracked world."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from lgp.execution.tracking import TrackedWorld
from lgp.logic.task import Action, Atom, Task


@dataclass(frozen=True)
class Predicate:
    """An atom that is to hold, or with `wanted` False is not to hold."""

    atom: Atom
    wanted: bool = True

    def __str__(self) -> str:
        return str(self.atom) if self.wanted else f"not {self.atom}"

    def check(self, view: TrackedWorld, believed: bool) -> PredicateState:
        """Return whether it holds.

        Args:
            view: the tracked world.
            believed: what the plan says about the atom, for those that have no geometry.
        """
        found = evaluate_predicate(view, self.atom)
        if found is None:
            return PredicateState(believed == self.wanted, f"{self} is not so by the plan")
        if self.wanted or found.holds is None:
            return PredicateState(found.holds, found.why or f"{self} does not hold")
        return PredicateState(not found.holds, f"{self.atom} holds")


def start_of(task: Task, action: Action) -> tuple[Predicate, ...]:
    """Return what is to hold before an action begins: its preconditions.

    Atoms without geometry come last, so that what is seen is told first.
    """
    return tuple(Predicate(atom) for atom in task.holding(action.needs)) + tuple(
        Predicate(atom, False) for atom in task.holding(action.forbids)
    )


def end_of(task: Task, action: Action) -> tuple[Predicate, ...]:
    """Return what is to hold for an action to be finished: what it brings about."""
    return tuple(Predicate(atom) for atom in task.holding(action.adds))


def check(predicates: tuple[Predicate, ...], view: TrackedWorld, task: Task, state: int) -> dict[str, PredicateState]:
    """Return the verdict on each predicate, by its text.

    Args:
        predicates: of the start or the end of an action.
        view: the tracked world.
        task: whose atoms they are.
        state: what the plan says holds, for atoms without geometry.
    """
    believed = set(task.holding(state))
    return {str(one): one.check(view, one.atom in believed) for one in predicates}


def all_hold(verdicts: dict[str, PredicateState]) -> bool:
    """Return whether all hold for sure."""
    return all(verdict.holds for verdict in verdicts.values())


def first_failing(verdicts: dict[str, PredicateState]) -> str:
    """Return why the first that does not hold does not, "" if all hold."""
    return next((verdict.why for verdict in verdicts.values() if not verdict.holds), "")


TOGETHER = 0.04
"""[m] Parts that are to be screwed together stand this near to where their joint has them."""


class PredicateState(NamedTuple):
    """Whether an atom holds (None: it cannot be told) and why not."""

    holds: bool | None
    why: str = ""


def grasped(view: TrackedWorld, hand: str, thing: str) -> PredicateState:
    """Return whether a hand has an object: it is at the grasping point and moves with the hand."""
    if _unsure(view, thing):
        return PredicateState(None, _unsure(view, thing))
    if view.gap(hand, thing) > view.tolerances.reach:
        return PredicateState(False, f"{thing} is {view.gap(hand, thing):.2f} m away from {hand}")
    if not _human(view, hand):
        if hand not in view.now.closed:
            return PredicateState(False, f"{hand} is open")
    elif _in_gripper(view, thing):
        return PredicateState(False, f"{thing} is still in a gripper")
    if not view.moves_with(thing, hand):
        return PredicateState(False, f"{thing} does not move with {hand}")
    return PredicateState(True)


def free(view: TrackedWorld, hand: str) -> PredicateState:
    """Return whether a hand has nothing: a gripper is open, a human hand is at no object that is off the tables."""
    if not _human(view, hand):
        return PredicateState(hand not in view.now.closed, f"{hand} is closed")
    for thing in view.world.scene.objects:
        if view.seen(thing) is None or view.gap(hand, thing) > view.tolerances.reach:
            continue
        if not view.table_under(thing) and not _in_gripper(view, thing):
            return PredicateState(False, f"{hand} has {thing}")
    return PredicateState(True)


def on_table(view: TrackedWorld, thing: str) -> PredicateState:
    """Return whether an object rests on any table."""
    if _unsure(view, thing):
        return PredicateState(None, _unsure(view, thing))
    if not view.table_under(thing):
        return PredicateState(False, f"{thing} lies on no table")
    return PredicateState(view.rests(thing), f"{thing} moves")


def placed(view: TrackedWorld, thing: str, table: str) -> PredicateState:
    """Return whether an object rests on a certain table."""
    found = on_table(view, thing)
    if found.holds and view.table_under(thing) != table:
        return PredicateState(False, f"{thing} lies on {view.table_under(thing)}, not on {table}")
    return found


def holding(view: TrackedWorld, hand: str, thing: str) -> PredicateState:
    """Return whether a hand keeps an object where it stands."""
    if _unsure(view, thing):
        return PredicateState(None, _unsure(view, thing))
    if view.gap(hand, thing) > view.tolerances.reach:
        return PredicateState(False, f"{hand} is {view.gap(hand, thing):.2f} m away from {thing}")
    if not _human(view, hand) and hand not in view.now.closed:
        return PredicateState(False, f"{hand} is open")
    return PredicateState(view.moves_with(thing, hand), f"{hand} is not at rest at {thing}")


def held(view: TrackedWorld, thing: str) -> PredicateState:
    """Return whether any hand keeps an object where it stands."""
    found = [holding(view, hand, thing) for hand in view.world.scene.hands]
    return next((one for one in found if one.holds), PredicateState(found[0].holds, f"no hand holds {thing}"))


def screwed(view: TrackedWorld, first: str, second: str) -> PredicateState:
    """Return whether a human hand rests at the screw of two parts that stand as their joint has them."""
    for joint in view.world.scene.assemblies:
        if set(joint.parts) != {first, second}:
            continue
        base, other = view.seen(joint.parts[0]), view.seen(joint.parts[1])
        if base is None or other is None:
            return PredicateState(None, f"{joint.parts[0] if base is None else joint.parts[1]} is not seen")
        apart = np.linalg.norm(base.position + base.rotation @ np.array(joint.position) - other.position)
        if apart > TOGETHER:
            return PredicateState(False, f"{joint.parts[1]} stands {apart:.2f} m away from where it is screwed on")
        screw = base.position + base.rotation @ np.array(joint.screw)
        reach = joint.tool + view.tolerances.reach
        for hand in view.world.scene.hands:
            near = np.linalg.norm(view.hand(hand).position - screw) <= reach
            if _human(view, hand) and near and view.moves_with(joint.parts[0], hand):
                return PredicateState(True)
        return PredicateState(False, "no hand is at the screw")
    return PredicateState(None, f"nothing is known about how {first} and {second} are joined")


RECOGNISERS: Final[dict[str, Callable[..., PredicateState]]] = {
    "grasped": grasped,
    "free": free,
    "on_table": on_table,
    "placed": placed,
    "holding": holding,
    "held": held,
    "screwed": screwed,
}
"""Predicate of a domain -> what it means; others are taken as the plan has them."""


def evaluate_predicate(view: TrackedWorld, atom: Atom) -> PredicateState | None:
    """Return whether an atom holds in the tracked world, None if its predicate has no geometry."""
    known = RECOGNISERS.get(atom.predicate)
    return None if known is None else known(view, *atom.arguments)


def _unsure(view: TrackedWorld, thing: str) -> str:
    """Return why nothing can be said about an object, "" if something can."""
    if view.seen(thing) is None:
        return f"{thing} is not seen"
    return "" if view.watched(thing) else f"{thing} was seen for a moment only"


def _human(view: TrackedWorld, hand: str) -> bool:
    return view.world.scene.hands[hand].agent == "human"


def _in_gripper(view: TrackedWorld, thing: str) -> bool:
    """Return whether a closed gripper is at an object."""
    return any(view.gap(hand, thing) <= view.tolerances.reach for hand in view.now.closed)


CLOSING = ("grasped", "holding")
"""Effects (hand, object) for which the hand closes."""


def gripper_commands(task: Task, action: Action, view: TrackedWorld) -> list[tuple[str, bool]]:
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
    things = [name for name in action.arguments if name in view.world.scene.objects]
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
