"""Why a task has no plan whatever its geometry: atoms that exclude each other, and the number of actions it needs.

Both look at the symbolic task alone. Pairs of atoms that are never true together are those that the second order of
delete relaxation (h^2, Haslum & Geffner 2000) does not reach: it drops conditions, so a pair that it excludes is
excluded.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations_with_replacement

import numpy as np

from lgp.logic.task import Action, Atom, Change, Task
from reba.arrays import Array, Indices

STATES = 20_000
"""States after which the shortest sequence counts as unknown (a choice: about a second)."""


def exclusive_goals(task: Task) -> tuple[Atom, Atom] | None:
    """Return two atoms of the goal that no sequence of actions makes true together, None if no two exclude each other.

    Example:
        >>> from lgp.planner import task_of
        >>> from lgp.scene.scene_file import load_scene
        >>> scene = load_scene("screwdriver", {"goal": ["grasped(human.right_hand, screwdriver)"]})
        >>> exclusive_goals(task_of(scene)) is None
        True
    """
    together = _pairs(task)
    goal = _indices(task.goal, len(task.atoms))
    for at, first in enumerate(goal):
        for second in goal[at + 1 :]:
            if not together[first, second]:
                return task.atoms[first], task.atoms[second]
    return None


def fewest_actions(task: Task, states: int = STATES) -> int | None:
    """Return the length of the shortest sequence that reaches the goal symbolically, by breadth-first search.

    -1 where all states were seen and none is a goal, None where `states` were not enough to know.
    """
    if task.is_goal(task.initial):
        return 0
    layer, seen, steps = [task.initial], {task.initial}, 0
    while layer:
        steps += 1
        following = []
        for state in layer:
            for _, after in task.successors(state):
                if after in seen:
                    continue
                if task.is_goal(after):
                    return steps
                seen.add(after)
                following.append(after)
            if len(seen) > states:
                return None
        layer = following
    return -1


def _pairs(task: Task) -> Array:
    """Return (atoms, atoms) bool: which pairs may be true together; the diagonal says which atoms may be true."""
    size = len(task.atoms)
    actions = [_columns(one, left, size) for action in task.actions for one, left in _cases(action)]
    together = np.zeros((size, size), dtype=bool)
    first = _indices(task.initial, size)
    together[np.ix_(first, first)] = True
    known = -1
    while known != (known := int(together.sum())):
        for needs, adds, gone in actions:
            if not together[np.ix_(needs, needs)].all():
                continue
            together[np.ix_(adds, adds)] = True
            # An atom that may be true beside all that the action needs, and that it leaves.
            stays = together.diagonal() & together[needs].all(axis=0)
            stays[gone] = False
            together[np.ix_(adds, stays)] = together[np.ix_(stays, adds)] = True
    return together


def _cases(action: Action) -> Iterator[tuple[Change, int]]:
    """Yield what an action does with none, one or two of its conditional effects, and all atoms that it may add."""
    parts, left = (Change(0, 0, 0, 0), *action.conditional), action.any_change.adds
    always = Change(action.needs, action.forbids, action.adds, action.deletes)
    for one, other in combinations_with_replacement(parts, 2):
        yield Change(*(a | b | c for a, b, c in zip(always, one, other, strict=True))), left


def _columns(case: Change, left: int, size: int) -> tuple[Indices, Indices, Indices]:
    """Return the atoms that an action needs, that it adds, and that are false after it; `left` are all it may add."""
    # What it forbids is false before it, and after it unless the action adds it.
    gone = (case.deletes | case.forbids) & ~left
    needs, adds, gone_atoms = (_indices(mask, size) for mask in (case.needs, case.adds, gone))
    return needs, adds, gone_atoms


def _indices(mask: int, size: int) -> Indices:
    return np.array([bit for bit in range(size) if mask >> bit & 1], dtype=np.intp)
