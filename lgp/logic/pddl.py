"""PDDL domains (typed STRIPS with negation, equality, conditional effects, action costs), parsed with `pddl`.

A `PddlDomain` is plain data: types, predicates with their argument types, and action schemas whose preconditions and
effects are lists of literals over the parameters.
"""

from __future__ import annotations

import contextlib
import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

from lgp.errors import LogicError
from reba.errors import did_you_mean
from reba.open_file import read_settings

SUPPORTED: Final = frozenset(
    {":strips", ":typing", ":negative-preconditions", ":equality", ":conditional-effects", ":action-costs"}
)
ALL: Final = ", ".join(sorted(SUPPORTED))
EQUAL: Final = "="
"""The predicate of an equality; it is decided when parameters are bound."""
COST: Final = "total-cost"
"""The only function: what actions cost in sum."""
SHIPPED: Final = Path(__file__).resolve().parents[1] / "domains"


class Literal(NamedTuple):
    """A predicate over parameters (`?e`) or constants, or its negation."""

    predicate: str
    terms: tuple[str, ...]
    positive: bool


@dataclass(frozen=True)
class ConditionalEffect:
    """What an action changes if its condition holds before it."""

    condition: tuple[Literal, ...]
    effect: tuple[Literal, ...]


@dataclass(frozen=True)
class ActionSchema:
    """A lifted action: literals over its parameters, which are (name with question mark, allowed types) in order.

    `cost` is what it adds to the total cost, in units of the planner's cost.
    """

    name: str
    parameters: tuple[tuple[str, frozenset[str]], ...]
    precondition: tuple[Literal, ...]
    effect: tuple[Literal, ...]
    conditional: tuple[ConditionalEffect, ...] = ()
    cost: float = 0.0

    @property
    def literals(self) -> tuple[Literal, ...]:
        """Every literal of its precondition and effects."""
        parts = [part for one in self.conditional for part in (one.condition, one.effect)]
        return tuple(literal for part in (self.precondition, self.effect, *parts) for literal in part)


@dataclass(frozen=True)
class PddlDomain:
    """A planning domain; actions are in the order of the file.

    Attributes:
        supertypes: type -> direct supertype, "object" at the top.
        predicates: predicate -> allowed types of each argument.
        constants: object -> type, declared in the domain.
    """

    name: str
    supertypes: dict[str, str]
    predicates: dict[str, tuple[frozenset[str], ...]]
    actions: tuple[ActionSchema, ...]
    constants: dict[str, str] = field(default_factory=dict)

    def is_a(self, kind: str, allowed: frozenset[str]) -> bool:
        """Return whether a type is one of the allowed types or a subtype of one."""
        while True:
            if kind in allowed or "object" in allowed:
                return True
            if kind not in self.supertypes:
                return False
            kind = self.supertypes[kind]


def shipped_domains() -> tuple[str, ...]:
    """Return the names of the domains in the package."""
    return tuple(sorted(file.stem for file in SHIPPED.glob("*.pddl")))


def load_domain(which: str | Path) -> PddlDomain:
    """Return a shipped domain by name, or the domain in a PDDL file.

    Raises:
        LogicError: unknown name, unreadable file, or invalid PDDL (with line and column).

    Example:
        >>> [schema.name for schema in load_domain("screwdriver").actions]
        ['grasp', 'place']
    """
    path = SHIPPED / f"{which}.pddl"
    if not os.path.isfile(path):
        path = Path(which)
    if not os.path.isfile(path):
        names = shipped_domains()
        raise LogicError(
            f"domain is {str(which)!r}, expected {', '.join(names)} or the path of a PDDL file that is there"
            f"{did_you_mean(str(which), names)}"
        )
    try:
        text = read_settings(path)
    except (OSError, UnicodeDecodeError) as error:
        raise LogicError(f"{path}: cannot be read ({error}); give a PDDL text file") from error
    return parse_domain(text, where=str(path))


