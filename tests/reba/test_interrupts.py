"""Ctrl-C and SIGTERM at any moment of any command: one line, exit 130 or 143, and nothing left behind."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from reba.interrupts import WORDS
from tests.support.interrupting import SCRIPTS, Ended, stopped
from tests.support.paths import DATASETS, ROOT

pytestmark = pytest.mark.slow
MOMENTS = 4
"""Moments at which each job is stopped, evenly over its time."""
JOBS: dict[str, list[str]] = {
    "reba help": ["reba", "--help"],
    "reba": ["reba", "score", str(DATASETS / "simulated_assembly.csv"), "-o", "OUT/x.csv", "--report", "OUT/x.html"],
    "reba processes": ["reba", "score", "IN", "-o", "OUT/dataset", "--jobs", "2"],
    "dreba help": ["dreba", "--help"],
    "dreba": ["dreba", "fit", "-n", "1000", "-o", "OUT/model.json"],
    "dreba processes": ["dreba", "compare", "quadratic", "convex", "-n", "500", "--tasks", "1", "--jobs", "2"],
    "lgp help": ["lgp", "--help"],
    "lgp": ["lgp", "plan", "screwdriver", "--no-collisions", "--no-ergonomics", "-o", "OUT/plan"],
    "lgp processes": ["lgp", "experiment", "screwdriver", "--runs", "2", "--jobs", "2", "-o", "OUT"],
}


@pytest.fixture
def recordings(tmp_path: Path) -> Path:
    folder = tmp_path / "in"
    folder.mkdir()
    for number in range(6):
        shutil.copy(DATASETS / "simulated_assembly.csv", folder / f"{number}.csv")
    return folder


def said(ended: Ended) -> list[str]:
    """Return the lines of standard error besides progress, such as "screwdriver: 1 of 2 runs"."""
    return [line for line in ended.err.splitlines() if not line.endswith(" runs")]


@pytest.mark.parametrize("job", JOBS)
def test_a_command_stopped_at_any_moment_says_one_line(job: str, recordings: Path, tmp_path: Path) -> None:
    def words(name: str) -> list[str]:
        out = tmp_path / name
        out.mkdir()
        return [word.replace("OUT", str(out)).replace("IN", str(recordings)) for word in JOBS[job]]

    whole = stopped(words("whole"), None)
    assert whole.code == 0, whole.err
    for moment in range(MOMENTS):
        ended = stopped(words(f"out{moment}"), whole.seconds * moment / MOMENTS, times=1 + moment % 3)
        if ended.code == 0:  # it was done already
            assert len(said(ended)) == len(said(whole)), ended.err
        else:
            assert (ended.code, said(ended)) == (130, [f"{JOBS[job][0]}: interrupted"])
    assert list(tmp_path.rglob("*.part")) == []


def test_the_processes_of_a_stopped_dataset_leave_no_scores_that_it_does_not_list(
    recordings: Path, tmp_path: Path
) -> None:
    words = ["reba", "score", recordings, "-o", tmp_path / "dataset", "--jobs", "2", "--json"]
    whole = stopped(["reba", "score", recordings, "-o", tmp_path / "whole", "--jobs", "2"], None)
    for moment in range(3):
        stopped(words, whole.seconds * (0.5 + moment / 6))
        manifests = list((tmp_path / "dataset").glob("*.jsonl"))
        listed = {json.loads(line)["output"] for file in manifests for line in file.read_text().splitlines()}
        tables = {str(table.relative_to(tmp_path / "dataset")) for table in (tmp_path / "dataset").rglob("*.parquet")}
        assert tables <= listed
    assert stopped(words, None).code == 0


@pytest.mark.parametrize("command", SCRIPTS)
def test_sigterm_is_143(command: str, tmp_path: Path) -> None:
    ended = stopped([command, *JOBS[command][1:-1], tmp_path / "out"], 0.0, signal.SIGTERM)
    assert (ended.code, said(ended)) == (143, [f"{command}: {WORDS[signal.SIGTERM]}"])


def test_a_signal_that_the_caller_ignores_is_ignored(tmp_path: Path) -> None:
    code = "import signal, os; signal.signal(signal.SIGINT, signal.SIG_IGN); import reba.interrupts as i; "
    code += "import types, sys; sys.modules['probe'] = m = types.ModuleType('probe'); "
    code += "m.main = lambda: (os.kill(os.getpid(), signal.SIGINT), print('done')); i.enter('probe')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert (done.stdout, done.stderr) == ("done\n", "")


PROBE = """
import os, signal, sys, time, types
signal.signal(signal.SIGINT, signal.default_int_handler)
from reba import interrupts
def press():
    os.kill(os.getpid(), signal.SIGINT)
{body}
module = types.ModuleType("probe")
module.main = main
sys.modules["probe"] = module
interrupts.enter("probe")
"""
BODIES = {
    "an import that turns it into another error": """
def main():
    import swallowing
    time.sleep(10)
""",
    "a finalizer": """
class Finalized:
    def __del__(self):
        press()
        time.sleep(0.1)
def main():
    Finalized()
    time.sleep(10)
""",
    "tidying up, pressed again": """
def main():
    try:
        press()
        time.sleep(10)
    finally:
        for _ in range(3):
            press()
            time.sleep(0.05)
        print("tidy")
""",
    "the end of the interpreter": """
import atexit
def main():
    atexit.register(press)
    press()
    time.sleep(10)
""",
}


@pytest.mark.parametrize("where", BODIES)
def test_an_interrupt_is_not_lost_in(where: str, tmp_path: Path) -> None:
    swallowing = "import os, signal\ntry:\n    os.kill(os.getpid(), signal.SIGINT)\n    x = [0] * 10\n"
    (tmp_path / "swallowing.py").write_text(f"{swallowing}except BaseException as error:\n    raise ImportError\n")
    env = {**os.environ, "PYTHONPATH": f"{ROOT}{os.pathsep}{tmp_path}"}
    call = [sys.executable, "-c", PROBE.format(body=BODIES[where])]
    done = subprocess.run(call, capture_output=True, text=True, timeout=9, env=env, check=False)
    assert (done.returncode, done.stderr) == (130, "probe: interrupted\n")


@pytest.mark.parametrize("command", SCRIPTS)
@pytest.mark.parametrize("module", ["", ".cli"])
def test_modules_run_as_commands(command: str, module: str, tmp_path: Path) -> None:
    call = [sys.executable, "-m", f"{command}{module}", "--version"]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(call, capture_output=True, text=True, cwd=tmp_path, env=env, check=True)
    assert done.stdout.startswith(f"{command}, version ")


@pytest.mark.parametrize("command", SCRIPTS)
def test_nothing_large_is_imported_before_the_handlers_stand(command: str) -> None:
    code = f"import sys, {SCRIPTS[command].partition(':')[0]}; print(*sys.modules)"
    call = [sys.executable, "-S", "-c", code]  # without what the installed packages import at every start
    done = subprocess.run(call, capture_output=True, text=True, check=True, cwd=ROOT)
    assert not {"numpy", "pandas", "click", "importlib.metadata", "typing"} & set(done.stdout.split())


def test_what_a_command_imports_is_not_searched_for_garbage_again() -> None:
    code = (
        "import gc, json, reba.cli, reba.interrupts\n"
        "reba.cli.main = lambda: print(json.dumps([gc.isenabled(), gc.get_freeze_count() > len(gc.get_objects())]))\n"
        "reba.interrupts.enter('reba.cli')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=True)
    assert json.loads(done.stdout) == [True, True]
