"""The partial order of the actions of a sequence, and phases in which independent ones happen at the same time.

Two actions are ordered as in the sequence if one of them changes an atom that the other needs or changes (interference,
Blum & Furst 1997), or if they share an agent or an object. Every order of the others leads to the same state, so two
actions with no path between them in this partial order may share a phase.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from lgp.logic.task import Action
from lgp.path.phases import switch_of

Layout = tuple[tuple[int, ...], ...]
"""The numbers of the actions that end each phase."""


def depends(action: Action, other: Action) -> bool:
    """Return whether the order of two actions matters: by their atoms, or as an agent or object takes part in both."""
    return not action.commutes_with(other) or bool(_takes_part(action) & _takes_part(other))


def _takes_part(action: Action) -> set[str]:
    """Return the agents and objects of an action, and what its further roles name."""
    switch = switch_of(action)
    names = {switch.object_name, switch.other, *(name for _, name in switch.more)} - {""}
    return names | {hand.partition(".")[0] for hand in switch.hands}


def earliest_phases(actions: Sequence[Action], separate: Collection[int] = ()) -> Layout:
    """Return the phases of a sequence, with each action in the first phase that it can end.

    Args:
        actions: in a valid order.
        separate: numbers of actions that begin a further phase, at the end of those before them.
    """
    phases: list[list[int]] = []
    phase_of: list[int] = []
    for number, action in enumerate(actions):
        after = [phase_of[earlier] for earlier in range(number) if depends(action, actions[earlier])]
        phase_of.append(len(phases) if number in separate else max(after, default=-1) + 1)
        if phase_of[number] == len(phases):
            phases.append([])
        phases[phase_of[number]].append(number)
    return tuple(map(tuple, phases))


def joined_phases(actions: Sequence[Action], layout: Layout) -> tuple[Action, ...]:
    """Return the actions in the order of their phases; those that share one are together."""
    return tuple(replace(actions[number], together=at > 0) for phase in layout for at, number in enumerate(phase))


def one_at_a_time(actions: Sequence[Action]) -> tuple[Action, ...]:
    """Return the actions in a phase of their own each."""
    return tuple(replace(action, together=False) for action in actions)


def same_phase(actions: Sequence[Action]) -> tuple[Action, ...]:
    """Return the actions of the last phase of a sequence."""
    first = max((number for number, action in enumerate(actions) if not action.together), default=0)
    return tuple(actions[first:])
