"""Strict TOML tables: values of the right kind, unknown keys refused, every message with place and expectation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from reba.errors import RebaError
from reba.toml_table import TomlTable
from tests.support.says import says

VALUES = {"a": 3, "b": "text", "c": [1, 2], "d": True, "e": {"f": 1.5}, "g": ["x", "y"], "h": [0, 0, 0], "i": 1 << 2000}


@pytest.fixture
def table() -> TomlTable:
    return TomlTable("file: part", VALUES)


def test_values_of_the_right_kind_are_read(table: TomlTable) -> None:
    assert table.number("a", low=0) == 3.0
    assert table.number("z", 1.0) == 1.0
    assert table.whole("a") == 3
    assert table.whole("z", 4) == 4
    assert table.text("b", choices=("text", "")) == "text"
    assert table.vector("c", 2) == (1.0, 2.0)
    assert table.flag("d") is True
    assert table.table("e").number("f") == 1.5
    assert table.numbers("e") == {"f": 1.5}
    assert table.names("b") == ("text",)
    assert table.names("g") == table.texts("g") == ("x", "y")
    assert table.has("h")
    assert table.keys(VALUES) == tuple(VALUES)
    table.done()


@pytest.mark.parametrize(
    ("read", "facts"),
    [
        (lambda table: table.number("b"), ("b is 'text'", "finite number")),
        (lambda table: table.table("e").whole("f"), ("f is 1.5", "whole number")),
        (lambda table: table.whole("a", high=2), ("a is 3", "0 to 2")),
        (lambda table: table.whole("d"), ("d is True", "finite number")),
        (lambda table: table.whole("i"), ("i is", "finite number")),
        (lambda table: table.number("d"), ("d is True", "finite number")),
        (lambda table: table.number("i"), ("finite number",)),
        (lambda table: table.number("a", low=4), ("a is 3", "4 to 1e+06")),
        (lambda table: table.number("a", low=0, high=1), ("a is 3", "0 to 1")),
        (lambda table: table.number("z"), ("z is missing",)),
        (lambda table: table.vector("c", 3), ("c is [1, 2]", "3 numbers")),
        (lambda table: table.unit("h"), ("h is [0.0, 0.0, 0.0]", "direction")),
        (lambda table: table.text("a"), ("a is 3", "text")),
        (lambda table: table.text("b", choices=("texts", "")), ("'text'", "one of texts, ''", "did you mean 'texts'")),
        (lambda table: table.texts("b"), ("b is 'text'", "list of texts")),
        (lambda table: table.names("c"), ("c is [1, 2]", "names in quotes")),
        (lambda table: table.flag("a"), ("a is 3", "true or false")),
        (lambda table: table.table("a"), ("part.a is 3", "a table")),
        (lambda table: table.keys("abcdefgh", "letter"), ("unknown letter 'i'", "known are a, b")),
        (lambda table: table.done(), ("unknown key 'a'",)),
    ],
)
def test_other_values_are_refused(table: TomlTable, read: Callable[[TomlTable], Any], facts: tuple[str, ...]) -> None:
    with pytest.raises(RebaError) as error:
        read(table)
    says(error, "file: part", *facts)
