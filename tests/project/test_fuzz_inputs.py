"""A small share of `fuzz/run.py`, and every input that was once a finding."""

from __future__ import annotations

import functools
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from tests.support.paths import ROOT

sys.path.insert(0, str(ROOT / "fuzz"))

import guided
import run as fuzz
from check import MEMORY, Result, check, report
from targets import TARGETS, Target

pytestmark = pytest.mark.slow


REGRESSIONS = sorted(path for path in (ROOT / "fuzz" / "regressions").rglob("*") if path.is_file())
SHARE = 8
"""Changed inputs of each target that are tried here."""


@pytest.mark.parametrize("path", REGRESSIONS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_an_input_that_was_a_finding_is_refused(path: Path) -> None:
    found = check(TARGETS[path.parent.name], path.read_bytes())
    assert found.outcome == "refused", found


@pytest.mark.parametrize("name", TARGETS)
def test_a_share_of_the_inputs(name: str) -> None:
    target = TARGETS[name]
    assert "read" in {check(target, data).outcome for data in target.seeds}
    for number in range(len(target.seeds), len(target.seeds) + SHARE):
        found = check(target, target.input(2, number))
        assert found.outcome != "finding", f"input {number}: {found.what}"


@pytest.mark.parametrize("name", TARGETS)
def test_seed_and_number_say_which_input(name: str) -> None:
    target = TARGETS[name]
    inputs = [target.input(3, number) for number in range(len(target.seeds), len(target.seeds) + 20)]
    assert inputs == [target.input(3, number) for number in range(len(target.seeds), len(target.seeds) + 20)]
    assert sum(data not in target.seeds for data in inputs) > 10
    assert inputs[0] != target.input(4, len(target.seeds))


def test_other_errors_and_long_messages_are_findings() -> None:
    from reba.errors import RebaError

    def raising(error: BaseException) -> Result:
        def use(path: Path) -> None:
            raise error

        return check(uses(use), b"")

    assert raising(RebaError("a\nb")) == ("refused", "RebaError")
    assert raising(KeyError("a")).outcome == "finding"
    assert raising(MemoryError()).outcome == "finding"
    assert raising(SystemExit(1)).outcome == "finding"


def sleeps(name: str, seed: int, numbers: range, memory: int, seconds: float, pipe: Connection) -> None:
    """Stand in for `check.work` and never come to an end."""
    pipe.send((numbers[0], None))
    time.sleep(600)


def uses(use: Callable[[Path], object]) -> Target:
    """Return a target that uses its inputs in this way."""
    return Target("x", "x", list, lambda rng, data, seeds: data, use)


def waits(name: str, seed: int, numbers: range, memory: int, seconds: float, pipe: Connection) -> None:
    """Stand in for `check.work` on a machine that is busy with other programs."""
    for number in numbers:
        report(pipe, number, uses(lambda path: time.sleep(2.5 * seconds)), b"", seconds)
    pipe.send((-1, 0))


def computes(name: str, seed: int, numbers: range, memory: int, seconds: float, pipe: Connection) -> None:
    """Stand in for `check.work` with inputs that never end."""
    report(pipe, numbers[0], uses(lambda path: sum(iter(int, 1))), b"", seconds)


def test_inputs_are_counted_and_a_hang_is_ended() -> None:
    found = fuzz.run(["rules"], seed=0, inputs=30, jobs=1)["rules"]
    assert found.outcomes.total() == 30
    assert not found.findings
    hung = fuzz.run_batch("rules", 0, range(7, 8), seconds=0.1, engine=sleeps)
    assert hung.findings == [(7, "no end after 6 s, exit code -9")]


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="processor time is limited by setitimer")
def test_the_time_of_an_input_is_that_of_the_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fuzz, "WAIT", 1000.0)
    waited = fuzz.run_batch("rules", 0, range(2), seconds=0.2, engine=waits)
    assert (waited.findings, waited.outcomes["read"]) == ([], 2)
    assert waited.slowest < 0.2
    hung = fuzz.run_batch("rules", 0, range(7, 8), seconds=0.2, engine=computes)
    assert hung.findings == [(7, f"no end after 0.2 s of processor time, exit code {-signal.SIGPROF}")]


@pytest.mark.skipif(sys.platform != "linux", reason="address space is limited by setrlimit")
def test_memory_is_bounded() -> None:
    code = "from check import limit; limit(1 << 28); bytearray(1 << 29)"
    path = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "fuzz")])}
    done = subprocess.run([sys.executable, "-c", code], env=path, capture_output=True, text=True, check=False)
    assert "MemoryError" in done.stderr


def test_a_wrong_pddl_text_leaves_tracebacks_on() -> None:
    for path in sorted((ROOT / "lgp" / "domains").glob("*.pddl")):
        assert check(TARGETS["pddl"], path.read_bytes()[:-20]).outcome == "refused"
    assert getattr(sys, "tracebacklimit", None) is None


def guided_engine(folder: Path, seconds: float = 600.0) -> fuzz.Engine:
    pytest.importorskip("atheris", reason="atheris has wheels for Linux on x86-64 only")
    return functools.partial(guided.work, folder, seconds)


def test_guided_inputs_reach_new_branches_and_findings_stay(tmp_path: Path) -> None:
    found = fuzz.run(["rules"], seed=0, inputs=60, jobs=1, engine=guided_engine(tmp_path))["rules"]
    assert found.outcomes.total() == 60
    kept = list(guided.corpus_folder(tmp_path, "rules", 0).iterdir())
    assert len(kept) > len(TARGETS["rules"].seeds)
    left = {path for path in tmp_path.iterdir() if path.is_file()}
    assert left == {guided.input_file(tmp_path, "rules", 0, number) for number, _ in found.findings}


def test_guided_inputs_end_with_the_time(tmp_path: Path) -> None:
    found = fuzz.run(["rules"], seed=0, inputs=1_000_000, jobs=1, engine=guided_engine(tmp_path, 0.5))["rules"]
    assert 0 < found.outcomes.total() < 1_000_000
    assert not found.findings


def test_an_input_that_ends_the_process_is_not_left_in_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here, folder = tmp_path / "here", tmp_path / "findings"
    here.mkdir()
    monkeypatch.chdir(here)
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe(duplex=False)
    ours.close()  # nobody listens: the first report ends the process
    arguments = ("rules", 0, range(9), MEMORY, 20.0, theirs)
    process = context.Process(target=guided_engine(folder), args=arguments, daemon=True)
    process.start()
    theirs.close()
    process.join(timeout=60)
    assert process.exitcode not in (0, None)
    assert list(here.iterdir()) == []
    assert any(path.name.startswith("crash-") for path in folder.iterdir())
