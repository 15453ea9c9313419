"""Files that users name are opened by `reba.open_file` alone, and every command refuses what is no regular file."""

from __future__ import annotations

import ast
import os
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest

import dreba.cli
import lgp.cli
import reba.cli
from tests.support.execution_plans import saved
from tests.support.lgp_worlds import needs_robots
from tests.support.paths import ROOT

OPENER = "reba/open_file.py"
OWN = {
    "reba/report/page.py": "templates, scripts and styles of the package",
    "reba/files.py": "a file that was just written, and its folder, to sync them to disk",
    "dreba/domain.py": "domains of the package, through importlib.resources",
    "lgp/page/page.py": "a table of the package",
    "lgp/page/objects.py": "a table of the package",
    "lgp/page/person.py": "a table of the package",
    "lgp/page/sentences.py": "a table of the package",
    "lgp/scene/body_measures.py": "a table of the package",
    "lgp/scene/scene_file.py": "the table of known robots of the package",
}
"""Modules that read a file that no user can choose, and which file."""
READS = ("open", "read_text", "read_bytes", "fdopen")
PARSERS = ("ParquetFile", "read_table", "read_schema", "read_parquet", "parse", "load_scene", "buildModelFromUrdf")
"""Functions of libraries that open a path themselves: they get an open file."""


def _mode(call: ast.Call, at: int) -> str:
    words = [*call.args[at : at + 1], *(word.value for word in call.keywords if word.arg == "mode")]
    return str(words[0].value) if words and isinstance(words[0], ast.Constant) else "r"


def _reads(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Yield (name, line) of every call that opens a file by its path for reading."""
    opened = {
        item.optional_vars.id
        for node in ast.walk(tree)
        if isinstance(node, ast.With)
        for item in node.items
        if isinstance(item.optional_vars, ast.Name) and "open_regular" in ast.dump(item.context_expr)
    }
    for node in ast.walk(tree):
        if not isinstance(node, ast.Call):
            continue
        name = getattr(node.func, "id", getattr(node.func, "attr", ""))
        owner = getattr(getattr(node.func, "value", None), "id", "")
        if name == "open" and (owner in ("known", "named") or _mode(node, 0 if owner else 1)[0] in "wx"):
            continue  # a reader of the registry, or a file that is written
        if name == "open" and any("O_WRONLY" in ast.dump(word) for word in node.args):
            continue
        in_memory = "BytesIO" in ast.dump(node.args[0]) if node.args else False
        if name in READS and not in_memory:
            yield name, node.lineno
        module = owner in ("pq", "pd", "ET", "trimesh", "pin", "c3d", "pa")
        if name in PARSERS and module and not in_memory and getattr(node.args[0], "id", "") not in opened:
            yield f"{owner}.{name}", node.lineno


def test_no_other_module_opens_a_file_for_reading() -> None:
    found = {}
    for package in ("reba", "dreba", "lgp"):
        for file in sorted((ROOT / package).rglob("*.py")):
            name = str(file.relative_to(ROOT))
            reads = list(_reads(ast.parse(file.read_text(encoding="utf-8"))))
            if name != OPENER and reads:
                found[name] = reads
    assert {name: reads for name, reads in found.items() if name not in OWN} == {}
    assert found.keys() == OWN.keys()
    assert all(len(reads) == 1 for reads in found.values()), found


@pytest.mark.parametrize(
    "text",
    ["open(p)", "p.open('rb')", "p.open('a+b')", "p.read_text()", "os.open(p, os.O_RDONLY)", "pd.read_parquet(p)"],
)
def test_the_check_sees_every_way_to_read(text: str) -> None:
    assert list(_reads(ast.parse(text)))


@pytest.mark.parametrize(
    "text", ["p.open('wb')", "Image.open(io.BytesIO(data))", "with open_regular(p) as f:\n    pd.read_parquet(f)"]
)
def test_the_check_permits_writing_and_open_files(text: str) -> None:
    assert not list(_reads(ast.parse(text)))


def _commands(command: click.Command, words: tuple[str, ...]) -> Iterator[tuple[tuple[str, ...], click.Command]]:
    if isinstance(command, click.Group):
        for name, inner in command.commands.items():
            yield from _commands(inner, (*words, name))
    else:
        yield words, command


def _files() -> Iterator[tuple[tuple[str, ...], click.Parameter]]:
    """Yield every command with each of its arguments and options that names a file which is read."""
    for name, group in (("reba", reba.cli.cli), ("dreba", dreba.cli.cli), ("lgp", lgp.cli.cli)):
        for words, command in _commands(group, (name,)):
            for parameter in command.params:
                written = parameter.name in ("output", "report", "tree", "export")
                text = isinstance(parameter.type, click.types.StringParamType)
                named = isinstance(parameter, click.Argument) or any(
                    word in str(parameter.metavar) for word in ("FILE", "MODEL", "LOG", "DIR")
                )
                if text and named and not written:
                    yield words, parameter


FILES = list(_files())


def _line(words: tuple[str, ...], given: click.Parameter, file: Path, folder: Path, strange: Path) -> list[str]:
    """Return a command line with `file` for one parameter and something that works for the others."""
    table = ROOT / "datasets" / "simulated_assembly.csv"
    works = {
        **dict.fromkeys(("a", "b", "path", "inputs", "source", "logs"), str(table)),
        "model": "quadratic",
        "scene": "screwdriver",
        "names": "quadratic",
        "time": "1",
        "pattern": "{participant}_{condition}",
        "target": "c",
        "name": "screwdriver",
        "output": str(folder / ("out.parquet" if words[-1] in ("sample", "convert") else "out")),
        "folder": f"{strange}-plan",
    }
    line = []
    root = {"reba": reba.cli.cli, "dreba": dreba.cli.cli, "lgp": lgp.cli.cli}[words[0]]
    command: click.Command = root
    for word in words[1:]:
        assert isinstance(command, click.Group)
        command = command.commands[word]
    needed = () if given.name == "manifest" else ("logs", "pattern")
    if words == ("reba", "live"):
        works["source"] = str(ROOT / "datasets" / "simulated_palletising.mcap")
    for parameter in command.params:
        if parameter is not given and not parameter.required and parameter.name not in needed:
            continue
        value = str(file) if parameter is given else works.get(str(parameter.name), str(folder / "none"))
        if parameter.name == "plans":
            value = f"a={value}"
        line += [value] if isinstance(parameter, click.Argument) else [parameter.opts[0], value]
    return line


@pytest.fixture(scope="module")
def strange(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Return a folder with a pipe, a socket, links to them and to a device that never ends."""
    folder = tmp_path_factory.mktemp("strange")
    for ending in ("", ".toml", ".mcap", ".json", ".csv", ".parquet"):
        os.mkfifo(folder / f"pipe{ending}")
        (folder / f"link{ending}").symlink_to(folder / f"pipe{ending}")
        (folder / f"zero{ending}").symlink_to("/dev/zero")
    (folder / "none").mkdir()
    saved(folder.parent / f"{folder.name}-plan")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(folder / "socket"))
        yield folder


