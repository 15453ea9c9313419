"""What actions do to the places of objects, beyond the effects that a domain states."""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from lgp.kinematics.actions import kind_of
from lgp.logic.task import Action, Task
from lgp.path.phases import switch_of

PLACED: Final = "placed"
"""Predicate of an object and the table it lies on."""


def leaving_places(task: Task) -> Task:
    """Return a task whose actions end that an object is placed where they take it away from.

    The domains of the paper do not delete `placed` in a grasp, so that a goal could hold for a thing that is in a hand,
    or lies on another table.

    Example:
        >>> from lgp.logic.pddl import load_domain
        >>> from lgp.logic.task import Atom, ground, parse_atom
        >>> objects = {"robot": "robot_hand", "box": "thing", "near": "table", "far": "table"}
        >>> first = [parse_atom(text) for text in ("free(robot)", "on_table(box)", "placed(box, near)")]
        >>> task = leaving_places(ground(load_domain("screwdriver"), objects, first, [parse_atom("placed(box, far)")]))
        >>> state = task.initial
        >>> for text in ("grasp(robot, box)", "place(robot, box, far)"):
        ...     state = task.action(text).apply(state)
        >>> Atom("placed", ("box", "near")) in task.holding(state)
        False
    """
    places: dict[str, int] = {}
    for bit, atom in enumerate(task.atoms):
        if atom.predicate == PLACED:
            places[atom.arguments[0]] = places.get(atom.arguments[0], 0) | 1 << bit
    return replace(task, actions=tuple(_leaving(action, places) for action in task.actions)) if places else task


def _leaving(action: Action, places: dict[str, int]) -> Action:
    kind = kind_of(action.name)
    if kind is None or not kind.attaches_to or len(kind.roles) != len(action.arguments):
        return action
    return replace(action, deletes=action.deletes | places.get(switch_of(action).object_name, 0))
