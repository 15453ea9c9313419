"""Ground planning tasks: a state is an integer with one bit per atom, an action is four bit masks and its cost."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, reduce
from operator import or_
from typing import Final, NamedTuple

from lgp.errors import LogicError
from lgp.logic.pddl import EQUAL, ActionSchema, ConditionalEffect, Literal, PddlDomain
from reba.errors import did_you_mean


class Change(NamedTuple):
    """What happens if some atoms are true and others false: masks, as of an action."""

    needs: int
    forbids: int
    adds: int
    deletes: int

    def applies(self, state: int) -> bool:
        """Return whether its conditions are satisfied in a state."""
        return state & self.needs == self.needs and not state & self.forbids


@dataclass(frozen=True)
class Action:
    """A ground action, printed as its name and arguments: `grasp`, ("baxter.left", "screwdriver").

    Attributes:
        needs, forbids: masks of the positive and negative preconditions.
        adds, deletes: masks of the effects; adding wins where an atom is in both.
        conditional: further effects, each if its conditions hold before the action.
        cost: what it adds to the cost of a plan.
        together: whether it ends the same phase as the action before it in its sequence.
    """

    name: str
    arguments: tuple[str, ...]
    needs: int
    forbids: int
    adds: int
    deletes: int
    conditional: tuple[Change, ...] = ()
    cost: float = 0.0
    together: bool = False

    def applies(self, state: int) -> bool:
        """Return whether the preconditions are satisfied in a state."""
        return state & self.needs == self.needs and not state & self.forbids

    def changes(self, state: int) -> tuple[int, int]:
        """Return the masks of what the action adds and deletes in a state."""
        adds, deletes = self.adds, self.deletes
        for one in self.conditional:
            if one.applies(state):
                adds, deletes = adds | one.adds, deletes | one.deletes
        return adds, deletes

    def apply(self, state: int) -> int:
        """Return the state after the action."""
        adds, deletes = self.changes(state)
        return (state & ~deletes) | adds

    @property
    def any_change(self) -> Change:
        """All that it may depend on and all that it may change."""
        parts = (Change(self.needs, self.forbids, self.adds, self.deletes), *self.conditional)
        return Change(*(reduce(or_, masks) for masks in zip(*parts, strict=True)))

    def commutes_with(self, other: Action) -> bool:
        """Return whether two actions are independent: neither order changes what the other needs or leaves."""
        pair = self.any_change, other.any_change
        return not any(
            (one.adds | one.deletes) & (two.needs | two.forbids) or one.adds & two.deletes
            for one, two in (pair, pair[::-1])
        )

    def at(self, step: int) -> str:
        """Return the action as the paper prints it: `grasp(1, baxter.left, screwdriver)`."""
        return f"{self.name}({', '.join((str(step), *self.arguments))})"

    def __str__(self) -> str:
        return f"{self.name}({', '.join(self.arguments)})"


@dataclass(frozen=True)
class Task:
    """A ground planning task.

    Attributes:
        objects: object -> type.
        atoms: every reachable atom, in a fixed order; atom i is bit i of a state.
        actions: every applicable action, in a fixed order.
        goal: mask of the atoms that must be true at the end.
        goal_not: mask of the atoms that must be false at the end.
    """

    domain: PddlDomain
    objects: dict[str, str]
    atoms: tuple[Atom, ...]
    actions: tuple[Action, ...]
    initial: int
    goal: int
    goal_not: int = 0

    @cached_property
    def rules(self) -> tuple[tuple[Change, Action], ...]:
        """What each action may do, one rule for its effects and one for each conditional effect."""
        rules = []
        for action in self.actions:
            always = Change(action.needs, action.forbids, action.adds, action.deletes)
            rules.append((always, action))
            rules += [
                (Change(one.needs | action.needs, one.forbids | action.forbids, one.adds, one.deletes), action)
                for one in action.conditional
            ]
        return tuple(rules)

    @property
    def goal_text(self) -> str:
        """The goal in words: `placed(box, table.a) and not held(box)`."""
        texts = [str(atom) for atom in self.holding(self.goal)]
        return " and ".join([*texts, *(f"not {atom}" for atom in self.holding(self.goal_not))])

    def successors(self, state: int) -> Iterator[tuple[Action, int]]:
        """Yield every applicable action with its successor state; actions without an effect are left out."""
        for action in self.actions:
            if action.applies(state):
                after = action.apply(state)
                if after != state:
                    yield action, after

    def is_goal(self, state: int) -> bool:
        """Return whether a state satisfies the goal."""
        return state & self.goal == self.goal and not state & self.goal_not

    def holding(self, state: int) -> tuple[Atom, ...]:
        """Return the atoms that are true in a state."""
        return tuple(atom for bit, atom in enumerate(self.atoms) if state >> bit & 1)

    def action(self, text: str) -> Action:
        """Return the action with a name such as `grasp(baxter.left, screwdriver)`; LogicError where there is none."""
        name = text.replace(" ", "")
        for action in self.actions:
            if str(action).replace(" ", "") == name:
                return action
        hint = did_you_mean(text, [str(action) for action in self.actions]) or "; check its name and arguments"
        raise LogicError(f"action {text!r} does not exist or never becomes applicable{hint}")


def ground(
    domain: PddlDomain,
    objects: Mapping[str, str],
    initial: Iterable[Atom],
    goal: Iterable[Atom],
    goal_not: Iterable[Atom] = (),
) -> Task:
    """Return the ground task of a domain for some objects, given as object -> type of the domain.

    Atoms of `goal_not` must be false at the end.

    It has only actions and atoms that are reachable under delete relaxation, and the atoms of the goal.

    Raises:
        LogicError: an object, type, predicate or number of arguments is unknown.
    """
    constants = {**domain.constants, **objects}
    for name, kind in constants.items():
        if kind not in domain.supertypes and kind != "object":
            raise LogicError(f"object {name!r} has unknown type {kind!r}{did_you_mean(kind, domain.supertypes)}")
    first, final, absent = set(initial), set(goal), set(goal_not)
    for atom in sorted(first | final | absent):
        _check(domain, constants, atom)
    if final & absent:
        raise LogicError(f"the goal has {min(final & absent)} and its negation; leave one of them out")
    reachable, candidates = _reachable(domain, constants, set(first))
    atoms = tuple(sorted(reachable | final | absent))
    bit = {atom: 1 << index for index, atom in enumerate(atoms)}
    actions = tuple(_action(schema, binding, bit) for schema, binding in candidates)
    masks = (sum(bit[atom] for atom in group) for group in (first, final, absent))
    return Task(domain, constants, atoms, actions, *masks)


def _check(domain: PddlDomain, objects: Mapping[str, str], atom: Atom) -> None:
    if atom.predicate not in domain.predicates:
        hint = did_you_mean(atom.predicate, domain.predicates)
        raise LogicError(f"{atom}: unknown predicate{hint}; known: {', '.join(domain.predicates)}")
    types = domain.predicates[atom.predicate]
    if len(types) != len(atom.arguments):
        raise LogicError(f"{atom} has {len(atom.arguments)} arguments, expected {len(types)} for {atom.predicate}")
    for name, allowed in zip(atom.arguments, types, strict=True):
        if name not in objects:
            raise LogicError(
                f"{atom}: unknown object {name!r}{did_you_mean(name, objects)}; known: {', '.join(objects)}"
            )
        if not domain.is_a(objects[name], allowed):
            raise LogicError(f"{atom}: {name} is a {objects[name]}, expected {' or '.join(sorted(allowed))}")


def _bindings(domain: PddlDomain, objects: Mapping[str, str], schema: ActionSchema) -> Iterator[dict[str, str]]:
    choices = [[name for name, kind in objects.items() if domain.is_a(kind, kinds)] for _, kinds in schema.parameters]
    for chosen in itertools.product(*choices):
        binding = dict(zip((name for name, _ in schema.parameters), chosen, strict=True))
        if _equalities_hold(schema.precondition, binding):
            yield binding


def _equalities_hold(literals: Iterable[Literal], binding: Mapping[str, str]) -> bool:
    """Return whether the equalities among some literals are true."""
    pairs = [(_bound(one, binding).arguments, one.positive) for one in literals if one.predicate == EQUAL]
    return all((first == second) == positive for (first, second), positive in pairs)


def _conditional(schema: ActionSchema, binding: Mapping[str, str]) -> Iterator[ConditionalEffect]:
    """Yield the conditional effects whose equalities are true."""
    return (one for one in schema.conditional if _equalities_hold(one.condition, binding))


def _bound(literal: Literal, binding: Mapping[str, str]) -> Atom:
    return Atom(literal.predicate, tuple(binding.get(term, term) for term in literal.terms))


def _reachable(
    domain: PddlDomain, objects: Mapping[str, str], known: set[Atom]
) -> tuple[set[Atom], list[tuple[ActionSchema, dict[str, str]]]]:
    """Return the atoms and actions that are reachable under delete relaxation."""
    waiting = [(schema, binding) for schema in domain.actions for binding in _bindings(domain, objects, schema)]
    order = {id(entry): index for index, entry in enumerate(waiting)}
    reached: list[tuple[ActionSchema, dict[str, str]]] = []
    changed = True
    while changed:
        changed = False
        later = []
        for entry in waiting:
            schema, binding = entry
            if _known(schema.precondition, binding, known):
                known |= {_bound(lit, binding) for lit in schema.effect if lit.positive}
                reached.append(entry)
                changed = True
            else:
                later.append(entry)
        waiting = later
        for schema, binding in reached:
            for one in _conditional(schema, binding):
                new = {_bound(lit, binding) for lit in one.effect if lit.positive} - known
                if new and _known(one.condition, binding, known):
                    known |= new
                    changed = True
    return known, sorted(reached, key=lambda entry: order[id(entry)])


def _known(literals: Iterable[Literal], binding: Mapping[str, str], known: set[Atom]) -> bool:
    """Return whether all positive literals are among known atoms."""
    return all(_bound(one, binding) in known for one in literals if one.positive and one.predicate != EQUAL)


def _action(schema: ActionSchema, binding: Mapping[str, str], bit: Mapping[Atom, int]) -> Action:
    def mask(literals: Iterable[Literal], positive: bool) -> int:
        # An unreachable atom needs no bit: deleting it has no effect, and its negation is always satisfied.
        return sum({bit.get(_bound(lit, binding), 0) for lit in literals if lit.positive == positive})

    # A condition with an atom that is never true never holds.
    possible = [one for one in _conditional(schema, binding) if _known(one.condition, binding, set(bit))]
    return Action(
        name=schema.name,
        arguments=tuple(binding[name] for name, _ in schema.parameters),
        needs=mask(schema.precondition, True),
        forbids=mask(schema.precondition, False),
        adds=mask(schema.effect, True),
        deletes=mask(schema.effect, False),
        conditional=tuple(
            Change(*(mask(part, positive) for part in (one.condition, one.effect) for positive in (True, False)))
            for one in possible
        ),
        cost=schema.cost,
    )


def parse_goal(texts: Iterable[str]) -> tuple[tuple[Atom, ...], tuple[Atom, ...]]:
    """Return the atoms that a goal wants true, and those that it wants false: `not placed(box, table.a)`.

    Raises:
        LogicError: a text is no atom.

    >>> [len(part) for part in parse_goal(["free(human.right_hand)", "not placed(box, table.a)"])]
    [1, 1]
    """
    wanted: tuple[list[Atom], list[Atom]] = ([], [])
    for text in texts:
        negated = re.match(r"\s*not\s+", text)
        wanted[negated is not None].append(parse_atom(text[negated.end() :] if negated else text))
    return tuple(wanted[0]), tuple(wanted[1])


_ATOM: Final = re.compile(r"\s*([A-Za-z_][\w.-]*)\s*\(([^()]*)\)\s*")


class Atom(NamedTuple):
    """A predicate with its arguments."""

    predicate: str
    arguments: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.predicate}({', '.join(self.arguments)})"


def numbered(lines: Iterable[str]) -> Iterator[tuple[str, bool]]:
    """Yield each action of a sequence without its number, and whether it has the number of the one before.

    >>> list(numbered(["grasp(1, arm, box)", "screw(1, human, lid)", "place(arm, box)"]))
    [('grasp(arm, box)', False), ('screw(human, lid)', True), ('place(arm, box)', False)]
    """
    before = ""
    for text in lines:
        number = re.match(r"[^(]*\(\s*(\d+)\s*,", text)
        now = number[1] if number else ""
        rest = text if number is None else text[: number.start(1)].rstrip() + text[number.end() :].lstrip()
        yield rest, now == before != ""
        before = now


def parse_atom(text: str) -> Atom:
    """Return the atom written as `predicate(argument, ...)`; LogicError for another form.

    Example:
        >>> parse_atom("placed(screwdriver, table.left)").arguments
        ('screwdriver', 'table.left')
    """
    match = _ATOM.fullmatch(text)
    if match is None:
        raise LogicError(f"{text!r} is no atom; write predicate(argument, ...), as in grasped(human.right_hand, box)")
    arguments = tuple(word.strip() for word in match[2].split(",")) if match[2].strip() else ()
    if not all(arguments):
        raise LogicError(f"{text!r} has an empty argument; write predicate(argument, ...)")
    return Atom(match[1], arguments)
