"""Payloads: a hand that takes an object heavier than it carries is an impossible action."""

from __future__ import annotations

from lgp.logic.task import parse_atom
from lgp.path.phases import Phases


def overload(phases: Phases) -> str:
    """Return why the hand of the last switch cannot carry what it takes, "" if it can or takes nothing.

    Parts that are screwed to the object by then are carried with it.
    """
    number = phases.count - 1
    switch = phases.switches[number]
    if switch.action.attaches_to != "hand":
        return ""
    hand, parts = phases.scene.hands[switch.hand], _joined(phases, switch.object_name)
    mass = sum(phases.scene.objects[name].mass for name in parts)
    if mass <= hand.payload:
        return ""
    what = " with ".join([switch.object_name, *sorted(parts - {switch.object_name})])
    return (
        f"phase {number + 1}, {phases.label(number)}: {what} has {mass:g} kg, {switch.hand} carries up to "
        f"{hand.payload:g} kg"
    )


def _joined(phases: Phases, name: str) -> set[str]:
    """Return an object and what is screwed to it before the last switch, directly or not."""
    facts = [parse_atom(text) for text in phases.scene.initial]
    pairs = [set(fact.arguments) for fact in facts if fact.predicate == "screwed"]
    pairs += [{one.object_name, one.other} for one in phases.switches[:-1] if one.action.screws]
    parts, before = {name}, 0
    while len(parts) > before:
        before = len(parts)
        parts |= {part for pair in pairs if pair & parts for part in pair}
    return parts
