"""Delete-relaxation heuristics (FF, Hoffmann & Nebel 2001).

The length of a relaxed plan guides the search. The layer of the relaxed planning graph at which the goal appears is a
lower bound of the number of actions; a goal that never appears is unreachable.
"""

from __future__ import annotations

from dataclasses import dataclass

from lgp.logic.task import Action, Atom, Task


@dataclass(frozen=True)
class RelaxedPlan:
    """A plan of the delete-relaxed task.

    Attributes:
        layers: first layer with all goal atoms: a lower bound of the number of actions (h_max).
        actions: of one relaxed plan, each once; their number estimates the length (h_FF).
    """

    layers: int
    actions: tuple[Action, ...]


def relaxed_plan(task: Task, state: int) -> RelaxedPlan | None:
    """Return a relaxed plan from a state, None where the goal is unreachable even without deletes."""
    layer_of: dict[int, int] = {}
    achiever: dict[int, Action] = {}
    known, layer = state, 0
    for bit in _bits(state):
        layer_of[bit] = 0
    while known & task.goal != task.goal:
        layer += 1
        new = 0
        for action in task.actions:
            if known & action.needs == action.needs:
                for bit in _bits(action.adds & ~known & ~new):
                    layer_of[bit], achiever[bit] = layer, action
                new |= action.adds
        if not new & ~known:
            return None
        known |= new
    chosen: dict[Action, None] = {}
    open_bits = {bit for bit in _bits(task.goal) if layer_of[bit] > 0}
    while open_bits:
        bit = max(open_bits, key=lambda b: (layer_of[b], b))
        open_bits.discard(bit)
        action = achiever[bit]
        if action not in chosen:
            chosen[action] = None
            open_bits |= {need for need in _bits(action.needs) if layer_of[need] > 0}
    return RelaxedPlan(layer, tuple(reversed(chosen)))


def why_unreachable(task: Task) -> str:
    """Return why no sequence reaches the goal: a goal atom, and the precondition of its actions that is never true.

    "" if the goal is reachable under delete relaxation.
    """
    known = task.initial
    while True:
        new = known
        for action in task.actions:
            if known & action.needs == action.needs:
                new |= action.adds
        if new == known:
            break
        known = new
    reachable = set(task.holding(known))
    missing = [atom for bit, atom in enumerate(task.atoms) if task.goal >> bit & 1 and not known >> bit & 1]
    if not missing:
        return ""
    reasons: list[str] = []
    _explain(task, missing[0], reachable, reasons, set())
    return "; ".join(reasons)


def _explain(task: Task, atom: Atom, reachable: set[Atom], reasons: list[str], seen: set[Atom]) -> None:
    seen.add(atom)
    achievers = []
    for schema in task.domain.actions:
        for literal in schema.effect:
            if literal.positive and literal.predicate == atom.predicate and len(literal.terms) == len(atom.arguments):
                achievers.append((schema, dict(zip(literal.terms, atom.arguments, strict=True))))
    if not achievers:
        reasons.append(f"{atom} is not true initially and no action adds it")
        return
    for schema, binding in achievers:
        for literal in schema.precondition:
            if not literal.positive:
                continue
            terms = tuple(binding.get(term, term) for term in literal.terms)
            fits = [r for r in reachable if r.predicate == literal.predicate and _matches(terms, r.arguments)]
            if not fits:
                need = Atom(literal.predicate, terms)
                reasons.append(f"{atom} needs {schema.name}, whose precondition {need} is never true")
                if not any(term.startswith("?") for term in terms) and need not in seen:
                    _explain(task, need, reachable, reasons, seen)
                return
    reasons.append(f"{atom} needs {achievers[0][0].name}, whose preconditions are never true together")


def _matches(terms: tuple[str, ...], arguments: tuple[str, ...]) -> bool:
    return all(term.startswith("?") or term == argument for term, argument in zip(terms, arguments, strict=True))


def _bits(mask: int) -> list[int]:
    bits = []
    while mask:
        low = mask & -mask
        bits.append(low)
        mask ^= low
    return bits
