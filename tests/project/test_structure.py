"""The structure of the packages: rooms import downhill only, and no circle, lazy or for types alone, is hidden."""

from __future__ import annotations

import ast
import runpy
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.paths import ROOT

ROOMS = tomllib.loads((ROOT / "docs" / "rooms.toml").read_text(encoding="utf-8"))
"""The rooms of each package in their order; a module imports its own row and those above it."""
COMMANDS = {"cli.py", "command.py", "commands.py", "options.py"}
"""Files of commands, which import on use what one command alone needs, so that `--help` is quick."""


def modules() -> dict[str, Path]:
    files = (path for package in ROOMS for path in (ROOT / package).rglob("*.py"))
    return {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in files}


MODULES = modules()
TRAVELLING = {"reba.batch.dask_cluster"}
"""Modules with functions that travel to other machines as code and import there."""
FACES = set(ROOMS)
"""What outside programs import; nothing inside a package imports its own face."""


def imports(path: Path) -> Iterator[tuple[str, ast.AST]]:
    """Give every project module that a file imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name in MODULES:
                    yield alias.name, node
        elif isinstance(node, ast.ImportFrom) and node.module in MODULES:
            for alias in node.names:
                inner = f"{node.module}.{alias.name}"
                yield (inner if inner in MODULES else node.module), node


GRAPH = {name: {to for to, _ in imports(path)} - {name} for name, path in MODULES.items()}


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """Return groups of modules that reach each other (Tarjan's strongly connected components)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for to in graph[node]:
            if to not in index:
                visit(to)
                low[node] = min(low[node], low[to])
            elif to in stack:
                low[node] = min(low[node], index[to])
        if low[node] == index[node]:
            group = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(group) > 1:
                found.append(sorted(group))

    for node in graph:
        if node not in index:
            visit(node)
    return found


def test_circles_are_recognised() -> None:
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a", "d"}, "d": set()}) == [["a", "b", "c"]]


def test_no_import_circle() -> None:
    assert circles(GRAPH) == []


def level(module: str) -> int | None:
    """Return the position of a module's room in its package, None where it has none."""
    package, _, inner = module.partition(".")
    ranks = {room: rank for rank, rooms in enumerate(ROOMS[package]) for room in rooms}
    parts = inner.split(".")
    return next((ranks[room] for n in range(len(parts), 0, -1) if (room := ".".join(parts[:n])) in ranks), None)


@pytest.mark.parametrize("package", sorted(ROOMS))
def test_rooms_import_downhill(package: str) -> None:
    uphill = [
        f"{name} imports {to}"
        for name in MODULES
        if name.startswith(f"{package}.")
        for to in GRAPH[name]
        if to in FACES & {package} or (to.startswith(f"{package}.") and level(to) > level(name))
    ]
    assert uphill == []


def test_project_imports_stand_at_the_top() -> None:
    inner = []
    for name, path in MODULES.items():
        tree = ast.parse(path.read_text(encoding="utf-8"))
        if path.name in COMMANDS or name in FACES | TRAVELLING:
            continue
        top = {id(node) for node in tree.body}
        inner += [f"{name}:{node.lineno}" for _, node in imports_of(tree) if id(node) not in top]
    assert inner == []


def imports_of(tree: ast.Module) -> Iterator[tuple[str, ast.stmt]]:
    """Give the statements that import from the project."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in ROOMS:
            yield node.module or "", node
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.split(".")[0] in ROOMS:
                    yield alias.name, node


def test_every_module_has_a_room_and_every_room_a_module() -> None:
    lived = {name for name in MODULES if name not in FACES}
    assert [name for name in lived if level(name) is None] == []
    rooms = {f"{package}.{room}" for package, rows in ROOMS.items() for row in rows for room in row}
    assert [room for room in rooms if not any(name == room or name.startswith(f"{room}.") for name in lived)] == []


def test_the_picture_of_the_rooms_is_that_of_the_code() -> None:
    drawing = runpy.run_path(str(ROOT / "docs" / "draw_rooms.py"))
    assert drawing["PICTURE"].read_text(encoding="utf-8") == drawing["draw"](), "run: python docs/draw_rooms.py"


def test_every_room_says_what_it_is_for() -> None:
    rooms = [path for path in MODULES.values() if path.name == "__init__.py"]
    assert [str(path) for path in rooms if not ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))] == []
    assert [str(path) for path in MODULES.values() if len(path.read_text(encoding="utf-8").splitlines()) > 400] == []
