"""Names from inputs reach the terminal as text: no command passes an escape code, a forged line or markup on.

Every command of the three packages runs with hostile names at every place that a user can put one: once with its output
in a pipe and once in a terminal.
"""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
import unicodedata
from dataclasses import replace
from pathlib import Path

import pytest

import dreba.cli
import lgp.cli
import reba.cli
from reba.readers.recording.profile import profile_text
from tests.support import hostile_names as hostile
from tests.support.hostile_names import FILE, FORGED, NAME
from tests.support.paths import ROOT
from tests.support.studies import log
from tests.support.terminal import in_a_terminal

pytestmark = pytest.mark.slow

JOINTS = ("middle_lumbar_Z", "left_shoulder_Z", "right_shoulder_Z", "left_elbow_Z", "right_elbow_Z")
RUN_ALL = """
import importlib, json, os, sys, traceback
for words in json.load(open(sys.argv[1])):
    for stream in (sys.stdout, sys.stderr):
        print("== " + ascii(words), file=stream, flush=True)
    sys.argv = [word.encode("latin-1").decode("utf-8", "surrogateescape") for word in words]
    if sys.argv[-1].startswith("<"):
        os.dup2(os.open(sys.argv.pop()[1:], os.O_RDONLY), 0)
    try:
        importlib.import_module(sys.argv[0] + ".cli").main()
    except SystemExit as stop:
        print(f"== exit {stop.code}", flush=True)
    except BaseException as error:
        print(f"== fell with {error!a}", flush=True)
"""
OURS = re.compile(r"\x1b\[[0-9;]*m|\x1b\[\?25[lh]|\x1b\[2K|\x1b\[1A|\r")
"""Styles, and what a progress bar does to its line."""


@pytest.fixture(scope="module")
def commands(tmp_path_factory: pytest.TempPathFactory) -> list[list[str]]:
    return hostile_commands(tmp_path_factory.mktemp("names"))