def parse_domain(text: str, where: str = "domain") -> PddlDomain:
    """Return the domain that a PDDL text describes.

    Raises:
        LogicError: the text is not PDDL, or has more than `SUPPORTED`; with line and column.
    """
    from lark.exceptions import LarkError, UnexpectedInput
    from pddl.exceptions import PDDLError
    from pddl.parser.domain import DomainParser

    try:
        with _traceback_limit_restored():
            parsed = DomainParser()(text)
    except UnexpectedInput as error:
        place = f"line {error.line}, column {error.column}"
        raise LogicError(f"{where}: {place}: {_unexpected(error)}; check the brackets and keywords there") from error
    except (LarkError, PDDLError, ValueError, AssertionError, TypeError, KeyError, RecursionError) as error:
        reason = " ".join(str(getattr(error, "orig_exc", error)).split()).removesuffix(".")
        lacking = re.search(r"requirement, (:[\w-]+) not|(numeric-fluents) requirement", reason)
        if lacking:
            name = lacking[1] or f":{lacking[2]}"
            what = "not stated; add it to its :requirements" if name in SUPPORTED else f"not supported; use {ALL}"
            raise LogicError(f"{where}: needs the requirement {name}, which is {what}") from error
        raise LogicError(f"{where}: {_blame(text, reason)}{reason}; correct the domain") from error
    return _checked(_convert(parsed, text, where), text, where)


@contextlib.contextmanager
def _traceback_limit_restored() -> Iterator[None]:
    """Restore sys.tracebacklimit, which the parser sets to 0 after a text that it cannot parse."""
    before = getattr(sys, "tracebacklimit", None)
    try:
        yield
    finally:
        if before is None:
            vars(sys).pop("tracebacklimit", None)
        else:
            sys.tracebacklimit = before


def _unexpected(error: Any) -> str:
    token = str(getattr(error, "token", "") or getattr(error, "char", ""))
    return f"unexpected {token!r}" if token.strip() else "the text ends too early"


def _convert(parsed: Any, text: str, where: str) -> PddlDomain:
    """Return the parser's objects as a `PddlDomain`."""
    requirements = {str(requirement) for requirement in parsed.requirements}
    unsupported = sorted(one for one in requirements if f":{one.lstrip(':')}" not in SUPPORTED)
    if unsupported:
        raise LogicError(
            f"{where}: {_place(text, unsupported[0])}requirement {unsupported[0]} is not supported; use {ALL}"
        )

    def kinds(term: Any) -> frozenset[str]:
        return frozenset(map(str, term.type_tags)) or frozenset({"object"})

    actions = []
    for action in parsed.actions:
        parameters = tuple((f"?{p.name}", kinds(p)) for p in action.parameters)
        precondition = _literals(action.precondition, text, where, f"precondition of {action.name}")
        actions.append(ActionSchema(str(action.name), parameters, precondition, *_effects(action, text, where)))
    # The parser returns actions as a set; file order makes searches repeatable.
    actions.sort(key=lambda schema: (_offset(text, schema.name), schema.name))
    return PddlDomain(
        name=str(parsed.name),
        supertypes={str(kind): str(above or "object") for kind, above in parsed.types.items()},
        predicates={str(p.name): tuple(kinds(term) for term in p.terms) for p in parsed.predicates},
        actions=tuple(actions),
        constants={str(c.name): str(c.type_tag or "object") for c in parsed.constants},
    )


def _literals(formula: Any, text: str, where: str, what: str) -> tuple[Literal, ...]:
    if formula is None:
        return ()
    kind = type(formula).__name__
    if kind == "And":
        return tuple(literal for part in formula.operands for literal in _literals(part, text, where, what))
    positive = kind != "Not"
    inner = formula if positive else formula.argument
    equal = type(inner).__name__ == "EqualTo" and what.startswith(CONDITIONS)
    if type(inner).__name__ != "Predicate" and not equal:
        expected = ["predicates", "(and ...)", "(not ...)", *(["(= ...)"] if what.startswith(CONDITIONS) else [])]
        expected += [] if what.startswith(CONDITIONS) else ["(when ...)", "(increase (total-cost) NUMBER)"]
        raise LogicError(
            f"{where}: {_place(text, what.rpartition(' ')[2])}{what} contains {type(inner).__name__.lower()!r}, "
            f"expected {', '.join(expected)} only"
        )
    given = (inner.left, inner.right) if equal else inner.terms
    terms = tuple(f"?{t.name}" if type(t).__name__ == "Variable" else str(t.name) for t in given)
    return (Literal(EQUAL if equal else str(inner.name), terms, positive),)


