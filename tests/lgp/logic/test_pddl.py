"""PDDL domains: the paper's actions, messages with line and column."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lgp.errors import LogicError
from lgp.logic.pddl import SHIPPED, load_domain, parse_domain
from tests.support.says import says


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


TEXT = (SHIPPED / "screwdriver.pddl").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("old", "new", "facts"),
    [
        ("(free ?e) (on_table ?o))", "(free ?e) on_table ?o))", ("line", "column", "unexpected")),
        ("(not (free ?e))", "(not (fre ?e))", ("undeclared predicate 'fre'", "did you mean 'free'")),
        ("(grasped ?e ?o) (not", "(grasped ?e) (not", ("expected 2",)),
        ("(placed ?o ?p) (not", "(placed ?p ?o) (not", ("?p of placed is table", "expected thing")),
        (":strips", ":strip", ("line", "column")),
        (":strips", ":strips :numeric-fluents", ("not supported",)),
        ("(define", "(defin", ("line", "column")),
        ("(free ?e) (on_table ?o))))", "(free ?e)", ("ends too early",)),
    ],
)
def test_bad_domains_say_where(old: str, new: str, facts: tuple[str, ...]) -> None:
    assert old in TEXT
    with pytest.raises(LogicError) as error:
        parse_domain(TEXT.replace(old, new, 1))
    says(error, *facts)


@pytest.mark.slow
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
