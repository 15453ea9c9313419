"""The project speaks the language of its fields (docs/glossary.md): words of its own stay out, by an explicit list."""

from __future__ import annotations

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.paths import ROOT

NAMES = {
    "anew", "apart", "believed", "detour", "detours", "found", "habits", "holder", "holders", "hopeless", "pinned",
    "pins", "sighting", "stance", "stretch", "stretches", "swings", "tell", "thing", "things", "ties", "told",
}  # fmt: skip
"""Words that no name of a module, class, function, argument or variable contains."""
TERMS = {"lgp/statistics": {"ties"}}
"""Rooms where such a word is the term of the field: ties are equal values in statistics."""
TEXT = re.compile(
    r"\b(anew|detours?|dual walk|holders?|stance|told|nobody|somewhere|anyhow|quick no|breaks? off|broke off"
    r"|(keep|keeps|kept|keeping) (bodies |them )?apart|how .{1,30} is held apart)\b",
    re.IGNORECASE,
)
"""Words that no docstring, comment, message, page or template contains."""
SPELLING = re.compile(r"\b(centre|colour|recogniz)\w*", re.IGNORECASE)
"""Spellings that no page has: one of each is enough."""
PACKAGES = ("reba", "dreba", "lgp")
ROOMS = sorted(
    {"/".join(path.relative_to(ROOT).parts[:-1][:2]) for package in PACKAGES for path in (ROOT / package).rglob("*.py")}
)
TEMPLATES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.html"))
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]


def bound_names(tree: ast.Module) -> Iterator[tuple[str, int]]:
    """Give every name that a module binds, with its line."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            yield node.name, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.id, node.lineno
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.attr, node.lineno


def words_of(name: str) -> set[str]:
    """Return the words of an identifier in snake or camel case."""
    return {word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)}


def texts(source: str) -> Iterator[tuple[str, int]]:
    """Give the strings and comments of a module, with their lines."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type in (tokenize.STRING, tokenize.COMMENT):
            yield token.string, token.start[0]


def coined_words(text: str) -> list[re.Match[str]]:
    """Return the coined words of a text; one alone in quotes or backticks is a key of an output, which stays."""
    quoted = {'""', "``"}
    return [
        match
        for match in TEXT.finditer(text)
        if text[match.start() - 1] + text[match.end() : match.end() + 1] not in quoted
    ]


@pytest.mark.parametrize("room", ROOMS)
def test_names_are_words_of_the_field(room: str) -> None:
    coined = []
    names = NAMES - TERMS.get(room, set())
    for path in files_of(room):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        own = words_of(path.stem) & names
        coined += [f"{path.name}: {sorted(own)}"] if own else []
        coined += [
            f"{path.relative_to(ROOT)}:{line} {name}" for name, line in bound_names(tree) if words_of(name) & names
        ]
    assert coined == []


@pytest.mark.parametrize("room", ROOMS)
def test_texts_are_words_of_the_field(room: str) -> None:
    coined = [
        f"{path.relative_to(ROOT)}:{line} {match.group()}"
        for path in files_of(room)
        for text, line in texts(path.read_text(encoding="utf-8"))
        for match in coined_words(text)
    ]
    folder = ROOT / room
    pages = [path for kind in ("*.html", "*.toml", "*.js") for path in folder.rglob(kind)] if "/" in room else []
    coined += [
        f"{path.relative_to(ROOT)} {match.group()}" for path in pages for match in coined_words(path.read_text("utf-8"))
    ]
    assert coined == []


@pytest.mark.parametrize("room", ROOMS)
def test_shares_have_a_space_before_their_unit(room: str) -> None:
    """As the International System of Units writes them, on every page and in every message: "19 %"."""
    tight = [
        f"{path.relative_to(ROOT)}:{number}"
        for path in files_of(room)
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if re.search(r"\{[^{}]*:[^{}]*%\}", line)
    ]
    assert tight == []


def files_of(room: str) -> list[Path]:
    """Return the modules of a room: of a package itself only those beside its rooms."""
    folder = ROOT / room
    return sorted(folder.rglob("*.py") if "/" in room else folder.glob("*.py"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_pages_are_words_of_the_field(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert [match.group() for match in coined_words(text) if page.stem != "glossary"] == []


@pytest.mark.parametrize("page", [*PAGES, *TEMPLATES], ids=lambda page: page.stem)
def test_pages_have_one_spelling(page: Path) -> None:
    said = re.sub(r"`[^`]*`|{[{%].*?[%}]}", "", page.read_text(encoding="utf-8"))
    assert SPELLING.findall(said) == []
