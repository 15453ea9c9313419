"""Delete-relaxation heuristics (FF, Hoffmann & Nebel 2001).

The length of a relaxed plan guides the search. The layer of the relaxed planning graph at which the goal appears is a
lower bound of the number of actions; a goal that never appears is unreachable.
"""

from __future__ import annotations

from dataclasses import dataclass

from lgp.logic.pddl import EQUAL
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
    """Return a relaxed plan from a state, None where the goal is unreachable even without deletes.

    An atom that the goal wants false stays false once an action deletes it.
    """
    layer_of: dict[int, int] = {}
    achiever: dict[int, tuple[Action, int]] = {}
    known, false, layer = state, ~state & task.goal_not, 0
    for bit in _bits(state):
        layer_of[bit] = 0
    while known & task.goal != task.goal or false != task.goal_not:
        layer += 1
        new = new_false = 0
        for rule, action in task.rules:
            if known & rule.needs == rule.needs:
                adds, deletes = rule.adds & ~known & ~new, rule.deletes & task.goal_not & ~false & ~new_false
                # A negative bit stands for an atom that is false.
                for bit in (*_bits(adds), *(-bit for bit in _bits(deletes))):
                    layer_of[bit], achiever[bit] = layer, (action, rule.needs)
                new |= rule.adds
                new_false |= deletes
        if not new & ~known and not new_false:
            return None
        known |= new
        false |= new_false
    chosen: dict[Action, None] = {}
    wanted = (*_bits(task.goal), *(-bit for bit in _bits(task.goal_not)))
    open_bits = {bit for bit in wanted if layer_of.get(bit, 0) > 0}
    while open_bits:
        bit = max(open_bits, key=lambda b: (layer_of[b], b))
        open_bits.discard(bit)
        action, needs = achiever[bit]
        if action not in chosen:
            chosen[action] = None
            open_bits |= {need for need in _bits(action.needs | needs) if layer_of[need] > 0}
    return RelaxedPlan(layer, tuple(reversed(chosen)))


def why_unreachable(task: Task) -> str:
    """Return why no sequence reaches the goal: a goal atom, and the precondition of its actions that is never true.

    "" if the goal is reachable under delete relaxation. An atom that it wants false and that stays true is named first.
    """
    known, deleted = task.initial, ~task.initial & task.goal_not
    while True:
        new, gone = known, deleted
        for rule, _ in task.rules:
            if known & rule.needs == rule.needs:
                new, gone = new | rule.adds, gone | rule.deletes & task.goal_not
        if new == known and gone == deleted:
            break
        known, deleted = new, gone
    stays = task.holding(task.goal_not & ~deleted)
    if stays:
        return f"{stays[0]} is true initially and no action that can be taken deletes it"
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
        effects = [((), schema.effect), *((one.condition, one.effect) for one in schema.conditional)]
        for condition, literal in ((condition, literal) for condition, effect in effects for literal in effect):
            if literal.positive and literal.predicate == atom.predicate and len(literal.terms) == len(atom.arguments):
                binding = dict(zip(literal.terms, atom.arguments, strict=True))
                achievers.append((schema, (*schema.precondition, *condition), binding))
    if not achievers:
        reasons.append(f"{atom} is not true initially and no action adds it")
        return
    for schema, conditions, binding in achievers:
        for literal in conditions:
            if not literal.positive or literal.predicate == EQUAL:
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
