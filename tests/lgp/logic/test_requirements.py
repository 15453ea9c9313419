"""Equality, conditional effects, action costs and negated goals: what they mean, and what is refused in one line."""

from __future__ import annotations

from itertools import product

import pytest

from lgp.errors import LogicError
from lgp.logic.heuristic import relaxed_plan, why_unreachable
from lgp.logic.impossible import _pairs, exclusive_goals, fewest_actions
from lgp.logic.pddl import parse_domain
from lgp.logic.task import Atom, Task, ground, parse_atom, parse_goal
from tests.support.says import says

TEXT = """
(define (domain kitchen)
  (:requirements :strips :typing :negative-preconditions :equality :conditional-effects :action-costs)
  (:types hand cup - object)
  (:predicates (clean ?c - cup) (full ?c - cup) (wet ?h - hand) (empty ?c - cup) (spilled ?c - cup))
  (:functions (total-cost) - number)
  (:action pour
    :parameters (?h - hand ?from ?to - cup)
    :precondition (and (full ?from) (not (= ?from ?to)))
    :effect (and (not (full ?from)) (empty ?from) (increase (total-cost) 2.5)
                 (when (full ?to) (and (wet ?h) (spilled ?to)))
                 (when (and (empty ?to) (not (full ?to))) (and (full ?to) (not (empty ?to))))))
  (:action dry
    :parameters (?h - hand)
    :precondition (wet ?h)
    :effect (not (wet ?h))))
"""
OBJECTS = {"hand": "hand", "a": "cup", "b": "cup", "c": "cup"}


def task(initial: list[str], goal: list[str], text: str = TEXT) -> Task:
    return ground(parse_domain(text), OBJECTS, map(parse_atom, initial), *parse_goal(goal))


def every_state(one: Task) -> set[int]:
    seen, queue = {one.initial}, [one.initial]
    while queue:
        for _, after in one.successors(queue.pop()):
            if after not in seen:
                seen.add(after)
                queue.append(after)
    return seen


def names(one: Task, state: int) -> set[str]:
    return {str(atom) for atom in one.holding(state)}


def test_equality_is_decided_when_parameters_are_bound() -> None:
    actions = [
        action.arguments for action in task(["full(a)", "full(b)"], ["empty(a)"]).actions if action.name == "pour"
    ]
    assert sorted(actions) == sorted(("hand", x, y) for x, y in product("ab", "abc") if x != y), "full(c) is never true"
    equal = TEXT.replace("(not (= ?from ?to))", "(= ?from ?to)")
    actions = [action.arguments for action in task(["full(a)"], ["empty(a)"], equal).actions if action.name == "pour"]
    assert actions == [("hand", "a", "a")]


def test_conditional_effects_are_those_of_the_state_before() -> None:
    one = task(["full(a)", "full(b)", "empty(c)"], ["full(c)"])
    into_full, into_empty = one.action("pour(hand, a, b)"), one.action("pour(hand, a, c)")
    assert names(one, into_full.apply(one.initial)) == {"empty(a)", "full(b)", "empty(c)", "wet(hand)", "spilled(b)"}
    assert names(one, into_empty.apply(one.initial)) == {"empty(a)", "full(b)", "full(c)"}
    assert not into_full.commutes_with(into_empty)
    assert into_full.cost == 2.5
    assert one.action("dry(hand)").cost == 0.0


def test_what_a_condition_alone_makes_true_is_reachable() -> None:
    one = task(["full(a)", "full(b)"], ["spilled(b)"])
    assert Atom("spilled", ("b",)) in one.atoms
    assert Atom("full", ("c",)) not in one.atoms
    relaxed = relaxed_plan(one, one.initial)
    assert relaxed is not None
    assert relaxed.layers == 1
    assert fewest_actions(one) == 1


@pytest.mark.parametrize("goal", [["not wet(hand)", "spilled(b)"], ["not full(a)"], ["not full(a)", "not full(b)"]])
def test_negated_goals_are_searched(goal: list[str]) -> None:
    one = task(["full(a)", "full(b)", "empty(c)"], goal)
    assert not one.is_goal(one.initial)
    states = every_state(one)
    assert any(one.is_goal(state) for state in states)
    for state in states:
        relaxed = relaxed_plan(one, state)
        true = fewest_actions(Task(one.domain, one.objects, one.atoms, one.actions, state, one.goal, one.goal_not))
        assert true is not None
        if true >= 0:
            assert relaxed is not None
            assert relaxed.layers <= true


def test_pairs_of_atoms_that_exclude_each_other_stay_sound() -> None:
    one = task(["full(a)", "full(b)", "empty(c)"], ["full(c)"])
    together = _pairs(one)
    for state in every_state(one):
        held = [bit for bit in range(len(one.atoms)) if state >> bit & 1]
        assert together[held][:, held].all()
    assert exclusive_goals(one) is None


def test_a_negated_goal_that_stays_true_has_a_reason() -> None:
    one = task(["full(a)", "spilled(b)"], ["not spilled(b)"])
    assert relaxed_plan(one, one.initial) is None
    assert why_unreachable(one) == "spilled(b) is true initially and no action that can be taken deletes it"
    with pytest.raises(LogicError) as error:
        task(["full(a)"], ["full(a)", "not full(a)"])
    says(error, "full(a)", "negation")


@pytest.mark.parametrize(
    ("old", "new", "facts"),
    [
        ("(empty ?from) (inc", "(forall (?x - cup) (empty ?x)) (inc", ("effect of pour", "'forall'", "(when ...)")),
        (
            ":equality",
            ":equality :disjunctive-preconditions",
            ("disjunctive-preconditions", "not supported", ":equality"),
        ),
        ("cost) 2.5)", "cost) -2.5)", ("line",)),
        ("(increase (total-cost) 2.5)", "(decrease (total-cost) 2.5)", ("pour", "'decrease'", "(increase")),
        (":equality", "", ("needs the requirement :equality", "add it to its :requirements")),
        ("(not (= ?from ?to))", "(or (= ?from ?to))", (":disjunctive-preconditions", "not supported", ":equality")),
        ("(total-cost) - number", "(total-cost) (level ?c - cup) - number", (":numeric-fluents", "not supported")),
        ("(when (full ?to) (and", "(when (ful ?to) (and", ("undeclared predicate 'ful'", "did you mean 'full'")),
    ],
)
def test_what_is_more_is_refused(old: str, new: str, facts: tuple[str, ...]) -> None:
    assert old in TEXT
    with pytest.raises(LogicError) as error:
        parse_domain(TEXT.replace(old, new, 1))
    says(error, *facts)
