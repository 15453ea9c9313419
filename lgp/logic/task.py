"""Ground tasks: states are integers with one bit for each atom, actions are bit masks."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from lgp.errors import LogicError
from lgp.logic.pddl import ActionSchema, Literal, PddlDomain
from reba.errors import did_you_mean


@dataclass(frozen=True)
class Action:
    """A ground action.

    Attributes:
        name, arguments: as printed: `grasp`, ("baxter.left", "screwdriver").
        needs, forbids: atoms that must hold, must not hold.
        adds, deletes: atoms that hold, do not hold afterwards (an atom in both holds).
    """

    name: str
    arguments: tuple[str, ...]
    needs: int
    forbids: int
    adds: int
    deletes: int

    def applies(self, state: int) -> bool:
        """Return whether the action can be done in a state."""
        return state & self.needs == self.needs and not state & self.forbids

    def apply(self, state: int) -> int:
        """Return the state after the action."""
        return (state & ~self.deletes) | self.adds

    def at(self, step: int) -> str:
        """Return the action as the paper prints it: `grasp(1, baxter.left, screwdriver)`."""
        return f"{self.name}({', '.join((str(step), *self.arguments))})"

    def __str__(self) -> str:
        return f"{self.name}({', '.join(self.arguments)})"


@dataclass(frozen=True)
class Task:
    """A ground planning task.

    Attributes:
        domain: where it comes from.
        objects: object -> type.
        atoms: every atom that can ever hold, in a fixed order; atom i is bit i.
        actions: every action that can ever be done, in a fixed order.
        initial: the first state.
        goal, goal_not: atoms that must hold, must not hold at the end.
    """

    domain: PddlDomain
    objects: dict[str, str]
    atoms: tuple[Atom, ...]
    actions: tuple[Action, ...]
    initial: int
    goal: int
    goal_not: int = 0

    def successors(self, state: int) -> Iterator[tuple[Action, int]]:
        """Yield every possible action with the state it leads to; actions that change nothing are left out."""
        for action in self.actions:
            if action.applies(state):
                after = action.apply(state)
                if after != state:
                    yield action, after

    def is_goal(self, state: int) -> bool:
        """Return whether the goal holds."""
        return state & self.goal == self.goal and not state & self.goal_not

    def holding(self, state: int) -> tuple[Atom, ...]:
        """Return the atoms that hold in a state."""
        return tuple(atom for bit, atom in enumerate(self.atoms) if state >> bit & 1)

    def action(self, text: str) -> Action:
        """Return the action that a text such as `grasp(baxter.left, screwdriver)` names.

        Raises:
            LogicError: there is no such action.
        """
        wanted = text.replace(" ", "")
        for action in self.actions:
            if str(action).replace(" ", "") == wanted:
                return action
        hint = did_you_mean(text, [str(action) for action in self.actions])
        raise LogicError(f"action {text!r} does not exist or can never be done{hint}")


def ground(
    domain: PddlDomain,
    objects: Mapping[str, str],
    initial: Iterable[Atom],
    goal: Iterable[Atom],
    goal_not: Iterable[Atom] = (),
) -> Task:
    """Return the task for some objects.

    Only actions whose preconditions can ever hold (deletes ignored) are kept, and only atoms that can ever hold or are
    asked for.

    Args:
        objects: object -> type of the domain.
        initial, goal: atoms.
        goal_not: atoms that must not hold at the end.

    Raises:
        LogicError: an object, type, predicate or number of arguments is unknown.
    """
    everything = {**domain.constants, **objects}
    for name, kind in everything.items():
        if kind not in domain.supertypes and kind != "object":
            raise LogicError(f"object {name!r} has unknown type {kind!r}{did_you_mean(kind, domain.supertypes)}")
    first, wanted, unwanted = tuple(initial), tuple(goal), tuple(goal_not)
    for atom in (*first, *wanted, *unwanted):
        _check(domain, everything, atom)
    possible, candidates = _reachable(domain, everything, set(first))
    atoms = tuple(sorted(possible | set(wanted) | set(unwanted)))
    bit = {atom: 1 << index for index, atom in enumerate(atoms)}
    actions = tuple(_action(schema, binding, bit) for schema, binding in candidates)
    masks = [sum(bit[atom] for atom in set(group)) for group in (first, wanted, unwanted)]
    return Task(domain, everything, atoms, actions, *masks)


def _check(domain: PddlDomain, objects: Mapping[str, str], atom: Atom) -> None:
    if atom.predicate not in domain.predicates:
        hint = did_you_mean(atom.predicate, domain.predicates)
        raise LogicError(f"{atom}: unknown predicate{hint}; known: {', '.join(domain.predicates)}")
    wanted = domain.predicates[atom.predicate]
    if len(wanted) != len(atom.arguments):
        raise LogicError(f"{atom}: {len(atom.arguments)} arguments; {atom.predicate} takes {len(wanted)}")
    for name, allowed in zip(atom.arguments, wanted, strict=True):
        if name not in objects:
            raise LogicError(
                f"{atom}: unknown object {name!r}{did_you_mean(name, objects)}; known: {', '.join(objects)}"
            )
        if not domain.is_a(objects[name], allowed):
            raise LogicError(f"{atom}: {name} is a {objects[name]}; expected {' or '.join(sorted(allowed))}")


def _bindings(domain: PddlDomain, objects: Mapping[str, str], schema: ActionSchema) -> Iterator[dict[str, str]]:
    choices = [[name for name, kind in objects.items() if domain.is_a(kind, kinds)] for _, kinds in schema.parameters]
    for chosen in itertools.product(*choices):
        yield dict(zip((name for name, _ in schema.parameters), chosen, strict=True))


def _bound(literal: Literal, binding: Mapping[str, str]) -> Atom:
    return Atom(literal.predicate, tuple(binding.get(term, term) for term in literal.terms))


def _reachable(
    domain: PddlDomain, objects: Mapping[str, str], known: set[Atom]
) -> tuple[set[Atom], list[tuple[ActionSchema, dict[str, str]]]]:
    """Return the atoms and actions that can be reached when nothing is ever deleted."""
    waiting = [(schema, binding) for schema in domain.actions for binding in _bindings(domain, objects, schema)]
    order = {id(entry): index for index, entry in enumerate(waiting)}
    reached: list[tuple[ActionSchema, dict[str, str]]] = []
    grew = True
    while grew:
        grew = False
        later = []
        for entry in waiting:
            schema, binding = entry
            if all(_bound(lit, binding) in known for lit in schema.precondition if lit.positive):
                known |= {_bound(lit, binding) for lit in schema.effect if lit.positive}
                reached.append(entry)
                grew = True
            else:
                later.append(entry)
        waiting = later
    return known, sorted(reached, key=lambda entry: order[id(entry)])


def _action(schema: ActionSchema, binding: Mapping[str, str], bit: Mapping[Atom, int]) -> Action:
    def mask(literals: Iterable[Literal], positive: bool) -> int:
        # An atom that can never hold needs no bit: it cannot be deleted, and a condition against it always holds.
        return sum({bit.get(_bound(lit, binding), 0) for lit in literals if lit.positive == positive})

    return Action(
        name=schema.name,
        arguments=tuple(binding[name] for name, _ in schema.parameters),
        needs=mask(schema.precondition, True),
        forbids=mask(schema.precondition, False),
        adds=mask(schema.effect, True),
        deletes=mask(schema.effect, False),
    )


_ATOM: Final = re.compile(r"\s*([A-Za-z_][\w.-]*)\s*\(([^()]*)\)\s*")


class Atom(NamedTuple):
    """A predicate with its arguments."""

    predicate: str
    arguments: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.predicate}({', '.join(self.arguments)})"


def parse_atom(text: str) -> Atom:
    """Return the atom that a text names.

    Raises:
        LogicError: the text is not of the form `predicate(argument, ...)`.

    Example:
        >>> parse_atom("placed(screwdriver, table.left)").arguments
        ('screwdriver', 'table.left')
    """
    found = _ATOM.fullmatch(text)
    if found is None:
        raise LogicError(f"{text!r} is no atom; write predicate(argument, ...), as in grasped(human.right_hand, box)")
    arguments = tuple(word.strip() for word in found[2].split(",")) if found[2].strip() else ()
    if not all(arguments):
        raise LogicError(f"{text!r} has an empty argument; write predicate(argument, ...)")
    return Atom(found[1], arguments)
