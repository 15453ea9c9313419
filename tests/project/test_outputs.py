"""Every output of every command is refused before the work where it cannot be written or would replace an input."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import pytest

import dreba.cli
import lgp.cli
import reba.cli
from reba.command_line import Command, OutputType, run
from tests.support.says import says

GROUPS = {"reba": reba.cli.cli, "dreba": dreba.cli.cli, "lgp": lgp.cli.cli}
TABLE = "time,trunk_flexion\n0,10\n1,20\n"
GIVEN: dict[str, tuple[str, ...]] = {
    "reba score": ("in.csv", "--rules", "in.toml", "--profile", "lab.toml"),
    "reba compare": ("in.csv", "other.csv"),
    "reba convert": ("in.csv", "--profile", "lab.toml"),
    "dreba sample": ("--domain", "in.toml"),
    "dreba fit": ("--poses", "in.csv", "--domain", "in.toml"),
    "dreba evaluate": ("in.json", "--poses", "in.csv"),
    "dreba card": ("in.json", "--usefulness", "other.csv"),
    "dreba export": ("in.json", "--to", "c"),
    "lgp plan": ("in.toml", "--cost", "in.json", "--sequence", "in.txt"),
    "lgp experiment": ("screwdriver", "--cost", "in.json"),
    "lgp page": ("plan",),
    "lgp study": ("in.csv", "--manifest", "other.csv"),
    "lgp simulate-study": ("a=plan",),
    "lgp run": ("plan",),
    "lgp improve": ("in.csv", "--cost", "in.json"),
}
"""What each command that writes is given beside its outputs; every file of it is an input."""
READ = {
    "reba": {
        "--rules", "--profile", "--topic", "--body", "--neutral", "--activity", "--error", "--scheduler", "--window",
        "--hold", "--settle", "--task", "--assessor", "--date", "--camera",
    },
    "dreba": {
        "--kind", "--option", "--poses", "--hold", "--joints", "--domain", "--factors", "--classes", "--name", "--to",
        "--scheduler", "--usefulness", "--map", "--tasks",
    },
    "lgp": {
        "--cost", "--scene", "--sequence", "--height", "--scheduler", "--manifest", "--pattern", "--conditions",
        "--rules", "--profile", "--topic", "--body", "--neutral", "--activity", "--fault", "--replay", "--host",
    },
}  # fmt: skip
"""Options with a text that is read and never written to: a new option stands here, or has an `OutputType`."""
ENDINGS = {"dreba sample -o": ".parquet", "reba convert -o": ".csv", "dreba export -o": ".c"}


def commands() -> Iterator[tuple[str, click.Command]]:
    for group, cli in GROUPS.items():
        for name, command in cli.commands.items():
            yield f"{group} {name}", command


def outputs(command: click.Command) -> dict[str, OutputType]:
    return {param.opts[0]: param.type for param in command.params if isinstance(param.type, OutputType)}


PLACES = [(name, option) for name, command in commands() for option in outputs(command)]
FOLDERS = {"lgp plan -o", "lgp experiment -o", "lgp page -o", "lgp study -o", "lgp simulate-study -o"}
FILES = [(name, option) for name, option in PLACES if f"{name} {option}" not in FOLDERS]


def test_every_option_is_known_to_write_or_to_read() -> None:
    unknown = []
    for name, command in commands():
        for param in command.params:
            plain = isinstance(param.type, click.types.StringParamType) and not isinstance(param.type, OutputType)
            if isinstance(param, click.Option) and plain and param.opts[-1] not in READ[name.split()[0]]:
                unknown.append(f"{name} {param.opts[-1]}")
            if isinstance(param, click.Option) and isinstance(param.type, click.types.File | click.Path):
                unknown.append(f"{name} {param.opts[-1]}: opened before it is checked")
    assert unknown == []


def test_every_command_that_writes_checks_it_and_is_tested() -> None:
    writing = {name for name, command in commands() if outputs(command)}
    assert writing == set(GIVEN)
    assert {name for name, command in commands() if not isinstance(command, Command)} == set()
    assert {f"{name} {option}" for name, option in PLACES} >= FOLDERS
    assert len(PLACES) >= 16


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give a folder with all inputs, in which a command that starts its work is an error."""
    folder = tmp_path / "here"
    (folder / "plan").mkdir(parents=True)
    for name in ("in.csv", "other.csv", "in.toml", "lab.toml", "in.json", "in.txt", "plan/plan.json"):
        (folder / name).write_text(TABLE if name.endswith(".csv") else "")
    monkeypatch.chdir(folder)

    def work(*_: Any) -> None:
        raise AssertionError("the work began")

    for _, command in commands():
        monkeypatch.setattr(command, "callback", work)
    return folder


