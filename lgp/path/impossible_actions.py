"""Actions that no posture makes possible: an object too heavy for a hand, or too high for a shelf."""

from __future__ import annotations

from lgp.logic.task import parse_atom
from lgp.path.phases import Phases


def impossible(phases: Phases) -> str:
    """Return why the last action of a sequence is impossible whatever the postures, "" if nothing says so."""
    return _overload(phases) or _too_high(phases)


def _overload(phases: Phases) -> str:
    """Return why the hand of the last switch cannot carry what it takes, "" if it can or takes nothing.

    Parts that are screwed to the object by then are carried with it.
    """
    number = len(phases.switches) - 1
    switch = phases.switches[number]
    if switch.action.attaches_to != "hand":
        return ""
    hand, parts = phases.scene.hands[switch.hand], _joined(phases, switch.object_name)
    mass = sum(phases.scene.objects[name].mass for name in parts)
    second = phases.scene.hands[switch.second].payload if switch.second else 0.0
    if mass <= hand.payload + second:
        return ""
    who = f"{switch.hand} and {switch.second} carry" if second else f"{switch.hand} carries"
    what = " with ".join([switch.object_name, *sorted(parts - {switch.object_name})])
    most = hand.payload + second
    return f"phase {phases.count}, {phases.label(number)}: {what} has {mass:g} kg, {who} up to {most:g} kg"


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


def _too_high(phases: Phases) -> str:
    """Return that an object is higher than the space above the table it is placed on; it stands on its x-y side."""
    number = len(phases.switches) - 1
    switch = phases.switches[number]
    if switch.action.attaches_to != "table":
        return ""
    height, space = phases.scene.objects[switch.object_name].size[2], phases.scene.tables[switch.table].clearance
    if height < space:
        return ""
    return (
        f"phase {phases.count}, {phases.label(number)}: {switch.object_name} is {height:g} m high, "
        f"above {switch.table} are {space:.3g} m"
    )
