"""Domains, ground tasks and relaxed heuristics."""

from __future__ import annotations

from collections import deque

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.errors import LogicError
from lgp.logic.heuristic import relaxed_plan, why_unreachable
from lgp.logic.pddl import SHIPPED, load_domain, parse_domain
from lgp.logic.task import Atom, Task, ground, parse_atom
from tests.support.says import says

OBJECTS = {
    "human.right_hand": "human_hand",
    "baxter.left": "robot_hand",
    "baxter.right": "robot_hand",
    "screwdriver": "thing",
    "table.start": "table",
    "table.left": "table",
    "table.center": "table",
}
INITIAL = [
    "free(human.right_hand)",
    "free(baxter.left)",
    "free(baxter.right)",
    "on_table(screwdriver)",
    "placed(screwdriver, table.start)",
]
GOAL = "grasped(human.right_hand, screwdriver)"
DOMAIN = load_domain("screwdriver")


def screwdriver(goal: str = GOAL, initial: list[str] = INITIAL) -> Task:
    return ground(DOMAIN, OBJECTS, map(parse_atom, initial), [parse_atom(goal)])


def shortest(task: Task) -> int | None:
    """Breadth-first search: the true number of actions to the goal."""
    seen, queue = {task.initial}, deque([(task.initial, 0)])
    while queue:
        state, steps = queue.popleft()
        if task.is_goal(state):
            return steps
        for _, after in task.successors(state):
            if after not in seen:
                seen.add(after)
                queue.append((after, steps + 1))
    return None


def test_the_paper_prints_its_actions_like_this() -> None:
    domain = load_domain("screwdriver")
    grasp, place = domain.actions
    assert {(x.predicate, x.positive) for x in grasp.precondition} == {("free", True), ("on_table", True)}
    assert {(x.predicate, x.positive) for x in grasp.effect} == {
        ("grasped", True),
        ("free", False),
        ("on_table", False),
    }
    assert [(x.predicate, x.positive) for x in place.precondition] == [("grasped", True)]
    assert {(x.predicate, x.positive) for x in place.effect} == {
        ("placed", True),
        ("grasped", False),
        ("free", True),
        ("on_table", True),
    }


def test_robot_places_human_grasps() -> None:
    task = screwdriver()
    state = task.initial
    for text in ("grasp(baxter.left, screwdriver)", "place(baxter.left, screwdriver, table.center)"):
        action = task.action(text)
        assert action.applies(state)
        state = action.apply(state)
        assert not task.is_goal(state)
    last = task.action("grasp(human.right_hand, screwdriver)")
    assert last.at(3) == "grasp(3, human.right_hand, screwdriver)"
    state = last.apply(state)
    assert task.is_goal(state)
    held = {str(atom) for atom in task.holding(state)}
    assert "on_table(screwdriver)" not in held
    assert "free(human.right_hand)" not in held
    assert "placed(screwdriver, table.center)" in held


def test_a_full_hand_cannot_grasp() -> None:
    task = screwdriver()
    after = task.action("grasp(baxter.left, screwdriver)").apply(task.initial)
    names = {str(action) for action, _ in task.successors(after)}
    assert names == {f"place(baxter.left, screwdriver, {table})" for table in OBJECTS if table.startswith("table")}


def test_relaxed_plan_bounds_the_length() -> None:
    task = screwdriver()
    seen, queue = {task.initial}, [task.initial]
    while queue:
        state = queue.pop()
        plan = relaxed_plan(task, state)
        true = shortest(Task(task.domain, task.objects, task.atoms, task.actions, state, task.goal))
        assert plan is not None
        assert true is not None
        assert plan.layers <= true
        assert plan.layers <= len(plan.actions)
        for _, after in task.successors(state):
            if after not in seen:
                seen.add(after)
                queue.append(after)
    assert len(seen) > 10


def test_unreachable_goals_say_why() -> None:
    task = screwdriver(initial=[atom for atom in INITIAL if "human" not in atom])
    assert relaxed_plan(task, task.initial) is None
    why = why_unreachable(task)
    assert "grasped(human.right_hand, screwdriver) needs grasp, whose precondition free(human.right_hand)" in why
    assert why_unreachable(screwdriver()) == ""
    lost = screwdriver(initial=[atom for atom in INITIAL if "on_table" not in atom])
    assert "on_table(screwdriver)" in why_unreachable(lost)


