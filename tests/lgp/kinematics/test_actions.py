"""Records of actions: what is registered, and what a record may not say."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import lgp
from lgp.kinematics.actions import SHIPPED, kind_of, register_action, registered_actions, sentences_of
from lgp.logic.pddl import load_domain, shipped_domains
from lgp.logic.task import Action
from lgp.path.phases import switch_of
from tests.support.own_actions import registered
from tests.support.paths import ROOT
from tests.support.says import says

ROLES = ("hand", "object")
GOOD = lgp.ActionConstraint("it holds", lambda at: at)  # type: ignore[arg-type,return-value]


@pytest.mark.parametrize(
    ("name", "record", "facts"),
    [
        ("grasp", {}, ("'grasp'", "shipped", "another name")),
        ("to grasp", {}, ("'to grasp'", "name of a PDDL action")),
        ("dip", {"roles": ["hand", "object"]}, ("roles", "tuple")),
        ("dip", {"roles": ("hand",)}, ("'object' is missing", "(hand)")),
        ("dip", {"roles": ("hand", "object", "hand")}, ("twice", "(hand, object, hand)")),
        ("dip", {"attaches_to": "table"}, ("'table'", "(hand, object)", "add it")),
        ("dip", {"attaches_to": "tables"}, ("'tables'", "'hand'")),
        ("dip", {"screws": True}, ("screws", "'other'")),
        ("dip", {"given_by": "giver"}, ("given_by", "'giver'")),
        ("dip", {"conflict_scope": "all"}, ("'all'", "'sequence'")),
        ("dip", {"holds_still": True, "attaches_to": "hand"}, ("holds_still", "exclude")),
        ("dip", {"constraints": (3,)}, ("constraint 3", "ActionConstraint")),
        ("dip", {"constraints": (lgp.ActionConstraint("x", GOOD.feature, unit="mm"),)}, ("'rad'",)),
        ("dip", {"sentences": lgp.Sentences("{robot} dips {cup}.", "Dip.", "dips", "dip")}, ("{cup}", "object")),
    ],
)
def test_records_that_contradict_themselves_are_refused(
    name: str, record: dict[str, Any], facts: tuple[str, ...]
) -> None:
    before = registered_actions()
    with pytest.raises(lgp.LgpError) as error:
        register_action(name, lgp.ActionKind(**{"roles": ROLES, **record}))
    says(error, *facts)
    assert registered_actions() == before


def test_ones_own_action_may_be_registered_again_and_has_arguments_by_role() -> None:
    with registered("stir", lgp.ActionKind(ROLES)), registered("stir", lgp.ActionKind((*ROLES, "other", "lamp"))):
        switch = switch_of(Action("stir", ("arm.tcp", "spoon", "pot", "lamp.1"), 0, 0, 0, 0))
    assert switch.arguments == {"hand": "arm.tcp", "object": "spoon", "other": "pot", "lamp": "lamp.1"}
    assert kind_of("stir") is None
    with pytest.raises(lgp.LgpError) as error:
        switch_of(Action("stir", ("arm.tcp", "spoon"), 0, 0, 0, 0))
    says(error, "stir(arm.tcp, spoon)", "grasp(hand, object)", "register_action")


def test_a_shipped_name_with_other_parameters_is_told_which_it_has() -> None:
    with pytest.raises(lgp.LgpError) as error:
        switch_of(Action("grasp", ("arm.tcp", "box", "table.a"), 0, 0, 0, 0))
    says(error, "grasp(arm.tcp, box, table.a) has 3 arguments", "expected grasp(hand, object)", "another name")


def test_an_action_without_sentences_is_named() -> None:
    with registered("look-at", lgp.ActionKind(ROLES)):
        assert sentences_of("look-at").human == "look at {object} with your {hand}."


ROOMS = [room for row in tomllib.loads((ROOT / "docs" / "rooms.toml").read_text())["lgp"] for room in row]
OF_THE_PAPER = ("experiments", "study")
"""Rooms about the two domains of the paper, whose actions they name."""
RECORDS = ROOT / "lgp" / "kinematics" / "actions.py"


def asked_names(source: str, names: set[str]) -> Iterator[str]:
    """Yield the action names that code compares with, looks up or has as keys of a table of several."""
    for node in ast.walk(ast.parse(source)):
        parts: list[ast.AST | None] = []
        if isinstance(node, ast.Compare):
            parts = [node.left, *node.comparators]
        elif isinstance(node, ast.Subscript):
            parts = [node.slice]
        elif isinstance(node, ast.MatchValue):
            parts = [node.value]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith((".get", "kind_of")):
            parts = [*node.args]
        elif isinstance(node, ast.Dict) and sum(getattr(key, "value", None) in names for key in node.keys) > 1:
            parts = [*node.keys]
        texts = (inner for part in parts if part is not None for inner in ast.walk(part))
        yield from (f"{one.lineno}: {one.value!r}" for one in texts
                    if isinstance(one, ast.Constant) and one.value in names)  # fmt: skip


def test_names_that_are_asked_for_are_recognised() -> None:
    code = 'x = {"place": 1}\nif a.name in ("grasp",): x["hold"], x.get("hold"), {"grasp": 1, "hold": 2}'
    asked = [line.partition(": ")[2] for line in asked_names(code, {"grasp", "hold", "place"})]
    assert sorted(asked) == ["'grasp'", "'grasp'", "'hold'", "'hold'", "'hold'"]


@pytest.mark.parametrize("room", [room for room in ROOMS if room not in OF_THE_PAPER])
def test_no_room_asks_for_the_name_of_an_action(room: str) -> None:
    names = {schema.name for domain in shipped_domains() for schema in load_domain(domain).actions} | set(SHIPPED)
    at = ROOT / "lgp" / room
    files: list[Path] = sorted(at.rglob("*.py")) if at.is_dir() else [at.with_suffix(".py")]
    asked = [
        f"{file.relative_to(ROOT)}:{line}"
        for file in files
        if file != RECORDS
        for line in asked_names(file.read_text(encoding="utf-8"), names)
    ]
    assert asked == []


def test_every_shipped_action_has_its_record() -> None:
    assert {schema.name for domain in shipped_domains() for schema in load_domain(domain).actions} == set(SHIPPED)
