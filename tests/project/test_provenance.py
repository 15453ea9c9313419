"""Every file and every JSON output of every command states the version that computed it, each format in its one way."""

from __future__ import annotations

import importlib
import json
import os
import re
import sys
import zipfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader

import reba
from lgp.defaults import COST
from lgp.experiments.runs import RunStore
from lgp.experiments.screwdriver import DEPTH, SCENE
from lgp.experiments.variants import setting, settings_of
from reba.batch.manifest import MANIFEST
from tests.support.execution_plans import small_plan
from tests.support.lgp_worlds import HAS_ROBOTS
from tests.support.screwdriver_runs import made
from tests.support.studies import log

pytestmark = pytest.mark.slow

BENCH = """
domain = "screwdriver"
initial = ["on_table(box)", "free(human.right_hand)"]
goal = ["grasped(human.right_hand, box)"]
[human]
hands = ["right_hand"]
[tables.near]
position = [0.5, 0.1]
size = [0.6, 0.4]
height = 0.8
[objects.box]
size = [0.3, 0.1, 0.2]
mass = 2.0
on = "table.near"
"""
COMMANDS: Mapping[str, tuple[str, ...]] = {
    "reba score": ("in.csv -o s.parquet --report s.html --json", "in.csv -o s.csv", "in.csv -o s.mcap",
                   "in.csv -o s.xlsx",
                   "in.csv other.csv -o dataset --json"),
    "reba info": ("in.csv --json",),
    "reba compare": ("in.csv other.csv --report c.html --json",),
    "reba explain": ("in.csv --at 0.1 --json",),
    "reba improve": ("in.csv --at 0.1 --json", "in.csv --json"),
    "reba convert": ("in.csv -o p.parquet --json", "in.csv -o p.csv", "in.csv -o p.mcap"),
    "reba profiles": ("--json",),
    "reba live": ("p.mcap --until-idle 0.1",),
    "dreba sample": ("-n 300 -o poses.parquet --json",),
    "dreba fit": ("--poses poses.parquet -o model.json --report model.html --json",),
    "dreba evaluate": ("model.json --poses poses.parquet --report e.html --json",),
    "dreba compare": ("model.json --poses poses.parquet --tasks 0 --json",),
    "dreba card": ("model.json -o card.md --json",),
    "dreba export": ("model.json --to c -o m.c --json", "model.json --to casadi -o m.casadi",
                     "model.json --to torch -o t.py", "model.json --to jax -o j.py"),
    "lgp plan": ("bench.toml --no-ergonomics -o bench --tree tree.svg --json",),
    "lgp experiment": ("screwdriver --as ours --runs 12 -o experiment --json",),
    "lgp page": ("plan -o page --json",),
    "lgp scenes": ("--json",),
    "lgp study": ("logs -o study --pattern {participant}_{condition} --report study.html --json",),
    "lgp simulate-study": ("a=bench b=bench --participants 2 -o simulated --json",),
    "lgp improve": ("arms.csv --at 0.1 --heights 0.9 1.1 --distances 0.3 0.4 --report moved.html --json",),
    "lgp run": ("plan --speed 0 --no-page --no-compare --human exact --json", "plan --export motion.mcap --json"),
}  # fmt: skip
"""Command -> lines that together write each kind of file and JSON it can; in an order in which inputs exist."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Give the current folder of all commands, with inputs."""
    inside = tmp_path_factory.mktemp("outputs")
    before = Path.cwd()
    os.chdir(inside)
    for name, trunk in (("in.csv", 10.0), ("other.csv", 50.0)):
        frames = pd.DataFrame({"time": [0.0, 0.1, 0.2], "trunk_flexion": trunk})
        frames.to_csv(name, index=False)
    arms = {"trunk_flexion": 40.0, "upper_arm_flexion": 50.0, "lower_arm_flexion": 30.0}
    pd.DataFrame({"time": [0.0, 0.1], **arms}).to_csv("arms.csv", index=False)
    Path("bench.toml").write_text(BENCH)
    for person in "abc":
        for condition, trunk in (("low", 10.0), ("high", 65.0 + ord(person) % 3)):
            log(inside / "logs" / f"{person}_{condition}.parquet", trunk=trunk)
    yield inside
    os.chdir(before)


def test_every_command_is_here() -> None:
    groups = {name: importlib.import_module(f"{name}.cli").cli.commands for name in ("reba", "dreba", "lgp")}
    assert {f"{group} {name}" for group, commands in groups.items() for name in commands} == {*COMMANDS, "reba app"}