def hostile_commands(here: Path) -> list[list[str]]:
    """Write the inputs into a folder, and return the commands that name them."""
    (here / FILE).mkdir()
    folder = here / FILE
    postures = hostile.posture_table(folder / f"{FILE}.csv", place=NAME)
    wrong = hostile.posture_table(folder / f"wrong {FILE}.csv", coupling_left=NAME)
    joints = hostile.joint_table(folder / f"joints {FILE}.csv", JOINTS)
    recording = hostile.mcap(folder / f"states {FILE}.mcap", JOINTS)
    lines = hostile.json_lines(here / "lines.jsonl")
    known = profile_text("human_description")
    profile = folder / f"{FILE}.toml"
    title = hostile.quoted(f"{NAME} lab")
    profile.write_text(re.sub(r'title = ".*"', lambda _: f"title = {title}", known), encoding="utf-8")
    bad_profile = folder / f"bad {FILE}.toml"
    bad_profile.write_text(f"{known}\n[{title}]\nkey = 1\n", encoding="utf-8")
    rules = folder / f"rules {FILE}.toml"
    rules.write_text(f"name = {title}\n{title} = 1\n", encoding="utf-8")
    manifest = hostile.study(here / "study", NAME)
    log(here / "labelled" / f"{FILE}.mcap", {"participant": FORGED, "condition": FORGED})
    plan = hostile.plan(FORGED.replace("\n", " ").replace("\r", " "))
    plan.save(here / "plan")
    replace(plan, feasible=False, reason=FORGED).save(here / "none")
    domain = folder / f"domain {FILE}.toml"
    domain.write_text(f"name = {title}\n{title} = 1\n", encoding="utf-8")
    out = str(folder / "out")
    score = ["reba", "score", str(postures)]
    several = [*score, str(joints), str(wrong), str(recording)]
    scene = hostile.scene(here / "scene.toml", NAME)
    run = ["lgp", "run", str(here / "plan")]
    study = ["lgp", "study", "--manifest", str(manifest)]
    calls: list[list[str]] = [
        ["reba", FORGED], ["reba", "score", f"--{FORGED}", "x"], ["reba", "score", "x", "--support", FORGED],
        ["reba", "score", "x", "--load", FORGED], ["reba", "score", FORGED], ["reba", "info", FORGED],
        [*score, "--rules", FORGED], [*score, "--rules", str(rules)], [*score, "--activity", FORGED],
        [*score, "--profile", FORGED], [*score, "--topic", FORGED], [*score, "--neutral", FORGED],
        [*score, "-o", f"{out}.csv", "--report", f"{out}.html"], [*score, "-o", f"{out}.{NAME}"],
        [*score, "--json"], [*several, "-o", f"{out} set"], several, [*several, "--json"],
        ["reba", "score", str(wrong)], ["reba", "score", str(joints), "--profile", str(profile)],
        ["reba", "score", str(joints), "--profile", str(bad_profile)],
        *(["reba", "info", str(path)] for path in (postures, joints, recording, wrong)),
        *(["reba", "info", str(path), "--json"] for path in (postures, joints, recording, wrong)),
        ["reba", "info", str(joints), "--profile", str(profile)],
        ["reba", "compare", str(postures), str(joints), "--report", f"{out} both.html"],
        ["reba", "explain", str(postures), "--at", "1"], ["reba", "improve", str(postures)],
        ["reba", "improve", str(recording), "--json"], ["reba", "convert", str(recording), "-o", f"{out} table.csv"],
        ["reba", "convert", str(recording), "-o", f"{out} table.parquet", "--json"],
        ["reba", "profiles", FORGED], ["reba", "profiles", FORGED, "--json"], ["reba", "profiles"],
        ["reba", "live", str(recording), "--until-idle", "0.2", "--settle", "0.1"],
        ["reba", "live", str(recording), "--until-idle", "0.2", "--profile", FORGED],
        ["reba", "live", "-", "--window", FORGED, f"<{lines}"], ["reba", "live", "-", "--topic", FORGED, f"<{lines}"],
        ["reba", "live", "-", "--settle", "0", f"<{lines}"], ["reba", "app", "--port", FORGED],
        ["dreba", FORGED], ["dreba", "fit", "-n", "300", "--kind", FORGED, "-o", f"{out}.json"],
        ["dreba", "fit", "-n", "600", "--classes", "1:6", "-o", f"{out}.json", "--report", f"{out} model.html"],
        ["dreba", "fit", "--poses", str(postures), "-o", f"{out}.json"], ["dreba", "sample", "-n", "9", "-o", FORGED],
        ["dreba", "sample", "-n", "20", "--domain", str(domain), "-o", f"{out}.parquet"],
        ["dreba", "sample", "-n", "20", "--classes", "1:4", "-o", f"{out}.parquet"],
        ["dreba", "evaluate", f"{out}.json"], ["dreba", "evaluate", FORGED], ["dreba", "evaluate", str(profile)],
        ["dreba", "compare", f"{out}.json", "quadratic", "--tasks", "1", "-n", "300", "--classes", "1:6"],
        ["dreba", "card", f"{out}.json"], ["dreba", "card", f"{out}.json", "--usefulness", str(profile)],
        ["dreba", "card", f"{out}.json", "-o", f"{out}.md"], ["dreba", "card", FORGED],
        ["dreba", "export", f"{out}.json", "--to", "c", "-o", f"{out}.c"],
        ["dreba", "export", f"{out}.json", "--to", FORGED],
        ["dreba", "export", "quadratic", "--to", "c", "--name", FORGED],
        ["lgp", FORGED], ["lgp", "scenes"], ["lgp", "plan", FORGED], ["lgp", "plan", "screwdriver", "--height", FORGED],
        ["lgp", "plan", "screwdriver", "--sequence", FORGED], ["lgp", "plan", str(profile)],
        ["lgp", "plan", str(scene), "--no-ergonomics", "--tree", f"{out} tree.svg", "-o", f"{out} plan"],
        ["lgp", "plan", str(scene), "--no-ergonomics", "--height", f"{NAME} table=9"],
        [*run, "--speed", "0", "--no-page", "--human", "exact"], [*run, "--fault", FORGED], ["lgp", "run", FORGED],
        [*run, "--speed", "0", "--no-page", "--fault", "stuck@1", "--patience", "1.5"],
        ["lgp", "run", str(here / "none")], [*run, "--export", f"{out} plan.mcap"], ["lgp", "page", FORGED],
        ["lgp", "page", str(here / "plan"), "--no-pictures", "-o", f"{out} page"], ["lgp", "page", str(here / "none")],
        [*study, "-o", f"{out} study"], [*study, "--json"], [*study, "--conditions", FORGED],
        ["lgp", "study", str(here / "labelled")], ["lgp", "study", str(here / "study"), "--pattern", FORGED],
        ["lgp", "simulate-study", f"{FORGED}={here / 'plan'}", "-n", "1", "-o", f"{out} logs"],
        ["lgp", "improve", FORGED], ["lgp", "improve", str(postures), "--cost", FORGED],
        ["lgp", "improve", str(postures), "--at", "1", "--heights", "0.9", "0.9", "--step", "0.4"],
        ["lgp", "experiment", "toolbox", "--cost", FORGED, "-o", f"{out} experiment"],
    ]  # fmt: skip
    return [[os.fsencode(word).decode("latin-1") for word in words] for words in calls]


