"""The toolbox domain: the paper's operators, who may do what, and which orders lead to the goal."""

from __future__ import annotations

import pytest

from lgp.logic.pddl import load_domain
from lgp.logic.task import Task, ground, parse_atom

HANDLE, SIDE = "toolbox/handle", "toolbox/side.left"
OBJECTS = {
    "human.right_hand": "human_hand",
    "baxter.left": "vacuum_gripper",
    "baxter.right": "parallel_gripper",
    HANDLE: "thing",
    SIDE: "thing",
    "table.robot": "table",
    "table.center": "table",
}
INITIAL = [
    *(f"free({name})" for name in ("human.right_hand", "baxter.left", "baxter.right")),
    *(f"on_table({part})" for part in (HANDLE, SIDE)),
    *(f"placed({part}, table.robot)" for part in (HANDLE, SIDE)),
    f"fit({HANDLE}, {SIDE})",
]
PAPER = {
    "ergonomic": (
        f"grasp(baxter.left, {HANDLE})",
        f"handover(baxter.left, {HANDLE}, human.right_hand)",
        f"place(human.right_hand, {HANDLE}, table.center)",
        f"grasp(baxter.left, {SIDE})",
        f"handover(baxter.left, {SIDE}, human.right_hand)",
        f"place(human.right_hand, {SIDE}, table.center)",
        f"hold(baxter.right, {HANDLE})",
        f"screw(human.right_hand, {HANDLE}, {SIDE})",
    ),
}
PAPER["non-ergonomic"] = (*PAPER["ergonomic"][:2], *PAPER["ergonomic"][3:1:-1], *PAPER["ergonomic"][4:])
BEYOND = {"holding", "fixed", "fit"}
"""Predicates that are not in the paper; `grasp` has `not held` beyond it too."""


@pytest.fixture(scope="module")
def task() -> Task:
    goal = [parse_atom(f"screwed({HANDLE}, {SIDE})")]
    return ground(load_domain("toolbox"), OBJECTS, map(parse_atom, INITIAL), goal)


@pytest.mark.parametrize("condition", PAPER)
def test_the_printed_sequences_reach_the_goal(task: Task, condition: str) -> None:
    state = task.initial
    for text in PAPER[condition]:
        action = task.action(text)
        assert action.applies(state), text
        assert not task.is_goal(state)
        state = action.apply(state)
    assert task.is_goal(state)


@pytest.mark.parametrize(
    ("name", "needs", "effects"),
    [
        ("grasp", {"free(?e)", "on_table(?o)"}, {"grasped(?e, ?o)", "-free(?e)", "-on_table(?o)"}),
        (
            "place",
            {"grasped(?e, ?o)"},
            {"placed(?o, ?p)", "-grasped(?e, ?o)", "free(?e)", "on_table(?o)"},
        ),
        (
            "handover",
            {"grasped(?e1, ?o)", "free(?e2)"},
            {"-grasped(?e1, ?o)", "free(?e1)", "grasped(?e2, ?o)", "-free(?e2)"},
        ),
        ("hold", {"on_table(?o)", "free(?e)"}, {"held(?o)", "-free(?e)"}),
        (
            "screw",
            {"on_table(?o1)", "on_table(?o2)", "free(?e)", "held(?o1)"},
            {"screwed(?o1, ?o2)", "-held(?o1)"},
        ),
    ],
)
def test_operators_are_the_printed_ones(name: str, needs: set[str], effects: set[str]) -> None:
    schema = next(schema for schema in load_domain("toolbox").actions if schema.name == name)

    def texts(literals: tuple) -> set[str]:
        return {
            f"{'' if literal.positive else '-'}{literal.predicate}({', '.join(literal.terms)})"
            for literal in literals
            if literal.predicate not in BEYOND
        }

    assert texts(schema.precondition) - {"-held(?o)"} == needs
    assert texts(schema.effect) == effects


def test_types_say_who_may_do_what(task: Task) -> None:
    doers: dict[str, set[str]] = {}
    for action in task.actions:
        doers.setdefault(action.name, set()).add(action.arguments[0])
    assert doers == {
        "grasp": {"human.right_hand", "baxter.left"},
        "place": {"human.right_hand"},
        "handover": {"baxter.left"},
        "hold": {"human.right_hand", "baxter.right"},
        "screw": {"human.right_hand"},
        "release": {"human.right_hand", "baxter.right"},
    }


def test_a_held_part_stays_and_the_gripper_leaves_only_after_the_screw(task: Task) -> None:
    state = task.initial
    hold, release = task.action(f"hold(baxter.right, {HANDLE})"), task.action(f"release(baxter.right, {HANDLE})")
    screw = task.action(f"screw(human.right_hand, {HANDLE}, {SIDE})")
    state = hold.apply(state)
    assert not task.action(f"grasp(baxter.left, {HANDLE})").applies(state)
    assert not release.applies(state)
    state = screw.apply(state)
    assert release.applies(state)
    assert not task.action(f"grasp(baxter.left, {SIDE})").applies(state)
    after = {str(atom) for atom in task.holding(release.apply(state))}
    assert "free(baxter.right)" in after
    assert f"holding(baxter.right, {HANDLE})" not in after