CODE = """
import sys
from importlib import import_module
name, *lines = sys.argv[1:]
for line in lines:
    sys.argv = [name, *line.split(chr(31))]
    try:
        import_module(f"{name}.cli").main()
    except SystemExit as stop:
        print("EXIT", stop.code, flush=True)
"""


@pytest.mark.slow
@needs_robots
@pytest.mark.parametrize("package", ["reba", "dreba", "lgp"])
def test_what_is_no_file_is_refused_at_once(package: str, strange: Path, tmp_path: Path) -> None:
    lines, named = [], []
    for words, given in FILES:
        if words[0] == package:
            endings = [ending for ending in (".toml", ".mcap", ".json", ".csv") if ending in str(given.metavar)]
            files = [strange / f"{name}{ending}" for name in ("pipe", "link", "zero") for ending in ("", *endings)]
            files += [strange / "socket", strange / "none"]
            named += files
            lines += [[*words[1:], *_line(words, given, file, tmp_path, strange)] for file in files]
    assert len(lines) > 40
    # One process for all of them: most of the time would go into imports.
    done = subprocess.run(
        [sys.executable, "-c", CODE, package, *(chr(31).join(line) for line in lines)],
        capture_output=True, text=True, timeout=300, check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    codes = [line for line in done.stdout.splitlines() if line.startswith("EXIT")]
    assert codes == ["EXIT 2"] * len(lines), (
        [line for line, code in zip(lines, codes, strict=False) if code != "EXIT 2"],
        done.stderr,
    )
    assert "Traceback" not in done.stderr
    told = done.stderr.splitlines()
    assert len(told) == len(lines), done.stderr
    for file, line in zip(named, told, strict=True):
        assert file.name in line