@pytest.fixture(scope="module")
def call(commands: list[list[str]], tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Return the call of Python that runs all commands in one process."""
    file = tmp_path_factory.mktemp("calls") / "commands.json"
    file.write_text(json.dumps(commands), encoding="utf-8")
    return [sys.executable, "-c", RUN_ALL, str(file)]


def check(output: str, commands: list[list[str]]) -> None:
    """Assert that texts have no control characters but line ends, no forged line, and that no command fell."""
    parts = re.split(r"(?m)^== (?=\[)", output)
    assert (len(parts) - 1) % max(len(commands), 1) == 0
    for part in parts:
        hidden = {char for char in part if unicodedata.category(char) in ("Cc", "Cf", "Cs", "Zl", "Zp")} - {"\n"}
        assert not hidden, (hidden, part)
        assert "== fell" not in part, part
        assert not re.search("(?m)^reba: forged", part), part
        assert "\U0001f4a5" not in part, part


def test_every_command_is_called(commands: list[list[str]]) -> None:
    groups = {"reba": reba.cli.cli, "dreba": dreba.cli.cli, "lgp": lgp.cli.cli}
    known = {(program, name) for program, group in groups.items() for name in group.commands}
    assert known <= {(words[0], words[1]) for words in commands}


def test_in_a_pipe(call: list[str], commands: list[list[str]]) -> None:
    done = subprocess.run(call, capture_output=True, timeout=600, cwd=ROOT, check=False)
    out, err = done.stdout.decode("utf-8"), done.stderr.decode("utf-8")
    check(out, commands)
    check(err, commands)
    assert "[red]" in out
    assert "\\x1b[35;45m" in out
    for line in out.splitlines():
        if line.startswith('{"'):
            json.loads(line)


def test_in_a_terminal(call: list[str], commands: list[list[str]]) -> None:
    text = in_a_terminal(call, 130)
    assert "\x1b[35;45m" not in text
    assert "\x1b[1m" in text
    check(OURS.sub("", text), commands)


def test_the_trace_of_a_defect_is_text_too() -> None:
    code = """
import click
from reba.command_line import run
@click.command()
def cli():
    raise LookupError("\x1b[2J\u202e\x9b" + chr(0xdcff))
run(cli, "reba")
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=60, cwd=ROOT, check=False)
    text = done.stderr.decode("utf-8")
    assert done.returncode == 1
    assert text.startswith("Traceback")
    assert text.endswith("LookupError: \\x1b[2J\\u202e\\x9b\\udcff\n")
    check(text, [])


def test_a_terminal_of_another_encoding_shows_the_letters_it_lacks_as_codes(tmp_path: Path) -> None:
    paths = [hostile.posture_table(tmp_path / name) for name in ("left→Ж.csv", "b.csv")]
    call = [sys.executable, "-c", "from reba.cli import main; main()", "score", *map(str, paths)]
    env = {**os.environ, "PYTHONIOENCODING": "latin-1"}
    done = subprocess.run(call, capture_output=True, timeout=60, cwd=ROOT, env=env, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert "left\\u2192\\u0416.csv" in done.stdout.decode("latin-1").replace("\n", "")


PRINTING = {("click", "echo"), ("click", "secho"), ("sys.stdout", "write"), ("sys.stderr", "write")}
BORDER = {"reba/command_line.py", "reba/terminal.py", "reba/interrupts.py"}
"""The only files that print, or that know rich's console and text."""


FILES = sorted(path for package in ("reba", "dreba", "lgp") for path in (ROOT / package).rglob("*.py"))


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_only_the_border_prints(path: Path) -> None:
    printing = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            called = ast.unparse(node.func)
            owner, _, name = called.rpartition(".")
            printing += [called] if called == "print" or (owner, name) in PRINTING else []
        elif isinstance(node, ast.ImportFrom) and node.module in ("rich", "rich.console", "rich.text", "rich.progress"):
            printing.append(f"from {node.module}")
    assert not printing or str(path.relative_to(ROOT)) in BORDER, printing
