"""Ground tasks: states, actions, messages."""

from __future__ import annotations

import pytest

from lgp.errors import LogicError
from lgp.logic.pddl import load_domain, parse_domain
from lgp.logic.task import Atom, ground, parse_atom
from tests.support.lgp_tasks import OBJECTS, screwdriver
from tests.support.says import says


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


def test_actions_of_one_hand_or_one_object_do_not_commute() -> None:
    task = screwdriver()
    left, right = (task.action(f"grasp(baxter.{side}, screwdriver)") for side in ("left", "right"))
    put, other = (task.action(f"place(baxter.left, screwdriver, table.{table})") for table in ("left", "center"))
    assert not left.commutes_with(right)
    assert not left.commutes_with(put)
    assert not put.commutes_with(other)
    tools = {**OBJECTS, "hammer": "thing"}
    first = [parse_atom(text) for text in ("free(baxter.left)", "free(baxter.right)", "on_table(hammer)")]
    more = ground(load_domain("screwdriver"), tools, [*first, parse_atom("on_table(screwdriver)")], [])
    assert more.action("grasp(baxter.left, screwdriver)").commutes_with(more.action("grasp(baxter.right, hammer)"))


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
        ("grasped(human.right_hand, screwdrivr)", ("unknown object 'screwdrivr'", "did you mean 'screwdriver'")),
        ("graspd(human.right_hand, screwdriver)", ("unknown predicate", "did you mean 'grasped'")),
        ("grasped(human.right_hand)", ("1 arguments", "expected 2")),
        ("grasped(screwdriver, screwdriver)", ("screwdriver is a thing", "expected end_effector")),
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
