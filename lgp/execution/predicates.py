"""Start and end predicates of an action: its PDDL preconditions and effects, evaluated in the tracked world."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from lgp.execution.tracking import TrackedWorld
from lgp.kinematics.actions import kind_of
from lgp.logic.task import Action, Atom, Task
from lgp.scene.model import Scene

CLOSING = ("grasped", "holding")
"""Atoms (hand, object) with which a gripper is closed."""


@dataclass(frozen=True)
class Predicate:
    """An atom that is required to hold, or with `wanted` False not to hold."""

    atom: Atom
    wanted: bool = True

    def __str__(self) -> str:
        return str(self.atom) if self.wanted else f"not {self.atom}"

    def check(self, view: TrackedWorld, nominal: AbstractSet[Atom]) -> PredicateState:
        """Return whether it holds; `nominal` are the atoms that do so in the plan."""
        state = evaluate_predicate(view, self.atom, nominal)
        if self.wanted or state.holds is None:
            return PredicateState(state.holds, state.why or f"{self} does not hold")
        said = TRUE.get(self.atom.predicate)
        return PredicateState(not state.holds, said.format(*self.atom.arguments) if said else f"{self.atom} holds")


def start_of(task: Task, action: Action) -> tuple[Predicate, ...]:
    """Return the start predicates of an action: its preconditions, negative ones last."""
    return tuple(Predicate(atom) for atom in task.holding(action.needs)) + tuple(
        Predicate(atom, False) for atom in task.holding(action.forbids)
    )


def end_of(task: Task, action: Action) -> tuple[Predicate, ...]:
    """Return the end predicates of an action: its add effects, first what a hand takes: before, no other is free."""
    return tuple(map(Predicate, sorted(task.holding(action.adds), key=lambda atom: atom.predicate not in CLOSING)))


def check(predicates: tuple[Predicate, ...], view: TrackedWorld, task: Task, state: int) -> dict[str, PredicateState]:
    """Return the state of each predicate, by its text; atoms without geometry hold as in the planned `state` (bits)."""
    nominal = set(task.holding(state))
    return {str(one): one.check(view, nominal) for one in predicates}


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


def reached(view: TrackedWorld, hand: str, object_name: str) -> PredicateState:
    """Return whether an object is at the grasping point of a hand and does not move relative to it."""
    if _unsure(view, object_name):
        return PredicateState(None, _unsure(view, object_name))
    if view.gap(hand, object_name) > view.tolerances.reach:
        return PredicateState(False, f"{object_name} is {view.gap(hand, object_name):.2f} m away from {hand}")
    return PredicateState(view.moves_with(object_name, hand), f"{object_name} does not move with {hand}")


def holding(view: TrackedWorld, hand: str, object_name: str) -> PredicateState:
    """Return whether a hand holds an object: the object has reached it, and a gripper is closed."""
    state = reached(view, hand, object_name)
    if state.holds and not _human(view, hand) and hand not in view.now.closed:
        return PredicateState(False, f"{hand} is open")
    return state


def grasped(
    view: TrackedWorld, hand: str, object_name: str, nominal: AbstractSet[Atom] = frozenset()
) -> PredicateState:
    """Return whether a hand has an object: it holds it, and no gripper still has what a person takes.

    A gripper that is free by the plan (`nominal`) has to have given it; another one may carry it with the person.
    """
    state = holding(view, hand, object_name)
    if state.holds and _human(view, hand) and _in_gripper(view, object_name, nominal):
        return PredicateState(False, f"{object_name} is still in a gripper")
    return state


def free(view: TrackedWorld, hand: str, nominal: bool = True) -> PredicateState:
    """Return whether a hand is empty: a gripper is open, a human hand has no object that is off the tables.

    An object at a hand may also be in another one, in both, or stand on a table while the hand takes it: the hand is
    then as `nominal`, as the plan has it.
    """
    if not _human(view, hand):
        return PredicateState(hand not in view.now.closed, f"{hand} is closed")
    for object_name in view.world.scene.objects:
        if view.seen(object_name) is None or view.gap(hand, object_name) > view.tolerances.reach:
            continue
        others = (other for other in view.world.scene.hands if other != hand)
        alone = not view.table_under(object_name) and not any(holding(view, one, object_name).holds for one in others)
        if alone or not nominal:
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


def held(view: TrackedWorld, object_name: str) -> PredicateState:
    """Return whether any hand holds an object in place."""
    states = [holding(view, hand, object_name) for hand in view.world.scene.hands]
    return next((one for one in states if one.holds), PredicateState(states[0].holds, f"no hand holds {object_name}"))


def screwed(view: TrackedWorld, first: str, second: str) -> PredicateState:
    """Return whether two parts stand as their joint has them, with a hand at rest at the screw that holds nothing."""
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
            if near and hand not in view.now.closed and view.moves_with(joint.parts[0], hand):
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
TRUE: Final = {
    "grasped": "{} has {}",
    "free": "{} is free",
    "on_table": "{} lies on a table",
    "placed": "{} lies on {}",
    "holding": "{} holds {}",
    "held": "{} is held",
    "screwed": "{} is screwed to {}",
}
"""What these predicates say where they must not hold."""
ACHIEVED = ("held", "holding", "screwed")
"""Predicates that only an action makes true: a hand may be where it would hold or screw without doing so."""


def evaluate_predicate(view: TrackedWorld, atom: Atom, nominal: AbstractSet[Atom]) -> PredicateState:
    """Return whether an atom holds in the tracked world; `nominal` are those that do so in the plan."""
    known = RECOGNISERS.get(atom.predicate)
    if known is None or (atom.predicate in ACHIEVED and atom not in nominal):
        return PredicateState(atom in nominal, f"{atom} does not hold by the plan")
    if known is grasped:
        hand, object_name = atom.arguments
        return grasped(view, hand, object_name, nominal)
    return free(view, atom.arguments[0], atom in nominal) if known is free else known(view, *atom.arguments)


def _unsure(view: TrackedWorld, object_name: str) -> str:
    """Return the reason if the state of an object is unknown, else ""."""
    if view.seen(object_name) is None:
        return f"{object_name} is not seen"
    return "" if view.watched(object_name) else f"{object_name} was seen for a moment only"


def _human(view: TrackedWorld, hand: str) -> bool:
    return view.world.scene.hands[hand].human


def _in_gripper(view: TrackedWorld, object_name: str, nominal: AbstractSet[Atom]) -> bool:
    """Return whether a closed gripper is at an object that is free by the plan."""
    given = [hand for hand in view.now.closed if Atom("free", (hand,)) in nominal]
    return any(view.gap(hand, object_name) <= view.tolerances.reach for hand in given)


def closed_grippers(scene: Scene, atoms: Iterable[Atom]) -> frozenset[str]:
    """Return the grippers that are closed where some atoms hold."""
    hands = (atom.arguments[0] for atom in atoms if atom.predicate in CLOSING)
    return frozenset(hand for hand in hands if not scene.hands[hand].human)


def closing_grippers(scene: Scene, task: Task, action: Action) -> list[tuple[str, str]]:
    """Return the grippers that an action closes, each with its object: also that of a second hand that carries."""
    pairs = [atom.arguments for atom in task.holding(action.adds) if atom.predicate in CLOSING]
    kind = kind_of(action.name)
    if kind is not None and kind.attaches_to == "hand" and "second" in kind.roles:
        pairs.append(tuple(action.arguments[kind.roles.index(role)] for role in ("second", "object")))
    return [(hand, name) for hand, name in pairs if not scene.hands[hand].human]


def gripper_commands(task: Task, action: Action, view: TrackedWorld) -> list[tuple[str, bool]]:
    """Return the grippers that close (True) or open (False) at the end of an action's motion.

    A gripper closes once the object has reached it. It opens at once, in an action that gives the object to a hand once
    all other hands of it hold the object.
    """
    scene, adds = view.world.scene, task.holding(action.adds)
    object_names = [name for name in action.arguments if name in scene.objects]
    closing, kind = closing_grippers(scene, task, action), kind_of(action.name)
    gives = kind is not None and kind.attaches_to == "hand"
    commands = [(hand, True) for hand, name in closing if reached(view, hand, name).holds]
    for hand in (atom.arguments[0] for atom in adds if atom.predicate == "free"):
        takers = [name for name in action.arguments if gives and name in scene.hands and name != hand]
        given = all(holding(view, taker, name).holds for taker in takers for name in object_names)
        if not scene.hands[hand].human and given:
            commands.append((hand, False))
    return commands