CONDITIONS: Final = ("precondition", "condition")
"""How the names of formulas begin that are conditions, not effects."""


def _effects(action: Any, text: str, where: str) -> tuple[tuple[Literal, ...], tuple[ConditionalEffect, ...], float]:
    """Return the effects of an action: unconditional, conditional, and its cost."""
    always: list[Literal] = []
    conditional: list[ConditionalEffect] = []
    cost = 0.0
    waiting = [action.effect]
    while waiting:
        part = waiting.pop(0)
        kind = type(part).__name__
        if kind == "And":
            waiting = [*part.operands, *waiting]
        elif kind == "When":
            condition = _literals(part.condition, text, where, f"condition of {action.name}")
            conditional.append(
                ConditionalEffect(condition, _literals(part.effect, text, where, f"effect of {action.name}"))
            )
        elif kind == "Increase":
            cost += _cost(part, action.name, text, where)
        else:
            always += _literals(part, text, where, f"effect of {action.name}")
    return tuple(always), tuple(conditional), cost


def _cost(part: Any, action: str, text: str, where: str) -> float:
    """Return the number by which an action increases the total cost."""
    function, amount = part.operands
    value = float(amount.value) if type(amount).__name__ == "NumericValue" else -1.0
    if str(getattr(function, "name", "")) != COST or not 0.0 <= value < float("inf"):
        raise LogicError(
            f"{where}: {_place(text, action)}effect of {action} is {part}, "
            "expected (increase (total-cost) NUMBER) with a number of 0 or more"
        )
    return value


def _checked(domain: PddlDomain, text: str, where: str) -> PddlDomain:
    """Return the domain if its actions use only predicates and types that it declares."""
    for schema in domain.actions:
        types = dict(schema.parameters)
        for literal in schema.literals:
            if literal.predicate == EQUAL:
                continue
            at = _place(text, literal.predicate)
            if literal.predicate not in domain.predicates:
                hint = did_you_mean(literal.predicate, domain.predicates)
                raise LogicError(
                    f"{where}: {at}action {schema.name} uses undeclared predicate {literal.predicate!r}{hint}"
                )
            allowed_types = domain.predicates[literal.predicate]
            if len(allowed_types) != len(literal.terms):
                raise LogicError(
                    f"{where}: {at}action {schema.name}: {literal.predicate} has {len(literal.terms)} arguments, "
                    f"expected {len(allowed_types)}"
                )
            for term, allowed in zip(literal.terms, allowed_types, strict=True):
                actual = types.get(term) or frozenset({domain.constants.get(term, "")})
                if not all(domain.is_a(kind, allowed) for kind in actual):
                    kinds, expected = " or ".join(sorted(actual)), " or ".join(sorted(allowed))
                    raise LogicError(
                        f"{where}: {at}action {schema.name}: {term} of {literal.predicate} is {kinds}, "
                        f"expected {expected}"
                    )
    return domain


def _offset(text: str, word: str) -> int:
    code = re.sub(r";[^\n]*", lambda comment: " " * len(comment[0]), text)
    match = re.search(rf"(?<![\w-]){re.escape(word)}(?![\w-])", code)
    return match.start() if match else len(text)


def _place(text: str, word: str) -> str:
    """Return "line 3, column 7: " for the first use of a word, "" if it is not in the text."""
    offset = _offset(text, word)
    if offset == len(text):
        return ""
    line = text.count("\n", 0, offset) + 1
    return f"line {line}, column {offset - text.rfind(chr(10), 0, offset)}: "


def _blame(text: str, reason: str) -> str:
    """Return the place of the first quoted word of a parser message that is in the text, as `_place`."""
    words = re.findall(r"'\??([\w-]+)'", reason)
    return next((place for place in (_place(text, word) for word in words) if place), "")