def refused(folder: Path, name: str, option: str, value: str, capsys: pytest.CaptureFixture[str], *more: str) -> str:
    """Return the message of a command whose output is refused; nothing may have changed."""
    group, command = name.split()
    words = [command, *GIVEN[name], option, value, *more]
    for other in outputs(GROUPS[group].commands[command]):
        required = any(other in param.opts and param.required for param in GROUPS[group].commands[command].params)
        if required and other != option and other not in more:
            words += [other, f"fine{ENDINGS.get(f'{name} {other}', '')}"]
    before = snapshot(folder)
    argv, sys.argv = sys.argv, [group, *words]
    try:
        with pytest.raises(SystemExit) as stop:
            run(GROUPS[group], group)
    finally:
        sys.argv = argv
    printed = capsys.readouterr()
    assert (stop.value.code, printed.out) == (2, ""), printed
    assert snapshot(folder) == before
    return printed.err


def snapshot(folder: Path) -> dict[str, tuple[int, int]]:
    return {str(path): (path.stat().st_ino, path.stat().st_mtime_ns) for path in folder.rglob("*")}


@pytest.mark.parametrize(("name", "option"), PLACES)
def test_what_cannot_be_written_is_refused_before_the_work(
    name: str, option: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ending = ENDINGS.get(f"{name} {option}", "")
    for value in (f"in.csv/below{ending}", f"/proc/nothing{ending}", f"{'x' * 256}{ending}", ""):
        text = refused(place, name, option, value, capsys)
        says(text, value or "empty name", "cannot be written" if value else "expected")


@pytest.mark.parametrize(("name", "option"), FILES)
def test_only_regular_files_are_replaced(
    name: str, option: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ending = ENDINGS.get(f"{name} {option}", "")
    (place / f"null{ending}").symlink_to("/dev/null")
    says(refused(place, name, option, f"null{ending}", capsys), f"null{ending}")
    if (name, option) != ("reba score", "-o"):
        (place / f"folder{ending}").mkdir()
        says(refused(place, name, option, f"folder{ending}", capsys), f"folder{ending}", "this is a folder")


@pytest.mark.parametrize(("name", "option"), [place for place in PLACES if place not in FILES])
def test_a_file_is_no_folder(name: str, option: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for value in ("in.csv", "/dev/null"):
        says(refused(place, name, option, value, capsys), value, "not a folder")


@pytest.mark.parametrize(("name", "option"), FILES)
def test_no_input_is_replaced_by_any_name(
    name: str, option: str, place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ending = ENDINGS.get(f"{name} {option}", "")
    read = [word for word in GIVEN[name] if (place / word).is_file() and (not ending or word.endswith(ending))]
    for number, word in enumerate(read):
        symbolic, hard = f"symbolic{number}{Path(word).suffix}", f"hard{number}{Path(word).suffix}"
        (place / symbolic).symlink_to(place / word)
        os.link(place / word, place / hard)
        for value in (word, f"../here/{word}", str(place / word), symbolic, hard):
            says(refused(place, name, option, value, capsys), value)


@pytest.mark.parametrize("name", [name for name, command in commands() if len(outputs(command)) > 1])
def test_two_outputs_are_two_files(name: str, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    group, command = name.split()
    first, second = outputs(GROUPS[group].commands[command])
    for values in (("both.csv", "both.csv"), ("both.csv", "./new/../both.csv"), ("both/under", "both")):
        says(refused(place, name, first, values[0], capsys, second, values[1]), "another output")


@pytest.mark.parametrize(
    ("name", "option", "value"),
    [
        ("reba score", "-o", "bag/scores.parquet"),
        ("reba score", "-o", "bag/scores"),
        ("reba score", "--report", "bag/a.html"),
        ("reba compare", "--report", "bag/a.html"),
        ("reba convert", "-o", "bag/a.csv"),
        ("dreba fit", "-o", "bag/m.json"),
        ("dreba fit", "--report", "bag/m.html"),
        ("dreba evaluate", "--report", "bag/m.html"),
        ("lgp study", "-o", "bag"),
        ("lgp study", "-o", "bag/new"),
        ("lgp study", "--report", "bag/a.html"),
    ],
)
def test_nothing_is_written_into_a_recording(
    name: str, option: str, value: str, place: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (place / "bag").mkdir()
    shutil.copy(place / "in.csv", place / "bag" / "metadata.yaml")
    (place / "bag" / "bag_0.mcap").write_bytes(b"")
    given = tuple("bag" if word == "in.csv" else word for word in GIVEN[name])
    monkeypatch.setitem(GIVEN, name, given)
    says(refused(place, name, option, value, capsys), value, "lies in the recording bag")