@pytest.mark.parametrize(
    ("text", "facts"),
    [
        ("grasped human", ("is no atom",)),
        ("grasped(,x)", ("empty argument",)),
        ("(free x)", ("is no atom",)),
    ],
)
def test_bad_atoms(text: str, facts: tuple[str, ...]) -> None:
    with pytest.raises(LogicError) as error:
        parse_atom(text)
    says(error, *facts)


@pytest.mark.parametrize(
    ("goal", "facts"),
    [
        (
            "grasped(human.right_hand, screwdrivr)",
            (
                "unknown object 'screwdrivr'",
                "did you mean 'screwdriver'",
            ),
        ),
        (
            "graspd(human.right_hand, screwdriver)",
            (
                "unknown predicate",
                "did you mean 'grasped'",
            ),
        ),
        (
            "grasped(human.right_hand)",
            (
                "1 arguments",
                "expected 2",
            ),
        ),
        (
            "grasped(screwdriver, screwdriver)",
            (
                "screwdriver is a thing",
                "expected end_effector",
            ),
        ),
    ],
)
def test_bad_goals(goal: str, facts: tuple[str, ...]) -> None:
    with pytest.raises(LogicError) as error:
        screwdriver(goal)
    says(error, *facts)


def test_bad_objects_and_actions() -> None:
    with pytest.raises(LogicError) as error:
        ground(load_domain("screwdriver"), {"t": "tabel"}, [], [])
    says(error, "unknown type 'tabel'", "did you mean 'table'")
    with pytest.raises(LogicError) as error:
        screwdriver().action("grasp(baxter.left, screwdrive)")
    says(error, "did you mean")
    with pytest.raises(LogicError) as error:
        load_domain("screwdrivers")
    says(error, "screwdrivers", "did you mean 'screwdriver'")


TEXT = (SHIPPED / "screwdriver.pddl").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "facts"),
    [
        (
            "(free ?e) (on_table ?o))",
            "(free ?e) on_table ?o))",
            (
                "line",
                "column",
                "unexpected",
            ),
        ),
        (
            "(not (free ?e))",
            "(not (fre ?e))",
            (
                "undeclared predicate 'fre'",
                "did you mean 'free'",
            ),
        ),
        ("(grasped ?e ?o) (not", "(grasped ?e) (not", ("expected 2",)),
        (
            "(placed ?o ?p) (not",
            "(placed ?p ?o) (not",
            (
                "?p of placed is table",
                "expected thing",
            ),
        ),
        (
            ":strips",
            ":strip",
            (
                "line",
                "column",
            ),
        ),
        (":strips", ":strips :numeric-fluents", ("not supported",)),
        (
            "(define",
            "(defin",
            (
                "line",
                "column",
            ),
        ),
        ("(free ?e) (on_table ?o))))", "(free ?e)", ("ends too early",)),
    ],
)
def test_bad_domains_say_where(old: str, new: str, facts: tuple[str, ...]) -> None:
    assert old in TEXT
    with pytest.raises(LogicError) as error:
        parse_domain(TEXT.replace(old, new, 1))
    says(error, *facts)


@settings(max_examples=25, deadline=None)
@given(st.data())
def test_cut_or_changed_domains_never_leak_other_errors(data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(TEXT) - 1))
    stop = data.draw(st.integers(start, min(start + 60, len(TEXT))))
    text = TEXT[:start] + data.draw(st.text(alphabet="()?-: abc\n;", max_size=8)) + TEXT[stop:]
    try:
        message = str(parse_domain(text).name)
    except LogicError as error:
        message = str(error)
    assert "\n" not in message


def test_atoms_print_and_parse() -> None:
    atom = Atom("placed", ("screwdriver", "table.left"))
    assert parse_atom(str(atom)) == atom


def test_negative_preconditions_hold() -> None:
    domain = parse_domain(
        "(define (domain switch) (:requirements :strips :typing :negative-preconditions) (:types lamp - object)"
        " (:predicates (on ?l - lamp) (broken ?l - lamp))"
        " (:action toggle :parameters (?l - lamp) :precondition (and (not (on ?l)) (not (broken ?l))) :effect (on ?l)))"
    )
    task = ground(domain, {"a": "lamp", "b": "lamp"}, [parse_atom("broken(b)")], [parse_atom("on(a)")])
    assert [str(action) for action, _ in task.successors(task.initial)] == ["toggle(a)"]
    after = task.action("toggle(a)").apply(task.initial)
    assert list(task.successors(after)) == []