def of_generator(text: str) -> str:
    """Return the version in the text of a generator, such as "dreba 0.1.0"."""
    program, _, version = text.strip().partition(" ")
    assert program in ("reba", "dreba", "lgp"), text
    return version


def of_json(text: str) -> str:
    data = json.loads(text)
    return str(data.get("summary", data)["provenance"]["version"])  # the last line of live scores is their summary


def of_record(record: Mapping[str, str]) -> str:
    return str(json.loads(record["provenance"])["version"])


def of_mcap(path: Path) -> str:
    with path.open("rb") as stream:
        reader = make_reader(stream)
        first = next(reader.iter_metadata())
        (version,) = {of_generator(reader.get_header().library), of_record(first.metadata)}
    return version


def of_markup(pattern: str) -> Callable[[str], str]:
    return lambda text: of_generator(re.findall(pattern, text)[0])


TEXTS: Mapping[str, Callable[[str], str]] = {
    ".json": of_json,
    ".html": of_markup('<meta name="generator" content="([^"]+)">'),
    ".svg": of_markup("^<svg[^>]*><metadata>([^<]+)</metadata>"),
    ".c": of_markup(r"\A/\*.*\n \* Written by (.+)\.\n"),
    ".h": of_markup(r"\A/\*.*\n \* Written by (.+)\.\n"),
    ".py": of_markup(r"\A\"\"\".*\n\nWritten by (.+)\.\n"),
    ".md": of_markup(r"\nWritten by (.+)\.\n\Z"),
    ".casadi": of_markup(r"\n(.+)\n\Z"),
    ".txt": of_markup(r"\A; (.+)\n"),
}


def versions(path: Path) -> set[str]:
    """Return every version that a file states; a format without a way to state one is an error."""
    if path.suffix == ".parquet":
        return {json.loads(pq.read_schema(path).metadata[b"provenance"])["version"]}
    if path.suffix == ".mcap":
        return {of_mcap(path)}
    if path.suffix == ".xlsx":
        with zipfile.ZipFile(path) as archive:
            return {of_markup("<dc:creator>(.+)</dc:creator>")(archive.read("docProps/core.xml").decode())}
    if path.suffix == ".csv":
        path = path.with_name(f"{path.name}.meta.json")
    text = path.read_text(encoding="utf-8")
    if path.name == MANIFEST:
        return {json.loads(line)["version"] for line in text.splitlines()}
    if path.suffix == ".jsonl":
        return set(map(of_json, text.splitlines()))
    return {TEXTS[path.suffix](text)}


def results(folder: Path) -> set[Path]:
    """Return the files below a folder but locks, inputs, and what index.html loads from beside it."""
    parts = {"assets", "pictures"}
    names = {"_lock", "settings.json"}
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path for path in files if not parts & set(path.parts) and path.name not in names}


def unstated(path: Path) -> str:
    """Return what a file lacks, "" if it states this version."""
    try:
        return "" if versions(path) == {reba.__version__} else f"{path.name}: {versions(path)}"
    except (AssertionError, KeyError, ValueError, IndexError, TypeError) as error:
        return f"{path.name}: {error!r}"


NEED_ROBOTS = {"lgp page", "lgp run", "lgp experiment"}


def test_every_output_states_its_version(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    commands = {name: lines for name, lines in COMMANDS.items() if HAS_ROBOTS or name not in NEED_ROBOTS}
    if HAS_ROBOTS:
        small_plan().save(folder / "plan")
        with_finished_runs(folder / "experiment")
    problems = [unstated(path) for path in results(folder / "experiment") | results(folder / "plan")]
    for name, lines in commands.items():
        program, *command = name.split()
        for line in lines:
            before = results(folder)
            monkeypatch.setattr(sys, "argv", [program, *command, *line.split()])
            with pytest.raises(SystemExit) as stop:
                importlib.import_module(f"{program}.cli").main()
            output = capfd.readouterr()
            assert stop.value.code == 0, output.err
            problems += map(unstated, results(folder) - before)
            if "--json" in line or name == "reba live":
                (folder / "printed.jsonl").write_text(output.out)
                problem = unstated(folder / "printed.jsonl")
                problems.append(problem and f"{name} {line}: {problem}")
    assert list(filter(None, problems)) == []


def with_finished_runs(folder: Path) -> None:
    """Put the runs of an experiment into its folder, which then plans no further one."""
    chosen, scene = setting("ours", SCENE, None, None, None)
    settings = settings_of(SCENE, chosen, scene, chosen.collisions) | {"cost": COST, "seed": 0, "depth": DEPTH}
    store = RunStore(folder, settings)
    runs, paths = made("rest")
    for number in range(12):
        store.append(runs[runs["run"] == number], paths[paths["run"] == number])
