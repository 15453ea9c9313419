"""Every code block of the documentation runs: Python as doctest, consoles by command, options against the CLI."""

from __future__ import annotations

import doctest
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import click
import pytest

import dreba.cli
import lgp.cli
import reba.cli
from lgp.planner import task_of
from lgp.scene.scene_file import read_scene
from tests.support.paths import ROOT

pytestmark = pytest.mark.slow


PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
COMMANDS = {"reba": reba.cli.cli, "dreba": dreba.cli.cli, "lgp": lgp.cli.cli}
KINDS = {"python", "console", "toml", "text", "json", "{toctree}", "{math}", "{eval-rst}"}
"""What a fenced block may be; `text` is output or a formula, and is not run."""
CHECK = doctest.OutputChecker()
LOOSE = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def blocks(page: Path, kind: str) -> list[str]:
    """Return the fenced blocks of one kind."""
    return re.findall(rf"^```{kind}\n(.*?)^```$", page.read_text(encoding="utf-8"), flags=re.M | re.S)


def with_blocks(kind: str) -> list[object]:
    return [pytest.param(page, id=page.stem) for page in PAGES if blocks(page, kind)]


def steps(block: str) -> list[tuple[str, str]]:
    """Return (command, expected output) of a console block."""
    parts = re.split(r"^\$ ", block, flags=re.M)
    assert not parts[0].strip(), "a console block begins with a command"
    pairs = [part.partition("\n") for part in parts[1:]]
    return [(command, expected) for command, _, expected in pairs]


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """A folder with the data sets in it, as after `cd datasets`, and beside it, as in the checkout."""
    for file in (ROOT / "datasets").iterdir():
        if file.suffix in (".mcap", ".csv", ".trc"):
            shutil.copy(file, tmp_path / file.name)
    (tmp_path / "datasets").symlink_to(ROOT / "datasets")
    return tmp_path


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_every_block_says_what_it_is(page: Path) -> None:
    opened = re.findall(r"^```(.*)$", page.read_text(encoding="utf-8"), flags=re.M)
    assert len(opened) % 2 == 0
    assert set(opened[::2]) <= KINDS
    assert set(opened[1::2]) <= {""}


@pytest.mark.parametrize("page", with_blocks("python"))
def test_python_prints_what_it_says(page: Path, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT if page.parent == ROOT else place)
    text = page.read_text(encoding="utf-8")
    for block in blocks(page, "python"):
        assert ">>>" in block, "Python is shown with its output"
    result = doctest.testfile(str(page), module_relative=False, optionflags=doctest.ELLIPSIS)
    assert result.attempted >= text.count("\n>>> ")
    assert result.failed == 0


@pytest.mark.parametrize("page", with_blocks("console"))
def test_consoles_print_what_they_say(page: Path, place: Path) -> None:
    paths = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": paths, "COLUMNS": "80", "NO_COLOR": "1"}
    for block in blocks(page, "console"):
        for command, expected in steps(block):
            done = subprocess.run(
                shlex.split(command), cwd=place, env=environment, capture_output=True, text=True, check=False
            )
            assert done.returncode == 0, f"{command}\n{done.stderr}"
            # Messages go to stderr and are seen in a terminal as well.
            printed = done.stdout + done.stderr
            if expected.strip():
                assert CHECK.check_output(expected, printed, LOOSE), f"{command}\n{printed}"


@pytest.mark.parametrize("page", with_blocks("toml"))
def test_toml_can_be_read(page: Path) -> None:
    for block in blocks(page, "toml"):
        values = tomllib.loads(block)
        if "goal" in values:
            assert task_of(read_scene(values, page.stem)).actions


def shown_commands() -> list[object]:
    """Return every command line that a page shows, indented or in a line of text."""
    found: dict[str, Path] = {}
    for page in PAGES:
        text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
        lines = re.findall(r"^    ((?:reba|dreba|lgp) .*)$", text, flags=re.M)
        lines += re.findall(r"`((?:reba|dreba|lgp) \w+ [^`]+)`", text)
        found |= dict.fromkeys((line.split(" #")[0].split("  ")[0].strip() for line in lines), page)
    return [pytest.param(line, id=f"{page.stem}: {line}") for line, page in found.items()]


@pytest.mark.parametrize("line", shown_commands())
def test_shown_commands_exist_with_their_options(line: str) -> None:
    program, *words = shlex.split(line.replace("[", "").replace("]", "").replace("...", ""))
    group = COMMANDS[program]
    name = next((word for word in words if not word.startswith("-")), None)
    if name is None:
        return
    assert name in group.commands, line
    command = group.commands[name]
    known = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
    known |= {"--help"}
    for word in words:
        if re.match(r"--?[a-zA-Z]", word):
            assert word.split("=")[0] in known, f"{line}: {word}"
    assert isinstance(command, click.Command)
